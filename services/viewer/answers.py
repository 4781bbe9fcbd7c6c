"""What the viewer is asked for on the bus: recordings of moves.

They are made in a thread of their own: frames are drawn at a rate that the machine allows, and a caller waits seconds
at most.
"""

from __future__ import annotations

import threading

from rackhand.bus import Bus, Request
from rackhand.bus.log import get_logger
from rackhand.schemas import topics
from rackhand.schemas.explain import MoveRecording, RecordMove
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.service import CELL
from rackhand.services.viewer.explained import recorded

log = get_logger(__name__)


def serve(bus: Bus) -> None:
    """Answer until the bus stops."""
    inbox = bus.inbox().on_request(topics.MOVE_RECORDING, answer, CELL)

    def run() -> None:
        for event in inbox:
            inbox.dispatch(event)

    threading.Thread(target=run, name="recordings", daemon=True).start()


def answer(request: Request[RecordMove, MoveRecording]) -> None:
    move = request.message.explanation.move.id
    try:
        reply = MoveRecording(data=recorded(request.message.robot, request.message.explanation))
    except Exception as error:  # the next request is answered all the same
        log.error("a recording could not be made", move=move, error=repr(error))
        request.refuse(RefusalCode.INTERNAL, f"the recording of move {move} could not be made: {error!r}")
    else:
        request.reply(reply)
