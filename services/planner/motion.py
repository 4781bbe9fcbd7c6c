"""How one chassis moves: perceive, step the running move, and let the braking guard check what comes out."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisModel
from rackhand.schemas.explain import Thing
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import MapData
from rackhand.schemas.moves import MoveCreate
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.behaviors.base import Context, Done, Drive
from rackhand.services.planner.behaviors.registry import BEHAVIORS, Registry
from rackhand.services.planner.behaviors.running import PATIENCE_NS, RunningMove
from rackhand.services.planner.control.braking_guard import BrakingGuard
from rackhand.services.planner.control.dynamic_avoidance import DynamicAvoidance
from rackhand.services.planner.control.load_limits import load_limits
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.load import Load, LoadState, Measured, next_load
from rackhand.services.planner.map.grid import StaticMap
from rackhand.services.planner.perception.carried_rack import WITNESSES, CarriedRack, Moved, objects_under
from rackhand.services.planner.perception.chassis_state import ChassisState
from rackhand.services.planner.perception.lift_view import is_in_lift
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.pipeline import Perception
from rackhand.services.planner.planning.worker import PlanWorker
from rackhand.services.planner.settings import Limits, NavigationSettings


class Motion:
    """Once a tick: ``perceive``, perhaps ``step``, then ``command``. No modes, no requests, no reports."""

    def __init__(
        self,
        settings: NavigationSettings,
        executor: Executor,
        registry: Registry = BEHAVIORS,
        patience_ns: int = PATIENCE_NS,
    ) -> None:
        """``executor``: one thread, for plans. ``patience_ns``: how long a move waits, as for a position."""
        self._configured = self.settings = settings
        self._registry = registry
        self._patience_ns = patience_ns
        self._unloaded = settings.own
        self._body: Footprint | None = None
        self.load = Load()
        self.load_changed = False
        self._carried = CarriedRack()
        self._rack_moved: Moved | None = None
        self.footprint: Footprint | None = None
        self._avoidance = DynamicAvoidance(settings)
        self._guard = BrakingGuard()
        self.perception = Perception(settings)
        self.plans = PlanWorker(executor)
        self.move: RunningMove | None = None

    def set_model(self, model: ChassisModel) -> None:
        """Move this chassis from now on, within its limits."""
        self.settings = self._configured.for_chassis(model)
        self._unloaded = self.settings.own
        self._avoidance = DynamicAvoidance(self.settings)
        self.set_body(Footprint.of(model.footprint))

    @property
    def own_limits(self) -> Limits | None:
        """What the chassis can do without a load, within the operator's caps; None before ``set_model``."""
        return None if self._body is None else self._unloaded

    @property
    def is_in_lift(self) -> bool:
        """Whether the whole chassis, with its load, is in the cabin of a lift of the map."""
        costmap, pose = self.perception.costmap, self.perception.pose
        if costmap is None or pose is None or self.footprint is None:
            return False
        return is_in_lift(costmap.static.overlays, se2.transformed(pose, self.footprint.polygon))

    def set_limits(self, limits: Limits, load: float = 0.0) -> None:
        """Command no more than this from the next tick on, also of the running move; ``set_model`` ends it.

        ``load``: the share (0 to 1) of the greatest load that is on the jack; it limits stops, too.
        """
        own = load_limits(self._unloaded, load)
        self.settings = replace(self.settings, own=own).commanding(limits.within(own))
        self._avoidance.set_limits(self.settings.control)

    def set_search_limit(self, places: int) -> None:
        """How many places a search for a path may try, from the next search on."""
        self._configured = replace(self._configured, max_expansions=places)
        self.settings = replace(self.settings, max_expansions=places)

    def set_build_up(self, build_up: float) -> None:
        """Seconds in which an acceleration builds up, from the next tick on."""
        self._configured = replace(self._configured, build_up=build_up)
        self.settings = replace(self.settings, build_up=build_up)

    def set_racks(self, specs: tuple[RackSpec, ...], ignore_objects_under_rack: bool) -> None:
        """The kinds of racks that may be carried, from the next move on; and whether what is under a carried one holds
        a move."""
        self._configured = replace(
            self._configured, rack_specs=specs, ignore_objects_under_rack=ignore_objects_under_rack
        )
        self.settings = replace(self.settings, rack_specs=specs, ignore_objects_under_rack=ignore_objects_under_rack)
        if self._body is not None:
            self.set_body(self._body)

    def set_body(self, body: Footprint) -> None:
        """The outline of the chassis without a load. ``footprint``, which must not touch anything, derives from it."""
        self._body = body
        self.footprint = self.load.footprint(body)
        self.perception.configure(self.settings, body, self.footprint, self.load)

    def update_load(self, state: ChassisState) -> bool:
        """What the chassis carries by now; True if that changed, and perhaps the footprint with it."""
        changed, self.load_changed = self.load_changed, False
        if self._body is None:
            return changed
        measured = Measured(state, self.perception.pose, self._body)
        load = next_load(self.load, measured, self.settings.unmeasured_rack)
        load, moved = self._carried.look(load, self.perception.seen, self.settings)
        self._rack_moved = moved or self._rack_moved
        if load == self.load:
            return changed
        self._take_load(load)
        return True

    def _take_load(self, load: Load) -> None:
        self.load = load
        if self._body is not None:
            self.set_body(self._body)

    def loads(self, data: MapData) -> Callable[[], LocalCostmap]:
        """What takes seconds of using a large map, to be called in any thread. It raises as ``set_map``."""
        return self.perception.loads(data)

    def loads_overlays(self, data: MapData) -> Callable[[], StaticMap]:
        """The same of using the map in use with other overlays."""
        return self.perception.loads_overlays(data)

    def set_map(self, data: MapData | None, loaded: LocalCostmap | None = None) -> None:
        """Use this map (or none), as it was ``loaded`` or is now. A running move must end.

        Raises ``MoveFailed(GET_MAP_FAILED)``; the map before is then still in use, and a running move goes on.
        """
        self.perception.set_map(data, loaded)
        self.plans.cancel()

    def set_overlays(self, data: MapData, loaded: StaticMap | None = None) -> None:
        """The map in use with other overlays: what was observed on it stays, and a running move goes on.

        Raises ``MoveFailed(GET_MAP_FAILED)``; the overlays before are then still in use.
        """
        self.perception.set_overlays(data, loaded)
        self.plans.cancel()

    def reset(self) -> None:
        """The driver restarted: nothing moves, and what was measured is void."""
        self.end()
        self.perception.reset()
        self._guard.reset()

    def begin(self, request: MoveCreate) -> None:
        """Take a move; its work starts with the next ``step``, so that asking for it costs nothing."""
        self.end()
        self._rack_moved = None
        self.move = RunningMove(request, self._registry, self._patience_ns)

    def end(self) -> None:
        """Forget the move and the plan that it waits for."""
        self.plans.cancel()
        self.move = None

    # -- once a tick -------------------------------------------------------------------------------------------------

    def perceive(self, state: ChassisState) -> None:
        self.perception.update(state)

    def step(self, state: ChassisState) -> Drive | Done | None:
        """One step of the running move; None while the scan cannot be trusted. Raises ``MoveFailed``.

        Raises ``RuntimeError`` without a move, a map, a pose or a footprint: the caller knows what is missing.
        """
        costmap, pose, odometry = self.perception.costmap, self.perception.pose, state.odometry
        if self.move is None or costmap is None or pose is None or odometry is None or self.footprint is None:
            raise RuntimeError("a move cannot be stepped without a map, a pose and a footprint")
        stamp = odometry.stamp
        if self.move.is_new:
            self.perception.begin(stamp)
        self.perception.check_scan(stamp)
        if self._rack_moved is not None:
            raise self._has_moved(self._rack_moved, pose)
        if (fault := self.perception.scan_fault(stamp) or self._under_rack()) is not None:
            self.move.hold(fault)
            return None
        ctx = Context(
            stamp=stamp,
            state=state,
            pose=pose,
            twist=odometry.twist,
            commanded=self._guard.command,
            vetoed=self._guard.vetoed,
            costmap=costmap,
            footprint=self.footprint,
            load=self.load,
            seen=self.perception.seen,
            settings=self.settings,
            plans=self.plans,
            avoidance=self._avoidance,
        )
        outcome = self.move.step(ctx)
        if outcome.load is not None and outcome.load != self.load:
            self._take_load(outcome.load)
            self.load_changed = True
        return outcome

    def _has_moved(self, moved: Moved, chassis: Pose) -> MoveFailed:
        failed = MoveFailed(MoveFailReason.RACK_MOVED, moved.text)
        if self.load.rack_pose is None:
            return failed.about(measures=moved.measures)
        x, y, _ = se2.compose(chassis, np.array(self.load.rack_pose)).round(3).tolist()
        return failed.about(Thing(role="seen", kind="rack", x=x, y=y), measures=moved.measures)

    def _under_rack(self) -> str | None:
        """Why a move with a rack must wait for what is under it; None if it need not."""
        seen = self.perception.seen
        if self.settings.ignore_objects_under_rack or self.load.state is not LoadState.CARRYING:
            return None
        if seen is None or self._body is None or len(found := objects_under(self.load, seen, self._body)) < WITNESSES:
            return None
        x, y = se2.transformed(seen.chassis, found).mean(axis=0)
        return f"something is under the rack, about ({x:.2f}, {y:.2f}), and safety.ignore_objects_under_rack is false"

    def command(self, wanted: Drive | None, state: ChassisState, limits: Limits) -> Twist2:
        """The twist to command now: what is wanted, within ``limits``, if the guard lets it pass. None brakes."""
        if state.odometry is None or self.footprint is None:
            return self._guard.brake(0 if state.odometry is None else state.odometry.stamp, self.settings.own)
        stamp, measured = state.odometry.stamp, state.odometry.twist
        if wanted is None:
            return self._guard.brake(stamp, self.settings.own)
        view = self.perception.surroundings(stamp, wanted.may_touch)
        return self._guard.drive(
            wanted.twist, view, measured, stamp, limits, self.footprint.edges, self.settings, wanted.may_touch
        )

    def brake(self, stamp: int) -> Twist2:
        """The next command of the shortest stop, whatever else is broken."""
        return self._guard.brake(stamp, self.settings.own)
