"""Time the cost map of a rover: 20 m x 20 m, 10 cm, 16 headings, and parts of 2 m x 2 m.

    python tools/time_costmap.py --rover osr

Prints wall time and processor time. On a busy machine, half of the processor time is the wall time of two idle cores.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import rockerbogie as rb

SIDE, STEP, PART = 20.0, 0.1, 2.0  # m


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rover", default="osr")
    parser.add_argument("--interpolation", default="linear", choices=("linear", "cubic"))
    parser.add_argument("--parts", type=int, default=5)
    options = parser.parse_args()
    nodes = np.arange(round(SIDE / STEP)) * STEP - SIDE / 2
    for surface in ("mars", "fractal", "mars, 5 % missing"):
        z = getattr(rb.surfaces, surface.partition(",")[0])().height(nodes, nodes[:, None])
        if "missing" in surface:  # 20 squares of 1 m, as shadows of rocks
            for row, col in np.random.default_rng(1).integers(0, len(nodes) - 10, (20, 2)):
                z[row : row + 10, col : col + 10] = np.nan
        costs = rb.CostMap(rb.load_rover(options.rover), headings=16, interpolation=options.interpolation)
        costs.replace(z[:30, :30], (nodes[0], nodes[0]), STEP)  # compiles kernels
        report(f"{surface}: whole map", lambda z=z, costs=costs: costs.replace(z, (nodes[0], nodes[0]), STEP))
        count = round(PART / STEP)
        rng = np.random.default_rng(0)
        for _ in range(options.parts):
            row, col = rng.integers(0, len(nodes) - count, 2)
            part = z[row : row + count, col : col + count] + 0.02 * rng.normal(size=(count, count))
            report(f"{surface}: part", lambda p=part, c=costs, x=nodes[col], y=nodes[row]: c.update(p, (x, y)))


def report(label: str, work: object) -> None:
    """Run a function, and print its times.

    Args:
        label: for the line.
        work: the function; it returns a `Change`.
    """
    wall, processor = time.perf_counter(), time.process_time()
    change = work()  # type: ignore[operator]
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"{label}: {change.cells} cells, {wall:.2f} s wall, {processor:.2f} s processor")


if __name__ == "__main__":
    main()
