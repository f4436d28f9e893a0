"""Comparison of equilibria of three rovers with MuJoCo.

    python tools/compare_equilibria.py [poses] [rover ...]

Terrains are solid shapes, fields of rocks, and fields of rocks for a rover with close joint limits. Prints the shares of
alike, marginal and other poses, RMS differences of the alike ones, and a line for each pose that differs.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from support.rest_cases import compare, field, load, solids, stiff


def main(poses: int, rovers: list[str]) -> None:
    """Compare poses of the named rovers (all if empty) on each terrain and print the results."""
    for name, size in (("elhami-dashti", 8.0), ("rocky7", 6.0), ("perseverance", 16.0)):
        if rovers and name not in rovers:
            continue
        rover = load(name)
        for label, ground, car in (
            ("solids", solids(size, 1), rover),
            ("field", field(2 * size, 1), rover),
            ("close limits", field(2 * size, 2), stiff(rover)),
        ):
            a = compare(car, ground, poses, seed=5)
            rms = np.degrees(np.sqrt((a.angles**2).mean(axis=0)))
            left = poses - len(a.z) - a.marginal
            shares = (
                f"alike {a.share:7.2%} of {poses}, else {a.marginal} marginal, {left} not; "
                f"equilibria of both {a.share_of_equilibria:7.2%}"
            )
            kinds = f"{a.lifted} with a wheel off the ground, {a.stopped} with a joint at its limit"
            angles = "roll {:.4f} pitch {:.4f} rocker {:.4f} bogies {:.4f} {:.4f} deg".format(*rms)
            z = 1e3 * np.sqrt((a.z**2).mean())
            print(f"{name:14s} {label:12s} {shares} ({kinds})  RMS {angles}, z {z:.3f} mm", flush=True)
            for line in a.unlike:
                print("   ", line, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300, sys.argv[2:])
