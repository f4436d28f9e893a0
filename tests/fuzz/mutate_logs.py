"""Spoil logs and compare odometry with the lap they record.

`python tests/fuzz/mutate_logs.py 200 [seed]` spoils 200.
Each spoilt log must be refused, give the lap, or give a warning or a note. It must not crash or take long.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import rockerbogie as rb
from support.lap import NAMES, RADIUS, ROVER, SPEED, Lap

LONGEST = 20.0  # s
TOLERANCE = 0.02 * 2 * np.pi * RADIUS / 4  # m, at the end of a quarter of the lap
CELLS = ("", "nan", "inf", "abc", "1e308", "-1", "0", "1,5", "1000", "1e-320")


def lines_of(lap: Lap) -> list[list[str]]:
    """Return a log as cells, header first."""
    steered = [k for k in range(6) if ROVER.steers[k]]
    header = ["time [s]", *[f"wheel_angle_{w} [rad]" for w in NAMES], *[f"steering_{NAMES[k]} [rad]" for k in steered]]
    rows = [[repr(float(v)) for v in (t, *a, *lap.steering[steered])] for t, a in zip(lap.t, lap.angle, strict=True)]
    return [header, *rows]


def spoil(cells: list[list[str]], rng: random.Random) -> str:
    """Return a spoilt copy as text."""
    cells = [row.copy() for row in cells]
    row, column = rng.randrange(1, len(cells)), rng.randrange(len(cells[0]))
    way = rng.randrange(9)
    if way == 0:
        cells[row][column] = rng.choice(CELLS)
    elif way == 1:
        cells[row][column] = repr(float(cells[row][column]) * rng.choice((-1.0, 57.3, 1000.0, 0.001)))
    elif way == 2:
        factor = rng.choice((-1.0, 57.3, 1000.0, 0.001))
        for one in cells[1:]:
            one[column] = repr(float(one[column]) * factor)
    elif way == 3:
        del cells[row : row + rng.choice((1, 3, 40))]
    elif way == 4:
        cells.insert(rng.randrange(1, len(cells)), cells[row])
    elif way == 5:
        cells[0][column] = rng.choice(
            ("", "x", cells[0][column - 1], cells[0][column].upper(), cells[0][column].replace("[", "[m"))
        )
    elif way == 6:
        for one in cells:
            del one[column]
    text = "\n".join(",".join(one) for one in cells) + "\n"
    if way == 7:
        text = text[: rng.randrange(len(text))]
    if way == 8:
        at = rng.randrange(len(text))
        text = text[:at] + rng.choice(("\0", '"', "\n", ";", ",", "é", "#")) + text[at + rng.choice((0, 1, 5)) :]
    return text


def run(count: int, seed: int = 0) -> Counter[str]:
    """Spoil and read `count` logs; return how many were refused, right, or wrong with a remark."""
    rng, lap = random.Random(seed), Lap(hz=5.0, laps=0.25)
    cells, tally = lines_of(lap), Counter[str]()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = Path(folder) / "log.csv"
        for k in range(count):
            text = spoil(cells, rng)
            file.write_text(text, encoding="utf-8")
            start = time.perf_counter()
            try:
                log = rb.read_log(file, ROVER)
                track = rb.odometry(ROVER, None, log)
            except rb.RockerbogieError:
                tally["refused"] += 1
                continue
            finally:
                assert time.perf_counter() - start < LONGEST, f"seed {seed}, file {k} took too long"
            turned = SPEED / RADIUS * float(log["time"][-1] - log["time"][0])
            end = np.array([np.sin(turned), 1 - np.cos(turned)]) * RADIUS
            off = float(np.hypot(float(track["x"][-1]) - end[0], float(track["y"][-1]) - end[1]))
            remark = log.attrs["warnings"] or track.attrs["warnings"] or log.attrs["notes"]
            right = off < TOLERANCE
            tally["right" if right else "wrong, with a remark" if remark else "wrong, silent"] += 1
            if not right and not remark:
                print(
                    f"seed {seed}, file {k}: off by {off:.3f} m",
                    next((a for a, b in zip(text.splitlines(), map(",".join, cells), strict=False) if a != b), "")[:200],
                )
    return tally


if __name__ == "__main__":
    print(dict(run(int(sys.argv[1]) if len(sys.argv) > 1 else 200, int(sys.argv[2]) if len(sys.argv) > 2 else 0)))
