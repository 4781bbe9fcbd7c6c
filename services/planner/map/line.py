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

    def put(self, request: Asked) -> None:
        """Answer a request now, or when it and those before it are done."""
        if self._running is None or isinstance(request.message.request, GetMap | ListMaps):
            self._begin(request, self._monotonic())
        else:
            self._waiting.append((request, self._monotonic()))

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
        (request, asked), self._running = self._running, None
        try:
            self._finish(request, self._monotonic() - asked, future)
        finally:
            while self._waiting and self._running is None:
                self._begin(*self._waiting.popleft())

    def _finish(self, request: Asked, waited: float, future: Future[Made]) -> None:
        if waited > WORK_SECONDS:  # who asked gives up soon, and must not find it in use later
            text = f"the map was not loaded after {waited:.0f} s, want {WORK_SECONDS:g} s; nothing has changed"
            request.refuse(RefusalCode.UNAVAILABLE, text)
            return
        try:
            self._answer(request, future.result)
        except Exception as error:
            request.refuse(
                RefusalCode.INTERNAL, f"the planner failed to load the map: {type(error).__name__}; see its log"
            )
            raise
