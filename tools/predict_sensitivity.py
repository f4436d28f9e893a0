"""Measure how far a predicted drive can be trusted; write the table of docs/prediction.md.

    python tools/predict_sensitivity.py [--write]

Drives are those of `predict_speed.py` over rocks. They are compared with drives from starts that are moved a little, and with
drives of shorter steps.
"""

from __future__ import annotations

import sys
from pathlib import Path as FilePath

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import rockerbogie as rb

PAGE = FilePath(__file__).resolve().parents[1] / "docs" / "prediction.md"
FIRST, LAST = "<!-- sensitivity -->", "<!-- end of sensitivity -->"
SPEED, LENGTH, DRIVES = 0.04, 20.0, 64
STEPS, FINEST = (0.25, 0.0625), 0.015625  # m
MOVES = (1e-9, 1e-6, 1e-3)  # m
AT = (1, 2, 5, 10, 20)  # m
SAME = 1e-6  # m/s and rad/s: largest difference of two solutions that are the same

Array = NDArray[np.float64]


def constant_rates(rover: rb.Rover, length: float) -> xr.Dataset:
    """Return commands of one rim speed for all wheels."""
    rates = np.tile(SPEED / rover.wheel_radius, (2, 1))
    table = {"wheel_rate": (("time", "wheel"), rates), "steering": (("time", "wheel"), np.zeros((2, 6)))}
    return xr.Dataset(table, {"time": [0.0, length / SPEED]})


def drive(
    rover: rb.Rover, ground: rb.Terrain, start: Array, commands: rb.Path | xr.Dataset, step: float, record: float
) -> xr.Dataset:
    """Return predicted drives."""
    return rb.predict(rover, ground, start, commands, friction=0.8, speed=SPEED, step=step, record=record, details=False)


def distances(one: xr.Dataset, other: xr.Dataset) -> Array:
    """Return the distances between drives at the lengths `AT`, (drives, lengths), m."""
    return np.asarray(np.hypot(one["x"] - other["x"], one["y"] - other["y"]))[:, list(AT)]


def shown(case: str, step: float, values: Array) -> str:
    """Return a row of the table: medians, and the 90 % quantile at the end."""
    medians = " | ".join(f"{1e3 * value:.2g}" for value in np.nanmedian(values, axis=0))
    return f"| {case} | {step:g} m | {medians} | {1e3 * np.nanquantile(values[:, -1], 0.9):.2g} |"


def solutions(rover: rb.Rover, ground: rb.Terrain, start: Array, step: float) -> tuple[int, int]:
    """Return the number of stations, and of those where a rover at rest gets another motion."""
    run = drive(rover, ground, start, constant_rates(rover, LENGTH), step, step)
    names = ("x_rate", "y_rate", "yaw_rate")
    place, rates = (np.stack([np.asarray(run[name]).ravel() for name in group], axis=-1) for group in (("x", "y", "yaw"), names))
    known = np.isfinite(rates).all(axis=1)
    anew = drive(rover, ground, place[known], constant_rates(rover, 1e-3), 1e-3, 1e-3)
    other = np.stack([np.asarray(anew[name])[:, 0] for name in names], axis=-1)
    return int(known.sum()), int((np.abs(other - rates[known]).max(axis=1) > SAME).sum())


def main() -> None:
    """Print the rows, and write them into the page if asked to."""
    rover = rb.load_rover("perseverance")
    rocks = rb.surfaces.rocks(0.1, 1, size=60.0, spacing=0.05, largest=0.3)
    rng = np.random.default_rng(0)
    x0, y0, x1, y1 = rocks.bounds
    middle = ((x0 + x1) / 2, (y0 + y1) / 2)
    start = np.column_stack([rng.uniform(-2, 2, (DRIVES, 2)) + middle, rng.uniform(-3.1, 3.1, DRIVES)])
    aside = np.column_stack([np.cos(5 * start[:, 2]), np.sin(5 * start[:, 2]), np.zeros(DRIVES)])
    rows = []
    for name, commands in (("constant rates", constant_rates(rover, LENGTH)), ("path", rb.Path.straight((0, 0), 0.0, LENGTH))):
        finest = drive(rover, rocks, start, commands, FINEST, 1.0)
        for step in STEPS:
            run = drive(rover, rocks, start, commands, step, 1.0)
            for move in MOVES:
                moved = drive(rover, rocks, start + move * aside, commands, step, 1.0)
                rows.append(shown(f"{name}, start moved by {1e3 * move:g} mm", step, distances(run, moved)))
                print(rows[-1], flush=True)
            rows.append(shown(f"{name}, against steps of {1e3 * FINEST:.0f} mm", step, distances(run, finest)))
            print(rows[-1], flush=True)
    lengths = " | ".join(f"{at} m" for at in AT)
    text = f"| constant rates or path | step | {lengths} | {AT[-1]} m, 90 % |\n|---|---|" + "---|" * (len(AT) + 1) + "\n"
    text += "\n".join(rows) + "\n"
    for step in STEPS:
        stations, others = solutions(rover, rocks, start, step)
        text += f"\nStations with a second balance, with constant rates and steps of {step:g} m: {others} of {stations:,}.\n"
    print(text)
    if "--write" in sys.argv:
        page = PAGE.read_text(encoding="utf-8")
        before, rest = page.split(FIRST)
        PAGE.write_text(before + FIRST + "\n\n" + text + "\n" + LAST + rest.split(LAST)[1], encoding="utf-8")


if __name__ == "__main__":
    main()
