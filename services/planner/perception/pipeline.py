"""Everything perceived, in one place: where the chassis is, what surrounds it, and whether the scan can be trusted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.chassis import Costmap, Scan
from rackhand.schemas.maps import MapData
from rackhand.services.planner.control.braking_guard import Surroundings, as_obstacles
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.map.grid import StaticMap, load_map
from rackhand.services.planner.perception.chassis_state import QUALITY_LOST, ChassisState
from rackhand.services.planner.perception.costmap import cost_bytes
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.perception.pose_filter import PoseFilter
from rackhand.services.planner.perception.scan_watchdog import ScanWatchdog
from rackhand.services.planner.perception.seen_scan import SeenScan, outside, points_of
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]


class Perception:
    """Fed once a tick with the newest measurements; everything that drives reads from it."""

    def __init__(self, settings: NavigationSettings) -> None:
        self._settings = settings
        self._body: Footprint | None = None
        self._footprint: Footprint | None = None
        self._load = Load()
        self.costmap: LocalCostmap | None = None
        self._data: MapData | None = None
        self.reset()

    def reset(self) -> None:
        """The driver restarted: all measurements are void, whatever their stamps. Map and footprint stay."""
        self._filter = PoseFilter(self._settings.noise)
        self._watchdog = ScanWatchdog(self._settings)
        self._odometry: Pose | None = None
        self._hits: Array = np.empty((0, 2))
        self.pose: Pose | None = None
        self.seen: SeenScan | None = None

    def loads(self, data: MapData) -> Callable[[], LocalCostmap]:
        """What takes seconds of using a large map, to be called in any thread. It raises as ``set_map``."""
        settings, static = self._settings, self._same_cells(data)
        return lambda: LocalCostmap(static or load_map(data, settings.slow_zone_velocity), settings)

    def loads_overlays(self, data: MapData) -> Callable[[], StaticMap]:
        """The same of using the map in use with other overlays."""
        slow_velocity = self._settings.slow_zone_velocity
        return lambda: load_map(data, slow_velocity)

    def _same_cells(self, data: MapData) -> StaticMap | None:
        """The cells of the map in use if it is that very one, as when the driver has restarted."""
        return self.costmap.static if self.costmap is not None and self._data is data else None

    def set_map(self, data: MapData | None, loaded: LocalCostmap | None = None) -> None:
        """Use this map (or none), as it was ``loaded`` or is now, and forget what was observed on the former one.

        Raises ``MoveFailed(GET_MAP_FAILED)`` for a map that cannot be read; the one before is then still in use.
        """
        self.costmap = None if data is None else loaded or self.loads(data)()
        self._data = data

    def set_overlays(self, data: MapData, loaded: StaticMap | None = None) -> None:
        """The map in use with other overlays, as ``loaded`` or now; what was observed stays. Raises as ``set_map``."""
        static = loaded or self.loads_overlays(data)()
        if self.costmap is None:
            self.costmap = LocalCostmap(static, self._settings)
        else:
            self.costmap.set_overlays(static, self.pose)
        self._data = data

    def configure(
        self, settings: NavigationSettings, body: Footprint, footprint: Footprint, load: Load | None = None
    ) -> None:
        """The body without a load, the outline that must not touch anything, the thresholds that suit it, and the load.

        What was seen inside the outline of a rack that is on the jack from now on are its legs.
        """
        lifted = load is not None and load.state is LoadState.CARRYING and self._load.state is not LoadState.CARRYING
        self._settings, self._body, self._footprint, self._load = settings, body, footprint, load or Load()
        if lifted and self.costmap is not None and self.pose is not None:
            self.costmap.clear(se2.transformed(self.pose, footprint.polygon))

    def update(self, state: ChassisState) -> None:
        """Take the newest measurements. ``pose`` is None afterwards unless the chassis is localised.

        Raises ``ValueError`` before any odometry.
        """
        if state.odometry is None:
            raise ValueError("no odometry yet")
        self._odometry = se2.pose(state.odometry.pose)
        seen = state.observation()
        if seen is not None and state.pose is not None and state.pose.quality != QUALITY_LOST:
            self._filter.update(seen)
        self.pose = self._filter.pose if state.pose_trouble() is None else None
        if self._watchdog.take(state.odometry.stamp, state.scan) and state.scan is not None:
            self._look(state.scan, self._footprint)

    def _look(self, scan: Scan, footprint: Footprint | None) -> None:
        if footprint is None or self._odometry is None:
            return
        # The scan belongs to the newest odometry or the one before it: odometry has moved by centimetres at most.
        points = points_of(scan, self._settings.obstacle_range, self._body or footprint)
        self._hits = se2.transformed(self._odometry, outside(points, footprint))
        # In doubt nothing is drawn into the map: it would stay there, at a place where it never was.
        if self.pose is not None and self.costmap is not None and not self._filter.is_doubtful:
            chassis = self._filter.at(scan.stamp)
            odometry, sensor = self._filter.odometry_at(scan.stamp), se2.pose(scan.sensor)
            self.seen = SeenScan(scan.stamp, points, chassis, odometry, sensor)
            self.costmap.look(scan, chassis, footprint, self._load, self._settings.rack_specs)
            self.costmap.refresh(self.pose)

    def begin(self, stamp: int) -> None:
        """A move begins: a scan that never came counts as missing from now."""
        self._watchdog.begin(stamp)

    def scan_fault(self, stamp: int) -> str | None:
        """Why the scan cannot be trusted now; None if it can."""
        return self._watchdog.fault(stamp)

    def check_scan(self, stamp: int) -> None:
        """Raises ``MoveFailed(CONTROL_COSTMAP_ERROR)`` if the scan has been missing for too long."""
        self._watchdog.check(stamp)

    def surroundings(self, stamp: int, touchable: tuple[Array, ...] = ()) -> Surroundings | None:
        """For the braking guard; None when the scan cannot be trusted, so that nothing can be known to be free.

        ``touchable``: of racks whose middle is inside one of these convex polygons, only the legs count.
        """
        if self._footprint is None or self._odometry is None or self.scan_fault(stamp) is not None:
            return None
        if self.pose is not None and self.costmap is not None:
            return Surroundings(self.pose, self.costmap.obstacles(self.pose, touchable))
        near = (np.abs(self._hits - self._odometry[:2]) < self._settings.safety_radius).all(axis=1)
        return Surroundings(self._odometry, as_obstacles(self._hits[near], self._settings.hit_margin))

    def costmap_message(self, stamp: int) -> Costmap | None:
        """The local costmap as published; None without a map or a footprint."""
        if self.costmap is None or self._footprint is None:
            return None
        grid = self.costmap.near
        cost = cost_bytes(grid, self._footprint.inscribed, self._settings.inflation_radius)
        g = grid.geometry
        return Costmap(
            stamp=stamp, origin=(g.x, g.y), resolution=g.resolution, columns=g.columns, cost=cost.reshape(-1)
        )
