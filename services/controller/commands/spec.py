"""A CRF command as one row: its model, what the protocol has to know of it, how it is checked and executed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.base import Message
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import Expected, RobotConfiguration
from rackhand.services.controller.access.types import Decision
from rackhand.services.controller.protocol.answers import Answer

if TYPE_CHECKING:
    from rackhand.services.controller.arm_control import ArmControl
    from rackhand.services.controller.protocol.context import RequestContext

R = TypeVar("R", bound=crf.Request)


class CommandTableError(TypeError):
    """The rows do not fit the schema: a command without a row, with two rows, or a row that no client can reach."""


@dataclass(frozen=True)
class GrantedCommand:
    """A request that has control (or needs none) and is carried out on the arm. ``ticket`` is its caller's."""

    request: crf.Request
    client: str
    decision: Decision
    echo: dict[str, Any]
    key: tuple[str, bytes] | None = None
    ticket: object = None


@dataclass(frozen=True)
class Result:
    """The ``message`` of the answer, and why where it is a refusal or differs from what was asked."""

    message: Message
    text: str = ""

    @classmethod
    def done(cls, text: str = "") -> Result:
        return cls(Expected[bool].of(True), text)

    @classmethod
    def failed(cls, code: CrfCode, text: str, detail: int = 0) -> Result:
        return cls(Expected[bool].failed(code, detail), text)


@dataclass(frozen=True)
class OnAccess(Generic[R]):
    """Executed in the protocol layer, on priority access and the sessions; the answer is known at once."""

    run: Callable[[R, RequestContext], Answer]


@dataclass(frozen=True)
class OnArm(Generic[R]):
    """Executed on the arm, for a ``ControlRequest`` after control is granted. Returns ``None`` where the answer comes
    later, through ``ArmControl.finish``."""

    run: Callable[[R, ArmControl, GrantedCommand], Result | None]


def _nothing_wrong(_request: Any, _arm: RobotConfiguration) -> str:
    return ""


def _well_formed(_request: Any, _joints: int) -> Answer | None:
    return None


@dataclass(frozen=True)
class CommandSpec(Generic[R]):
    """One command.

    ``moves``: it sets the arm in motion, so a latched stop refuses it. ``resumes``: it lifts a latched stop.
    ``audited``: it is written to the audit log even when it succeeds. ``once``: executing it twice is not the same as
    executing it once, so a retry with the same ``id`` and text is answered from memory for ``AccessConfig.retry_ns``.
    ``malformed``: the error for values that CRF's parser refuses (its second argument is the number of joints);
    ``named_errors``: malformed fields are answered with CRF's texts instead of a bare 400. ``check``: why this arm
    cannot do it, empty if it can; it is asked before control is taken.
    """

    model: type[R]
    execute: OnAccess[R] | OnArm[R]
    moves: bool = False
    resumes: bool = False
    audited: bool = False
    once: bool = False
    check: Callable[[R, RobotConfiguration], str] = field(default=_nothing_wrong)
    malformed: Callable[[R, int], Answer | None] = field(default=_well_formed)
    named_errors: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The values of ``command`` on the wire."""
        return crf.words(self.model)


class CommandTable:
    """The rows of a controller, by name and by model.

    ``schema``: every model in it needs exactly one row. Raises ``CommandTableError``.
    """

    def __init__(self, specs: Iterable[CommandSpec[Any]], schema: Iterable[type[crf.Request]] = ()) -> None:
        self._specs = tuple(specs)
        self._by_model = {spec.model: spec for spec in self._specs}
        if len(self._by_model) < len(self._specs):
            raise CommandTableError("two rows have the same model")
        missing = [model.__name__ for model in schema if model not in self._by_model]
        if missing:
            raise CommandTableError(f"no CommandSpec for {', '.join(missing)}")
        self._by_name: dict[str, tuple[CommandSpec[Any], ...]] = {}
        for spec in self._specs:
            for name in spec.names:
                self._by_name[name] = (*self._by_name.get(name, ()), spec)
        for name, variants in self._by_name.items():
            if len({crf.type_of(spec.model) for spec in variants}) < len(variants):
                raise CommandTableError(f"rows of {name} that ``type`` does not distinguish")

    def __iter__(self) -> Iterator[CommandSpec[Any]]:
        return iter(self._specs)

    def of(self, request: crf.Request) -> CommandSpec[Any]:
        return self._by_model[type(request)]

    def named(self, name: str) -> tuple[CommandSpec[Any], ...]:
        """The rows of this name: none if it is unknown, several where ``type`` distinguishes them."""
        return self._by_name.get(name, ())
