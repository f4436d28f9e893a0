"""Tables of numbers in CSV files, with columns `name [unit]`."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import RockerbogieError

Array = NDArray[np.float64]

#: Column head: name and unit, as in `wheel_rate_LF [rad/s]`; with no unit, SI and radians.
HEAD = re.compile(r"^\s*(.+?)\s*(?:\[\s*([^\]]*?)\s*\])?\s*$")
SCALES = {"deg": np.pi / 180, "deg/s": np.pi / 180, "rpm": np.pi / 30, "mm": 1e-3, "cm": 1e-2, "ms": 1e-3, "ns": 1e-9}
PLAIN = ("", "s", "m", "rad", "m/s", "rad/s", "1")


def read_columns(path: Path) -> dict[str, Array]:
    """Columns of a CSV file by their names, in SI: `name [unit]` at the head, or no unit.

    Raises:
        RockerbogieError: not CSV, no rows, a unit not known, or something that is no number.
    """
    try:
        with open(path, newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise RockerbogieError(f"{path.name} cannot be read as CSV: {error}") from None
    if len(rows) < 2:
        raise RockerbogieError(f"{path.name} holds no rows of numbers")
    columns = {}
    for k, head in enumerate(rows[0]):
        found = HEAD.match(head)
        if found is None:
            continue
        name, unit = found[1], found[2] or ""
        if unit not in SCALES and unit not in PLAIN:
            raise RockerbogieError(f"{path.name}: column {name!r} is in {unit!r}; known are {', '.join((*PLAIN[1:], *SCALES))}")
        values = np.empty(len(rows) - 1)
        for n, row in enumerate(rows[1:]):
            text = row[k].strip() if k < len(row) else ""
            try:
                values[n] = float(text) if text else np.nan
            except ValueError:
                raise RockerbogieError(f"{path.name}: row {n + 2}, column {name!r} holds {text!r}, which is no number") from None
        columns[name] = values * SCALES.get(unit, 1.0)
    return columns
