"""Mutation of robot files, rasters and logs by the thousand.

`python tools/fuzz_files.py --kind robot|raster|log --count 10000`

Every mutated file gives one sentence or a right answer, within seconds; the rules are in tests/fuzz. The same functions run with
small counts in pytest (tests/fuzz/test_fuzz.py, tests/rover/test_formats_fuzz.py).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
    from fuzz import mutate, mutate_logs, mutate_rasters

    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kind", choices=("robot", "raster", "log"), required=True)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    runs = {"robot": mutate.run, "raster": mutate_rasters.run, "log": mutate_logs.run}
    print(dict(runs[given.kind](given.count, given.seed)))
