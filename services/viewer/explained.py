"""A move explained, as a recording: what a planner has kept of it, drawn as the running cell is."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS, Pose2, Twist2
from rackhand.schemas.explain import Explanation, Held, Measure, Role, Thing
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import PlannedPath
from rackhand.schemas.planar import as_tuple, between, transform
from rackhand.services.viewer import colours
from rackhand.services.viewer.blueprint import CAUSE, LOG, THINGS, move_blueprint
from rackhand.services.viewer.chassis import LINE_Z, ChassisView
from rackhand.services.viewer.items import Drawing, Item, Level, Note
from rackhand.services.viewer.picture import RobotSet
from rackhand.services.viewer.racks import outline_drawing
from rackhand.services.viewer.recording import Recording

AROUND = 1.0  # m around everything that is drawn
THING_RADIUS = 0.06
_ROLES: dict[Role, colours.Colour] = {"blocks": colours.WALL, "expected": colours.DETECTED, "seen": colours.RACK}
_ORIGIN = (0.0, 0.0, 0.0)


def recorded(robot: str, explanation: Explanation) -> bytes:
    """A file of Rerun's format ``.rrd``: costmap, things, paths, the last 10 s of pose, velocity and command on the
    simulation timeline, and the words, with a layout of its own."""
    recording = Recording("", ())
    memory = recording.to_memory()
    recording.show(move_blueprint(RobotSet(chassis=(robot,), bounds=bounds(explanation))))
    for stamp, items in _moments(ChassisView(robot), explanation):
        recording.write((stamp, item) for item in items)
    recording.flush_rows()
    data = memory.drain_as_bytes()
    recording.close()
    return data


def words(explanation: Explanation) -> str:
    """The explanation as plain text: a headline, the cause, what to do, the things, the numbers."""
    move, evidence = explanation.move, explanation.evidence
    reason = f": {MoveFailReason(move.fail_reason).doc_name}" if move.fail_reason else ""
    driven = f"{explanation.duration:.1f} s, {explanation.driven:.2f} m driven"
    lines = [f"Move {move.id} ({move.type}) {explanation.verdict}{reason}. {driven}.", "", explanation.cause]
    lines += [f"To do: {explanation.advice}"] if explanation.advice else []
    for title, rows in (
        ("Things", [thing.sentence for thing in evidence.things]),
        ("Measured", [_measure_words(measure) for measure in evidence.measures]),
        ("Held by", [_held_words(held) for held in explanation.held]),
    ):
        lines += ["", f"{title}:", *(f"  {row}" for row in rows)] if rows else []
    return "\n".join(lines)


def bounds(explanation: Explanation) -> tuple[tuple[float, ...], ...] | None:
    """Lowest and highest corner of what is drawn, with room around it; None where nothing has a place."""
    places = [
        explanation.trace[:, 1:3],
        explanation.footprint,
        np.array([(thing.x, thing.y) for thing in explanation.evidence.things]).reshape(-1, 2),
        _corners(explanation),
        *(path.poses[:, :2] for path in explanation.paths),
    ]
    points = np.vstack(places)
    if not len(points):
        return None
    low, high = points.min(axis=0) - AROUND, points.max(axis=0) + AROUND
    return (float(low[0]), float(low[1]), 0.0), (float(high[0]), float(high[1]), 1.0)


def _moments(view: ChassisView, explanation: Explanation) -> Iterable[tuple[int, Iterable[Item]]]:
    """What is drawn, by its stamp. All that is known of the end alone is drawn at the end."""
    end = explanation.stamp
    yield end, view.begin()
    yield end, [Drawing(f"{view.robot}/{CAUSE}", (rr.TextDocument(words(explanation)),), frame=None, static=True)]
    for path in explanation.paths:
        yield path.stamp, view.path(PlannedPath(stamp=path.stamp, poses=path.poses))
    for row in explanation.trace.astype(np.float64):
        yield max(0, end + round(row[0] * NANOSECONDS)), _tick(view, row)
    if explanation.pose is not None:
        if not len(explanation.trace):
            yield end, view.place(explanation.pose)
        yield end, [outline_drawing(view.robot, view.frame, _outline(explanation, explanation.pose))]
    if explanation.costmap is not None:
        yield end, view.costmap(explanation.costmap)
    yield end, [_things(view.robot, explanation.evidence.things)]
    level: Level = "WARN" if explanation.verdict in ("failed", "stuck") else "INFO"
    text = f"move {explanation.move.id} ({explanation.move.type}) {explanation.verdict}: {explanation.cause}"
    yield end, [Note(f"{view.robot}/{LOG}", text, level)]


def _tick(view: ChassisView, row: NDArray[np.float64]) -> Iterable[Item]:
    _, x, y, yaw, linear, angular, linear_wanted, angular_wanted = row.tolist()
    yield from view.place(Pose2(x=x, y=y, yaw=yaw))
    yield from view.measured(Twist2(linear=linear, angular=angular))
    yield from view.commanded(Twist2(linear=linear_wanted, angular=angular_wanted))


def _outline(explanation: Explanation, pose: Pose2) -> NDArray[np.float64]:
    """The footprint (n, 2) in the frame of the chassis, of that in the map."""
    to_chassis = between(as_tuple(pose), _ORIGIN)
    return np.array([transform(to_chassis, x, y) for x, y in explanation.footprint.tolist()]).reshape(-1, 2)


def _things(robot: str, things: Iterable[Thing]) -> Drawing:
    shown = list(things)
    dots = rr.Points3D(
        np.array([(thing.x, thing.y, LINE_Z) for thing in shown]).reshape(-1, 3),
        colors=[_ROLES[thing.role] for thing in shown] or None,
        radii=THING_RADIUS,
        labels=[thing.title for thing in shown] or None,
        show_labels=True,
    )
    return Drawing(f"{robot}/{THINGS}", (dots,))


def _corners(explanation: Explanation) -> NDArray[np.float64]:
    """Lower-left and upper-right corner (2, 2) of the costmap; (0, 2) without one."""
    costmap = explanation.costmap
    if costmap is None:
        return np.empty((0, 2))
    cells = np.array([costmap.columns, costmap.cost.size // costmap.columns])
    return np.array([costmap.origin, costmap.origin + cells * costmap.resolution])


def _measure_words(measure: Measure) -> str:
    unit = f" {measure.unit}" if measure.unit else ""
    expected = "" if measure.expected is None else f", expected {measure.expected:g}{unit}"
    setting = f" ({measure.setting})" if measure.setting else ""
    return f"{measure.name} {measure.value:g}{unit}{expected}{setting}"


def _held_words(held: Held) -> str:
    return f"{held.by}: {held.seconds:.1f} s{f' ({held.setting})' if held.setting else ''}"
