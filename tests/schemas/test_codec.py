"""The codec: every message of the contract there and back, and one error for everything malformed."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.schemas import chassis, moves, topics, world
from rackhand.schemas.base import Message, Pose2, Twist2
from rackhand.schemas.codec import MalformedMessage, codec_for

ODOMETRY = chassis.Odometry(
    stamp=40_000_000,
    pose=Pose2(x=1.0, y=-2.0, yaw=0.5),
    twist=Twist2(linear=0.3, angular=0.0),
    wheel_velocities=(3.0, 3.5),
)


def scan(ranges: list[float]) -> chassis.Scan:
    return chassis.Scan(
        stamp=0,
        sensor=Pose2(x=0.2, y=0.0, yaw=0.0),
        angle_min=-math.pi,
        angle_step=0.1,
        range_max=25.0,
        ranges=np.array(ranges, "<f4"),
    )


def spoilt(message: Message, **changes: Any) -> bytes:
    """The bytes of a message some of whose fields were replaced after validation."""
    return msgspec.msgpack.encode(message.model_dump() | changes)


def test_a_message_comes_back_equal() -> None:
    codec = codec_for(chassis.Odometry)
    assert codec.loads(codec.dumps(ODOMETRY), codec.encoding) == ODOMETRY


def test_an_array_comes_back_equal_read_only_and_may_hold_nan_where_that_means_no_return() -> None:
    codec = codec_for(chassis.Scan)
    back = codec.loads(codec.dumps(scan([1.0, math.nan, 3.0])))
    np.testing.assert_array_equal(back.ranges, np.array([1.0, math.nan, 3.0], "<f4"))
    assert not back.ranges.flags.writeable


@pytest.mark.parametrize("row", [*topics.TOPICS], ids=lambda row: row.name)
def test_encodings_name_type_version_and_fingerprint(row: topics.Topic[Any]) -> None:
    codec = codec_for(row.model)
    media, schema = codec.encoding.split(";")
    assert media == "application/msgpack"
    assert schema == f"{codec.name}@{row.model.VERSION}#{codec.fingerprint}"


@pytest.mark.parametrize(
    ("payload", "told"),
    [
        (codec_for(chassis.Odometry).dumps(ODOMETRY)[:-3], "truncated"),
        (codec_for(chassis.Odometry).dumps(ODOMETRY) + b"\x00", "trailing"),
        (b"", "truncated"),
        (b"\xc1", "malformed"),
        (b"\x91" * 200_000, "message:|recursion|nested"),
        (b"\xa2\xff\xfe", "utf"),
        (msgspec.msgpack.encode([1, 2]), "message"),
        (spoilt(ODOMETRY, stamp=-1), "stamp"),
        (spoilt(ODOMETRY, stamp="1"), "stamp"),
        (spoilt(ODOMETRY, pose={"x": math.nan, "y": 0.0, "yaw": 0.0}), r"pose\.x"),
        (spoilt(ODOMETRY, wheel_velocities=[1.0]), "wheel_velocities"),
        (spoilt(ODOMETRY, wheel_velocities=[1.0, "2"]), r"wheel_velocities\.1"),
        (spoilt(ODOMETRY, extra=1), "extra"),
    ],
)
def test_malformed_bytes_are_one_error_that_says_what_and_where(payload: bytes, told: str) -> None:
    with pytest.raises(MalformedMessage, match=f"(?i)chassis.Odometry.*({told})"):
        codec_for(chassis.Odometry).loads(payload)


@pytest.mark.parametrize(
    ("ranges", "told"), [(b"\x00\x00\x00", "multiple of 4"), ([1.0, 2.0], "list, want"), (None, "NoneType, want")]
)
def test_an_array_of_wrong_length_or_type_is_refused_by_field(ranges: Any, told: str) -> None:
    with pytest.raises(MalformedMessage, match=f"ranges: .*{told}"):
        codec_for(chassis.Scan).loads(spoilt(scan([1.0]), ranges=ranges))


def test_an_array_that_must_be_finite_is_refused_when_it_is_not() -> None:
    pose = chassis.LocalisedPose(stamp=0, pose=Pose2(x=0, y=0, yaw=0), covariance=np.zeros((3, 3)), quality=10)
    with pytest.raises(MalformedMessage, match=r"covariance: .*not finite"):
        codec_for(chassis.LocalisedPose).loads(spoilt(pose, covariance=np.full((3, 3), np.inf).tobytes()))


@pytest.mark.parametrize(
    ("encoding", "told"),
    [
        ("application/json", "want application/msgpack"),
        ("application/msgpack;chassis.Scan@1#000000000000", "names it 'chassis.Scan'"),
        ("application/msgpack;chassis.Odometry@2#000000000000", "version 2, this side version 1"),
    ],
)
def test_another_encoding_type_or_version_is_refused(encoding: str, told: str) -> None:
    with pytest.raises(MalformedMessage, match=told):
        codec_for(chassis.Odometry).loads(codec_for(chassis.Odometry).dumps(ODOMETRY), encoding)


@pytest.mark.parametrize("encoding", ["application/msgpack", "zenoh/bytes", "application/msgpack;chassis.Odometry@1"])
def test_a_sender_that_says_less_is_heard(encoding: str) -> None:
    codec = codec_for(chassis.Odometry)
    assert codec.loads(codec.dumps(ODOMETRY), encoding) == ODOMETRY


def test_the_fingerprint_changes_with_the_schema_and_not_with_its_prose() -> None:
    one = type("Thing", (Message,), {"__annotations__": {"value": int}, "__doc__": "one"})
    same = type("Thing", (Message,), {"__annotations__": {"value": int}, "__doc__": "another text"})
    other = type("Thing", (Message,), {"__annotations__": {"value": float}, "__doc__": "one"})
    assert codec_for(one).fingerprint == codec_for(same).fingerprint != codec_for(other).fingerprint


def test_what_msgpack_cannot_carry_is_refused_by_the_sender() -> None:
    move = moves.MoveCreate(target_ori=0.0, properties={"n": 2**70})
    with pytest.raises(MalformedMessage, match="cannot be encoded"):
        codec_for(moves.MoveCreate).dumps(move)


@given(st.binary(max_size=300))
def test_random_bytes_never_raise_anything_else(payload: bytes) -> None:
    for model in (chassis.Odometry, moves.MoveRequest, world.WorldRequest, chassis.Scan):
        with pytest.raises(MalformedMessage):
            codec_for(model).loads(payload)


json_like = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=5)
    | st.binary(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner, max_size=4),
    max_leaves=12,
)


@given(st.sampled_from(sorted(chassis.Odometry.model_fields)), json_like)
def test_any_field_of_any_value_is_taken_or_refused(field: str, value: Any) -> None:
    codec = codec_for(chassis.Odometry)
    try:
        message = codec.loads(spoilt(ODOMETRY, **{field: value}))
    except MalformedMessage as error:
        assert field in str(error) or "nested" in str(error)
    else:
        assert codec.loads(codec.dumps(message)) == message
