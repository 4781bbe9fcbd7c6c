"""Whether a goal is reached: position, heading, or the goal's zone."""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.base import Twist2
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.planning.plan import Target
from rackhand.services.planner.settings import NavigationSettings

PUSHED_ASIDE = 0.05  # m beyond the goal's accuracy while turning at it
LEAST_ACCURACY = 0.015  # m; localisation is no better


class GoalChecker:
    """Distances in metres, angles in radians; all about one goal, given poses in the map frame."""

    def __init__(self, goal: Goal, start: Pose, settings: NavigationSettings) -> None:
        self.goal = goal
        self.turn_only = goal.x is None or goal.y is None
        self.target = Target(
            float(start[0]) if goal.x is None else goal.x,
            float(start[1]) if goal.y is None else goal.y,
            goal.yaw,
            goal.rotate_in_place,
        )
        self._settings = settings

    @property
    def stop_within(self) -> float:
        """How near to the goal point driving stops."""
        return min(self._settings.position_tolerance, 0.5 * self.goal.accuracy)

    def distance(self, pose: Pose) -> float:
        return math.hypot(self.target.x - pose[0], self.target.y - pose[1])

    def heading_error(self, pose: Pose) -> float:
        """Signed angle still to turn; 0 for a goal of any heading."""
        return 0.0 if self.target.yaw is None else wrap(self.target.yaw - pose[2])

    def is_in_zone(self, pose: Pose) -> bool:
        """Whether the goal is a zone and the chassis is in it."""
        return self.goal.zone and self.distance(pose) <= self.goal.accuracy

    def is_there(self, pose: Pose) -> bool:
        """Whether a chassis that has not moved yet counts as being at the goal."""
        turned = abs(self.heading_error(pose)) <= self._settings.equal_yaw
        return self.distance(pose) <= self.goal.accuracy and (turned or self.goal.zone)

    def has_position(self, pose: Pose) -> bool:
        """Whether the chassis stopped near enough to the goal point; turning on the spot keeps its place."""
        return self.turn_only or self.distance(pose) <= max(0.8 * self.goal.accuracy, LEAST_ACCURACY)

    def was_pushed_aside(self, pose: Pose) -> bool:
        return not self.turn_only and self.distance(pose) > self.goal.accuracy + PUSHED_ASIDE

    def has_heading(self, pose: Pose) -> bool:
        return abs(self.heading_error(pose)) <= self._settings.yaw_tolerance

    def as_pose(self, pose: Pose) -> Pose:
        """The goal pose; of any heading: with the present one."""
        return np.array([self.target.x, self.target.y, pose[2] if self.target.yaw is None else self.target.yaw])


def is_still(twist: Twist2) -> bool:
    """Whether a measured twist is standstill but for noise."""
    return abs(twist.linear) < 0.012 and abs(twist.angular) < 0.03
