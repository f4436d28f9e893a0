"""Draw docs/img/reach.png: reachable cells, a keep-out area, and a route around it.

python docs/draw_plan.py
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

import rockerbogie as rb

HERE = Path(__file__).parent
START, GOALS = (-14.0, -12.0), [(2.0, -10.0), (14.0, 12.0)]


def main() -> None:
    """Write docs/img/reach.png."""
    rover, terrain = rb.load_rover("curiosity"), rb.surfaces.mars(seed=2, k=0.12, crater_density=0.05)
    maps = rb.traversability(rover, terrain, 16, 0.5)
    x, y = np.meshgrid(maps["x"].values, maps["y"].values)
    wall = (np.abs(x - 8) < 0.6) & (y > -14) & (y < 9)
    options = {"keep_out": wall, "keep_out_margin": 1.5}
    reach = rb.reachability(maps, START, **options)
    route = rb.plan(maps, START, GOALS, **options)
    print(route)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        figure = rb.plot.map(reach, terrain=terrain, route=route)
    axes = figure.axes[0]
    axes.contourf(maps["x"], maps["y"], wall, levels=[0.5, 1.5], colors="none", hatches=["////"])
    axes.contour(maps["x"], maps["y"], wall, levels=[0.5], colors="#222222", linewidths=1.2)
    axes.plot(*GOALS[0], "D", mfc="white", mec="#222222", ms=8, zorder=9)
    figure.savefig(HERE / "img" / "reach.png", dpi=110)


if __name__ == "__main__":
    main()
