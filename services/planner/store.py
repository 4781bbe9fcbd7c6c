"""What one chassis keeps: moves, maps and parameters, in memory while the planner runs, written by a thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from rackhand.runtime.store import Settled, StoreThread
from rackhand.services.planner.database import Database
from rackhand.services.planner.load import LoadStore
from rackhand.services.planner.map.store import MapStore
from rackhand.services.planner.moves.explanations import ExplanationStore
from rackhand.services.planner.moves.records import HISTORY_LIMIT, MoveStore
from rackhand.services.planner.parameters import ParameterStore


@dataclass(frozen=True)
class NotWritten:
    """What became of a change that could not be written: ``move_id`` is a new move that is not on disk."""

    why: str
    move_id: int | None
    maps_undone: bool


class PlannerStore:
    """Opens the store of a chassis. Raises ``StoreError`` for a file that is not a usable store of this robot."""

    def __init__(self, path: Path, robot: str, history_limit: int = HISTORY_LIMIT) -> None:
        self.path = str(path)
        self._thread = StoreThread("store", lambda: Database(path, robot), Database.close)
        try:
            self.moves, self.maps = MoveStore(self._thread, history_limit), MapStore(self._thread)
            self.parameters = ParameterStore(self._thread)
            self.load = LoadStore(self._thread)
            self.explanations = ExplanationStore(self._thread)
        except BaseException:
            self._thread.close()
            raise

    @property
    def submitted(self) -> int:
        """Number of the last change that was given to the thread."""
        return self._thread.submitted

    def on_settled(self, settled: Callable[[Settled], None]) -> None:
        """Call ``settled`` in the store thread for each change; the control thread is to pass it to ``settle``."""
        self._thread.settled = settled

    def settle(self, settled: Settled) -> NotWritten | None:
        """The disk's answer to a change, in the control thread."""
        move_id, maps_undone = self.moves.settle(settled), self.maps.settle(settled)
        self.parameters.settle(settled)
        if settled.error is None:
            return None
        self._thread.resume()
        return NotWritten(str(settled.error), move_id, maps_undone)

    def close(self) -> None:
        """Returns when everything is written."""
        self._thread.close()

    def __enter__(self) -> PlannerStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
