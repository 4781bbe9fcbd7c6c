"""Time to plan on the warehouse map, beside what other libraries offer for grids, on the same queries of one run."""

from __future__ import annotations

import importlib.util
import math
import random
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.csgraph import dijkstra

from benchmarks.progress import track
from benchmarks.report import Report, Table, median, percentile
from rackhand import worlds
from rackhand.schemas.maps import MapData
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.map.directory import read_map_directory
from rackhand.services.planner.map.grid import StaticMap, load_map
from rackhand.services.planner.planning.plan import GlobalPlanner, NoPathFound, Target
from rackhand.services.planner.planning.windows import LargePlanner
from rackhand.services.planner.settings import NavigationSettings

QUERIES, SEED = 60, 3
SIZES, CELL = (20, 50, 100, 200, 500), 0.05  # m: of a hall's side, and of a cell
LARGEST_GRAPH = 100  # m; the graph of a larger hall takes more than 4 GB
HALL_QUERIES = 5
LONGJACK = ((0.379, 0.23), (-0.369, 0.23), (-0.369, -0.23), (0.379, -0.23))
Cell = tuple[int, int]
# Path length in metres, or None for no way.
Planner = Callable[[Cell, Cell], float | None]


def run() -> Report:
    static = warehouse()
    free = ndimage.distance_transform_edt(~static.blocked) * static.geometry.resolution > 0.25
    queries = random_queries(free)
    planners = {"rackhand (field, footprint checked)": own(static)} | others(free, static.geometry.resolution)
    times: dict[str, list[float]] = {name: [] for name in planners}
    lengths: dict[str, list[float | None]] = {name: [] for name in planners}
    for start, goal in [queries[0], *queries]:
        for name, plan in planners.items():
            begun = time.perf_counter()
            length = plan(start, goal)
            times[name].append(time.perf_counter() - begun)
            lengths[name].append(length)
    best = [
        min(found, default=None) for found in ([x for x in row if x] for row in zip(*lengths.values(), strict=True))
    ]
    ours = median(times["rackhand (field, footprint checked)"][1:])
    rows = []
    for name in planners:
        ratios = [x / b for x, b in zip(lengths[name][1:], best[1:], strict=True) if x and b]
        took = times[name][1:]
        rows.append(
            (
                name,
                f"{median(took) * 1e3:.1f}",
                f"{percentile(took, 0.95) * 1e3:.1f}",
                f"{median(took) / ours:.2f}",
                f"{len(ratios)}/{QUERIES}",
                f"{sum(ratios) / len(ratios):.3f}",
            )
        )
    missing = [module for module in ("pyastar2d", "skimage") if importlib.util.find_spec(module) is None]
    return Report(
        "Planning time on the warehouse map",
        "python -m benchmarks planning",
        ("planner", "median ms", "p95 ms", "ratio to ours", "found", "length / shortest"),
        rows,
        f"{QUERIES} random queries, {free.shape[1]}x{free.shape[0]} cells of 5 cm. Ours starts from the map, weighs "
        "clearance and checks the real footprint along the way; the others plan for a circle on a ready mask."
        + (f" Not installed in this run: {', '.join(missing)}." if missing else ""),
        (by_size(),),
    )


def by_size() -> Table:
    """Ours as the worker plans, beside Dijkstra, in halls of all sizes."""
    return Table(
        "Against the size of the map",
        (
            "hall",
            "million cells",
            "ms of ours, median / worst",
            "of scipy csgraph Dijkstra",
            "scipy / ours",
            "length / scipy's",
        ),
        [size_row(size) for size in track(SIZES, "halls")],
        f"CPU time of {HALL_QUERIES} plans a hall with rows of shelves, the first one from corner to corner, in cells "
        f"of {CELL} m, as the planner's worker makes them. The time to make scipy's graph is not counted; that of a "
        f"hall larger than {LARGEST_GRAPH} m takes more than 4 GB. Above 9 million cells ours is coarse to fine: exact "
        "in the first 40 m, the rest is planned on the way. For the ticks meanwhile see `planner_tick`.",
    )


def size_row(size: int) -> tuple[str, ...]:
    blocked = shelves(round(size / CELL))
    queries = list(hall_queries(blocked))
    in_worker(blocked, *queries[0])  # touches memory, and compiles if need be
    own_runs = [timed(in_worker, blocked, *query) for query in queries]
    took = [seconds for _, seconds in own_runs]
    name = f"{size} m", f"{blocked.size / 1e6:.2f}", f"{median(took) * 1e3:.0f} / {max(took) * 1e3:.0f}"
    if size > LARGEST_GRAPH:
        return *name, "-", "-", "-"
    theirs = csgraph(ndimage.distance_transform_edt(~blocked) * CELL > 0.25, CELL)
    their_runs = [timed(theirs, *query) for query in queries]
    their_time = [seconds for _, seconds in their_runs]
    lengths = [a / b for (a, _), (b, _) in zip(own_runs, their_runs, strict=True) if a and b]
    return (
        *name,
        f"{median(their_time) * 1e3:.0f} / {max(their_time) * 1e3:.0f}",
        f"{median(their_time) / median(took):.2f}",
        f"{median(lengths):.3f}",
    )


def timed(plan: Callable[..., float | None], *query: Any) -> tuple[float | None, float]:
    """What it returns, and seconds of CPU."""
    begun = time.process_time()
    length = plan(*query)
    return length, time.process_time() - begun


def shelves(side: int) -> NDArray[np.bool_]:
    """A walled hall of ``side`` cells with rows of shelves, 1 m deep and 10 m long, and aisles of 3 m and 2 m."""
    blocked = np.zeros((side, side), dtype=np.bool_)
    blocked[:4], blocked[-4:], blocked[:, :4], blocked[:, -4:] = True, True, True, True
    for row in range(80, side - 80, 80):
        for column in range(60, side - 240, 240):
            blocked[row : row + 20, column : column + 200] = True
    return blocked


def hall_queries(blocked: NDArray[np.bool_]) -> Iterator[tuple[Cell, Cell]]:
    """From corner to corner, then from random aisle to aisle."""
    side, rng = len(blocked), random.Random(SEED)
    yield (30, 30), (side - 31, side - 31)
    aisles = range(50, side - 40, 80)
    for _ in range(HALL_QUERIES - 1):
        yield (rng.choice(aisles), rng.randrange(40, side - 40)), (rng.choice(aisles), rng.randrange(40, side - 40))


def in_worker(blocked: NDArray[np.bool_], start: Cell, goal: Cell) -> float | None:
    """Metres of the plan that the worker makes."""
    geometry = Geometry(0.0, 0.0, CELL, *blocked.shape)
    footprint = Footprint.of(np.array(LONGJACK))
    planner = LargePlanner(geometry, blocked, np.empty(0, dtype=np.int64), footprint, NavigationSettings())
    steps = planner.search(np.array([*geometry.centre(*start), 0.0]), Target(*geometry.centre(*goal), None))
    while True:
        try:
            next(steps)
        except StopIteration as found:
            return float(found.value.length)
        except NoPathFound:
            return None


def warehouse() -> StaticMap:
    created = read_map_directory(Path(worlds.__file__).parent / "warehouse").map
    row = {"id": 1, "uid": created.uid, "create_time": 0, "last_modified_time": 0}
    data = MapData.model_validate({**created.model_dump(exclude={"op", "uid"}), **row})
    return load_map(data, NavigationSettings().slow_zone_velocity)


def random_queries(free: NDArray[np.bool_]) -> list[tuple[Cell, Cell]]:
    labels, _ = ndimage.label(free)
    largest = int(np.bincount(labels[labels > 0]).argmax())
    cells = np.argwhere((labels == largest) & (ndimage.distance_transform_edt(free) > 6))
    rng = random.Random(SEED)
    return [(tuple(rng.choice(cells)), tuple(rng.choice(cells))) for _ in range(QUERIES)]


def own(static: StaticMap) -> Planner:
    planner = GlobalPlanner(static.geometry, Footprint.of(np.array(LONGJACK)), NavigationSettings())

    def plan(start: Cell, goal: Cell) -> float | None:
        here = np.array([*static.geometry.centre(*start), 0.0])
        try:
            return planner.plan(here, Target(*static.geometry.centre(*goal), None), static.blocked).length
        except NoPathFound:
            return None

    return plan


def others(free: NDArray[np.bool_], resolution: float) -> dict[str, Planner]:
    found: dict[str, Planner] = {"scipy csgraph Dijkstra": csgraph(free, resolution)}
    if importlib.util.find_spec("skimage"):
        from skimage.graph import MCP_Geometric

        costs = np.where(free, 1.0, -1.0)

        def mcp(start: Cell, goal: Cell) -> float | None:
            search = MCP_Geometric(costs)
            search.find_costs([start], [goal])
            return chain_length(np.array(search.traceback(goal)), resolution)

        found["scikit-image MCP_Geometric"] = mcp
    if importlib.util.find_spec("pyastar2d"):
        import pyastar2d

        weights = np.where(free, 1.0, np.inf).astype(np.float32)

        def astar(start: Cell, goal: Cell) -> float | None:
            path = pyastar2d.astar_path(weights, start, goal, allow_diagonal=True)
            return None if path is None else chain_length(path, resolution)

        found["pyastar2d"] = astar
    return found


def csgraph(free: NDArray[np.bool_], resolution: float) -> Planner:
    """Eight-connected graph of the free cells, made once; one Dijkstra a query."""
    index = np.arange(free.size).reshape(free.shape)
    rows, columns, costs = [], [], []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = index[: free.shape[0] - di, max(0, -dj) : free.shape[1] - max(0, dj)]
        b = index[di:, max(0, dj) : free.shape[1] + min(0, dj)]
        both = (free.flat[a] & free.flat[b]).ravel()
        rows.append(a.ravel()[both])
        columns.append(b.ravel()[both])
        costs.append(np.full(both.sum(), math.hypot(di, dj) * resolution))
    graph = sparse.csr_array(
        (np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=(free.size, free.size)
    )

    def plan(start: Cell, goal: Cell) -> float | None:
        distance = dijkstra(graph, directed=False, indices=index[start])[index[goal]]
        return float(distance) if np.isfinite(distance) else None

    return plan


def chain_length(cells: NDArray[np.int64], resolution: float) -> float:
    return float(np.hypot(*np.diff(cells, axis=0).T).sum() * resolution)
