"""``python -m benchmarks.motion [--world W] [--seconds S]``: print the tables for another world, or a longer run."""

import argparse

from benchmarks.motion import SECONDS, TURNS, run

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks.motion", description=__doc__)
    parser.add_argument("--world", default="pick_station", help="whose arm1 moves (default pick_station)")
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help=f"of each of the {TURNS} turns (default {SECONDS:g})"
    )
    arguments = parser.parse_args()
    print(run(arguments.world, arguments.seconds).markdown())
