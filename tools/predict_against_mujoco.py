"""Compare predicted drives with MuJoCo, and write the table of docs/prediction.md.

    python tools/predict_against_mujoco.py [ROVER ...] [--write]

Both drive the same wheel rates and steering over time, open loop; MuJoCo's motors hold them. The error is the largest distance
between the two reference points at equal times. All rovers take about 10 minutes; --write replaces the rows of the rovers given.
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np
import xarray as xr

import rockerbogie as rb

PAGE = FilePath(__file__).resolve().parents[1] / "docs" / "prediction.md"
FIRST, LAST = "<!-- mujoco -->", "<!-- end of mujoco -->"
HEADER = (
    "| rover | terrain | friction | commands | distance | path error, largest | at the end | yaw error | "
    "roll slip: median, 95 % (MuJoCo) | time with a wheel off the ground (MuJoCo) | predict | MuJoCo |\n" + 12 * "|---" + "|\n"
)
FRICTIONS, SPEED, LENGTH = (0.5, 0.8), 0.05, 10.0
#: Rover -> smallest and largest diameter of rocks, node spacing, m.
ROCKS = {"osr": (0.05, 0.12, 0.02), "curiosity": (0.1, 0.3, 0.05), "perseverance": (0.1, 0.3, 0.05)}


class Case(NamedTuple):
    """One drive."""

    rover: str
    name: str
    terrain: rb.Terrain
    start: tuple[float, float, float]
    curvature: float  # 1/m
    constant: bool  # True: all wheels turn at one constant rate
    friction: float


def slope(degrees: float) -> rb.Terrain:
    """Return a plane of 40 m that rises along y."""
    rise = np.arange(81) * 0.5 * np.tan(np.radians(degrees))
    return rb.Terrain.from_array(
        np.add.outer(rise, np.zeros(81)), spacing=0.5, interpolation="linear", name=f"slope of {degrees:g}°"
    )


def cases(rover: str) -> list[Case]:
    """Return the drives of one rover on a slope and on two fields of rocks, with each friction."""
    plane = slope(15.0)
    small, large, spacing = ROCKS[rover]
    fields = [rb.surfaces.rocks(0.1, seed, smallest=small, largest=large, size=30.0, spacing=spacing) for seed in (0, 1)]
    found = []
    for friction in FRICTIONS:
        found += [
            Case(rover, "15° up", plane, (20.0, 10.0, np.pi / 2), 0.0, False, friction),
            Case(rover, "15° across", plane, (10.0, 20.0, 0.0), 0.0, False, friction),
            Case(rover, "15°, arc of 10 m radius", plane, (15.0, 15.0, 0.6), 0.1, False, friction),
        ]
        for seed, ground in enumerate(fields):
            x0, y0, x1, y1 = ground.bounds
            start = ((x0 + x1) / 2 - 4, (y0 + y1) / 2, 0.1)
            name = f"rocks of {100 * small:g} to {100 * large:g} cm, seed {seed}"
            found.append(Case(rover, name, ground, start, 0.0, True, friction))
    return found


def row(case: Case) -> str:
    """Return the row of one drive."""
    rover = rb.load_rover(case.rover)
    x, y, yaw = case.start
    straight = rb.Path.straight((x, y), yaw, LENGTH)
    if case.constant:
        rates = np.tile(SPEED / rover.wheel_radius, (2, 1))
        table = {"wheel_rate": (("time", "wheel"), rates), "steering": (("time", "wheel"), np.zeros((2, 6)))}
        commands = xr.Dataset(table, {"time": [0.0, LENGTH / SPEED]})
        predicted = rb.predict(rover, case.terrain, case.start, commands, friction=case.friction, details=False)
        began = time.process_time()
        rb.predict(rover, case.terrain, case.start, commands, friction=case.friction, details=False)
    else:
        path = straight if case.curvature == 0.0 else rb.Path.arc((x, y), yaw, 1 / case.curvature, LENGTH * case.curvature)
        predicted = rb.predict(rover, case.terrain, None, path, friction=case.friction, speed=SPEED, details=False)
        began = time.process_time()
        rb.predict(rover, case.terrain, None, path, friction=case.friction, speed=SPEED, details=False)
        commands = predicted[["wheel_rate_command", "steering"]].rename(wheel_rate_command="wheel_rate")
    ours = time.process_time() - began
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sim = rb.simulate(
            rover, case.terrain, straight, SPEED, friction=case.friction, torque=1e6, commands=commands, interval=0.5
        )
    theirs = time.process_time() - began
    at = {name: np.interp(sim["time"], predicted["time"], predicted[name]) for name in ("x", "y", "yaw")}
    error = np.hypot(sim["x"] - at["x"], sim["y"] - at["y"]).to_numpy()
    turned = abs(np.degrees(float(sim["yaw"][-1]) - at["yaw"][-1]))
    slip = [np.nanpercentile(np.abs(run["roll_slip"]), (50, 95)) for run in (predicted, sim)]
    shown = "{:.2g}, {:.2g} ({:.2g}, {:.2g}) mm/s".format(*(1e3 * np.concatenate(slip)))
    without_load = predicted["wheel_lifted"] > 0, np.isnan(sim["contact_angle"])
    lifted = "{:.0f} % ({:.0f} %)".format(*(100 * float(off.any("wheel").mean()) for off in without_load))
    rates = "constant rates" if case.constant else "path"
    share = 100 * error / LENGTH
    return (
        f"| {case.rover} | {case.name} | {case.friction:g} | {rates} | {float(sim['distance'][-1]):.2f} m | {share.max():.2f} % "
        f"| {share[-1]:.2f} % | {turned:.2f}° | {shown} | {lifted} | {1e3 * ours:.0f} ms | {theirs:.0f} s |"
    )


def main() -> None:
    """Print the rows, and write them into the page if asked to."""
    names = [name for name in sys.argv[1:] if not name.startswith("-")] or list(ROCKS)
    rows = []
    for name in names:
        for case in cases(name):
            rows.append(row(case))
            print(rows[-1], flush=True)
    if "--write" in sys.argv:
        text = PAGE.read_text(encoding="utf-8")
        before, rest = text.split(FIRST)
        old, after = rest.split(LAST)
        kept = [
            line for line in old.splitlines() if line.startswith("| ") and line.split("|")[1].strip() in set(ROCKS) - set(names)
        ]
        order = {name: k for k, name in enumerate(ROCKS)}
        lines = sorted(kept + rows, key=lambda line: order[line.split("|")[1].strip()])
        PAGE.write_text(before + FIRST + "\n\n" + HEADER + "\n".join(lines) + "\n\n" + LAST + after, encoding="utf-8")


if __name__ == "__main__":
    main()
