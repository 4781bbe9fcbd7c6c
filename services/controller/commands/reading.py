"""Commands that read: status, configuration, status streams (spec motion-controller §2, §6.7, §6.8)."""

from __future__ import annotations

import math

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.crf import CrfCode
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.commands.spec import CommandSpec, GrantedCommand, OnAccess, OnArm, Result
from rackhand.services.controller.protocol.answers import Answer, error, reply
from rackhand.services.controller.protocol.context import RequestContext

MIN_FREQUENCY = 1e-6  # Hz


def _status(_request: crf.GetStatus, arm: ArmControl, _granted: GrantedCommand) -> Result:
    return Result(arm.status())


def _configuration(request: crf.GetConfiguration, context: RequestContext) -> Answer:
    return reply(request.command, context.arm)


def _start_stream(request: crf.StartStreamStatus, context: RequestContext) -> Answer:
    """CRF leaves this unanswered on success. Its clients ignore a ``true``, and other clients need an answer."""
    if not context.streams.start(context.session, request.frequency, request.mode, context.now):
        return error(CrfCode.ServiceUnavailable, f"{len(context.streams)} streams are active")
    return reply(request.command, True)


def _malformed_stream(request: crf.StartStreamStatus, _joints: int) -> Answer | None:
    if not MIN_FREQUENCY <= request.frequency < math.inf:
        return error("Frequency not valid", f"{request.frequency} Hz, want at least {MIN_FREQUENCY:g}")
    if request.mode not in (1, 2):
        return error("Mode not valid", f"mode {request.mode}, want 1 (frequency) or 2 (differential)")
    return None


def _stop_stream(request: crf.StopStreamStatus, context: RequestContext) -> Answer:
    if not context.streams.stop(context.session):
        return error("Stream was not active")
    return reply(request.command, True)


SPECS = (
    CommandSpec(crf.GetStatus, OnArm(_status)),
    CommandSpec(crf.GetConfiguration, OnAccess(_configuration)),
    CommandSpec(crf.StartStreamStatus, OnAccess(_start_stream), malformed=_malformed_stream, named_errors=True),
    CommandSpec(crf.StopStreamStatus, OnAccess(_stop_stream)),
)
