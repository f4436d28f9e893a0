"""Verification of settled poses on rock fields and a Mars yard by the oracle.

    python tools/verify_settle.py [--poses 10000] [--mode contact] [--rover perseverance] [--ground k=20%]

Prints, for each rover on each terrain, the share settled, the counts of each status, and the worst gap by the oracle.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import rockerbogie as rb

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from support.verified import CHUNK, Equilibria, draw, grounds, verify_contact, verify_equilibrium

ROVERS = ("elhami-dashti", "perseverance", "rocky7")


def main() -> None:
    """Settle and verify poses of the chosen rovers and terrains; print a line for each pair."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--mode", choices=("contact", "equilibrium"), default="contact")
    parser.add_argument("--rover", choices=ROVERS, action="append")
    parser.add_argument("--ground", action="append", help="part of a terrain's name")
    given = parser.parse_args()
    for name, make in grounds().items():
        if given.ground and not any(part in name for part in given.ground):
            continue
        terrain = make()
        for which in given.rover or ROVERS:
            rover = rb.load_rover(which)
            place = draw(terrain, rover, given.poses, 1)
            began = time.perf_counter()
            pose = rb.settle(rover, terrain, *place, mode=given.mode)
            took = 1e6 * (time.perf_counter() - began) / given.poses
            counts = np.bincount(pose.status, minlength=len(rb.Status))
            codes = ", ".join(f"{n} {rb.Status(k).name}" for k, n in enumerate(counts) if n)
            if given.mode == "contact":
                found = verify_contact(pose)
                settled, said = len(found.gap), f"worst gap {found.worst:.2e} m, {found.failed} wrong"
            else:
                parts = [verify_part(pose, slice(k, k + CHUNK)) for k in range(0, given.poses, CHUNK)]
                settled, wrong = np.isfinite(pose.z).sum(), [line for part in parts for line in part.wrong]
                said = f"deepest {min(part.deepest for part in parts):.2e} m, {len(wrong)} wrong {wrong[:3]}"
            share = 100 * settled / (counts.sum() - counts[rb.Status.NO_DATA])
            print(f"{name:20} {which:14} {share:7.3f} % settled, {said}, {took:.1f} µs per pose: {codes}", flush=True)


def verify_part(pose: rb.Pose, part: slice) -> Equilibria:
    """Verify some poses of a batch."""
    fields = {name: getattr(pose, name)[part] for name in ("x", "y", "yaw", "steering", "q", "status", "report")}
    return verify_equilibrium(replace(pose, **fields), tries=12)


if __name__ == "__main__":
    main()
