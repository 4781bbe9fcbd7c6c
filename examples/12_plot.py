"""A plot of a run from a recording: where a robot was, and where it believed to be, as SVG.

rackhand record run.rrd              # while the cell runs; Ctrl-C ends it
python examples/12_plot.py run.rrd run.svg
"""

import sys
from pathlib import Path

from rerun.chunk import RrdReader

ROBOT, SIZE, RIM = "amr1", 600, 20  # px
recording, picture = sys.argv[1], Path(sys.argv[2])

paths: dict[str, list[tuple[int, float, float]]] = {ROBOT: [], f"{ROBOT}:localised": []}  # truth, and belief
for chunk in RrdReader(recording).stream():
    if chunk.entity_path != "/tf" or not chunk.num_rows:
        continue
    rows = chunk.to_record_batch()
    columns = (rows["sim_time"].cast("int64"), rows["Transform3D:child_frame"], rows["Transform3D:translation"])
    for stamp, [frame], [position] in zip(*(column.to_pylist() for column in columns), strict=True):
        if frame in paths:
            paths[frame].append((stamp, position[0], position[1]))

if not all(paths.values()):
    sys.exit(f"{recording} does not hold both the true and the localised pose of {ROBOT}: record while it moves")
points = [point for path in paths.values() for point in path]
low = [min(point[axis] for point in points) for axis in (1, 2)]
span = max(max(point[axis] for point in points) - low[axis - 1] for axis in (1, 2)) or 1.0
scale = (SIZE - 2 * RIM) / span


def line(path: list[tuple[int, float, float]], colour: str) -> str:
    places = [(RIM + (x - low[0]) * scale, SIZE - RIM - (y - low[1]) * scale) for _, x, y in sorted(path)]
    drawn = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    return f'<polyline points="{drawn}" fill="none" stroke="{colour}" stroke-width="2"/>'


truth, belief = paths.values()
seconds = (max(truth)[0] - min(truth)[0]) / 1e9
picture.write_text(
    f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE}" height="{SIZE}">\n'
    f'<rect width="100%" height="100%" fill="white"/>\n{line(belief, "#e0a030")}\n{line(truth, "#3060c0")}\n'
    f'<text x="{RIM}" y="{RIM - 5}" font-family="sans-serif" font-size="12">{ROBOT}, {seconds:.1f} s, {span:.1f} m: '
    f"truth blue, localised yellow</text>\n</svg>\n"
)
print(f"{len(truth)} poses of {ROBOT} in {seconds:.1f} s, {picture}")
