"""Settled poses on grounds as sharp as the grid allows, each certified over the whole of every tread.

    python tests/prove_sharp.py [--poses 1000000] [--seed 0] [--mode contact] [--interpolation cubic] [--json out.json]

For each family of grounds (sharp_grounds.py) and interpolation, prints how many poses were given and how many of these are
wrong, by fault:

    deep       a tread point is deeper than 1e-6 m in the ground
    far        a wheel that touches is further than 1e-6 m from the ground
    gap        `pose.gap` is more than 1e-8 m outside its certified bracket
    clearance  `pose.clearance` is
    belly      equilibrium: the box is deeper than 1e-6 m in the ground, or BELLY_CONTACT and further from it
    lifted     equilibrium: a wheel that is marked as lifted touches
    no data    NO_DATA although the pose of the filled map is good on the map with missing data
    count      `pose.contact_count` differs from the contacts counted by dense sampling (a sample of poses)

Progress lines state the seed reached: continue from it with --seed. The worst pose of each fault is printed as Python.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

import rockerbogie as rb
from support.certified import FAULTS, judge
from support.sharp_grounds import FAMILIES, draw_case

HOLED = 4  # one terrain in so many has missing data
SNIPPET = """\
import rockerbogie as rb
from support.sharp_grounds import draw_case  # tests/
case = draw_case({seed}, {family!r}, {interpolation!r}, {count}, holes={holes})
k = {k}
pose = rb.settle(case.rover, case.terrain, case.x[k], case.y[k], case.yaw[k], steering=case.steering[k], mode={mode!r})
"""


@dataclass
class Worst:
    """The worst pose of a fault: how bad, and what reproduces it."""

    value: float
    snippet: str
    status: str
    rover: str


@dataclass
class Row:
    """Counts of one family, interpolation and mode."""

    poses: int = 0
    given: int = 0
    unproved: int = 0
    status: dict[str, int] = field(default_factory=dict)
    wrong: dict[str, int] = field(default_factory=lambda: dict.fromkeys(FAULTS, 0))
    worst: dict[str, Worst] = field(default_factory=dict)


def prove_case(
    row: Row, seed: int, family: str, interpolation: str, count: int, holes: bool, mode: str, counted: int, truth: str
) -> None:
    """Settle one terrain's poses, certify them and add what is wrong to a row."""
    case = draw_case(seed, family, interpolation, count, holes)  # type: ignore[arg-type]
    pose, verdict = judge(case, mode, counted, truth)
    row.poses += count
    row.given += int(verdict.given.sum())
    row.unproved += verdict.unproved
    for code, n in zip(*np.unique(pose.status, return_counts=True), strict=True):
        name = rb.Status(int(code)).name
        row.status[name] = row.status.get(name, 0) + int(n)
    for fault, bad in verdict.bad.items():
        row.wrong[fault] += int((bad > 0).sum())
        k = int(bad.argmax())
        if bad[k] > 0 and (fault not in row.worst or bad[k] > row.worst[fault].value):
            snippet = SNIPPET.format(
                seed=seed, family=family, interpolation=interpolation, count=count, holes=holes, k=k, mode=mode
            )
            if fault not in row.worst:
                at = f"draw_case({seed}, {family!r}, {interpolation!r}, {count}, holes={holes}), k = {k}"
                print(f"{fault} {bad[k]:.3g}, {mode}: {at}", file=sys.stderr, flush=True)
            row.worst[fault] = Worst(float(bad[k]), snippet, rb.Status(int(pose.status[k])).name, case.rover.name)


def table(rows: dict[tuple[str, str], Row]) -> str:
    """Return the counts as text."""
    lines = [f"{'ground':14}{'kind':8}{'poses':>9}{'given':>9}{'share':>8}{'open':>6}" + "".join(f"{f:>11}" for f in FAULTS)]
    for (family, kind), row in rows.items():
        share = f"{100 * row.given / max(row.poses, 1):.1f}%"
        wrong = "".join(f"{row.wrong[f]:11}" for f in FAULTS)
        lines.append(f"{family:14}{kind:8}{row.poses:9}{row.given:9}{share:>8}{row.unproved:6}{wrong}")
    return "\n".join(lines)


def main() -> int:
    """Run the draws and print the table; exit status 1 if any pose is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0, help="first seed; each seed is one terrain of every family")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after the seed at which this time is up")
    parser.add_argument("--batch", type=int, default=250, help="poses a terrain")
    parser.add_argument("--counted", type=int, default=1, help="poses a terrain whose contacts are counted by sampling")
    parser.add_argument("--mode", choices=("contact", "equilibrium"), default="contact")
    parser.add_argument("--interpolation", choices=("cubic", "linear"), action="append")
    parser.add_argument("--family", choices=FAMILIES, action="append")
    default = "verify" if hasattr(rb, "verify") else "oracle"
    parser.add_argument("--truth", choices=("verify", "oracle"), default=default, help="what brackets gaps and clearance")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    kinds, families = given.interpolation or ["cubic", "linear"], given.family or FAMILIES
    rows = {(family, kind): Row() for family in families for kind in kinds}
    seed, began, told = given.seed, time.perf_counter(), time.perf_counter()
    while sum(row.poses for row in rows.values()) < given.poses and time.perf_counter() - began < given.seconds:
        for (family, kind), row in rows.items():
            prove_case(row, seed, family, kind, given.batch, seed % HOLED == HOLED - 1, given.mode, given.counted, given.truth)
        seed += 1
        if time.perf_counter() - told > 20:
            told = time.perf_counter()
            done = sum(row.poses for row in rows.values())
            wrong = {f: n for f in FAULTS if (n := sum(row.wrong[f] for row in rows.values()))}
            print(
                f"{told - began:7.0f} s  {done:9} poses, next seed {seed}, wrong: {wrong or 'none'}", file=sys.stderr, flush=True
            )
    print(table(rows))
    took = time.perf_counter() - began
    print(f"mode {given.mode}, seeds {given.seed}..{seed - 1}, batch {given.batch}, {took:.0f} s, brackets by {given.truth}")
    for fault in FAULTS:
        found = [(row.worst[fault].value, key, row.worst[fault]) for key, row in rows.items() if fault in row.worst]
        if found:
            value, key, worst = max(found, key=lambda one: one[0])
            print(f"\nworst {fault}: {value:.3g} on {' '.join(key)}, {worst.rover}, {worst.status}\n{worst.snippet}")
    if given.json:
        given.json.write_text(json.dumps({" ".join(key): asdict(row) for key, row in rows.items()}, indent=1))
    return int(any(n for row in rows.values() for n in row.wrong.values()))


if __name__ == "__main__":
    sys.exit(main())
