"""Orientations as CRF writes them (spec motion-controller §4.3), and rotation matrices.

Five representations, each named by its key on the wire. All of them turn into a rotation matrix and back; matrices
map TCP coordinates into the base frame. Angles are radians.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Annotated, Any, Self

import numpy as np
from pydantic import (
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    ModelWrapValidatorHandler,
    Strict,
    model_serializer,
    model_validator,
)
from pydantic.alias_generators import to_pascal
from pydantic_core import CoreSchema, core_schema

from rackhand.schemas.base import Message

Matrix3 = np.ndarray[tuple[int, int], np.dtype[np.float64]]

_NON_FINITE = {"inf": math.inf, "-inf": -math.inf, "NaN": math.nan, "nan": math.nan}


def _write_number(value: float) -> float | str:
    if math.isfinite(value):
        return value
    return "NaN" if math.isnan(value) else ("inf" if value > 0 else "-inf")


class _CrfNumber:
    """JSON has no numbers that are not finite, so CRF writes them as words. Numbers take the fast way: paths have
    thousands."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        word = core_schema.no_info_after_validator_function(
            _NON_FINITE.__getitem__, core_schema.literal_schema(list(_NON_FINITE))
        )
        return core_schema.union_schema(
            [core_schema.float_schema(strict=True, allow_inf_nan=True), word],
            mode="left_to_right",
            serialization=core_schema.plain_serializer_function_ser_schema(
                _write_number, return_schema=core_schema.any_schema()
            ),
        )


CrfFloat = Annotated[float, _CrfNumber()]
CrfVec3 = Annotated[tuple[CrfFloat, CrfFloat, CrfFloat], Strict(False)]
CrfVec6 = Annotated[tuple[CrfFloat, CrfFloat, CrfFloat, CrfFloat, CrfFloat, CrfFloat], Strict(False)]

TOLERANCE = 2e-3
"""How far a quaternion, an axis or a matrix may be from a rotation; the nearest rotation is taken. CRF's 1e-12 refuses
ordinary rounded input, and clients send three or four digits."""

_SINGULAR = 1e-15  # sine of the middle angle below which the outer angles of a Cardan or Euler form are one


class Representation(IntEnum):
    """The order in which CRF lists the representations; where several are given, the first wins."""

    QUATERNION = 0
    MATRIX = 1
    ANGLE_AXIS = 2
    CARDAN_XYZ = 3
    EULER_ZXZ = 4


class _Form(Message):
    model_config = ConfigDict(alias_generator=to_pascal, validate_by_name=True, serialize_by_alias=True)

    def numbers(self) -> list[float]:
        return [float(n) for _, value in self for n in (value if isinstance(value, tuple) else (value,))]


class QuaternionForm(_Form):
    """A unit quaternion, w first."""

    w: CrfFloat
    x: CrfFloat
    y: CrfFloat
    z: CrfFloat

    @model_validator(mode="after")
    def _unit(self) -> Self:
        _require_unit("Quaternion", (self.w, self.x, self.y, self.z))
        return self

    def matrix(self) -> Matrix3:
        w, x, y, z = np.array([self.w, self.x, self.y, self.z]) / math.hypot(self.w, self.x, self.y, self.z)
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    @classmethod
    def of(cls, rotation: Matrix3) -> Self:
        w, x, y, z = quaternion(rotation)
        return cls(w=w, x=x, y=y, z=z)


class MatrixForm(_Form):
    """A rotation matrix by rows."""

    row1: CrfVec3
    row2: CrfVec3
    row3: CrfVec3

    @model_validator(mode="after")
    def _rotation(self) -> Self:
        rows = np.array([self.row1, self.row2, self.row3])
        with np.errstate(over="ignore"):
            error = np.abs(rows @ rows.T - np.eye(3)).max() if np.isfinite(rows).all() else math.inf
        if not error <= TOLERANCE:
            raise ValueError(f"Matrix is not orthonormal: off by {error:.3g}, at most {TOLERANCE:g}")
        if np.linalg.det(rows) < 0:
            raise ValueError("Matrix is a reflection: its determinant is -1, want 1")
        return self

    def matrix(self) -> Matrix3:
        """The rotation nearest to the rows as given."""
        left, _, right = np.linalg.svd(np.array([self.row1, self.row2, self.row3]))
        return np.asarray(left @ right)

    @classmethod
    def of(cls, rotation: Matrix3) -> Self:
        row1, row2, row3 = ((float(a), float(b), float(c)) for a, b, c in rotation)
        return cls(row1=row1, row2=row2, row3=row3)


class AngleAxisForm(_Form):
    """A turn by ``angle`` about a unit axis."""

    angle: CrfFloat
    axis: CrfVec3

    @model_validator(mode="after")
    def _unit(self) -> Self:
        _require_unit("Axis", self.axis)
        return self

    def matrix(self) -> Matrix3:
        x, y, z = np.array(self.axis) / math.hypot(*self.axis)
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.asarray(np.eye(3) + math.sin(self.angle) * cross + (1 - math.cos(self.angle)) * (cross @ cross))

    @classmethod
    def of(cls, rotation: Matrix3) -> Self:
        """Angle in [0, π]; without a turn the axis is x."""
        w, x, y, z = quaternion(rotation)
        size = math.hypot(x, y, z)
        axis = (x / size, y / size, z / size) if size > 0 else (1.0, 0.0, 0.0)
        return cls(angle=2 * math.atan2(size, w), axis=axis)


class CardanForm(_Form):
    """Turns about fixed x, then y, then z: R = Rz·Ry·Rx (roll, pitch, yaw)."""

    x: CrfFloat
    y: CrfFloat
    z: CrfFloat

    def matrix(self) -> Matrix3:
        return np.asarray(_about_z(self.z) @ _about_y(self.y) @ _about_x(self.x))

    @classmethod
    def of(cls, rotation: Matrix3) -> Self:
        """Where the pitch is ±π/2 only x∓z is determined; z is then 0. Near it x is what z leaves of the turn, so that
        rounding errors of the two cancel."""
        level = math.hypot(rotation[0, 0], rotation[1, 0])
        z = math.atan2(rotation[1, 0], rotation[0, 0]) if level >= _SINGULAR else 0.0
        c, s = math.cos(z), math.sin(z)
        x = math.atan2(s * rotation[0, 2] - c * rotation[1, 2], c * rotation[1, 1] - s * rotation[0, 1])
        return cls(x=x, y=math.atan2(-rotation[2, 0], level), z=z)


class EulerForm(_Form):
    """Turns about fixed z by z1, then x, then z by z2: R = Rz(z2)·Rx(x)·Rz(z1)."""

    z1: CrfFloat
    x: CrfFloat
    z2: CrfFloat

    def matrix(self) -> Matrix3:
        return np.asarray(_about_z(self.z2) @ _about_x(self.x) @ _about_z(self.z1))

    @classmethod
    def of(cls, rotation: Matrix3) -> Self:
        """Where x is 0 or π only z2±z1 is determined; z1 is then 0. Near it z1 is what z2 leaves of the turn, so that
        rounding errors of the two cancel."""
        tilt = math.hypot(rotation[0, 2], rotation[1, 2])
        x = math.atan2(tilt, rotation[2, 2])
        if tilt < _SINGULAR:
            return cls(z1=0.0, x=x, z2=math.atan2(rotation[1, 0], rotation[0, 0]))
        z2 = math.atan2(rotation[0, 2], -rotation[1, 2])
        c, s = math.cos(z2), math.sin(z2)
        z1 = math.atan2(-c * rotation[0, 1] - s * rotation[1, 1], c * rotation[0, 0] + s * rotation[1, 0])
        return cls(z1=z1, x=x, z2=z2)


Form = QuaternionForm | MatrixForm | AngleAxisForm | CardanForm | EulerForm
_FIELDS = ("quaternion", "matrix", "angle_axis", "cardan_xyz", "euler_zxz")
_KEYS = ("Quaternion", "Matrix", "AngleAxis", "CardanXYZ", "EulerZXZ")
_FORMS: tuple[type[Form], ...] = (QuaternionForm, MatrixForm, AngleAxisForm, CardanForm, EulerForm)


class Orientation(Message):
    """One orientation in one of five representations. Given several, the first in the order of the fields is taken."""

    model_config = ConfigDict(validate_by_name=True, serialize_by_alias=True)

    quaternion: QuaternionForm | None = Field(None, alias="Quaternion")
    matrix: MatrixForm | None = Field(None, alias="Matrix")
    angle_axis: AngleAxisForm | None = Field(None, alias="AngleAxis")
    cardan_xyz: CardanForm | None = Field(None, alias="CardanXYZ")
    euler_zxz: EulerForm | None = Field(None, alias="EulerZXZ")

    @model_validator(mode="wrap")
    @classmethod
    def _first(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(value, dict):
            for key, field in zip(_KEYS, _FIELDS, strict=True):
                given = value.get(key, value.get(field))
                if given is not None:
                    return handler({key: given})
            raise ValueError(f"Orientation without a representation, want one of {', '.join(_KEYS)}")
        return handler(value)

    @model_serializer
    def _only(self) -> dict[str, Any]:
        return {_KEYS[self.representation]: self.form.model_dump()}

    @property
    def form(self) -> Form:
        """The representation that is set."""
        for field in _FIELDS:
            form: Form | None = getattr(self, field)
            if form is not None:
                return form
        raise AssertionError("validated: one representation is set")

    @property
    def representation(self) -> Representation:
        return Representation(_FORMS.index(type(self.form)))

    def rotation(self) -> Matrix3:
        return self.form.matrix()

    @classmethod
    def of(cls, rotation: Matrix3, representation: Representation = Representation.QUATERNION) -> Self:
        """Raises ``ValueError`` (pydantic's) if the matrix is not a rotation."""
        form = _FORMS[representation].of(rotation)
        return cls.model_validate({_KEYS[representation]: form})


class TaskPose(Message):
    """Position in metres and orientation, in the frame its command names.

    The seed's older form ``{"data": [x, y, z, rx, ry, rz], "representation": 1}`` is taken as Cardan XYZ and never
    written. Other numbers are refused: what they meant is not documented.
    """

    model_config = ConfigDict(validate_by_name=True, serialize_by_alias=True)

    position: CrfVec3 = Field(alias="Position")
    orientation: Orientation = Field(alias="Orientation")

    @model_validator(mode="before")
    @classmethod
    def _legacy(cls, value: Any) -> Any:
        if not isinstance(value, dict) or "representation" not in value or "Position" in value:
            return value
        form = _LegacyPose.model_validate(value)
        x, y, z, *angles = form.data
        return {"Position": (x, y, z), "Orientation": {"CardanXYZ": dict(zip("XYZ", angles, strict=True))}}

    @property
    def finite(self) -> bool:
        """Whether every number is finite: NaN means "no preference" in configurations and is no target."""
        return all(math.isfinite(number) for number in (*self.position, *self.orientation.form.numbers()))


class _LegacyPose(Message):
    data: CrfVec6
    representation: Annotated[int, Field(ge=1, le=1)]


def quaternion(rotation: Matrix3) -> tuple[float, float, float, float]:
    """Unit quaternion (w, x, y, z) of a rotation matrix, w ≥ 0, from its largest component (Shepperd 1978)."""
    m = rotation
    # Four times the products of the components: row i holds q_i · (w, x, y, z).
    products = np.array(
        [
            [1 + m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], 1 + m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], 1 - m[0, 0] + m[1, 1] - m[2, 2], m[1, 2] + m[2, 1]],
            [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1 - m[0, 0] - m[1, 1] + m[2, 2]],
        ]
    )
    row = products[int(np.argmax(products.diagonal()))]
    w, x, y, z = row / np.linalg.norm(row) * (-1.0 if row[0] < 0 else 1.0)
    return float(w), float(x), float(y), float(z)


def _require_unit(name: str, vector: tuple[float, ...]) -> None:
    size = math.hypot(*vector)
    if not abs(size - 1) <= TOLERANCE:
        raise ValueError(f"{name} has length {size:.9g}, want 1 within {TOLERANCE:g}")


def _about_x(angle: float) -> Matrix3:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _about_y(angle: float) -> Matrix3:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _about_z(angle: float) -> Matrix3:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
