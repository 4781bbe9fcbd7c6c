"""Whether a scenario fits its world: names, parts and places, without running it."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from pydantic import ValidationError

from rackhand.schemas.codec import explain
from rackhand.schemas.faults import FAULTS, amount_of
from rackhand.schemas.moves import MoveCreate
from rackhand.worlds.scenario_model import Fault, Scenario, Step
from rackhand.worlds.world_model import World


def problems_of(scenario: Scenario, world: World) -> tuple[str, ...]:
    """A sentence for each thing that cannot work, each beginning with where it is."""
    found = list(_of_the_robot(scenario, world))
    placed: set[str] = set()
    for kind, steps in (("timeline", scenario.timeline), ("mend", scenario.mend)):
        for number, step in enumerate(steps, 1):
            placed |= set(step.place)
            found += [f"{kind} {number}: {text}" for text in _of_step(step, scenario, world, placed)]
    if scenario.then is not None:
        found += [f"then: {text}" for text in _of_move(scenario.then)]
    return tuple(f"{scenario.name}: {text}" for text in found)


def _of_the_robot(scenario: Scenario, world: World) -> Iterator[str]:
    if scenario.robot not in world.robots:
        yield f"robot {scenario.robot!r} is not in world {world.name}; its robots: {sorted(world.robots)}"
    if scenario.start is not None:
        x, y, _ = scenario.start
        halls = world.bounds_of_floors.values()
        if not any(hall[0] <= x <= hall[2] and hall[1] <= y <= hall[3] for hall in halls):
            yield f"start ({x:g}, {y:g}) is in no hall of world {world.name}: {list(halls)}"


def _of_step(step: Step, scenario: Scenario, world: World, placed: set[str]) -> Iterator[str]:
    movable = {*world.racks, *world.items}
    for name in step.put:
        if name not in movable | {scenario.robot}:
            yield f"put: {name!r} is neither the robot nor a rack or item of world {world.name}"
    for name in step.remove:
        if name not in movable | placed:
            yield f"remove: {name!r} is neither a rack or item of world {world.name} nor placed before"
    for name in (*step.restore, *(() if step.push is None else (step.push.name,))):
        if name not in movable:
            yield f"{name!r} is no rack or item of world {world.name}; known: {sorted(movable)}"
    for fault in (*step.faults, *step.clear):
        yield from _of_fault(fault, scenario, world, active=fault in step.faults)
    for name in step.lift:
        if name not in world.lifts:
            yield f"lift: {name!r} is no lift of world {world.name}; known: {sorted(world.lifts)}"
    if step.move is not None:
        yield from _of_move(step.move)


def _of_fault(fault: Fault, scenario: Scenario, world: World, active: bool) -> Iterator[str]:
    kind, target = FAULTS[fault.fault], fault.target or scenario.robot
    known = _things(world).get(kind.target)
    if known is not None and target not in known:
        yield f"fault {fault.fault}: {target!r} is no {kind.target} of world {world.name}; known: {sorted(known)}"
    if fault.part is not None and fault.part >= kind.parts:
        yield f"fault {fault.fault} has no part {fault.part}; it has {kind.parts}"
    if active and (fault.pose is None) != (kind.pose is None):
        yield f"fault {fault.fault}: {'takes no pose' if kind.pose is None else f'needs a pose ({kind.pose})'}"
    try:
        amount_of(kind, fault.amount)
    except ValueError as error:
        yield str(error)


def _things(world: World) -> dict[str, Collection[str]]:
    """What can have faults of each target; others can have a name that no file has."""
    return {"chassis": world.robots, "rack": world.racks, "lift": world.lifts, "charger": world.chargers}


def _of_move(body: dict[str, Any]) -> Iterator[str]:
    try:
        MoveCreate.model_validate({"creator": "scenario", **body})
    except ValidationError as error:
        yield f"move: {explain(error)}"
