"""What pushes an arm, or keeps it off its path, as status and events report it. Not in CRF."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from rackhand.schemas.crf_requests import CrfMessage


class Contact(CrfMessage):
    """Extension: what stopped the arm, or pushes it. ``following``: a joint is off its command [rad]; ``torque``: its
    model does not explain the torque of a joint [N·m]; ``force``: of the tool on the flange, beside its load [N]."""

    kind: Literal["following", "torque", "force"]
    joint: int | None = Field(None, description="counted from 0; none for a force")
    value: float
    bound: float
    unit: Literal["rad", "N·m", "N"]
    stopped: bool = Field(False, description="whether the arm was stopped for it")
