"""Navigation of one chassis: a goal in, body twists out. ``ChassisNavigator.tick`` is the whole procedure.

Why a move fails, and when:

==== ========================== =======================================================================================
  #  reason                     raised
==== ========================== =======================================================================================
  2  get_map_failed             by ``set_map``: the PNG or the overlays cannot be read; by ``start``: there is no map
  3  starting_point_out_of_map  at start: the chassis' origin lies outside the grid
  4  ending_point_out_of_map    at start: the goal lies outside the grid
  5  starting_point_not_in_     at start: the origin's cell is no ground (built, unknown, virtual wall, no-go region),
     ground                     or the body overlaps no-ground by more than 5 cm
  6  ending_point_not_in_       at start: the goal's cell is no ground, or the inscribed circle is not free there, or,
     ground                     where the goal has a heading, the body at the goal pose is not
  7  starting_equal_ending      at start: within the goal's accuracy, and within 2 degrees of its heading if it has one;
                                not for a zone, which then succeeds at once
  9  calculation_failed         at start: on map and overlays the inscribed circle has no way from start to goal
 10  calculation_timeout        at start*: a search expanded ``max_expansions`` cells or states without an answer
 11  no_global_path             at start*: on map and overlays the circle has a way, the body none; or the body has one
                                but unmapped things seal it for longer than ``sealed_patience``
 14  planning_timeout           later: there has been no way for ``planning_timeout``
 15  move_timeout               there is a way, but no headway on it for ``move_timeout``: a person stands in it, the
                                wheels are blocked, the pose is not coming
 16  control_costmap_error      no usable scan for ``scan_timeout`` + ``scan_fail_after`` while a move runs; the chassis
                                brakes as soon as a scan is blind or ``scan_timeout`` has passed
 18  rotate_timeout             a turn to the goal's heading comes no nearer to it for ``rotate_timeout``
==== ========================== =======================================================================================

* or in the first ticks, before a wheel turns: a long search goes on in slices of ``expansions_per_tick``.
"""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.schemas.chassis import ChassisModel, Costmap
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import MapData
from rackhand.services.planner.behaviors.interface import Progress
from rackhand.services.planner.behaviors.run import PlanJob, Run
from rackhand.services.planner.control import braking_guard as safety
from rackhand.services.planner.control import driving
from rackhand.services.planner.control import speed_profile as profile
from rackhand.services.planner.control.dynamic_avoidance import DynamicAvoidance
from rackhand.services.planner.control.progress_checker import ProgressWatch
from rackhand.services.planner.control.route import Route
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import STANDSTILL, Pose, wrap
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.perception.costmap import cost_bytes
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.pose_filter import PoseFilter
from rackhand.services.planner.perception.scan_watchdog import ScanWatchdog
from rackhand.services.planner.planning.goals import Goal, check_goal, check_start, is_there
from rackhand.services.planner.planning.plan import GlobalPlanner, NoPathFound, Plan, Target
from rackhand.services.planner.settings import NavigationSettings
from rackhand.services.planner.warm_up import warm_up

PERIOD = 0.04  # s; the nominal tick
STEPS_ASIDE = 0.5  # m from what blocks the way to what moved lately, to take them for the same
DRIFT = 0.1  # m driven while a search went on, after which its way begins in the wrong place
ASIDE = 0.05  # m beyond the goal's accuracy: pushed aside while turning
NO_FIELD = np.empty((0, 0), dtype=np.float32)
LONGEJACK_BODY = ((0.379, 0.23), (-0.369, 0.23), (-0.369, -0.23), (0.379, -0.23))
_REASONS = {
    "disconnected": MoveFailReason.CALCULATION_FAILED,
    "footprint": MoveFailReason.NO_GLOBAL_PATH,
    "budget": MoveFailReason.CALCULATION_TIMEOUT,
}


class ChassisNavigator:
    """The ``Navigator`` of ``rackhand.services.planner.behaviors.interface``."""

    def __init__(self, settings: NavigationSettings | None = None) -> None:
        self._configured = settings or NavigationSettings()
        self.settings = self._configured
        self._footprint = Footprint.of(np.array(LONGEJACK_BODY))
        self._around: LocalCostmap | None = None
        self._planner: GlobalPlanner | None = None
        self.reset()

    # ---- what it is told ------------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Another run of the driver has begun: all that was measured is void, whatever its stamps."""
        self._filter = PoseFilter(self.settings.noise)
        self._senses = ScanWatchdog(self.settings)
        self._give_way = DynamicAvoidance(self.settings)
        self._run: Run | None = None
        self._command = STANDSTILL
        self._commanded_at: int | None = None

    def set_map(self, data: MapData | None) -> None:
        """Use this map from now on; raises ``MoveFailed(GET_MAP_FAILED)`` and then has none."""
        self._around = self._planner = self._run = None
        if data is not None:
            self._around = LocalCostmap(load_map(data, self.settings.slow_zone_velocity), self.settings)
            self._make_planner()

    def set_model(self, model: ChassisModel) -> None:
        """Navigate this chassis from now on, within its limits."""
        self.settings = self._configured.for_chassis(model)
        self._give_way = DynamicAvoidance(self.settings)
        self._footprint = Footprint.of(model.footprint)
        self._make_planner()

    def _make_planner(self) -> None:
        if self._around is not None:
            self._planner = GlobalPlanner(self._around.static.geometry, self._footprint, self.settings)

    def warm_up(self) -> None:
        """Compile everything that is compiled, so that no tick of a real move waits for it. Takes seconds once."""
        warm_up(self.settings, ChassisNavigator)

    # ---- the Navigator protocol -----------------------------------------------------------------------------------

    def start(self, goal: Goal, seen: Observation) -> None:
        """Begin a move; see the table above for what is refused at once."""
        self._run = None
        self._perceive(seen)
        around = self._surroundings()
        here = self._filter.pose
        target = Target(
            float(here[0]) if goal.x is None else goal.x,
            float(here[1]) if goal.y is None else goal.y,
            goal.yaw,
            goal.rotate_in_place,
        )
        check_start(around, self._footprint, here)
        turn_only = goal.x is None or goal.y is None
        if not turn_only:
            check_goal(around, self._footprint, target, self.settings)
        if not goal.zone and is_there(here, goal, target, self.settings):
            raise MoveFailed(
                MoveFailReason.STARTING_EQUAL_ENDING,
                f"the chassis is at the goal ({target.x:.3f}, {target.y:.3f}) already, within {goal.accuracy} m",
            )
        self._senses.begin(seen.stamp)
        self._give_way.begin()
        run = Run(goal, target, ProgressWatch(self.settings, seen.stamp), seen.stamp)
        if turn_only:
            run.phase = "rotating"
        else:
            self._look_for_way(run, here, seen.stamp)
        self._run = run

    def tick(self, seen: Observation) -> Progress:
        """One control step: perceive, keep the plan good, steer, and let nothing through that could not be stopped."""
        run = self._run
        if run is None:
            raise RuntimeError("tick without a move")
        self._perceive(seen)
        pose = self._filter.pose
        trouble = self._senses.trouble(seen)
        if trouble is not None:
            return self._stand(run, seen, trouble)
        run.replanned = False
        if run.goal.zone and self._away(run, pose) <= run.goal.accuracy:
            run.phase = "done"
        if run.phase in ("planning", "driving"):
            self._keep_plan(run, pose, seen.stamp)
        wanted = self._steer(run, pose, seen)
        command = self._let_through(run, pose, seen, wanted)
        self._measure_progress(run, pose, seen.stamp)
        return self._progress(run, pose, seen.stamp, command)

    def observe(self, seen: Observation) -> None:
        """No move runs: keep the picture of the surroundings fresh."""
        self._perceive(seen)
        at_rest = abs(seen.twist.linear) < 0.02 and abs(seen.twist.angular) < 0.02
        self._commanded(STANDSTILL if at_rest else seen.twist, seen.stamp)

    def brake(self, seen: Observation) -> Twist2:
        """The next twist of the shortest stop within the deceleration limits."""
        self._perceive(seen)
        return self._commanded(profile.braked(self._command, self._dt(seen.stamp), self.settings.control), seen.stamp)

    def stop(self) -> None:
        """Forget the goal."""
        self._run = None

    def costmap(self, stamp: int) -> Costmap | None:
        """Map and what is observed on it, within reach of the chassis, at the cost of the global plan."""
        if self._around is None:
            return None
        room = self._around.near
        cost = cost_bytes(room, self._footprint.inscribed, self.settings.inflation_radius)
        g = room.geometry
        return Costmap(
            stamp=stamp, origin=(g.x, g.y), resolution=g.resolution, columns=g.columns, cost=cost.reshape(-1)
        )

    # ---- steps of a tick ------------------------------------------------------------------------------------------

    def _perceive(self, seen: Observation) -> None:
        """Where the chassis is, and what the scan adds to the surroundings."""
        self._filter.update(seen)
        if self._senses.is_new_scan(seen) and self._around is not None and seen.scan is not None:
            self._around.look(seen.scan, self._filter.at(seen.scan.stamp), self._footprint)
            self._around.refresh(self._filter.pose)

    def _surroundings(self) -> LocalCostmap:
        if self._around is None:
            raise MoveFailed(MoveFailReason.GET_MAP_FAILED, "no map is in use")
        return self._around

    def _look_for_way(
        self, run: Run, here: Pose, stamp: int, *, better_than: float = math.inf, tight: bool = False,
        on_map: bool = False,
    ) -> None:  # fmt: skip
        """Begin to look for a way; most are found at once. ``on_map``: leave out what is observed."""
        if self._planner is None:
            raise MoveFailed(MoveFailReason.GET_MAP_FAILED, "no map is in use")
        around = self._surroundings()
        blocked = around.static.blocked if on_map else around.blocked()
        run.planned_at = stamp
        run.search = PlanJob(self._planner.search(here, run.target, blocked, tight), here, better_than, on_map)
        self._search_on(run, here, stamp)
        if run.search is not None and better_than < math.inf:
            run.search = None  # a good way is not left for a long search

    def _search_on(self, run: Run, here: Pose, stamp: int) -> None:
        """Another slice of the search; raises ``MoveFailed`` where waiting cannot help."""
        search = run.search
        if search is None:
            return
        try:
            next(search.steps)
        except StopIteration as found:
            run.search = None
            if search.on_map:
                run.path_on_static_map = True
            elif _away_from(search.start, here) > DRIFT:
                self._look_for_way(run, here, stamp)
            else:
                self._take(run, found.value, search.better_than)
        except NoPathFound as no_way:
            run.search = None
            if search.on_map:
                raise MoveFailed(_REASONS[no_way.kind], no_way.text) from None
            run.no_way = no_way
            if run.no_way_since is None:
                run.no_way_since = stamp
            if not run.had_plan and not run.path_on_static_map:  # the map alone tells whether waiting can help
                self._look_for_way(run, here, stamp, on_map=True)

    def _take(self, run: Run, plan: Plan, better_than: float) -> None:
        run.no_way = run.no_way_since = None
        if plan.length < better_than:
            run.route = Route(plan)
            run.phase = "driving"
            run.replanned = run.had_plan
            run.had_plan = True
            run.blocked_since = None
            run.watch.renew()

    def _keep_plan(self, run: Run, pose: Pose, stamp: int) -> None:
        """Have a plan; replace it when it is blocked, left behind, or much longer than need be."""
        s = self.settings
        if run.search is not None:
            self._search_on(run, pose, stamp)
            self._check_patience(run, stamp)
            return
        since = (stamp - run.planned_at) / NANOSECONDS
        if run.route is None:
            if since >= s.replan_period:
                self._look_for_way(run, pose, stamp)
            self._check_patience(run, stamp)
            return
        route = run.route
        route.current.update(pose)
        around = self._surroundings()
        run.free, where = route.free_distance(around, self._footprint, s.path_check_distance)
        if math.isinf(run.free):
            run.blocked_since = run.no_way_since = None
        elif run.blocked_since is None:
            run.blocked_since = stamp
        blocked = run.blocked_since is not None
        if run.blocked_since is not None and around.movers.moved_near(where, STEPS_ASIDE, stamp):
            # It walked there, so it may walk on: planning round it waits a little.
            blocked = (stamp - run.blocked_since) / NANOSECONDS >= s.blocked_patience
        lost = route.current.deviation > s.off_path_distance
        stuck = run.watch.standing(stamp) > s.stuck_after and not blocked
        if (blocked or lost) and since >= s.replan_period:
            self._look_for_way(run, pose, stamp)
        elif stuck and since >= s.improve_period:
            self._look_for_way(run, pose, stamp, tight=True)
        elif since >= s.improve_period and route.left(pose) > 1.5:
            self._look_for_way(run, pose, stamp, better_than=s.improve_ratio * route.left(pose))
        self._check_patience(run, stamp)

    def _check_patience(self, run: Run, stamp: int) -> None:
        if run.no_way_since is None:
            return
        waited = (stamp - run.no_way_since) / NANOSECONDS
        if not run.had_plan and waited > self.settings.sealed_patience:
            text = f"unmapped things have sealed the way for {waited:.0f} s ({run.no_way})"
            raise MoveFailed(MoveFailReason.NO_GLOBAL_PATH, text)
        if waited > self.settings.planning_timeout:
            raise MoveFailed(MoveFailReason.PLANNING_TIMEOUT, f"no way for {waited:.0f} s ({run.no_way})")

    def _steer(self, run: Run, pose: Pose, seen: Observation) -> Twist2:
        """The twist wanted in this phase; goes on to the next phase where one ends."""
        around, s = self._surroundings(), self.settings
        if self._must_give_way(run, pose, seen):
            cost = run.route.plan.cost if run.route is not None else NO_FIELD
            goal = np.array([run.target.x, run.target.y, pose[2] if run.target.yaw is None else run.target.yaw])
            ahead = self._predicted(pose, seen.twist)
            return self._give_way.command(ahead, seen.twist, self._command, around, cost, goal, self._footprint)
        if run.search is not None:
            return STANDSTILL  # a long search is for tight places: think, then go
        if run.phase == "driving" and run.route is not None:
            stop_within = (
                min(s.position_tolerance, 0.5 * run.goal.accuracy) if run.route.is_last else driving.SEGMENT_END
            )
            if not driving.has_ended(run.route, pose, stop_within):
                ahead = self._predicted(pose, seen.twist)
                return driving.follow(
                    run.route, ahead, seen.twist, run.free, around, self._footprint, s, run.goal.rotate_in_place
                )
            if not _is_still(seen.twist):
                return STANDSTILL
            if not run.route.is_last:
                run.route.advance()
                return STANDSTILL
            self._arrive(run, pose, seen.stamp)
        if run.phase == "rotating" and run.target.yaw is not None:
            error = wrap(run.target.yaw - pose[2])
            if not run.turn_only and self._away(run, pose) > run.goal.accuracy + ASIDE:
                self._arrive(run, pose, seen.stamp)
                return STANDSTILL
            if abs(error) > s.yaw_tolerance:
                ahead = self._predicted(pose, seen.twist)
                return driving.turn(ahead, wrap(run.target.yaw - ahead[2]), around, self._footprint, s)
            if _is_still(seen.twist):
                self._arrive(run, pose, seen.stamp)
        return STANDSTILL

    def _must_give_way(self, run: Run, pose: Pose, seen: Observation) -> bool:
        """Whether something that moves will come too near. A chassis that may only turn on the spot cannot make way."""
        if run.phase == "done" or run.turn_only or run.goal.rotate_in_place:
            return False
        path = run.route.ahead() if run.route is not None and run.phase == "driving" else pose[None]
        movers = self._surroundings().movers.rows()
        return self._give_way.is_due(pose, path, abs(seen.twist.linear), movers, self._footprint, seen.stamp)

    def _arrive(self, run: Run, pose: Pose, stamp: int) -> None:
        """At rest where driving or turning ended: done, turn, or go once more for what was missed."""
        if not run.turn_only and self._away(run, pose) > max(0.8 * run.goal.accuracy, 0.015):
            run.route, run.phase = None, "planning"
            self._look_for_way(run, pose, stamp)
        elif run.target.yaw is not None and abs(wrap(run.target.yaw - pose[2])) > self.settings.yaw_tolerance:
            run.phase = "rotating"
        else:
            run.phase = "done"

    def _away(self, run: Run, pose: Pose) -> float:
        return math.hypot(run.target.x - pose[0], run.target.y - pose[1])

    def _predicted(self, pose: Pose, twist: Twist2) -> Pose:
        """Where the chassis is when a command given now takes hold."""
        t = self.settings.actuation.latency
        yaw = pose[2] + 0.5 * twist.angular * t
        step = twist.linear * t
        return np.array([pose[0] + step * math.cos(yaw), pose[1] + step * math.sin(yaw), pose[2] + twist.angular * t])

    def _let_through(self, run: Run, pose: Pose, seen: Observation, wanted: Twist2) -> Twist2:
        """The wanted twist within the limits, if the chassis could still stop after it; else slower, else braking."""
        dt = self._dt(seen.stamp)
        obstacles = self._surroundings().obstacles(pose)
        run.held = False
        for share in (1.0, 0.5, 0.2):
            command = profile.limited(
                self._command, share * wanted.linear, share * wanted.angular, dt, self.settings.control
            )
            if safety.braking_is_free(
                pose, seen.twist, command, PERIOD, obstacles, self._footprint.edges, self.settings
            ):
                return self._commanded(command, seen.stamp)
        run.held = True
        return self._commanded(profile.braked(self._command, dt, self.settings.control), seen.stamp)

    def _measure_progress(self, run: Run, pose: Pose, stamp: int) -> None:
        if run.phase == "rotating" and run.target.yaw is not None:
            run.watch.update(stamp, "turn to the goal", abs(wrap(run.target.yaw - pose[2])))
        elif run.phase == "driving" and run.route is not None:
            tracker = run.route.current
            if tracker.aligned:
                run.watch.update(stamp, "way", run.route.left(pose))
            else:
                run.watch.update(stamp, "turn", abs(wrap(tracker.segment.points[tracker.index][2] - pose[2])))
        run.watch.check(stamp, run.phase, "something is in the way" if run.held else "the chassis does not follow")

    def _stand(self, run: Run, seen: Observation, why: str) -> Progress:
        """Brake without looking: what is seen cannot be trusted."""
        command = profile.braked(self._command, self._dt(seen.stamp), self.settings.control)
        run.watch.check(seen.stamp, run.phase, why)
        return self._progress(run, self._filter.pose, seen.stamp, self._commanded(command, seen.stamp))

    def _progress(self, run: Run, pose: Pose, stamp: int, command: Twist2) -> Progress:
        route = run.route if run.phase in ("driving", "planning") else None
        return Progress(
            twist=command,
            arrived=run.phase == "done",
            remaining_distance=route.left(pose) if route is not None else 0.0,
            stuck_state="none" if run.phase == "done" else run.watch.stuck_state(stamp, run.phase),
            path=route.ahead() if route is not None else np.empty((0, 3)),
            replanned=run.replanned,
            viewport_blocked=run.held or run.blocked_since is not None,
        )

    def _dt(self, stamp: int) -> float:
        if self._commanded_at is None or stamp <= self._commanded_at:
            return PERIOD
        return min((stamp - self._commanded_at) / NANOSECONDS, 0.1)

    def _commanded(self, command: Twist2, stamp: int) -> Twist2:
        self._command, self._commanded_at = command, stamp
        return command


def _away_from(start: Pose, here: Pose) -> float:
    return math.hypot(here[0] - start[0], here[1] - start[1])


def _is_still(twist: Twist2) -> bool:
    return abs(twist.linear) < 0.012 and abs(twist.angular) < 0.03
