"""Certification of settled poses on terrain as sharp as its grid allows.

    python tools/verify_sharp.py [--poses 1000000] [--seed 0] [--mode contact] [--interpolation cubic] [--json out.json]
    python tools/verify_sharp.py --table docs/settling.md run1.json run2.json ...

The first form prints, for each family of terrain (sharp_grounds.py) and interpolation, the number of poses with a result and
the number of these with each fault:

    deep       a tread point is more than 1e-6 m below the terrain
    far        a wheel in contact has a gap above 1e-6 m
    gap        `pose.gap` is more than 1e-8 m outside its certified bracket
    clearance  `pose.clearance` is more than 1e-8 m outside its certified bracket
    belly      equilibrium: the box is more than 1e-6 m below the terrain, or above it by more at BELLY_CONTACT
    lifted     equilibrium: a wheel reported as lifted is in contact
    no data    NO_DATA although the pose of the filled map is valid on the map with missing data
    count      `pose.contact_count` differs from the count by dense sampling (checked for a part of the poses)

Progress lines state the next seed; --seed continues from it. The JSON file is written at each progress line. The worst pose
of each fault is printed as Python. The second form adds runs and writes their table into a page, between the lines
`<!-- sharp -->` and `<!-- end of sharp -->`.
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

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from support.certified import FAULTS, LENGTHS, judge
from support.sharp_grounds import FAMILIES, draw_case

GAPPY = 4  # 1 terrain of this number has missing data
MARKS = ("<!-- sharp -->", "<!-- end of sharp -->")
SNIPPET = """\
import rockerbogie as rb
from support.sharp_grounds import draw_case  # tests/
case = draw_case({seed}, {family!r}, {interpolation!r}, {count}, missing={missing})
k = {k}
pose = rb.settle(case.rover, case.terrain, case.x[k], case.y[k], case.yaw[k], steering=case.steering[k], mode={mode!r})
"""


@dataclass
class Worst:
    """The worst pose of a fault: its error, and Python code that reproduces it."""

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
    counted: int = 0  # poses whose contacts were counted
    wrong: dict[str, int] = field(default_factory=lambda: dict.fromkeys(FAULTS, 0))
    largest: dict[str, float] = field(default_factory=lambda: dict.fromkeys(LENGTHS, 0.0))  # m, wrong or not
    worst: dict[str, Worst] = field(default_factory=dict)


def verify_case(
    row: Row, seed: int, family: str, interpolation: str, count: int, missing: bool, mode: str, counted: int, truth: str
) -> None:
    """Settle the poses of one terrain, certify them, and add their faults to a row."""
    case = draw_case(seed, family, interpolation, count, missing)  # type: ignore[arg-type]
    pose, verdict = judge(case, mode, counted, truth)
    row.poses += count
    row.given += int(verdict.given.sum())
    row.unproved += verdict.unproved
    row.counted += min(counted, int(verdict.given.sum()))
    row.largest = {name: max(row.largest[name], verdict.worst[name]) for name in LENGTHS}
    for code, n in zip(*np.unique(pose.status, return_counts=True), strict=True):
        name = rb.Status(int(code)).name
        row.status[name] = row.status.get(name, 0) + int(n)
    for fault, bad in verdict.bad.items():
        row.wrong[fault] += int((bad > 0).sum())
        k = int(bad.argmax())
        if bad[k] > 0 and (fault not in row.worst or bad[k] > row.worst[fault].value):
            snippet = SNIPPET.format(
                seed=seed, family=family, interpolation=interpolation, count=count, missing=missing, k=k, mode=mode
            )
            if fault not in row.worst:
                at = f"draw_case({seed}, {family!r}, {interpolation!r}, {count}, missing={missing}), k = {k}"
                print(f"{fault} {bad[k]:.3g}, {mode}: {at}", file=sys.stderr, flush=True)
            row.worst[fault] = Worst(float(bad[k]), snippet, rb.Status(int(pose.status[k])).name, case.rover.name)


def table(rows: dict[tuple[str, str], Row]) -> str:
    """Return the counts as text."""
    lines = [f"{'terrain':14}{'kind':8}{'poses':>9}{'given':>9}{'share':>8}{'open':>6}" + "".join(f"{f:>11}" for f in FAULTS)]
    for (family, kind), row in rows.items():
        share = f"{100 * row.given / max(row.poses, 1):.1f}%"
        wrong = "".join(f"{row.wrong[f]:11}" for f in FAULTS)
        lines.append(f"{family:14}{kind:8}{row.poses:9}{row.given:9}{share:>8}{row.unproved:6}{wrong}")
    return "\n".join(lines)


def save(path: Path, rows: dict[tuple[str, str], Row], given: argparse.Namespace, seed: int) -> None:
    """Write a run's rows, mode, batch and seeds (first, one past the last) as JSON."""
    run = {"mode": given.mode, "batch": given.batch, "seeds": [given.seed, seed], "truth": given.truth}
    path.write_text(json.dumps(run | {"rows": {" ".join(key): asdict(row) for key, row in rows.items()}}, indent=1))


def summary(files: list[Path]) -> str:
    """Return a Markdown table of runs, by mode and interpolation, and their commands."""
    runs = [json.loads(path.read_text()) for path in files]
    head = ["mode", "interpolation", "poses", "given", "brackets open", *FAULTS, *(f"largest {name}, m" for name in LENGTHS)]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for mode in ("contact", "equilibrium"):
        for kind in ("cubic", "linear"):
            rows = [row for run in runs if run["mode"] == mode for key, row in run["rows"].items() if key.endswith(f" {kind}")]
            if not sum(row["poses"] for row in rows):
                continue
            poses, given, unproved, counted = (
                sum(row[name] for row in rows) for name in ("poses", "given", "unproved", "counted")
            )
            wrong = {fault: str(sum(row["wrong"][fault] for row in rows)) for fault in FAULTS}
            wrong["count"] += f" of {counted:,}"
            if mode == "contact":
                wrong["belly"] = wrong["lifted"] = "–"
            largest = [f"{max(row['largest'][name] for row in rows):.1e}" for name in LENGTHS]
            cells = [mode, kind, f"{poses:,}", f"{given:,}", str(unproved), *wrong.values(), *largest]
            lines.append("| " + " | ".join(cells) + " |")
    commands = [
        f"`python tools/verify_sharp.py --mode {run['mode']} --batch {run['batch']} --seed {run['seeds'][0]}` to seed "
        f"{run['seeds'][1] - 1}"
        for run in runs
    ]
    return "\n".join([*lines, "", "Runs: " + "; ".join(commands) + "."])


def write_table(page: Path, files: list[Path]) -> None:
    """Write the summary of runs into a page, between its markers."""
    before, rest = page.read_text().split(MARKS[0], 1)
    _, after = rest.split(MARKS[1], 1)
    page.write_text(f"{before}{MARKS[0]}\n{summary(files)}\n{MARKS[1]}{after}")


def main() -> int:
    """Run the draws and print the table; exit status 1 if any pose is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0, help="first seed; each seed is one terrain of every family")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after the first seed that ends later than this")
    parser.add_argument("--batch", type=int, default=250, help="poses per terrain")
    parser.add_argument("--counted", type=int, default=1, help="poses per terrain whose contacts are counted by sampling")
    parser.add_argument("--mode", choices=("contact", "equilibrium"), default="contact")
    parser.add_argument("--interpolation", choices=("cubic", "linear"), action="append")
    parser.add_argument("--family", choices=FAMILIES, action="append")
    default = "verify" if hasattr(rb, "verify") else "oracle"
    parser.add_argument("--truth", choices=("verify", "oracle"), default=default, help="method that brackets gaps and clearance")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--table", type=Path, nargs="+", help="a page, and JSON files of runs to write into it as a table")
    given = parser.parse_args()
    if given.table:
        write_table(given.table[0], given.table[1:])
        return 0
    kinds, families = given.interpolation or ["cubic", "linear"], given.family or FAMILIES
    rows = {(family, kind): Row() for family in families for kind in kinds}
    seed, began, reported = given.seed, time.perf_counter(), time.perf_counter()
    while sum(row.poses for row in rows.values()) < given.poses and time.perf_counter() - began < given.seconds:
        for (family, kind), row in rows.items():
            verify_case(
                row,
                seed,
                family,
                kind,
                given.batch,
                seed % GAPPY == GAPPY - 1,
                given.mode,
                given.counted,
                given.truth,
            )
        seed += 1
        if time.perf_counter() - reported > 20:
            reported = time.perf_counter()
            done = sum(row.poses for row in rows.values())
            wrong = {f: n for f in FAULTS if (n := sum(row.wrong[f] for row in rows.values()))}
            progress = f"{reported - began:7.0f} s  {done:9} poses, next seed {seed}, wrong: {wrong or 'none'}"
            print(progress, file=sys.stderr, flush=True)
            if given.json:
                save(given.json, rows, given, seed)
    print(table(rows))
    took = time.perf_counter() - began
    print(f"mode {given.mode}, seeds {given.seed}..{seed - 1}, batch {given.batch}, {took:.0f} s, brackets by {given.truth}")
    for fault in FAULTS:
        found = [(row.worst[fault].value, key, row.worst[fault]) for key, row in rows.items() if fault in row.worst]
        if found:
            value, key, worst = max(found, key=lambda one: one[0])
            print(f"\nworst {fault}: {value:.3g} on {' '.join(key)}, {worst.rover}, {worst.status}\n{worst.snippet}")
    if given.json:
        save(given.json, rows, given, seed)
    return int(any(n for row in rows.values() for n in row.wrong.values()))


if __name__ == "__main__":
    sys.exit(main())
