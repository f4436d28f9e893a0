"""Equilibria of three rovers against MuJoCo: on solids, on fields, and with close joint limits.

python tests/prove_rest.py [poses] [rover ...]
"""

from __future__ import annotations

import sys

import numpy as np

from support.rest_cases import compare, field, load, solids, stiff


def main(poses: int, rovers: list[str]) -> None:
    for name, size in (("elhami-dashti", 8.0), ("rocky7", 6.0), ("perseverance", 16.0)):
        if rovers and name not in rovers:
            continue
        rover = load(name)
        for label, ground, car in (
            ("solids", solids(size, 1), rover),
            ("field", field(2 * size, 1), rover),
            ("close stops", field(2 * size, 2), stiff(rover)),
        ):
            a = compare(car, ground, poses, seed=5)
            rms = np.degrees(np.sqrt((a.angles**2).mean(axis=0)))
            left = poses - len(a.z) - a.marginal
            shares = (
                f"alike {a.share:7.2%} of {poses}, else {a.marginal} marginal, {left} not; a rest of both {a.share_of_rests:7.2%}"
            )
            kinds = f"{a.lifted} with a wheel off the ground, {a.stopped} on a stop"
            angles = "roll {:.4f} pitch {:.4f} rocker {:.4f} bogies {:.4f} {:.4f} deg".format(*rms)
            z = 1e3 * np.sqrt((a.z**2).mean())
            print(f"{name:14s} {label:12s} {shares} ({kinds})  RMS {angles}, z {z:.3f} mm", flush=True)
            for line in a.unlike:
                print("   ", line, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300, sys.argv[2:])
