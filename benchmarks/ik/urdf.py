"""Our arms as URDF text, for libraries that read nothing else: kinematics and limits, no shapes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rackhand.services.controller.ik import Arm

TOOL = "flange"
_MASS = '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'


def to_urdf(arm: Arm) -> str:
    """Links ``link0`` … and joints of the arm's own names, each turning about its z; the tool is link ``flange``."""
    limits = arm.limits
    parts = [f'<robot name="{arm.name}">', f'<link name="link0">{_MASS}</link>']
    for i, name in enumerate(arm.joints):
        bounds = (
            f'lower="{float(limits.lower[i])!r}" upper="{float(limits.upper[i])!r}" '
            f'velocity="{float(limits.velocity[i])!r}" effort="{float(limits.torque[i])!r}"'
        )
        parts += [
            f'<link name="link{i + 1}">{_MASS}</link>',
            f'<joint name="{name}" type="revolute"><parent link="link{i}"/><child link="link{i + 1}"/>'
            f'{_origin(arm.placements[i])}<axis xyz="0 0 1"/><limit {bounds}/></joint>',
        ]
    parts += [
        f'<link name="{TOOL}"/>',
        f'<joint name="{TOOL}_mount" type="fixed"><parent link="link{arm.n}"/><child link="{TOOL}"/>'
        f"{_origin(arm.placements[-1])}</joint>",
        "</robot>",
    ]
    return "\n".join(parts)


def _origin(pose: NDArray[np.float64]) -> str:
    xyz, rpy = pose[:, 3], pin.rpy.matrixToRpy(np.ascontiguousarray(pose[:, :3]))
    return f'<origin xyz="{_numbers(xyz)}" rpy="{_numbers(rpy)}"/>'


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(repr(float(value)) for value in values)
