"""The base of every message, and the types messages are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, Strict
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

NANOSECONDS = 1_000_000_000

Stamp = Annotated[int, Field(ge=0, description="nanoseconds of world/clock")]
# msgpack knows lists only; a fixed-length vector travels as one and is read back as a tuple.
Vec2 = Annotated[tuple[float, float], Strict(False)]
Vec3 = Annotated[tuple[float, float, float], Strict(False)]
Vec6 = Annotated[tuple[float, float, float, float, float, float], Strict(False)]
Quaternion = Annotated[tuple[float, float, float, float], Strict(False), Field(description="w, x, y, z")]


class Message(BaseModel):
    """A value that travels on the bus: frozen, strict, finite, and closed to unknown fields.

    ``VERSION`` goes up when a change breaks readers of the former one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, ser_json_bytes="base64")
    VERSION: ClassVar[int] = 1


@dataclass(frozen=True)
class Array:
    """Annotates a numpy field: ``Annotated[np.ndarray, Array("<f4", (-1, 2))]``.

    It travels as little-endian bytes and comes back as a read-only array. One dimension may be -1 (free). Floating
    arrays must be finite unless ``finite=False`` (a lidar has inf and NaN).
    """

    dtype: str
    shape: tuple[int, ...]
    finite: bool = True

    def _check(self, array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        wanted = np.dtype(self.dtype)
        if array.ndim != len(self.shape) or any(w not in (-1, n) for w, n in zip(self.shape, array.shape, strict=True)):
            raise ValueError(f"shape {array.shape}, want {self.shape}")
        if self.finite and wanted.kind == "f" and not np.isfinite(array).all():
            raise ValueError("holds a value that is not finite")
        return np.ascontiguousarray(array, dtype=wanted)

    def _read(self, value: Any) -> np.ndarray[Any, Any]:
        if isinstance(value, np.ndarray):
            return self._check(value)
        if not isinstance(value, bytes | bytearray | memoryview):
            raise ValueError(f"{type(value).__name__}, want {self.dtype} bytes or an array")
        dtype = np.dtype(self.dtype)
        fixed = int(np.prod([n for n in self.shape if n != -1], dtype=np.int64)) * dtype.itemsize
        if len(value) % max(fixed, 1) or (-1 not in self.shape and len(value) != fixed):
            raise ValueError(f"{len(value)} bytes, want {'a multiple of ' if -1 in self.shape else ''}{fixed}")
        return self._check(np.frombuffer(value, dtype=dtype).reshape(self.shape))

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self._read,
            serialization=core_schema.plain_serializer_function_ser_schema(lambda a: a.tobytes(), when_used="always"),
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"type": "string", "format": "binary", "dtype": self.dtype, "shape": list(self.shape)}


class Pose2(Message):
    """A pose in the plane: metres and radians, counter-clockwise from +x; map frame unless the name says else."""

    x: float
    y: float
    yaw: float


class Twist2(Message):
    """A body twist of a chassis: forward velocity in m/s, turning rate in rad/s (left positive)."""

    linear: float
    angular: float
