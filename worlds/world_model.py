"""The models of ``world.yaml``. Metres, radians, seconds; map frame.

Things are named mappings, so that an error reads ``movers.anna.motion.walk: …`` and a name exists once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from rackhand.worlds.data import (
    Data,
    Name,
    NonNegative,
    Point,
    PoseTuple,
    Positive,
    Size3,
    WorldFileError,
    read_model,
    worlds_folders,
)

# The chassis' drivers work in control steps of 20 ms, those of arms in control steps of 2 ms and their servos at 1 kHz.
CONTROL_STEP_NS = 20_000_000
ARM_INSTANT_NS = 2_000_000
ARM_TIMESTEP = 0.001


Bounds = tuple[float, float, float, float]


class Static(Data):
    """Something that never moves. ``mapped``: the map shows it (its cut with the lidar's plane)."""

    mapped: bool = True
    colour: tuple[float, float, float] = (0.6, 0.6, 0.62)


class Wall(Static):
    """An upright wall whose middle line goes from ``start`` to ``end``."""

    kind: Literal["wall"]
    start: Point
    end: Point
    thickness: Positive = 0.2
    height: Positive = 2.0

    @model_validator(mode="after")
    def _has_length(self) -> Wall:
        if self.start == self.end:
            raise ValueError(f"start and end are both {self.start}: a wall needs a length")
        return self


class Box(Static):
    """A box l×w×h; ``pose`` is that of its middle, ``z`` the height of its underside."""

    kind: Literal["box"]
    pose: PoseTuple
    size: Size3
    z: NonNegative = 0.0


class Cylinder(Static):
    kind: Literal["cylinder"]
    centre: Point
    radius: Positive
    height: Positive


StaticThing = Annotated[Wall | Box | Cylinder, Field(discriminator="kind")]


class RackKind(Data):
    """A rack with four legs at the corners of ``size`` (l×w over the legs), and boards from ``underside`` up to
    ``height`` in equal distances.
    """

    size: tuple[Positive, Positive]
    underside: Positive
    height: Positive
    mass: Positive
    leg: Positive = 0.03
    board: Positive = 0.03  # thickness
    boards: Annotated[int, Field(ge=2, le=12)] = 3

    @property
    def levels(self) -> tuple[float, ...]:
        """Heights of the upper sides of its boards, from the lowest to the top."""
        lowest = self.underside + self.board
        step = (self.height - lowest) / (self.boards - 1)
        return tuple(lowest + step * i for i in range(self.boards))


class Rack(Data):
    kind: str
    pose: PoseTuple


class Item(Data):
    """A box l×w×h (m, kg) that can be lifted and carried; ``pose`` is that of its middle. It lies on top of the box
    named ``lies_on``, or on a board of the rack of that name: ``level`` counts from 0, the lowest, and None is the top.
    Without ``lies_on``, its underside is ``z`` above the floor.
    """

    size: Size3
    pose: PoseTuple
    lies_on: str | None = None
    level: Annotated[int, Field(ge=0)] | None = None
    z: NonNegative = 0.0
    mass: Positive = 0.5
    colour: tuple[float, float, float] = (0.72, 0.55, 0.36)

    @model_validator(mode="after")
    def _height_once(self) -> Item:
        if self.lies_on is not None and self.z > 0:
            raise ValueError(f"lies_on {self.lies_on!r} and z {self.z:g}: want one of the two")
        if self.level is not None and self.lies_on is None:
            raise ValueError(f"level {self.level} without lies_on: want the rack whose board it is")
        return self


@dataclass(frozen=True)
class Surfaces:
    """What items can lie on: rectangles l×w, one above another, whose middles are at ``pose``, at these heights."""

    pose: PoseTuple
    size: tuple[float, float]
    heights: tuple[float, ...]

    def height(self, level: int | None) -> float:
        """Of the level, or of the top. Raises ``ValueError`` for one that is not there."""
        if level is not None and level >= len(self.heights):
            raise ValueError(f"level {level} is not there; it has 0 … {len(self.heights) - 1}")
        return self.heights[-1 if level is None else level]

    def is_under(self, x: float, y: float) -> bool:
        dx, dy, yaw = x - self.pose[0], y - self.pose[1], self.pose[2]
        along, across = dx * math.cos(yaw) + dy * math.sin(yaw), dy * math.cos(yaw) - dx * math.sin(yaw)
        return abs(along) <= self.size[0] / 2 and abs(across) <= self.size[1] / 2


class Charger(Data):
    """A charging dock with a V-shaped face looking along its yaw. ``dock``: the pose of a chassis that is charged at
    its back; one that is charged at its front docks there turned round.
    """

    pose: PoseTuple
    dock: PoseTuple


MAIN_FLOOR = "floor1"
"""The floor that ``bounds`` of a world is."""


class Floor(Data):
    """A further floor: a hall of the same world, beside the others. ``bounds`` as those of the world; its map is in the
    folder of its name beside ``world.yaml``, in the same frame.
    """

    bounds: Bounds


class Lift(Data):
    """A lift: a cabin with a door at each floor, and a door of the shaft before it. Its walls are among the statics.

    ``floors``: floor → the middle of the cabin, x axis out of the door, the same yaw on all of them; it begins at the
    first. ``cabin``: inside, along and across that axis. ``door_at``: distance of the shaft's door from the middle.
    ``door_time``: seconds in which a door opens; ``travel``: from one floor to the next. ``traffic``: how many times a
    minute others call it.
    """

    floors: Annotated[dict[Name, PoseTuple], Field(min_length=2)]
    cabin: tuple[Positive, Positive]
    door: Positive
    door_at: Positive
    door_time: Positive = 3.0
    travel: Positive = 8.0
    traffic: NonNegative = 0.0

    @model_validator(mode="after")
    def _is_straight(self) -> Lift:
        yaws = {pose[2] for pose in self.floors.values()}
        if len(yaws) > 1:
            raise ValueError(f"floors: yaws {sorted(yaws)}: want the same yaw on all floors, a ride turns nothing")
        return self


class Walk(Data):
    """Walk along the points and from the last to the first again, for ever, ``wait`` seconds at each."""

    kind: Literal["walk"]
    points: Annotated[tuple[Point, ...], Field(min_length=2)]
    speed: Positive = 1.0
    wait: NonNegative = 0.0


class Stand(Data):
    kind: Literal["stand"]
    pose: PoseTuple


class Mover(Data):
    """A person (a capsule) that follows a script."""

    motion: Annotated[Walk | Stand, Field(discriminator="kind")]
    radius: Positive = 0.25
    height: Positive = 1.75


class Obstacle(Data):
    """A box l×w×h or a cylinder r×h that is on no map."""

    kind: Literal["box", "cylinder"] = "box"
    pose: PoseTuple
    size: Annotated[tuple[Positive, ...], Field(min_length=2, max_length=3)]


class RobotPlace(Data):
    """A robot of the world: its profile, start pose and charge (0 … 1)."""

    profile: str
    pose: PoseTuple
    battery: Annotated[float, Field(gt=0, le=1)] = 0.8


class ArmPlace(Data):
    """An arm of the world: its kind, the pose of its base frame, and how high above the floor (``mount``). What it
    is mounted on is one of the statics. ``home``: joint positions it begins with, those of its kind if not given.
    """

    kind: str
    pose: PoseTuple
    mount: NonNegative = 0.0
    home: tuple[float, ...] | None = None
    gripper: Literal["suction"] | None = None


class MapSettings(Data):
    """How the map is drawn. ``height``: of the plane that is cut; ``margin``: unknown rim round the floor."""

    resolution: Positive = 0.05
    margin: NonNegative = 0.5
    height: Positive = 0.18


class Task(Data):
    """The task of a benchmark world: reach ``goal`` within ``radius`` and ``timeout``."""

    goal: Point
    radius: Positive
    path_length: Positive
    timeout: Positive
    source: str = ""


def _default_timestep(world: dict[str, Any]) -> float:
    return ARM_TIMESTEP if world.get("arms") else 0.002


class World(Data):
    """A whole world. ``bounds``: x_min, y_min, x_max, y_max of the floor that is mapped."""

    version: Literal[1]
    name: str
    description: str = ""
    seed: Annotated[int, Field(ge=0)] = 0
    bounds: Bounds
    floors: dict[Name, Floor] = Field(default_factory=dict)
    robots: dict[Name, RobotPlace] = Field(default_factory=dict)
    arms: dict[Name, ArmPlace] = Field(default_factory=dict)
    timestep: Annotated[float, Field(gt=0, le=0.005)] = Field(default_factory=_default_timestep)
    statics: dict[Name, StaticThing] = Field(default_factory=dict)
    rack_kinds: dict[Name, RackKind] = Field(default_factory=dict)
    racks: dict[Name, Rack] = Field(default_factory=dict)
    items: dict[Name, Item] = Field(default_factory=dict)
    chargers: dict[Name, Charger] = Field(default_factory=dict)
    lifts: dict[Name, Lift] = Field(default_factory=dict)
    movers: dict[Name, Mover] = Field(default_factory=dict)
    obstacles: dict[Name, Obstacle] = Field(default_factory=dict)
    map: MapSettings = MapSettings()
    task: Task | None = None

    @model_validator(mode="after")
    def _is_consistent(self) -> World:
        floors = self.bounds_of_floors
        for floor, bounds in floors.items():
            if not (bounds[0] < bounds[2] and bounds[1] < bounds[3]):
                raise ValueError(f"bounds {bounds} of {floor}: want x_min, y_min, x_max, y_max")
        for name, lift in self.lifts.items():
            if unknown := sorted(set(lift.floors) - set(self.bounds_of_floors)):
                raise ValueError(
                    f"lifts.{name}.floors: {unknown} are not known; known: {sorted(self.bounds_of_floors)}"
                )
        for name, rack in self.racks.items():
            if rack.kind not in self.rack_kinds:
                raise ValueError(f"rack {name!r} is of unknown kind {rack.kind!r}; known: {sorted(self.rack_kinds)}")
        if not self.robots and not self.arms:
            raise ValueError("robots: a world needs at least one robot or arm")
        self._check_names()
        self._check_items()
        step = self.control_step_ns * 1e-9
        if not math.isclose(steps := step / self.timestep, round(steps), rel_tol=1e-9):
            raise ValueError(f"timestep {self.timestep}: a control step of {step:g} s must be a whole number of steps")
        if self.arms and self.timestep > ARM_TIMESTEP:
            raise ValueError(f"timestep {self.timestep}: the servo of an arm needs {ARM_TIMESTEP} or less")
        return self

    @property
    def control_step_ns(self) -> int:
        """Duration of a control step, in nanoseconds. Commands take effect at the start of a step."""
        return ARM_INSTANT_NS if self.arms else CONTROL_STEP_NS

    @property
    def bounds_of_floors(self) -> dict[str, Bounds]:
        """Floor → x_min, y_min, x_max, y_max; the main one first."""
        return {MAIN_FLOOR: self.bounds} | {name: floor.bounds for name, floor in self.floors.items()}

    def map_name(self, floor: str) -> str:
        return self.name if floor == MAIN_FLOOR else f"{self.name}_{floor}"

    def underside(self, item: Item) -> float:
        """How high above the floor an item lies."""
        return item.z if item.lies_on is None else self.surfaces()[item.lies_on].height(item.level)

    def surfaces(self) -> dict[str, Surfaces]:
        """All that items can lie on."""
        boxes = {name: thing for name, thing in self.statics.items() if isinstance(thing, Box)}
        surfaces = {name: Surfaces(box.pose, box.size[:2], (box.z + box.size[2],)) for name, box in boxes.items()}
        for name, rack in self.racks.items():
            kind = self.rack_kinds[rack.kind]
            surfaces[name] = Surfaces(rack.pose, kind.size, kind.levels)
        return surfaces

    def _check_items(self) -> None:
        surfaces = self.surfaces()
        for name, item in self.items.items():
            if item.lies_on is None:
                continue
            if item.lies_on not in surfaces:
                raise ValueError(
                    f"items.{name}.lies_on: {item.lies_on!r} is neither a box nor a rack; known: {sorted(surfaces)}"
                )
            on = surfaces[item.lies_on]
            try:
                on.height(item.level)
            except ValueError as error:
                raise ValueError(f"items.{name}.lies_on: {item.lies_on!r}: {error}") from None
            if not on.is_under(*item.pose[:2]):
                raise ValueError(f"items.{name}.pose: its centre is not above {item.lies_on}, which is at {on.pose}")

    def _check_names(self) -> None:
        owner: dict[str, str] = {}
        for group in ("robots", "arms", "statics", "racks", "items", "chargers", "lifts", "movers", "obstacles"):
            for name in getattr(self, group):
                if name in owner:
                    raise ValueError(f"the name {name!r} is used in {owner[name]} and in {group}")
                owner[name] = group


WORLD_FILE = "world.yaml"


def known_worlds() -> list[str]:
    """The names of the worlds in the worlds folders."""
    return sorted({path.parent.name for folder in worlds_folders() for path in folder.glob(f"*/{WORLD_FILE}")})


def world_directory(name_or_path: str) -> Path:
    """The folder of a world given by name, or by the path of a folder. Raises ``WorldFileError``."""
    for directory in (Path(name_or_path), *(folder / name_or_path for folder in worlds_folders())):
        if (directory / WORLD_FILE).is_file():
            return directory
    raise WorldFileError(
        f"{name_or_path!r} is neither a world ({', '.join(known_worlds())}) nor a folder that holds a {WORLD_FILE}"
    )


def load_world(name_or_path: str) -> World:
    """Read a world by its name or folder. Raises ``WorldFileError`` that says file, place and what was expected."""
    return read_model(World, world_directory(name_or_path) / WORLD_FILE)
