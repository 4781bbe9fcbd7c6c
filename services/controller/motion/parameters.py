"""``setParameters``: objective functions, the spheres to stay out of, stop conditions. All of a call or none of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.crf_parameters import (
    ControllerParameters,
    Objective,
    ObjectiveFunctions,
    SphereObjective,
    StopConditions,
)
from rackhand.services.controller import ik

_STOPS_ON = {
    "stop_on_low_manipulability": CrfCode.LowManipulability,
    "stop_on_tolerance_violation": CrfCode.EndEffectorToleranceViolation,
    "stop_on_computation_time_violation": CrfCode.RealTimeViolation,
    "stop_on_workspace_violation": CrfCode.WorkspaceViolation,
}


class ParametersRefused(ValueError):
    """Parameters that are not possible, and why. ``code`` is CRF's."""

    def __init__(self, text: str, code: CrfCode = CrfCode.BadRequest) -> None:
        super().__init__(text)
        self.code = code


class Tuning:
    """The parameters of one arm's inverse kinematics that can be changed while it moves."""

    def __init__(self, solver: ik.DifferentialIk) -> None:
        self._ik = solver
        self._enabled: frozenset[str] = frozenset()
        self.stops_on: frozenset[CrfCode] = frozenset()
        self.stops_on_contact = True
        self.zones = False

    @property
    def shapes_paths(self) -> bool:
        """Whether anything asks for other joint velocities than a planned path has."""
        blended = any(share > 0.0 for share in self._ik.objectives.state().values())
        return self.zones or blended or bool(self._enabled)

    def apply(self, parameters: ControllerParameters) -> None:
        """Raises ``ParametersRefused``, and then nothing has changed."""
        if parameters.update_joints_initial_position is not None:
            text = "UpdateJointsInitialPosition: inverse kinematics always starts from the present joint positions"
            raise ParametersRefused(text, CrfCode.NotImplemented)
        functions = parameters.objective_functions or ObjectiveFunctions()
        wanted = list(_wanted(functions))
        desired = parameters.desired_joint_position
        if desired is not None:
            wanted.append(("DesiredJointPositions", {"attraction": np.array(desired.attraction_position)}))
        trial = ik.Objectives(self._ik.arm)
        try:
            for name, values in wanted:
                trial.configure(name, values)
        except ik.ObjectiveError as error:
            raise ParametersRefused(str(error)) from None
        spheres = functions.collision_avoidance_sphere
        zones = None if spheres is None else [_zone(i, sphere) for i, sphere in enumerate(spheres) if sphere.enable]
        for name, values in wanted:
            self._ik.objectives.configure(name, values)
        if zones is not None:
            self._ik.set_zones(zones)
            self.zones = bool(zones)
        blends = [f.blend for f in _functions(functions) if f.blend is not None]
        if blends:
            self._ik.objectives.blend_time = max(blends)
        if parameters.stop_conditions is not None:
            self._set_conditions(parameters.stop_conditions)
        on = {name for name, values in wanted if values.get("enable") is True}
        off = {name for name, values in wanted if values.get("enable") is False}
        self._enabled = (self._enabled | on) - off

    def _set_conditions(self, conditions: StopConditions) -> None:
        stops_on = set(self.stops_on)
        for name, code in _STOPS_ON.items():
            wanted = getattr(conditions, name)
            if wanted is not None:
                (stops_on.add if wanted else stops_on.discard)(code)
        self.stops_on = frozenset(stops_on)
        if conditions.stop_on_tolerance_violation is not None:
            self.stops_on_contact = conditions.stop_on_tolerance_violation


def _functions(functions: ObjectiveFunctions) -> Iterator[Objective]:
    for function in (functions.joint_limits, functions.desired_joint_positions, functions.manipulability):
        if function is not None:
            yield function
    yield from functions.collision_avoidance_sphere or ()


def _wanted(functions: ObjectiveFunctions) -> Iterator[tuple[str, dict[str, Any]]]:
    for name, function in (
        ("JointLimits", functions.joint_limits),
        ("DesiredJointPositions", functions.desired_joint_positions),
        ("Manipulability", functions.manipulability),
    ):
        if function is not None:
            yield name, function.model_dump(exclude_none=True, exclude={"blend"}, by_alias=False)
    spheres = functions.collision_avoidance_sphere
    if spheres:
        # The first one also pushes; all of them are never entered.
        values = spheres[0].model_dump(exclude_none=True, exclude={"blend"}, by_alias=False)
        yield "CollisionAvoidanceSphere", values
    elif spheres is not None:
        yield "CollisionAvoidanceSphere", {"enable": False}


def _zone(i: int, sphere: SphereObjective) -> ik.Zone:
    if sphere.center is None or sphere.radius is None:
        raise ParametersRefused(f"CollisionAvoidanceSphere[{i}]: want center and radius to enable it")
    return ik.Zone(sphere.center, sphere.radius)
