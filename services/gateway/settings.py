"""Settings of the gateway, from options and the environment."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from rackhand.schemas.service import CELL, WORLD, ServiceId
from rackhand.schemas.topics import websocket_topics
from rackhand.schemas.websocket import DEFAULT_RATE

_NAME = re.compile(r"[A-Za-z0-9_-]{1,60}")


class Settings(BaseSettings):
    """Each field may come from the environment as ``RACKHAND_GATEWAY_<FIELD>``.

    ``name`` tells several gateways on one bus apart. ``robots`` are the chassis it serves; the first is the default,
    whose API has no prefix. ``expect`` names the services (``robot/service``) without which the cell is not up.
    ``secret``, when set, is required in every request's ``Secret`` header. ``service_status`` is the status of a
    service that was executed: the documentation says 201, clients in the field test for 200. ``rates`` are the most
    frames a second of a WebSocket topic; changes of state are not held back. ``crf_ports`` are the arms that also
    listen to CRF's packet framing.
    """

    model_config = SettingsConfigDict(env_prefix="RACKHAND_GATEWAY_", frozen=True)

    name: str = CELL
    robots: tuple[str, ...] = Field(default=(), description="amr1 where neither a robot nor an arm is named")
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
        float, Field(ge=0, description="seconds POST waits, at most, until /planning_state shows the new move")
    ] = 0.25
    max_body_bytes: Annotated[int, Field(gt=0)] = 32 * 1024 * 1024
    rates: dict[str, Annotated[float, Field(gt=0)]] = Field(
        default_factory=dict, description="overrides of the maximum frames per second, by WebSocket topic"
    )

    @model_validator(mode="before")
    @classmethod
    def _default_robot(cls, given: Any) -> Any:
        if isinstance(given, dict) and not given.get("robots") and not given.get("arms"):
            return {**given, "robots": ("amr1",)}
        return given

    @model_validator(mode="after")
    def _names(self) -> Self:
        if wrong := [name for name in (self.name, *self.robots, *self.arms) if not _NAME.fullmatch(name)]:
            raise ValueError(f"{wrong[0]!r} is not a name: want 1 … 60 letters, digits, '_' or '-'")
        return self

    @model_validator(mode="after")
    def _crf_ports_of_arms(self) -> Self:
        if unknown := [arm for arm in self.crf_ports if arm not in self.arms]:
            raise ValueError(
                f"crf_ports: {', '.join(unknown)} is not one of the arms ({', '.join(self.arms) or 'none'})"
            )
        if self.crf_ports and self.secret:
            raise ValueError("crf_ports: CRF's framing carries no secret, so a gateway with one cannot offer it")
        return self

    def interval(self, topic: str) -> float:
        """Least seconds of wall time between two frames of a WebSocket topic."""
        rate = next((view.RATE for view in websocket_topics() if topic == view.TOPIC), DEFAULT_RATE)
        return 1.0 / self.rates.get(topic, rate)

    def expected_services(self) -> tuple[ServiceId, ...]:
        """The services without which the cell is not up: by default, all that move something, and the sim."""
        actors = (*(f"{robot}/planner" for robot in self.robots), *(f"{arm}/controller" for arm in self.arms))
        named = self.expect or (f"{CELL}/router", f"{WORLD}/sim", *actors)
        return tuple(parse_service(text) for text in named)


def parse_service(text: str) -> ServiceId:
    """``robot/service`` as in ``amr1/planner``. Raises ``ValueError``."""
    robot, slash, service = text.partition("/")
    if not (robot and slash and service) or "/" in service:
        raise ValueError(f"{text!r} is not a service; want ROBOT/SERVICE, as in amr1/planner or world/sim")
    return ServiceId(service, robot)
