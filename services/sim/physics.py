"""Physics steps with the servos of arms in their middle, as one compiled call a step.

A step of MuJoCo takes some 20 µs. Two calls from Python with a servo between them add half as much again, most of it
for handing arrays over; here the compiled code gets their addresses once and calls MuJoCo's C functions itself.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.services.sim.arm.servo import JointLimits, Joints, Reference, Servo, hold_to

Addresses = NDArray[np.int64]


class Physics:
    """Steps one model and data, with ``servos`` that hold their joints to their references."""

    def __init__(self, model: Any, data: Any, servos: Sequence[Servo]) -> None:
        library = _library()
        self._kept = (library, model, data, servos)
        functions = (library.mj_step1, library.mj_step2)
        pointers = [ctypes.cast(function, ctypes.c_void_p).value or 0 for function in functions]
        self._calls = np.array([*pointers, model._address, data._address], np.int64)
        self._addresses = np.array([servo.addresses for servo in servos], np.int64)
        self._sizes = np.array([servo.sizes for servo in servos], np.int64)
        self._timestep = float(model.opt.timestep)

    def step(self) -> bool:
        """One physics step. Whether a reference has now come to the end of its segment."""
        return bool(_step(self._calls, self._addresses, self._sizes, self._timestep))


def is_available() -> bool:
    """Whether compiled code can call MuJoCo: not while numba is switched off."""
    return not numba.config.DISABLE_JIT


def _library() -> ctypes.CDLL:
    """MuJoCo's shared library, which its Python package has loaded already."""
    folder = Path(mujoco.__file__).parent
    found = sorted([*folder.glob("libmujoco*.so*"), *folder.glob("libmujoco*.dylib"), *folder.glob("mujoco*.dll")])
    return ctypes.CDLL(str(found[0]))


@intrinsic  # type: ignore[untyped-decorator]
def _call(_context: Any, _function: Any, _model: Any, _data: Any) -> Any:
    """``_call(function, model, data)``: the C function ``void (*)(mjModel *, mjData *)`` at an address."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word, word])
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


@intrinsic  # type: ignore[untyped-decorator]
def _pointer(_context: Any, _address: Any) -> Any:
    """``_pointer(address)``: for ``numba.carray``."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@compiled
def _floats(address: int, size: int) -> NDArray[np.float64]:
    return numba.carray(_pointer(address), size, np.float64)  # type: ignore[no-any-return]


@compiled
def _step(calls: Addresses, addresses: Addresses, sizes: Addresses, timestep: float) -> bool:
    _call(calls[0], calls[2], calls[3])
    ended = False
    for k in range(len(addresses)):
        a, n, entries, controls = addresses[k], sizes[k, 0], sizes[k, 1], sizes[k, 2]
        reference = Reference(
            _floats(a[0], n),
            _floats(a[1], n),
            numba.carray(_pointer(a[2]), n, np.bool_),
            _floats(a[3], n),
            _floats(a[4], n),
            _floats(a[5], n),
            _floats(a[6], n),
            _floats(a[7], 2),
        )
        joints = Joints(
            _floats(a[8], n),
            _floats(a[9], n),
            _floats(a[10], entries),
            _floats(a[11], n),
            _floats(a[12], n),
            _floats(a[13], n),
        )
        limits = JointLimits(
            _floats(a[14], n), _floats(a[15], n), _floats(a[16], n), _floats(a[17], n), _floats(a[18], n)
        )
        torque, total, motors = _floats(a[19], n), _floats(a[20], n), numba.carray(_pointer(a[21]), n, np.int64)
        ctrl = _floats(a[22], controls)
        hold_to(reference, joints, limits, timestep, torque)
        for j in range(n):
            ctrl[motors[j]] = torque[j]
            total[j] += torque[j]
        ended = ended or reference.timing[0] > reference.timing[1] - timestep / 2
    _call(calls[1], calls[2], calls[3])
    return ended
