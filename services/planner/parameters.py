"""The parameters of a chassis: its own limits, lowered by what clients have set and the store keeps."""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import NamedTuple

from pydantic import ValidationError

from rackhand.runtime.store import Settled, Store
from rackhand.schemas.codec import explain
from rackhand.schemas.parameters import (
    KEYS,
    ParameterChanges,
    Parameters,
    ParametersReply,
    ParametersRequest,
    SetParameters,
)
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.settings import Limits

MIN_ACC = 0.1  # m/s²: with less, starting and stopping take longer than a move may be without progress
_META = "parameters"


class Range(NamedTuple):
    """Both ends belong to it."""

    low: float
    high: float
    unit: str

    def __str__(self) -> str:
        return f"{self.low:g} … {self.high:g} {self.unit}".rstrip()


def ranges(limits: Limits) -> dict[str, Range]:
    """What each number may be set to on a chassis with these limits."""
    return {
        "max_forward_velocity": Range(0.0, limits.max_forward_velocity, "m/s"),
        "max_backward_velocity": Range(limits.max_backward_velocity, 0.0, "m/s"),
        "max_forward_acc": Range(min(MIN_ACC, limits.max_forward_acc), limits.max_forward_acc, "m/s²"),
        "max_forward_decel": Range(limits.max_forward_decel, max(-MIN_ACC, limits.max_forward_decel), "m/s²"),
        "max_angular_velocity": Range(0.0, limits.max_angular_velocity, "rad/s"),
        "bump_tolerance": Range(0.0, 1.0, ""),
    }


def check(changes: ParameterChanges, limits: Limits) -> None:
    """Raises ``RequestRefused`` (invalid) that names each key out of range, its value and its range."""
    faults = [
        f"{KEYS[name]}: {value:g} is not in {allowed}"
        for name, allowed in ranges(limits).items()
        if (value := getattr(changes, name)) is not None and not allowed.low <= value <= allowed.high
    ]
    if faults:
        raise RequestRefused(RefusalCode.INVALID, "; ".join(faults))


def defaults(limits: Limits) -> Parameters:
    """The parameters of a chassis with these limits before anyone has changed them."""
    numbers = {name: value for name, value in limits._asdict().items() if name in Parameters.model_fields}
    return Parameters(**numbers)


def in_force(changes: ParameterChanges, limits: Limits) -> Parameters:
    """The defaults with changes made; what was set on another chassis is brought into the range of this one."""
    values = changes.model_dump(exclude_none=True)
    for name, allowed in ranges(limits).items():
        if name in values:
            values[name] = min(max(values[name], allowed.low), allowed.high)
    return defaults(limits).model_copy(update=values)


def commanded(parameters: Parameters, limits: Limits) -> Limits:
    """What may be commanded with these parameters, on a chassis with these limits."""
    fields = parameters.model_dump(include=set(Limits._fields))
    return limits._replace(**fields)


def merged(old: ParameterChanges, new: ParameterChanges) -> ParameterChanges:
    """The new values, and the old ones where there is none."""
    return old.model_copy(update=new.model_dump(exclude_none=True))


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
    """Answers requests for the parameters of one chassis, and has its motion obey them."""

    def __init__(self, store: ParameterStore, motion: Motion) -> None:
        self._store, self._motion = store, motion

    def apply(self) -> None:
        """From the next tick on, also for a running move; nothing before the chassis is known."""
        limits = self._motion.own_limits
        if limits is not None:
            self._motion.set_limits(commanded(in_force(self._store.changes, limits), limits))

    def answer(self, request: ParametersRequest) -> ParametersReply:
        """What is in force after the request. Raises ``RequestRefused``."""
        limits = self._motion.own_limits
        if limits is None:
            raise RequestRefused(RefusalCode.UNAVAILABLE, "the driver has not published the chassis' model")
        if isinstance(request.request, SetParameters):
            check(request.request.changes, limits)
            self._store.set(merged(self._store.changes, request.request.changes))
            self.apply()
        return ParametersReply(values=in_force(self._store.changes, limits), defaults=defaults(limits))


def _load(database: Database) -> ParameterChanges:
    record = database.get(_META)
    try:
        return ParameterChanges() if record is None else ParameterChanges.model_validate_json(record)
    except ValidationError as error:
        raise StoreError(f"the parameters in the store cannot be read: {explain(error)}") from error


def _save(database: Database, changes: ParameterChanges) -> None:
    with database.transaction():
        database.set(_META, changes.model_dump_json(exclude_none=True))
