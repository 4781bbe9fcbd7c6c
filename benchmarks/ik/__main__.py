"""``python -m benchmarks.ik``: print the tables, shorter or longer than ``python -m benchmarks ik`` does."""

import argparse

from benchmarks.ik import run

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ik", description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0, help="of each course (default 5)")
    parser.add_argument("--poses", type=int, default=10_000, help="of TRAC-IK's task (default 10000)")
    arguments = parser.parse_args()
    print(run(arguments.seconds, arguments.poses).markdown())
