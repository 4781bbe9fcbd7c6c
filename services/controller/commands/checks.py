"""Checks that several commands share. Each returns why it cannot be done, empty if it can."""

from __future__ import annotations

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.crf import CrfCode
from rackhand.services.controller.protocol.answers import Answer, error


def wrong_reference(reference: int | None) -> str:
    return "" if reference in (1, 2) else f"reference {reference}, want 1 (robot base) or 2 (TCP)"


def malformed_joint_vector(request: crf.SetVelocity | crf.SetTorque, joints: int) -> Answer | None:
    """CRF's parser refuses a wrong count here, where it refuses a path's with an ``expected``."""
    if request.type == "joints" and len(request.data) != joints:
        return error(CrfCode.BadRequest, f"data has {len(request.data)} numbers, the arm {joints} joints")
    return None
