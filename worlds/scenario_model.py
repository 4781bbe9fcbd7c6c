"""The models of scenario files, ``worlds/<world>/scenarios/<name>.yaml``: what goes wrong, when, and what must follow.

A scenario begins with the world as its file has it, at simulation time 0. ``timeline`` is a list of steps; each waits
for its ``when`` and then acts. The newest move that the timeline requested is judged against ``expect``. After that
everything the scenario changed is undone, ``mend`` is done, and the move ``then`` must succeed.

Metres, radians, seconds of simulation time; map frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from rackhand.schemas.explain import Role, ThingKind
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.faults import FaultName
from rackhand.worlds.data import (
    Data,
    Name,
    NonNegative,
    Point,
    PoseTuple,
    Positive,
    WorldFileError,
    installed_worlds,
    read_model,
    worlds_folders,
)

FOLDER = "scenarios"
Json = dict[str, Any]
PATIENCE = 60.0  # s of simulation time for which a step waits for its condition


def _reason(value: Any) -> Any:
    """A reason by its REST name or its number."""
    if isinstance(value, str):
        known = {reason.rest_name: reason for reason in MoveFailReason}
        if value not in known:
            raise ValueError(f"{value!r} is not a MoveFailReason; want its REST name, as rack_detection_error")
        return known[value]
    return value


Reason = Annotated[MoveFailReason, BeforeValidator(_reason)]


class Condition(Data):
    """When a step is taken: as soon as all that is given holds.

    ``after``: so long after the step before. ``driven``: the robot is truly so far from where it was when the newest
    move was requested. ``near``: x, y and radius of a place that the robot truly is in. ``ended``: the newest move has
    ended. ``planning_state``: these keys of the newest ``/planning_state`` frame have these values. The scenario is
    broken if that takes longer than ``within``.
    """

    after: NonNegative | None = None
    driven: Positive | None = None
    near: tuple[float, float, Positive] | None = None
    ended: bool = False
    planning_state: Json = Field(default_factory=dict)
    within: Positive = PATIENCE


class Obstacle(Data):
    """A box l×w×h, or a cylinder or person r×h. ``walk``: points that it walks in a loop at ``speed``."""

    kind: Literal["box", "cylinder", "person"] = "box"
    at: PoseTuple
    size: Annotated[tuple[Positive, ...], Field(min_length=2, max_length=3)] = (0.4, 0.4, 0.6)
    walk: tuple[PoseTuple, ...] = ()
    speed: NonNegative = 0.0


class Fault(Data):
    """A fault of ``rackhand.schemas.faults``; ``target`` is the scenario's robot if none is named."""

    fault: FaultName
    target: str | None = None
    part: Annotated[int, Field(ge=0)] | None = None
    amount: float | None = None
    pose: PoseTuple | None = None


class Push(Data):
    """A shift of a rack or an item in its own frame: x, y, yaw."""

    name: str
    shift: PoseTuple


class BlankMap(Data):
    """A map of free ground: its lower left corner, and its size."""

    origin: Point
    size: tuple[Positive, Positive]


class MapChange(Data):
    """Use another map: the geometry of the world's map (or a ``blank`` one) with these overlays. ``keep``: with those
    of the world's map, too. Rack points and chargers are x, y and a yaw in degrees, as in overlays.
    """

    blank: BlankMap | None = None
    keep: bool = True
    walls: tuple[tuple[Point, ...], ...] = ()
    no_go: tuple[tuple[Point, ...], ...] = ()
    rack_points: dict[str, PoseTuple] = Field(default_factory=dict)
    rack_areas: dict[str, tuple[Point, ...]] = Field(default_factory=dict)
    chargers: dict[str, PoseTuple] = Field(default_factory=dict)


class Call(Data):
    """A request to the chassis API, answered with a success or with ``status``."""

    method: Literal["GET", "POST", "PATCH", "PUT", "DELETE"] = "POST"
    path: Annotated[str, Field(pattern="^/")]
    body: Any = None
    status: int | None = None


class Step(Data):
    """What is done once ``when`` holds (at once, if it is not given); of several things, in the order below.

    ``put``: set robots, racks and items down elsewhere. ``remove``: take racks, items and obstacles out of the world.
    ``kill``: end a service's process; the supervisor starts it again. ``map``: a changed one, ``none``, or that of the
    ``world``. ``jack``: request its way up or down, and wait until it has arrived. ``lift``: a request to a
    lift, as ``{op: call, floor: floor1}``. ``move``: the body of ``POST /chassis/moves``.
    """

    when: Condition | None = None
    put: dict[str, PoseTuple] = Field(default_factory=dict)
    place: dict[str, Obstacle] = Field(default_factory=dict)
    remove: tuple[str, ...] = ()
    restore: tuple[str, ...] = ()
    push: Push | None = None
    faults: tuple[Fault, ...] = ()
    clear: tuple[Fault, ...] = ()
    kill: str | None = None
    map: MapChange | Literal["none", "world"] | None = None
    settings: Json = Field(default_factory=dict)
    jack: Literal["up", "down"] | None = None
    lift: dict[str, Json] = Field(default_factory=dict)
    call: Call | None = None
    move: Json | None = None

    @model_validator(mode="after")
    def _does_something(self) -> Step:
        if not self.model_fields_set - {"when"}:
            raise ValueError("a step without an action")
        return self


class NamedThing(Data):
    """A thing that an explanation must name: its kind and role (``rackhand.schemas.explain.Thing``), within so many
    metres of ``at``, and its name, where these are given."""

    kind: ThingKind
    role: Role = "blocks"
    name: str | None = None
    at: Point | None = None
    within: Positive = 0.3


class Explained(Data):
    """What ``explain`` must say of the judged move: all ``words`` in its cause, all ``things``, and measures of these
    names, each of which misses what was expected."""

    words: tuple[str, ...] = ()
    things: tuple[NamedThing, ...] = ()
    measures: tuple[str, ...] = ()


class Expectation(Data):
    """What must be true of the judged move: its final ``state`` within so many seconds of its request, the ``reason``,
    all these ``text`` parts in its fail_message, what ``explain`` says of it, and no more ``contacts`` of the robot
    than these.
    """

    state: Literal["succeeded", "failed", "cancelled"]
    reason: Reason = MoveFailReason.NONE
    text: tuple[str, ...] = ()
    explain: Explained | None = None
    within: Positive
    contacts: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _has_a_reason_if_it_fails(self) -> Expectation:
        if (self.state == "failed") != (self.reason is not MoveFailReason.NONE):
            found = f"state {self.state} with reason {self.reason.rest_name}"
            raise ValueError(f"{found}: a reason is of failed moves only")
        return self


class Scenario(Data):
    """A whole scenario. ``shows``: what a reader learns from it. ``slow``: it may take more than 20 s of wall time on
    two cores. ``start``: where the robot is set down first."""

    name: Name
    shows: Annotated[str, Field(min_length=10)]
    world: Name
    seed: Annotated[int, Field(ge=0)] = 1
    robot: Name = "amr1"
    slow: bool = False
    start: PoseTuple | None = None
    timeline: Annotated[tuple[Step, ...], Field(min_length=1)]
    expect: Expectation
    mend: tuple[Step, ...] = ()
    then: Json | None = None

    @model_validator(mode="after")
    def _has_a_move(self) -> Scenario:
        if all(step.move is None for step in self.timeline):
            raise ValueError("timeline: no step requests a move, so there is none to judge")
        if self.expect.state == "failed" and self.then is None:
            raise ValueError("then: a scenario that fails needs a move that succeeds after it")
        return self

    @property
    def steps(self) -> tuple[Step, ...]:
        return (*self.timeline, *self.mend)


def read_scenario(path: Path) -> Scenario:
    """Raises ``WorldFileError``: also where the file's name or folder is not that of the scenario."""
    scenario = read_model(Scenario, path)
    if scenario.name != path.stem:
        raise WorldFileError(f"{path}: name is {scenario.name!r}: want that of the file, {path.stem!r}")
    if path.parent.name == FOLDER and scenario.world != path.parents[1].name:
        raise WorldFileError(f"{path}: world is {scenario.world!r}: want that of the folder, {path.parents[1].name!r}")
    return scenario


def known_scenarios() -> dict[str, Path]:
    """Name → file of all scenarios in the worlds folders, by world and name."""
    return _scenarios_in(worlds_folders())


def installed_scenarios() -> dict[str, Path]:
    """Those that come with rackhand."""
    return _scenarios_in([installed_worlds()])


def _scenarios_in(folders: Iterable[Path]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for folder in folders:
        for path in sorted(folder.glob(f"*/{FOLDER}/*.yaml")):
            found.setdefault(path.stem, path)
    return found


def scenario_files(names: Iterable[str]) -> tuple[Path, ...]:
    """Files of scenarios by their names, by the name of a world (all of its own), or by their paths; of all known ones
    if none is named. Raises ``WorldFileError``.
    """
    known = known_scenarios()
    worlds = {path.parents[1].name for path in known.values()}
    paths: list[Path] = []
    for name in names:
        if name in known:
            paths.append(known[name])
        elif name in worlds:
            paths += [path for path in known.values() if path.parents[1].name == name]
        elif name.endswith((".yaml", ".yml")):
            paths.append(Path(name))
        else:
            raise WorldFileError(f"there is no scenario or world {name!r}; `rackhand scenario list` shows them")
    return tuple(dict.fromkeys(paths or known.values()))


def load_scenarios(names: Iterable[str]) -> tuple[Scenario, ...]:
    """The scenarios of ``scenario_files``. Raises ``WorldFileError``."""
    return tuple(read_scenario(path) for path in scenario_files(names))
