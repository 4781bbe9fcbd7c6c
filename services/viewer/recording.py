"""One run as a Rerun recording. The timeline is simulation time, and nothing else."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from rackhand.services.viewer.geometry import quaternions_xyzw
from rackhand.services.viewer.items import TIMELINE, Drawing, Item, Note, Pose, Row

APPLICATION = "rackhand"
FRAMES = "tf"  # the entity that holds where all frames are

Stamped = tuple[int, Item]


class Recording:
    """Writes items: at each ``write`` the poses, all in one, and of each drawing the last; rows when ``flush_rows`` is
    called, many at once.
    """

    def __init__(self, run: str, sinks: Sequence[rr.LogSinkLike]) -> None:
        self._stream = rr.RecordingStream(APPLICATION, recording_id=run or None)
        self._stream.set_log_time_enabled(False)
        self._stream.set_sinks(*sinks)
        self._frames: dict[str, str] = {}
        self._poses: dict[str, Pose] = {}
        self._lasting: dict[str, Drawing] = {}
        self._rows: dict[str, list[tuple[int, tuple[float, ...]]]] = defaultdict(list)

    def to_memory(self) -> rr.MemoryRecording:
        """Keep what is written from now on in memory, in place of the sinks."""
        return self._stream.memory_recording()

    def show(self, blueprint: rrb.Blueprint) -> None:
        """How this recording, and each one after it, is laid out."""
        self._stream.send_blueprint(blueprint)

    def write(self, items: Iterable[Stamped]) -> None:
        moved: dict[str, tuple[int, Pose]] = {}
        drawn: dict[str, tuple[int, Drawing]] = {}
        for stamp, item in items:
            match item:
                case Pose():
                    moved[item.frame] = (stamp, item)
                case Row():
                    self._rows[item.entity].append((stamp, item.values))
                case Drawing():
                    drawn[item.entity] = (stamp, item)
                case Note():
                    self._log(stamp, item.entity, rr.TextLog(item.text, level=item.level))
        self._poses |= {frame: pose for frame, (_, pose) in moved.items()}
        self._move(moved.values())
        for stamp, drawing in drawn.values():
            self._draw(stamp, drawing)

    def repeat(self, stamp: int) -> None:
        """Draw again what lasts: a server of limited memory forgets what is old."""
        for drawing in self._lasting.values():
            self._draw(stamp, drawing)
        self._move([(stamp, pose) for pose in self._poses.values()])

    def flush_rows(self) -> None:
        for entity, rows in self._rows.items():
            values = rr.Scalars.columns(scalars=np.array([row for _, row in rows]))
            self._stream.send_columns(entity, [_time(stamp for stamp, _ in rows)], values)
        self._rows.clear()

    def close(self) -> None:
        self.flush_rows()
        self._stream.flush(timeout_sec=2.0)
        self._stream.disconnect()

    def _draw(self, stamp: int, drawing: Drawing) -> None:
        if drawing.lasting:
            self._lasting[drawing.entity] = drawing
        if drawing.frame is not None and self._frames.get(drawing.entity) != drawing.frame:
            self._frames[drawing.entity] = drawing.frame
            self._stream.log(drawing.entity, rr.CoordinateFrame(drawing.frame), static=True)
        if drawing.static:
            self._stream.log(drawing.entity, *drawing.parts, static=True)
        else:
            self._log(stamp, drawing.entity, *drawing.parts)

    def _log(self, stamp: int, entity: str, *parts: rr.AsComponents) -> None:
        self._stream.set_time(TIMELINE, duration=np.timedelta64(stamp, "ns"))
        self._stream.log(entity, *parts)

    def _move(self, moved: Iterable[tuple[int, Pose]]) -> None:
        """Many frames by one call, as rows of one entity: a seventh of the price of an entity each."""
        rows = list(moved)
        if not rows:
            return
        poses = [pose for _, pose in rows]
        columns = rr.Transform3D.columns(
            translation=np.array([pose.position for pose in poses]),
            quaternion=quaternions_xyzw(pose.orientation for pose in poses),
            child_frame=[pose.frame for pose in poses],
            parent_frame=[pose.parent for pose in poses],
        )
        self._stream.send_columns(FRAMES, [_time(stamp for stamp, _ in rows)], columns)


def _time(stamps: Iterable[int]) -> rr.TimeColumn:
    nanoseconds: NDArray[np.int64] = np.fromiter(stamps, dtype=np.int64)
    return rr.TimeColumn(TIMELINE, duration=nanoseconds.astype("timedelta64[ns]"))
