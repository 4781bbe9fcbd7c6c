"""CRF's types on the wire: spelling, numbers that are not finite, poses in every representation."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.codec import Codec
from rackhand.schemas.crf_parameters import Parameters
from rackhand.schemas.motion import (
    ArmCommand,
    ArmState,
    Expected,
    FencingToken,
    MotionStatus,
    RobotConfiguration,
    TaskSpace,
)
from rackhand.schemas.orientation import Orientation, Representation, TaskPose

ANGLES = st.floats(-math.pi, math.pi)


def pose(**orientation: Any) -> dict[str, Any]:
    return {"Position": [0.1, 0.2, 0.3], "Orientation": orientation}


def rotation_of(orientation: dict[str, Any]) -> np.ndarray:
    return TaskPose.model_validate(pose(**orientation)).orientation.rotation()


@given(ANGLES, ANGLES, ANGLES)
def test_cardan_is_fixed_x_then_y_then_z(x: float, y: float, z: float) -> None:
    wanted = Rotation.from_euler("xyz", [x, y, z]).as_matrix()
    assert np.allclose(rotation_of({"CardanXYZ": {"X": x, "Y": y, "Z": z}}), wanted, atol=1e-12)


@given(ANGLES, ANGLES, ANGLES)
def test_euler_is_z1_then_x_then_z2_about_fixed_axes(z1: float, x: float, z2: float) -> None:
    wanted = Rotation.from_euler("zxz", [z1, x, z2]).as_matrix()
    assert np.allclose(rotation_of({"EulerZXZ": {"Z1": z1, "X": x, "Z2": z2}}), wanted, atol=1e-12)


def test_quaternion_has_w_first_and_angle_axis_the_angle() -> None:
    turn = Rotation.from_rotvec([0.3, -0.5, 0.7])
    x, y, z, w = turn.as_quat()
    vector = turn.as_rotvec()
    angle = float(np.linalg.norm(vector))
    assert np.allclose(rotation_of({"Quaternion": {"W": w, "X": x, "Y": y, "Z": z}}), turn.as_matrix())
    axis = {"Angle": angle, "Axis": list(vector / angle)}
    assert np.allclose(rotation_of({"AngleAxis": axis}), turn.as_matrix())


@given(ANGLES, ANGLES, ANGLES, st.sampled_from(list(Representation)))
@example(0.4, math.pi / 2, 0.2, Representation.CARDAN_XYZ)
@example(0.4, -math.pi / 2, 0.2, Representation.CARDAN_XYZ)
@example(0.0, 0.0, 0.4, Representation.EULER_ZXZ)
@example(math.pi, 0.0, 0.4, Representation.EULER_ZXZ)
@example(0.0, 0.0, 0.0, Representation.ANGLE_AXIS)
@example(math.pi, 0.0, 0.0, Representation.ANGLE_AXIS)
@example(math.pi, 0.0, 0.0, Representation.QUATERNION)
def test_every_representation_gives_the_rotation_back(
    x: float, y: float, z: float, representation: Representation
) -> None:
    rotation = Rotation.from_euler("xyz", [x, y, z]).as_matrix()
    written = json.loads(Orientation.of(rotation, representation).model_dump_json())
    assert len(written) == 1
    read = Orientation.model_validate(written)
    assert read.representation is representation
    assert np.allclose(read.rotation(), rotation, atol=1e-8)


def test_rounded_input_is_taken_and_made_a_rotation() -> None:
    rotation = rotation_of({"Quaternion": {"W": 0.7071068, "X": 0.7071068, "Y": 0, "Z": 0}})
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-15
    rows = np.round(Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix(), 7)
    matrix = rotation_of({"Matrix": {f"Row{i + 1}": list(row) for i, row in enumerate(rows)}})
    assert np.abs(matrix @ matrix.T - np.eye(3)).max() < 1e-14


@pytest.mark.parametrize(
    ("orientation", "named"),
    [
        ({"Quaternion": {"W": 1, "X": 0.1, "Y": 0, "Z": 0}}, "length 1.00498756"),
        ({"Quaternion": {"W": "NaN", "X": 0, "Y": 0, "Z": 0}}, "length nan"),
        ({"Matrix": {"Row1": [1, 0, 0], "Row2": [0, 1, 0], "Row3": [0, 0, -1]}}, "reflection"),
        ({"Matrix": {"Row1": [2, 0, 0], "Row2": [0, 1, 0], "Row3": [0, 0, 1]}}, "not orthonormal"),
        ({"AngleAxis": {"Angle": 1, "Axis": [0, 0, 0]}}, "Axis has length 0"),
        ({"cardanXYZ": {"X": 0, "Y": 0, "Z": 0}}, "without a representation"),
        ({"CardanXYZ": {"X": True, "Y": 0, "Z": 0}}, "number"),
        ({"CardanXYZ": {"X": 10**400, "Y": 0, "Z": 0}}, "number"),
        ({}, "without a representation"),
    ],
)
def test_what_is_no_rotation_is_refused_by_name(orientation: dict[str, Any], named: str) -> None:
    with pytest.raises(ValidationError, match=named):
        TaskPose.model_validate(pose(**orientation))


def test_of_several_representations_the_first_of_the_table_wins() -> None:
    both = {"CardanXYZ": {"X": 1, "Y": 0, "Z": 0}, "Quaternion": {"W": 1, "X": 0, "Y": 0, "Z": 0}}
    assert TaskPose.model_validate(pose(**both)).orientation.representation is Representation.QUATERNION


def test_the_legacy_pose_is_cardan_and_is_never_written() -> None:
    read = TaskPose.model_validate({"data": [1, 2, 3, 0.1, 0.2, 0.3], "representation": 1})
    assert read.model_dump() == {
        "Position": (1, 2, 3),
        "Orientation": {"CardanXYZ": {"X": 0.1, "Y": 0.2, "Z": 0.3}},
    }
    for wrong in ({"data": [0] * 6, "representation": 2}, {"data": [0] * 5, "representation": 1}):
        with pytest.raises(ValidationError):
            TaskPose.model_validate(wrong)


def test_numbers_that_are_not_finite_are_words() -> None:
    read = TaskPose.model_validate({**pose(CardanXYZ={"X": "inf", "Y": "-inf", "Z": "nan"}), "Position": ["NaN", 0, 1]})
    assert not read.finite
    assert json.loads(read.model_dump_json()) == {
        "Position": ["NaN", 0, 1],
        "Orientation": {"CardanXYZ": {"X": "inf", "Y": "-inf", "Z": "NaN"}},
    }
    with pytest.raises(ValidationError):
        TaskPose.model_validate({**pose(CardanXYZ={"X": 0, "Y": 0, "Z": 0}), "Position": ["Infinity", 0, 1]})


def test_expected_to_the_letter() -> None:
    assert Expected[bool].of(True).model_dump_json() == '{"value":true,"code":200,"detail":0}'
    assert Expected[bool].failed(403).model_dump_json() == '{"code":403,"detail":0}'
    assert Expected[bool].model_validate({"value": False, "code": 200, "detail": 0}).value is False
    with pytest.raises(ValidationError):
        Expected[bool].model_validate({"value": True})


def status(**changes: Any) -> dict[str, Any]:
    unmeasured = {"code": 405, "detail": 0}
    joints = {"value": [0.0] * 6, "code": 200, "detail": 0}
    return {
        "status": "initialize",
        "priorityUnderControl": 10,
        "isTrajectoryRunning": {"value": False, "code": 200, "detail": 0},
        "controllerStatus": [200, 801],
        "jointPositions": joints,
        "jointVelocities": joints,
        "jointAccelerations": unmeasured,
        "jointForceTorques": joints,
        "taskPose": {"value": pose(Quaternion={"W": 1, "X": 0, "Y": 0, "Z": 0}), "code": 200, "detail": 0},
        "taskVelocity": joints,
        "taskAcceleration": unmeasured,
        "taskForceTorque": unmeasured,
        **changes,
    }


def test_status_keeps_the_spelling_of_the_wire() -> None:
    read = MotionStatus.model_validate(status())
    assert json.loads(read.model_dump_json(exclude_none=True)) == status()
    codec = Codec(MotionStatus)
    assert codec.loads(codec.dumps(read)) == read


def test_status_takes_the_words_of_documents_and_of_code() -> None:
    words = ("initialize", "initialized", "deinitialize", "deinitialized")
    read = [MotionStatus.model_validate(status(status=word)).status for word in words]
    assert read == ["initialize", "initialize", "deinitialize", "deinitialize"]


@pytest.mark.parametrize("codes", [[801, 200], [200, 200]])
def test_controller_status_is_a_sorted_set(codes: list[int]) -> None:
    with pytest.raises(ValidationError, match="ascending"):
        MotionStatus.model_validate(status(controllerStatus=codes))


def configuration(joints: int = 6) -> dict[str, Any]:
    return {
        "JointSpaceDegreeOfFreedom": joints,
        "ControllerLoopTimeMs": 4.0,
        "JointLimits": {
            "MaxPosition": [6.28] * joints,
            "MinPosition": [-6.28] * joints,
            "MaxVelocity": [3.14] * joints,
            "MaxAcceleration": [10.0] * joints,
            "MaxTorque": [150.0] * joints,
        },
        "TaskLimits": {"MaxVelocity": [1.0] * 6, "MaxAcceleration": [5.0] * 6},
        "ProfileParameters": {
            "JointVelocities": [1.0] * joints,
            "JointAccelerations": [3.0] * joints,
            "TaskVelocity": [0.25] * 6,
            "TaskAcceleration": [1.0] * 6,
        },
    }


def test_configuration_keeps_the_spelling_and_counts_joints() -> None:
    read = RobotConfiguration.model_validate(configuration())
    written = json.loads(read.model_dump_json())
    assert {key: written[key] for key in configuration()} == configuration()
    assert written["TaskSpace"] == {"Vx": True, "Vy": True, "Vz": True, "Wx": True, "Wy": True, "Wz": True}
    assert TaskSpace.model_validate({"Vx": False}).vx is False
    broken = configuration()
    broken["JointLimits"]["MaxVelocity"] = [1.0] * 5
    with pytest.raises(ValidationError, match=r"JointLimits\.MaxVelocity has 5 numbers, the robot 6 joints"):
        RobotConfiguration.model_validate(broken)


def test_stop_conditions_are_taken_from_both_places() -> None:
    inside = {"Controller": {"StopConditions": {"StopOnLowManipulability": True}}}
    beside = {"Controller": {"StopConditions": {}, "StopOnLowManipulability": True}}
    assert Parameters.model_validate(inside) == Parameters.model_validate(beside)
    with pytest.raises(ValidationError, match="StopOnFullMoon"):
        Parameters.model_validate({"Controller": {"StopOnFullMoon": True}})


def test_one_sphere_or_several() -> None:
    sphere = {"enable": True, "c": 1.0, "center": [0.0, 0.0, 1.0], "radius": 0.1}
    one, two = (
        Parameters.model_validate({"Controller": {"ObjectiveFunctions": {"CollisionAvoidanceSphere": given_}}})
        for given_ in (sphere, [sphere, sphere])
    )
    found = [p.controller.objective_functions.collision_avoidance_sphere for p in (one, two)]  # type: ignore[union-attr]
    assert [len(spheres or ()) for spheres in found] == [1, 2]


def test_driver_messages_travel_and_are_finite() -> None:
    state = ArmState(stamp=4, q=(0.0,) * 6, dq=(0.1,) * 6, efforts=(1.0,) * 6, wrench=(0.0,) * 6)
    command = ArmCommand(answers=4, mode="velocity", values=(0.1,) * 6, token=FencingToken(epoch="e", lease=3))
    assert Codec(ArmState).loads(Codec(ArmState).dumps(state)) == state
    assert Codec(ArmCommand).loads(Codec(ArmCommand).dumps(command)) == command
    with pytest.raises(ValidationError):
        ArmCommand(answers=4, mode="velocity", values=(math.nan,), token=command.token)
    with pytest.raises(ValidationError, match="6 positions, 5 velocities"):
        ArmState(stamp=4, q=(0.0,) * 6, dq=(0.1,) * 5, efforts=(1.0,) * 6, wrench=(0.0,) * 6)


def test_every_request_has_a_schema_with_its_word() -> None:
    words = {word for model in crf.REQUESTS for word in _words(model.model_json_schema())}
    seed = {"appendPath", "setVelocity", "setTorque", "setProfileVelocity", "setProfileAcceleration", "softStop"}
    seed |= {"hardStop", "setParameters", "getStatus", "getConfiguration", "lockControl", "unlockControl"}
    assert seed <= words


def _words(schema: dict[str, Any]) -> list[str]:
    command = schema["properties"]["command"]
    return command.get("enum", [command.get("const")])
