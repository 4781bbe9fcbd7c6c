"""Commands about control of the arm: locks, stops, heartbeats (spec motion-controller §5, §7.2)."""

from __future__ import annotations

import math

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import Expected
from rackhand.services.controller.access.types import SECOND, Beat, Decision, Lock, StartBeat, Stop, StopBeat, Unlock
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.commands.spec import CommandSpec, GrantedCommand, OnAccess, OnArm, Result
from rackhand.services.controller.protocol.answers import Answer, denied, error, reply
from rackhand.services.controller.protocol.context import RequestContext

MIN_HEARTBEAT_S, MAX_HEARTBEAT_S = 0.001, 3600.0
_MAX_KEEP_ALIVE_S = 1e6  # what is longer is cut to the configuration's anyway; this keeps the product an int64


def _lock(request: crf.LockControl, context: RequestContext) -> Answer:
    keep_alive = None if request.keep_alive is None else int(min(request.keep_alive, _MAX_KEEP_ALIVE_S) * SECOND)
    lock = Lock(context.caller, request.priority, keep_alive, request.on_loss, request.takeover, request.force)
    decision = context.handle(lock)
    return reply(request.command, decision.ok, decision.text, **context.lease(decision))


def _malformed_lock(request: crf.LockControl, _joints: int) -> Answer | None:
    seconds = request.keep_alive
    if seconds is None or (math.isfinite(seconds) and seconds > 0):
        return None
    return error("Wrong parameters", f"keepAlive {seconds} s, want more than 0")


def _unlock(request: crf.UnlockControl, context: RequestContext) -> Answer:
    decision = context.handle(Unlock(context.caller, request.priority))
    return reply(request.command, decision.ok, decision.text)


def _resume(_request: crf.ResumeControl, _arm: ArmControl, _granted: GrantedCommand) -> Result:
    """Priority access has lifted the latch and continued a kept queue when it granted the command."""
    return Result.done()


def _stop(request: crf.SoftStop | crf.HardStop, context: RequestContext) -> Answer:
    if request.priority is None and context.strict_crf:
        return error(CrfCode.BadRequest, "priority is missing")
    decision = context.handle(Stop(context.caller, request.command, request.priority))
    return reply(request.command, Expected[bool].of(True)) if decision.ok else denied(request.command, decision)


def _start_heartbeat(request: crf.StartHeartbeat, context: RequestContext) -> Answer:
    return _beat(request, context.handle(StartBeat(context.caller, int(request.period * SECOND))))


def _malformed_heartbeat(request: crf.StartHeartbeat, _joints: int) -> Answer | None:
    if MIN_HEARTBEAT_S <= request.period <= MAX_HEARTBEAT_S:
        return None
    text = f"{request.period} s, want {MIN_HEARTBEAT_S:g} to {MAX_HEARTBEAT_S:g}"
    return error("Heartbeat period not valid", text)


def _heartbeat(request: crf.Heartbeat, context: RequestContext) -> Answer:
    return _beat(request, context.handle(Beat(context.caller)))


def _stop_heartbeat(request: crf.StopHeartbeat, context: RequestContext) -> Answer:
    return _beat(request, context.handle(StopBeat(context.caller)))


def _beat(request: crf.Request, decision: Decision) -> Answer:
    if decision.ok:
        return reply(request.command, True)
    return error(decision.text if decision.code == CrfCode.BadRequest else int(decision.code), decision.text)


SPECS = (
    CommandSpec(crf.LockControl, OnAccess(_lock), malformed=_malformed_lock, named_errors=True),
    CommandSpec(crf.UnlockControl, OnAccess(_unlock), named_errors=True),
    CommandSpec(crf.ResumeControl, OnArm(_resume), resumes=True),
    CommandSpec(crf.SoftStop, OnAccess(_stop)),
    CommandSpec(crf.HardStop, OnAccess(_stop)),
    CommandSpec(crf.StartHeartbeat, OnAccess(_start_heartbeat), malformed=_malformed_heartbeat, named_errors=True),
    CommandSpec(crf.Heartbeat, OnAccess(_heartbeat)),
    CommandSpec(crf.StopHeartbeat, OnAccess(_stop_heartbeat)),
)
