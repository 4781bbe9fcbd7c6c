"""What the gateway can be told, from options and the environment."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from rackhand.schemas.service import CELL, WORLD, ServiceId

# Hz of wall time, as measured on a real Longjack; the pose as its makers promise it. Others go out at DEFAULT_RATE.
RATES = {
    "/tracked_pose": 10.0,
    "/motion_metrics": 10.0,
    "/scan_matched_points2": 2.0,
    "/slam/state": 1.0,
    "/battery_state": 1.0,
    "/jack_state": 2.0,
}
DEFAULT_RATE = 5.0


class Settings(BaseSettings):
    """Each field may come from the environment as ``RACKHAND_GATEWAY_<FIELD>``.

    ``expect`` names the services (``robot/service``) without which the cell is not up. ``secret``, when set, is wanted
    in every request's ``Secret`` header. ``service_status`` is what a service that was executed answers: the
    documentation says 201, clients in the field test for 200. ``rates`` are the most frames a second of a WebSocket
    topic; changes of state are never held back. ``crf_ports`` are the arms that also listen to CRF's packet framing.
    """

    model_config = SettingsConfigDict(env_prefix="RACKHAND_GATEWAY_", frozen=True)

    robot: str = Field(default="", description="the chassis; amr1 where neither it nor an arm is named")
    arms: tuple[str, ...] = ()
    crf_ports: dict[str, Annotated[int, Field(ge=0, le=65535)]] = Field(
        default_factory=dict, description="TCP port of each such arm; 0 is any free one"
    )
    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8090
    expect: tuple[str, ...] = ()
    secret: str = ""
    allow_origins: str = Field(default=".*", description="regular expression of browser origins that may call")
    service_status: Literal[200, 201] = 200
    call_timeout: Annotated[float, Field(gt=0, description="seconds to wait for an answer from the bus")] = 2.0
    motion_timeout: Annotated[float, Field(gt=0, description="seconds to wait for an arm's answer")] = 10.0
    planning_state_timeout: Annotated[
        float, Field(ge=0, description="seconds POST waits, at most, until /planning_state tells of the new move")
    ] = 0.25
    max_body_bytes: Annotated[int, Field(gt=0)] = 32 * 1024 * 1024
    rates: dict[str, Annotated[float, Field(gt=0)]] = Field(
        default_factory=dict, description="overrides the measured rates, Hz"
    )

    @model_validator(mode="before")
    @classmethod
    def _somebody(cls, given: Any) -> Any:
        if isinstance(given, dict) and not given.get("robot") and not given.get("arms"):
            return {**given, "robot": "amr1"}
        return given

    @model_validator(mode="after")
    def _crf_ports_of_arms(self) -> Self:
        if strangers := [arm for arm in self.crf_ports if arm not in self.arms]:
            raise ValueError(
                f"crf_ports: {', '.join(strangers)} is none of the arms ({', '.join(self.arms) or 'none'})"
            )
        if self.crf_ports and self.secret:
            raise ValueError("crf_ports: CRF's framing carries no secret, so a gateway with one cannot offer it")
        return self

    def interval(self, topic: str) -> float:
        """Least seconds of wall time between two frames of a WebSocket topic."""
        return 1.0 / self.rates.get(topic, RATES.get(topic, DEFAULT_RATE))

    def expected_services(self) -> tuple[ServiceId, ...]:
        """What must be there for the cell to be up: by default, all of the default cell."""
        actors = (*((f"{self.robot}/planner",) if self.robot else ()), *(f"{arm}/controller" for arm in self.arms))
        named = self.expect or (f"{CELL}/router", f"{WORLD}/sim", *actors)
        return tuple(parse_service(text) for text in named)


def parse_service(text: str) -> ServiceId:
    """``robot/service`` as in ``amr1/planner``. Raises ``ValueError``."""
    robot, slash, service = text.partition("/")
    if not (robot and slash and service) or "/" in service:
        raise ValueError(f"{text!r} is not a service; want ROBOT/SERVICE, as in amr1/planner or world/sim")
    return ServiceId(service, robot)
