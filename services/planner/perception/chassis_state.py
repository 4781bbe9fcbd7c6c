"""What is known of the chassis: the newest message of each topic of its driver and localiser."""

from __future__ import annotations

from dataclasses import dataclass

from rackhand.schemas.base import NANOSECONDS, Message, Pose2, Twist2
from rackhand.schemas.chassis import Battery, ChassisModel, Contacts, FollowTarget, Jack, LocalisedPose, Odometry, Scan

POSE_TIMEOUT_NS = NANOSECONDS // 2
QUALITY_LOST = 1
AT_REST = 0.05  # m/s and rad/s: measured below it, the chassis is at rest


@dataclass(frozen=True)
class Observation:
    """What is known at one tick. Stamps in ns; the scan is the newest one (its own stamp may be older), or none yet."""

    stamp: int
    pose: Pose2
    pose_stamp: int
    odometry: Pose2
    twist: Twist2
    scan: Scan | None


@dataclass(frozen=True)
class Followed:
    """What a client says of the target of a ``follow_target`` move, and when it was taken (ns)."""

    stamp: int
    target: FollowTarget


class ChassisState:
    """The newest message of each kind."""

    def __init__(self) -> None:
        self.model: ChassisModel | None = None
        self.forget()

    def forget(self) -> None:
        """Another run of the driver has begun. Its body stays the same; all that was measured is void."""
        self.odometry: Odometry | None = None
        self.pose: LocalisedPose | None = None
        self.scan: Scan | None = None
        self.jack: Jack | None = None
        self.battery: Battery | None = None
        self.contacts: Contacts | None = None
        self.followed: Followed | None = None

    def take(self, message: Message) -> bool:
        """Keep a message. False if it is none of those kept here."""
        name = _KEPT.get(type(message))
        if name is not None:
            setattr(self, name, message)
        return name is not None

    @property
    def rests(self) -> bool:
        """Whether the chassis is measured to be at rest."""
        return self.odometry is not None and (
            max(abs(self.odometry.twist.linear), abs(self.odometry.twist.angular)) < AT_REST
        )

    def observation(self) -> Observation | None:
        """What navigation is to know now, or None before odometry and a pose have come."""
        if self.odometry is None or self.pose is None:
            return None
        return Observation(
            stamp=self.odometry.stamp,
            pose=self.pose.pose,
            pose_stamp=self.pose.stamp,
            odometry=self.odometry.pose,
            twist=self.odometry.twist,
            scan=self.scan,
        )

    def pose_trouble(self) -> str | None:
        """Why the robot does not know where it is; None when it does."""
        if self.odometry is None:
            return "no message from the chassis driver yet"
        if self.pose is None:
            return "no localised pose received yet"
        if self.pose.quality == QUALITY_LOST:
            return "the localiser has lost the position"
        age = self.odometry.stamp - self.pose.stamp
        if age > POSE_TIMEOUT_NS:
            return f"the last localised pose is {age / NANOSECONDS:.1f} s old"
        return None

    @property
    def power_cable(self) -> bool:
        return self.contacts is not None and self.contacts.power_cable


_KEPT: dict[type[Message], str] = {
    Odometry: "odometry",
    LocalisedPose: "pose",
    Scan: "scan",
    Jack: "jack",
    Battery: "battery",
    Contacts: "contacts",
    ChassisModel: "model",
}
