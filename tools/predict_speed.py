"""Time predicted drives, and write the table of docs/prediction.md.

    NUMBA_NUM_THREADS=1 python tools/predict_speed.py [--write]

Times are processor times of one thread: the least of three runs, without compilation.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path as FilePath

import numpy as np
import xarray as xr

import rockerbogie as rb

PAGE = FilePath(__file__).resolve().parents[1] / "docs" / "prediction.md"
FIRST, LAST = "<!-- speed -->", "<!-- end of speed -->"
HEADER = (
    "| rover | terrain | law | commands | step | ms per m | × real time at 4 cm/s | 10,000 rollouts of 20 m on 2 cores |\n"
    "|---|---|---|---|---|---|---|---|\n"
)
SPEED, LENGTH, DRIVES = 0.04, 20.0, 16


def row(rover: rb.Rover, ground: rb.Terrain, name: str, law: dict[str, object], constant: bool, step: float) -> str:
    """Return the row of one case."""
    rng = np.random.default_rng(0)
    x0, y0, x1, y1 = ground.bounds
    start = np.column_stack([rng.uniform(-2, 2, (DRIVES, 2)) + ((x0 + x1) / 2, (y0 + y1) / 2), rng.uniform(-3.1, 3.1, DRIVES)])
    commands: rb.Path | xr.Dataset = rb.Path.straight((0, 0), 0.0, LENGTH)
    if constant:
        rates = np.tile(SPEED / rover.wheel_radius, (2, 1))
        table = {"wheel_rate": (("time", "wheel"), rates), "steering": (("time", "wheel"), np.zeros((2, 6)))}
        commands = xr.Dataset(table, {"time": [0.0, LENGTH / SPEED]})
    best, driven = np.inf, 0.0
    for _ in range(4):
        began = time.process_time()
        run = rb.predict(rover, ground, start, commands, speed=SPEED, step=step, record=1.0, details=False, **law)  # type: ignore[arg-type]
        driven = float(run["distance"].max("time").sum())
        best = min(best, (time.process_time() - began) / driven)
    shown = f"friction {law['friction']}" if "friction" in law else str(law["soil"])
    return (
        f"| {rover.name} | {name} | {shown} | {'constant rates' if constant else 'path'} | {step:g} m | {1e3 * best:.2f} "
        f"| {1 / (best * SPEED):,.0f} | {best * LENGTH * 10_000 / 2:.0f} s |"
    )


def main() -> None:
    """Print the rows, and write them into the page if asked to."""
    mars = rb.surfaces.mars(1, size=100.0, spacing=1.0, k=0.0, smallest_crater=10.0, interpolation="cubic")
    linear = rb.Terrain.from_array(mars.z, mars.spacing, mars.origin, "linear")
    rocks = rb.surfaces.rocks(0.1, 1, size=60.0, spacing=0.05, largest=0.3)
    rovers = [rb.load_rover("perseverance"), rb.load_rover("osr")]
    rows = []
    for rover in rovers:
        for ground, name, step in ((linear, "1 m, bilinear", 0.25), (mars, "1 m, cubic", 0.25), (rocks, "rocks, 5 cm", 0.25)):
            for constant in (False, True):
                rows.append(row(rover, ground, name, {"friction": 0.8}, constant, step))
                print(rows[-1], flush=True)
    fine = 0.25 * float(rovers[0].wheel_radius.min())
    rows.append(row(rovers[0], rocks, "rocks, 5 cm", {"friction": 0.8}, True, round(fine, 4)))
    rows.append(row(rovers[0], linear, "1 m, bilinear", {"soil": "dry-sand", "gravity": rb.GRAVITY["mars"]}, False, 0.25))
    print(*rows[-2:], sep="\n")
    if "--write" in sys.argv:
        text = PAGE.read_text(encoding="utf-8")
        before, rest = text.split(FIRST)
        PAGE.write_text(
            before + FIRST + "\n\n" + HEADER + "\n".join(rows) + "\n\n" + LAST + rest.split(LAST)[1], encoding="utf-8"
        )


if __name__ == "__main__":
    main()
