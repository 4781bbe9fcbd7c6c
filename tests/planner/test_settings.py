"""The settings of a chassis: its own limits, capped by the operator's."""

from __future__ import annotations

import pytest

from rackhand.schemas.chassis import Actuation, ChassisLimits
from rackhand.services.planner.settings import NavigationSettings, SpeedCaps
from tests.chassis_models import chassis_model

FAST = chassis_model(
    limits=ChassisLimits(
        forward=2.0, reverse=0.3, angular=4.0, acceleration=4.0, deceleration=3.0, angular_acceleration=12.0
    ),
    actuation=Actuation(latency=0.02, lag=0.05),
)


def test_limits_and_actuation_are_those_of_the_chassis() -> None:
    settings = NavigationSettings().for_chassis(FAST)
    control = settings.control
    assert (control.max_forward_velocity, control.max_backward_velocity, control.max_angular_velocity) == (
        2.0,
        -0.3,
        4.0,
    )
    assert (control.max_forward_acc, control.max_forward_decel, control.max_angular_acc) == (4.0, -3.0, 12.0)
    assert settings.actuation == FAST.actuation
    assert settings.approach_decel == pytest.approx(0.75)


def test_the_longjack_is_driven_as_by_default() -> None:
    settings = NavigationSettings()
    longjack = settings.for_chassis(chassis_model())
    assert longjack.control == settings.control and longjack.actuation == settings.actuation
    assert longjack.approach_decel == pytest.approx(settings.approach_decel)


def test_the_operator_lowers_speeds_and_never_raises_them() -> None:
    capped = NavigationSettings(caps=SpeedCaps(0.2, 9.0)).for_chassis(FAST).control
    assert (capped.max_forward_velocity, capped.max_backward_velocity, capped.max_angular_velocity) == (0.2, -0.2, 4.0)
