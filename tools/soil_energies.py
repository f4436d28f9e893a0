"""Write the table of energies of drives on soil over rough terrain in docs/prediction.md.

python tools/soil_energies.py [--write]
"""

from __future__ import annotations

import sys
from pathlib import Path as FilePath

import numpy as np
import xarray as xr

import rockerbogie as rb

PAGE = FilePath(__file__).resolve().parents[1] / "docs" / "prediction.md"
FIRST, LAST = "<!-- energies -->", "<!-- end of energies -->"
HEADER = (
    "| terrain | rover | driven (m) | end | error | error by default | apart at the end (m) |\n|---|---|---|---|---|---|---|\n"
)
TOLERANCE, SPEED, LENGTHS = 1e-5, 0.04, 6.0  # LENGTHS: of the path, in wheelbases


def missing(run: xr.Dataset) -> float:
    """Return the largest error of the energy balance along a drive, over the motors' work."""
    error = abs(run["motor_work"] - run["dissipation"] - run["height_gain"]).max()
    return float(error / run["motor_work"].max())


def row(name: str, terrain: rb.Terrain, rover: rb.Rover) -> str:
    """Return the row of one drive."""
    far = LENGTHS * rover.wheelbase
    path = rb.Path.straight((-far / 2, 0), 0.0, far)
    fine = rb.predict(rover, terrain, None, path, soil="dry-sand", speed=SPEED, tolerance=TOLERANCE, details=False)
    coarse = rb.predict(rover, terrain, None, path, soil="dry-sand", speed=SPEED, details=False)
    last = min(fine.sizes["time"], coarse.sizes["time"]) - 1
    apart = np.hypot(float(fine["x"][last] - coarse["x"][last]), float(fine["y"][last] - coarse["y"][last]))
    return (
        f"| {name} | {rover.name} | {float(fine['distance'][-1]):.2f} | {fine.attrs['end']} | {missing(fine):.0e} "
        f"| {missing(coarse):.0e} | {apart:.2f} |\n"
    )


def main() -> None:
    """Print the table; with --write, replace that of the page."""
    terrains = {
        "`fractal(3)`": rb.surfaces.fractal(3),
        "`mars(1)`": rb.surfaces.mars(1),
        "`rough(3, size=45.0)`": rb.surfaces.rough(3, size=45.0),
        "`rocks(0.05, 1, size=45.0)`": rb.surfaces.rocks(0.05, 1, size=45.0),
        "`rocks(0.2, 1, size=45.0)`": rb.surfaces.rocks(0.2, 1, size=45.0),
    }
    table = HEADER
    for name, terrain in terrains.items():
        for rover in ("curiosity", "perseverance"):
            table += row(name, terrain, rb.load_rover(rover))
            print(table.splitlines()[-1], flush=True)
    if "--write" in sys.argv:
        text = PAGE.read_text(encoding="utf-8")
        before, rest = text.split(FIRST)
        PAGE.write_text(f"{before}{FIRST}\n\n{table}\n{LAST}{rest.split(LAST)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()
