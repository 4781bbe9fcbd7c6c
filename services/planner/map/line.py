"""Map requests in the order in which they came, with the long work of some done beside the control loop.

A map of 10 000 x 10 000 cells takes seconds to decode, in which stops must be answered and commands must go out. So a
request that needs such work waits for a worker, and those behind it wait with it, but for those that only read.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future

from rackhand.bus import Request
from rackhand.schemas.maps import WORK_SECONDS, GetMap, ListMaps, MapReply, MapRequest
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.map.service import Made

Asked = Request[MapRequest, MapReply]
Work = Callable[[], Made]


class MapLine:
    """Used by the control thread alone."""

    def __init__(
        self,
        work_of: Callable[[MapRequest], Work | None],
        answer: Callable[[Asked, Work | None], None],
        executor: Executor,
        poster: Callable[[Callable[[Future[Made]], None]], Callable[[Future[Made]], None]],
        monotonic: Callable[[], float],
    ) -> None:
        """``work_of``: what must be done in a thread of ``executor`` before a request can be answered; None for
        nothing. ``answer``: answers a request, with a function that returns what was made of it or raises what the work
        raised. ``poster``: as ``Inbox.poster``, which brings it back to the control thread."""
        self._work_of, self._answer, self._executor, self._monotonic = work_of, answer, executor, monotonic
        self._post = poster(self._made)
        self._waiting: deque[tuple[Asked, float]] = deque()
        self._running: tuple[Asked, float] | None = None
        self._late = False  # what runs was refused

    def put(self, request: Asked) -> None:
        """Answer a request now, or when it and those before it are done."""
        if self._running is None or isinstance(request.message.request, GetMap | ListMaps):
            self._begin(request, self._monotonic())
        else:
            self._waiting.append((request, self._monotonic()))

    def check(self) -> None:
        """Refuse what has waited for too long: who asked gives up soon, and must not find it in use later."""
        late = [request for request, asked in self._waiting if self._is_late(asked)]
        self._waiting = deque(entry for entry in self._waiting if entry[0] not in late)
        if self._running is not None and not self._late and self._is_late(self._running[1]):
            self._late = True
            late.append(self._running[0])
        for request in late:
            text = f"the map, or one before it, was not loaded after {WORK_SECONDS:g} s; nothing has changed"
            request.refuse(RefusalCode.UNAVAILABLE, text)

    def _is_late(self, asked: float) -> bool:
        return self._monotonic() - asked > WORK_SECONDS

    def _begin(self, request: Asked, asked: float) -> None:
        try:
            work = self._work_of(request.message)
        except RequestRefused:
            work = None  # it is answered at once, by the same refusal
        if work is None:
            self._answer(request, None)
            return
        self._running = request, asked
        self._executor.submit(work).add_done_callback(self._post)

    def _made(self, future: Future[Made]) -> None:
        assert self._running is not None
        self.check()
        (request, _), self._running = self._running, None
        late, self._late = self._late, False
        try:
            if not late:
                self._finish(request, future)
        finally:
            while self._waiting and self._running is None:
                self._begin(*self._waiting.popleft())

    def _finish(self, request: Asked, future: Future[Made]) -> None:
        try:
            self._answer(request, future.result)
        except Exception as error:
            request.refuse(
                RefusalCode.INTERNAL, f"the planner failed to load the map: {type(error).__name__}; see its log"
            )
            raise
