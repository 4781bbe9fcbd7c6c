"""The parameters of a chassis: its own limits, lowered by what clients have set and the store keeps."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

from pydantic import ValidationError

from rackhand.runtime.store import Settled, Store
from rackhand.schemas.codec import explain
from rackhand.schemas.parameters import (
    KEYS,
    NAMES,
    ParameterChanges,
    Parameters,
    ParametersReply,
    ParametersRequest,
    Range,
    SetParameters,
    SmoothLevel,
)
from rackhand.schemas.racks import RackSpec
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.jacking import REACHED
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.perception.chassis_state import ChassisState
from rackhand.services.planner.settings import DEFAULT_RACKS, Limits

MAX_EXPANSION = 0.5  # m
LEAST_SEARCH, MOST_SEARCH = 1_000.0, 6_000_000.0  # a hall of 100 m has 4 million cells
MIN_LOADED = 0.05  # m/s and rad/s: a load must not stop the chassis
LOAD_STEP = 0.03  # of the greatest load, by which a measured weight must differ to change the velocities
MIN_ACC = 0.1  # m/s²: with less, starting and stopping take longer than a move may be without progress
BUILD_UP: dict[SmoothLevel, float] = {"disabled": 0.0, "lower": 0.12, "normal": 0.2, "higher": 0.4}
"""Seconds in which an acceleration builds up, by ``smooth_level``."""
_META = "parameters"


@dataclass(frozen=True)
class Basis:
    """Where defaults and ranges come from: the limits of the chassis, and the options of the planner. Velocities in
    m/s."""

    limits: Limits = field(default_factory=Limits)
    remote_max_forward_velocity: float = 0.8
    refuse_moves_while_jacking: bool = False
    rack_specs: tuple[RackSpec, ...] = DEFAULT_RACKS


def ranges(basis: Basis) -> dict[str, Range]:
    """What each number may be set to, by field."""
    limits = basis.limits
    spans = {
        "max_forward_velocity": (0.0, limits.max_forward_velocity, "m/s"),
        "max_backward_velocity": (limits.max_backward_velocity, 0.0, "m/s"),
        "max_forward_acc": (min(MIN_ACC, limits.max_forward_acc), limits.max_forward_acc, "m/s²"),
        "max_forward_decel": (limits.max_forward_decel, max(-MIN_ACC, limits.max_forward_decel), "m/s²"),
        "max_angular_velocity": (0.0, limits.max_angular_velocity, "rad/s"),
        "bump_tolerance": (0.0, 1.0, ""),
        "remote_max_forward_velocity": (0.0, basis.remote_max_forward_velocity, "m/s"),
        "weight_min_linear": (MIN_LOADED, limits.max_forward_velocity, "m/s"),
        "weight_min_angular": (MIN_LOADED, limits.max_angular_velocity, "rad/s"),
        "footprint_expansion": (0.0, MAX_EXPANSION, "m"),
        "search_limit": (LEAST_SEARCH, MOST_SEARCH, "places"),
    }
    return {name: Range(low=low, high=high, unit=unit) for name, (low, high, unit) in spans.items()}


def check(changes: ParameterChanges, basis: Basis, names: Literal["settings", "robot_params"] = "settings") -> None:
    """Raises ``RequestRefused`` (invalid) that names each key out of range, its value and its range."""
    spelled = NAMES if names == "settings" else NAMES | KEYS
    faults = [
        f"{spelled[name]}: {value:g} is not in {allowed}"
        for name, allowed in ranges(basis).items()
        if (value := getattr(changes, name)) is not None and not allowed.low <= value <= allowed.high
    ]
    if faults:
        raise RequestRefused(RefusalCode.INVALID, "; ".join(faults))


def defaults(basis: Basis) -> Parameters:
    """The parameters of a chassis before anyone has changed them."""
    numbers = {name: value for name, value in basis.limits._asdict().items() if name in Parameters.model_fields}
    return Parameters(
        **numbers,
        remote_max_forward_velocity=basis.remote_max_forward_velocity,
        weight_min_linear=min(0.4, basis.limits.max_forward_velocity),
        weight_min_angular=min(0.4, basis.limits.max_angular_velocity),
        refuse_moves_while_jacking=basis.refuse_moves_while_jacking,
        rack_specs=basis.rack_specs,
    )


def in_force(changes: ParameterChanges, basis: Basis) -> Parameters:
    """The defaults with changes made; what was set on another chassis is brought into the range of this one."""
    values = _set_fields(changes)
    for name, allowed in ranges(basis).items():
        if name in values:
            values[name] = min(max(values[name], allowed.low), allowed.high)
    return defaults(basis).model_copy(update=values)


def commanded(parameters: Parameters, limits: Limits, load: float = 0.0) -> Limits:
    """What may be commanded with these parameters, on a chassis with these limits.

    ``load``: the share (0 to 1) of the jack's greatest load that is on it. By as much the velocities are lowered, down
    to ``weight_min_linear`` and ``weight_min_angular``.
    """
    allowed = limits._replace(**parameters.model_dump(include=set(Limits._fields)))
    if not parameters.weight_based_speed_limit or load == 0.0:
        return allowed
    linear = max(parameters.weight_min_linear, (1.0 - load) * limits.max_forward_velocity)
    angular = max(parameters.weight_min_angular, (1.0 - load) * limits.max_angular_velocity)
    return allowed._replace(
        max_forward_velocity=min(allowed.max_forward_velocity, linear),
        max_angular_velocity=min(allowed.max_angular_velocity, angular),
    )


def load_share(state: ChassisState) -> float:
    """The share (0 to 1) of the jack's greatest load that its sensor reads; 0 with the jack down or without one."""
    if state.jack is None or state.model is None or state.model.jack is None or state.jack.progress <= REACHED:
        return 0.0
    return min(max(state.jack.weight / state.model.jack.max_load, 0.0), 1.0)


def changed(old: ParameterChanges, request: SetParameters) -> ParameterChanges:
    """What is set after a request."""
    kept = {} if request.replace else _set_fields(old)
    values = kept | _set_fields(request.changes)
    return ParameterChanges(**{name: value for name, value in values.items() if name not in request.reset})


def _set_fields(changes: ParameterChanges) -> dict[str, Any]:
    return {name: value for name in changes.model_fields_set if (value := getattr(changes, name)) is not None}


class ParameterStore:
    """What clients have set, in memory and in SQLite. A change that cannot be written is undone by ``settle``."""

    def __init__(self, store: Store[Database]) -> None:
        """Raises ``StoreError`` for a record that cannot be read."""
        self._store = store
        self.changes = self._written = store.call(_load)
        self._unwritten: deque[tuple[int, ParameterChanges]] = deque()  # numbers of jobs, and what is set after each

    def set(self, changes: ParameterChanges) -> None:
        """Replace all that is set."""
        number = self._store.submit(partial(_save, changes=changes))
        self.changes = changes
        if number:
            self._unwritten.append((number, changes))
        else:
            self._written = changes

    def settle(self, settled: Settled) -> bool:
        """The disk's answer to a job. True if a change could not be written: it and all since are undone."""
        if not any(number == settled.number for number, _ in self._unwritten):
            return False
        if settled.error is not None:
            self.changes = self._written
            self._unwritten.clear()
            return True
        while self._unwritten and self._unwritten[0][0] <= settled.number:
            _, self._written = self._unwritten.popleft()
        return False


class ParameterService:
    """Answers requests for the parameters of one chassis, and has its motion obey them. ``values`` are in force."""

    def __init__(self, store: ParameterStore, motion: Motion, basis: Basis) -> None:
        """``basis``: the options of the planner; the limits in it are those of a chassis not described yet."""
        self._store, self._motion, self._basis = store, motion, basis
        self._load = 0.0
        self.apply()

    def apply(self) -> None:
        """From the next tick on, also for a running move; limits only once the chassis is known."""
        limits = self._motion.own_limits
        if limits is not None:
            self._basis = replace(self._basis, limits=limits)
        self.values = in_force(self._store.changes, self._basis)
        self._motion.set_racks(self.values.rack_specs, self.values.ignore_objects_under_rack)
        self._motion.set_search_limit(int(self.values.search_limit))
        if limits is not None:
            self._motion.set_build_up(BUILD_UP[self.values.smooth_level])
            self._motion.set_limits(commanded(self.values, limits, self._load), self._load)

    def follow_load(self, state: ChassisState) -> None:
        """Once a tick: velocities and accelerations depend on what is on the jack."""
        load = load_share(state)
        if load == self._load or (load > 0.0 and abs(load - self._load) < LOAD_STEP):
            return
        self._load = load
        self.apply()

    def answer(self, request: ParametersRequest) -> ParametersReply:
        """What is in force after the request. Raises ``RequestRefused``."""
        if self._motion.own_limits is None:
            raise RequestRefused(RefusalCode.UNAVAILABLE, "the driver has not published the chassis' model")
        if isinstance(request.request, SetParameters):
            check(request.request.changes, self._basis, request.request.names)
            self._store.set(changed(self._store.changes, request.request))
            self.apply()
        return ParametersReply(
            values=self.values,
            defaults=defaults(self._basis),
            user=self._store.changes,
            ranges=ranges(self._basis),
        )


def _load(database: Database) -> ParameterChanges:
    record = database.get(_META)
    try:
        return ParameterChanges() if record is None else ParameterChanges.model_validate_json(record)
    except ValidationError as error:
        raise StoreError(f"the parameters in the store cannot be read: {explain(error)}") from error


def _save(database: Database, changes: ParameterChanges) -> None:
    with database.transaction():
        database.set(_META, changes.model_dump_json(exclude_none=True))
