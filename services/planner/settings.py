"""Every threshold of the navigation, with units. Names under ``control`` are those of the chassis' settings API."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from rackhand.schemas.chassis import Actuation, ChassisModel
from rackhand.schemas.racks import RackSpec

# Shares of the limits of a chassis that a foreseen stop uses.
FORESEEN_ACC, FORESEEN_DECEL = 0.8, 0.25
LATERAL_SHARE, TURN_SHARE = 0.3, 0.33  # of its accelerations that a nimble chassis uses in bends and turns
SHORTEST_LOOK = 0.4  # s


DEFAULT_RACKS = (RackSpec(width=0.83, depth=0.83), RackSpec(width=0.9, depth=1.2, leg_size=0.04))


class Limits(NamedTuple):
    """What may be commanded: m/s, rad/s, m/s², rad/s². Decelerations are negative, as in the API.

    Compiled functions take it as it is.
    """

    max_forward_velocity: float = 1.2
    max_backward_velocity: float = -0.2
    max_forward_acc: float = 0.5
    max_forward_decel: float = -2.0
    max_angular_velocity: float = 1.2
    max_angular_acc: float = 1.5

    def standstill(self) -> str | None:
        """Why nothing can be driven within these limits; None if it can."""
        if self.max_forward_velocity == 0.0:
            return "the maximum forward velocity is set to 0"
        return "the maximum angular velocity is set to 0" if self.max_angular_velocity == 0.0 else None

    def within(self, other: Limits) -> Limits:
        """The tighter of both, value by value."""
        return Limits(
            max_forward_velocity=min(self.max_forward_velocity, other.max_forward_velocity),
            max_backward_velocity=max(self.max_backward_velocity, other.max_backward_velocity),
            max_forward_acc=min(self.max_forward_acc, other.max_forward_acc),
            max_forward_decel=max(self.max_forward_decel, other.max_forward_decel),
            max_angular_velocity=min(self.max_angular_velocity, other.max_angular_velocity),
            max_angular_acc=min(self.max_angular_acc, other.max_angular_acc),
        )


@dataclass(frozen=True)
class SpeedCaps:
    """What the operator allows at most, whatever the chassis could do: m/s and rad/s."""

    max_forward_velocity: float = math.inf
    max_angular_velocity: float = math.inf


@dataclass(frozen=True)
class PoseNoise:
    """Standard deviations for the pose filter: of one localised pose, and of odometry for what was driven."""

    position: float = 0.01  # m
    yaw: float = 0.005  # rad
    odometry_per_metre: float = 0.01  # m for a driven metre
    odometry_yaw_per_metre: float = 0.005  # rad for a driven metre
    odometry_yaw_per_radian: float = 0.01  # rad for a turned radian


class MppiCosts(NamedTuple):
    """What a rollout costs, in metres of path: a cost of 1 is worth a detour of 1 m. Compiled functions take it as it
    is."""

    collision: float = 400.0
    """Of a step in collision with a cell or a dynamic obstacle; 1/m more for each metre inside a dynamic obstacle."""
    late_discount: float = 0.5
    """Share (0 to 1) by which a collision at the end of the horizon costs less than one now; linear between."""
    static_proximity: float = 2.0
    """Per second in contact with blocked cells; falls by a factor e each ``static_scale``."""
    static_scale: float = 0.08
    """Metres."""
    static_range: float = 0.4
    """Metres from blocked cells, beyond which they cost nothing."""
    dynamic_proximity: float = 6.0
    """Per second in contact with a dynamic obstacle; falls by a factor e each ``dynamic_scale``."""
    dynamic_scale: float = 0.35
    """Metres."""
    dynamic_range: float = 2.5
    """Metres along x and along y from a dynamic obstacle, beyond which it costs nothing."""
    dynamic_growth: float = 0.04
    """m/s by which the radius of a dynamic obstacle grows over the horizon, for the uncertainty of its prediction."""
    effort: float = 0.02
    """Per second at a turning rate of 1 rad/s; grows with its square."""
    effort_linear: float = 0.2
    """Share of ``effort`` per second at a speed of 1 m/s; grows with its square."""
    backward: float = 0.3
    """Per metre driven backward."""
    off_field: float = 60.0
    """At the end of the horizon where the cost to go is unknown or infinite, on top of the distance to the goal."""
    heading: float = 0.3
    """Per radian off the goal's heading at the end of the horizon, at the goal; less with the distance."""
    heading_range: float = 1.0
    """Metres from the goal, beyond which its heading costs nothing."""


@dataclass(frozen=True)
class MppiSettings:
    """Model predictive path integral control, used while something moves nearby."""

    samples: int = 1000
    """Rollouts a tick."""
    steps: int = 32
    """Of a rollout."""
    step: float = 0.12
    """Seconds; 32 of them are 3.8 s ahead, since at 0.5 m/s² avoiding a walker takes 2 s."""
    temperature: float = 0.3
    """Of the weights exp(-cost / temperature), in the unit of the costs."""
    noise_linear: float = 0.35
    """Standard deviation, m/s."""
    noise_angular: float = 0.6
    """Standard deviation, rad/s."""
    noise_correlation: float = 0.85
    """Of the noise from step to step."""
    banks: int = 8
    """Sets of noise drawn once, used in turn."""
    costs: MppiCosts = field(default_factory=MppiCosts)


@dataclass(frozen=True)
class NavigationSettings:
    """Distances in metres, angles in radians, times in seconds of simulation time."""

    control: Limits = field(default_factory=Limits)
    own: Limits = field(default_factory=Limits)  # what it can, with its load; a stop that protects it uses all of that
    caps: SpeedCaps = field(default_factory=SpeedCaps)
    actuation: Actuation = field(default_factory=lambda: Actuation(latency=0.04, lag=0.1))
    noise: PoseNoise = field(default_factory=PoseNoise)
    mppi: MppiSettings = field(default_factory=MppiSettings)

    # racks: the kinds that may be carried
    rack_specs: tuple[RackSpec, ...] = DEFAULT_RACKS

    rack_range: float = 5.0  # m from the lidar, within which the scan shows racks and free rack points
    rack_memory: float = 1800.0  # s after it was seen last, when a rack or the state of a rack point is forgotten

    ignore_objects_under_rack: bool = True  # else a move with a rack is held while something is under it
    rack_moved_slightly: float = 0.03  # m on the jack since it was lifted: a warning
    rack_turned_slightly: float = math.radians(2.0)
    rack_moved_far: float = 0.06  # m: the move fails
    rack_turned_far: float = math.radians(4.0)

    # setting a rack down
    rack_point_radius: float = 0.3  # a request within this distance of a rack point means that point
    unload_accuracy: float = 0.02  # of the chassis' position
    unload_position_tolerance: float = 0.006  # where the approach stops
    unload_yaw_tolerance: float = 0.005
    unload_patience: float = 15.0  # while something is where the rack would be
    area_patience: float = 4.0  # the same, where the next point of an area can be taken instead
    rack_state_fresh: float = 120.0  # since a rack point was seen, after which an area's move looks at it again

    # the map
    slow_zone_velocity: float = 0.4
    static_match_distance: float = 0.11  # a hit this near to a mapped obstacle is that obstacle

    # what the scan shows
    obstacle_range: float = 8.0
    scan_timeout: float = 1.0
    scan_fail_after: float = 5.0
    scan_min_valid_fraction: float = 0.05  # of the beams that must be measured; one without a return is
    forget_after: float = 300.0
    forget_mover_after: float = 2.0

    # the global plan
    plan_margin: float = 0.035  # clearance of the footprint along a plan
    path_margin: float = 0.0  # and of one that is driven: what the guard asks, but for jitter of cells
    ground_margin: float = 0.0  # clearance of the footprint at start and goal
    inflation_radius: float = 0.5  # beyond the inscribed circle; nearer costs more
    clearance_weight: float = 4.0
    max_expansions: int = 6_000_000  # a hall of 100 m has 4 million cells
    expansions_per_tick: int = 5_000  # of a search with the footprint; about 20 ms
    heuristic_weight: float = 1.3

    # driving
    lookahead_time: float = 0.8
    min_lookahead: float = 0.3
    max_lookahead: float = 0.9
    max_lateral_acc: float = 0.6
    turn_decel: float = 1.0  # rad/s², for turns on the spot
    approach_decel: float = 0.4  # m/s², for stops that are foreseen
    full_speed_clearance: float = 0.45
    min_clearance_velocity: float = 0.3
    rotate_first_angle: float = 0.6
    off_path_distance: float = 0.35
    path_check_distance: float = 5.0
    stop_before_obstacle: float = 0.35

    build_up: float = 0.2  # s in which an acceleration builds up, by ``control.acc_smoother.smooth_level``; 0: at once

    # given routes
    route_join_distance: float = 5.0  # from the first point, within which a route may be begun
    off_line_distance: float = 0.1  # off a given line, as after a push, from which on the chassis drives back to it

    # following a target
    follow_distance: float = 1.2  # from the chassis' origin to the target
    follow_gain: float = 1.0  # m/s for each metre that the target is farther
    follow_silence: float = 1.0  # without a /follow_target_state, after which the chassis stops
    follow_timeout: float = 10.0  # and after which the move fails
    follow_replan_period: float = 0.3
    target_radius: float = 0.5  # about the target, in which what is observed is the target itself

    # arrival
    position_tolerance: float = 0.012  # where the approach stops, if the goal's accuracy is not smaller
    yaw_tolerance: float = 0.012
    equal_yaw: float = 0.035  # start = goal: 2 degrees

    # the last check
    cell_margin: float = 0.01  # clearance to the edge of a cell
    hit_margin: float = 0.012  # clearance to a hit; noise of the nearest of many adds to it
    mover_margin: float = 0.1  # clearance to what moves
    safety_radius: float = 2.5

    # what moves
    yield_distance: float = 0.7  # m; nearer than this within the horizon, and making way begins
    yield_horizon: float = 3.5

    # patience
    blocked_patience: float = 1.5  # before planning round something that moves
    replan_period: float = 0.5  # while blocked
    improve_period: float = 3.0  # look for a better way this often
    improve_ratio: float = 0.8  # and take it when it is this much shorter
    stuck_after: float = 4.0
    planning_timeout: float = 60.0
    move_timeout: float = 60.0
    rotate_timeout: float = 30.0

    @property
    def unmeasured_rack(self) -> RackSpec:
        """What a rack counts as that is lifted without having been measured: as large as the largest of all kinds."""
        kinds = self.rack_specs or DEFAULT_RACKS
        margins = [max(sides) for sides in zip(*(kind.margin for kind in kinds), strict=True)]
        return RackSpec(
            width=max(kind.width for kind in kinds),
            depth=max(kind.depth for kind in kinds),
            margin=(margins[0], margins[1], margins[2], margins[3]),
        )

    def for_chassis(self, model: ChassisModel) -> NavigationSettings:
        """These settings with the limits and the actuation of a chassis, within ``caps``.

        A stop that is foreseen takes a quarter of the braking that is there, so that the rest is left for surprises.
        What else depends on how nimble a chassis is has the value here for the default one, or more.
        """
        limits = model.limits
        control = Limits(
            max_forward_velocity=min(limits.forward, self.caps.max_forward_velocity),
            max_backward_velocity=-min(limits.reverse, self.caps.max_forward_velocity),
            max_forward_acc=limits.acceleration,
            max_forward_decel=-limits.deceleration,
            max_angular_velocity=min(limits.angular, self.caps.max_angular_velocity),
            max_angular_acc=limits.angular_acceleration,
        )
        approach = min(FORESEEN_ACC * limits.acceleration, FORESEEN_DECEL * limits.deceleration)
        # Followed closely by chassis that turn fast: they look ahead for as long as a turning rate takes to build up.
        build_up = min(max(control.max_angular_velocity / control.max_angular_acc, SHORTEST_LOOK), self.lookahead_time)
        return replace(
            self,
            control=control,
            own=control,
            actuation=model.actuation,
            approach_decel=approach,
            lookahead_time=build_up,
            max_lookahead=self.max_lookahead * (0.4 + 0.6 * build_up / self.lookahead_time),
            max_lateral_acc=max(self.max_lateral_acc, LATERAL_SHARE * limits.acceleration),
            turn_decel=max(self.turn_decel, TURN_SHARE * limits.angular_acceleration),
            min_clearance_velocity=self.min_clearance_velocity * max(1.0, math.sqrt(0.5 * limits.deceleration)),
        )

    def commanding(self, control: Limits) -> NavigationSettings:
        """These settings of a chassis with at most ``control`` commanded; it brakes for obstacles as hard as ever."""
        own = self.own
        approach = min(
            FORESEEN_ACC * control.max_forward_acc,
            -FORESEEN_DECEL * own.max_forward_decel,
            -FORESEEN_ACC * control.max_forward_decel,
        )
        return replace(self, control=control, approach_decel=approach)
