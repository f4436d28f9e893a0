"""Time maps of 16 headings at 1 m with Curiosity, in seconds per km².

    python tools/time_map.py [--raster dem.tif] [--side 220]

The usual layers are made, then the three layers of forces. Without a raster, the terrain is `surfaces.fractal(2)`. Of a raster,
the middle is taken, by bilinear interpolation.
"""

from __future__ import annotations

import argparse
import time

import rockerbogie as rb

FORCES = ("required_friction", "tip_margin", "max_torque")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--raster")
    parser.add_argument("--side", type=float, default=220.0, help="side of the square, m")
    given = parser.parse_args()
    rover, half = rb.load_rover("curiosity"), given.side / 2
    if given.raster:
        terrain = rb.Terrain.from_raster(given.raster, interpolation="linear")
    else:
        terrain = rb.surfaces.fractal(2, size=given.side, spacing=1.0, interpolation="linear")
    west, south, east, north = terrain.bounds
    x, y = (west + east) / 2, (south + north) / 2
    for name, layers in (("usual layers", None), ("layers of forces", FORCES)):
        rb.traversability(rover, terrain, 16, 1.0, bounds=(x - 5, y - 5, x + 5, y + 5), layers=layers)  # loads the kernels
        began = time.perf_counter()
        made = rb.traversability(rover, terrain, 16, 1.0, bounds=(x - half, y - half, x + half, y + half), layers=layers)
        took = time.perf_counter() - began
        cells = made.sizes["x"] * made.sizes["y"]
        print(f"{name}: {16 * cells} poses in {took:.1f} s, {took / cells * 1e6:.0f} s per km²")


if __name__ == "__main__":
    main()
