"""``/system/settings``: what the chassis drives with, and the kinds of racks, as one flat table of names and values."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict

from rackhand.schemas.parameters import (
    NAMES,
    SETTINGS,
    GetParameters,
    ParameterChanges,
    Parameters,
    ParametersReply,
    Range,
    SetParameters,
    Setting,
)
from rackhand.services.gateway.chassis_api.parameters import (
    Outline,
    ask_parameters,
    check_outline,
    described_outline,
)
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.http.errors import failures

router = APIRouter(prefix="/system/settings", tags=["settings"])

FOOTPRINT = "robot.footprint"


def _name(field: str) -> str:
    return NAMES.get(field, FOOTPRINT)


class SettingRow(BaseModel):
    """One setting: its type, default and range, as in ``[0, 1.2]``."""

    name: str
    title: str
    type: str
    default: Any
    range: str | None = None
    options: list[str] | None = None
    description: str | None = None


class SettingsSchema(BaseModel):
    """All settings of this chassis."""

    ax: list[SettingRow]


class SettingsBody(ParameterChanges):
    """New values of some settings. ``null`` returns one to its default."""

    model_config = ConfigDict(
        alias_generator=_name,
        json_schema_extra={
            "examples": [
                {
                    "control.max_forward_velocity": 0.8,
                    "rack.specs": [{"width": 0.83, "depth": 0.83, "margin": [0.05, 0.05, 0.05, 0.05]}],
                }
            ]
        },
    )
    footprint: Outline | None = None


class SettingsTable(Parameters):
    """A value for each setting."""

    model_config = ConfigDict(alias_generator=_name)
    footprint: Outline


@router.get("/schema", response_model_exclude_none=True, responses=failures(404, 503))
async def settings_schema(gateway: Gateway) -> SettingsSchema:
    """What may be set on this chassis: names, types, defaults, ranges, and what each does."""
    outline = described_outline(gateway)
    reply = await ask_parameters(gateway, GetParameters())
    body = SettingRow(
        name=FOOTPRINT,
        title="Robot: Footprint",
        type="Polygon",
        default=outline,
        description="m, x to the right and y to the front; that of the chassis' description, cannot be changed",
    )
    return SettingsSchema(ax=[body, *(_row(setting, reply) for setting in SETTINGS)])


@router.get("/default", responses=failures(404, 503))
async def default_settings(gateway: Gateway) -> SettingsTable:
    """The settings as nobody has changed them."""
    outline = described_outline(gateway)
    return _table((await ask_parameters(gateway, GetParameters())).defaults, outline)


@router.get("/effective", responses=failures(404, 503))
async def effective_settings(gateway: Gateway) -> SettingsTable:
    """The settings in force: the defaults, and over them what was set."""
    outline = described_outline(gateway)
    return _table((await ask_parameters(gateway, GetParameters())).values, outline)


@router.get("/user", responses=failures(404, 503))
async def user_settings(gateway: Gateway) -> dict[str, Any]:
    """What was set, and nothing else."""
    return _user((await ask_parameters(gateway, GetParameters())).user)


@router.post("/user", responses=failures(400, 404, 413, 503))
async def save_user_settings(body: SettingsBody, gateway: Gateway) -> dict[str, Any]:
    """Set these and no others: what is not given returns to its default. All or nothing; at once, and lastingly.
    Answered with what is set.
    """
    return await _set(gateway, body, replace=True)


@router.patch("/user", responses=failures(400, 404, 413, 503))
async def change_user_settings(body: SettingsBody, gateway: Gateway) -> dict[str, Any]:
    """Set these; what is not given stays as it is, `null` returns to its default. All or nothing; at once, and
    lastingly. Answered with all that is set.
    """
    return await _set(gateway, body, replace=False)


async def _set(gateway: Context, body: SettingsBody, replace: bool) -> dict[str, Any]:
    check_outline(FOOTPRINT, body.footprint, described_outline(gateway))
    given = {name: getattr(body, name) for name in body.model_fields_set - {"footprint"}}
    request = SetParameters(
        changes=ParameterChanges(**{name: value for name, value in given.items() if value is not None}),
        reset=tuple(sorted(name for name, value in given.items() if value is None)),
        replace=replace,
    )
    return _user((await ask_parameters(gateway, request)).user)


def _row(setting: Setting, reply: ParametersReply) -> SettingRow:
    allowed = reply.ranges.get(setting.field)
    return SettingRow(
        name=setting.name,
        title=setting.title,
        type=setting.type,
        default=reply.defaults.model_dump(mode="json")[setting.field],
        range=None if allowed is None else _brackets(allowed),
        options=list(setting.options) or None,
        description=setting.description,
    )


def _brackets(allowed: Range) -> str:
    return f"[{allowed.low:g}, {allowed.high:g}]"


def _table(values: Parameters, outline: Outline) -> SettingsTable:
    fields: dict[str, Any] = {name: getattr(values, field) for field, name in NAMES.items()}
    return SettingsTable(**(fields | {FOOTPRINT: outline}))


def _user(changes: ParameterChanges) -> dict[str, Any]:
    values = changes.model_dump(mode="json", exclude_none=True)
    return {name: values[field] for field, name in NAMES.items() if field in values}
