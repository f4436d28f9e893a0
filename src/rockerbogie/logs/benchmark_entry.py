"""Predictions of another program that enter the benchmark, read from a CSV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError, unknown_name
from ..files.tables import Table, read_columns
from .validate import CHANNELS

#: Predictions are in the wrong unit if their cosine with the logged angles is above ALIKE, and the ratio of their sizes is
#: that of radian and degree within a factor MIXED; at least MIXED_COUNT angles must be predicted.
ALIKE, MIXED, MIXED_COUNT = 0.6, 2.0, 6
ENDS = ("low", "high")


def read_predictions(file: Path, cases: Sequence[str]) -> Array:
    """Read predicted pitch and roll, and the ends of their bands.

    Args:
        file: CSV in the form of `write_benchmark_template`.
        cases: names of the benchmark's cases.

    Returns:
        (3, cases, 2) rad: prediction, low and high end; NaN where there are none.

    Raises:
        RockerbogieError: a file that cannot be read or predicts no case; unknown or repeated cases; angles out of range.
    """
    table = read_columns(file)
    names, known = table.text("case"), {name: k for k, name in enumerate(cases)}
    values = np.full((3, len(known), len(CHANNELS)), np.nan)  # predicted, low, high
    read = [[_angles(table, f"{channel}{end}", required=not end) for channel in CHANNELS] for end in ("", "_low", "_high")]
    seen: dict[str, int] = {}
    for n, name in enumerate(names):
        if name not in known:
            raise RockerbogieError(f"{table.file}: row {table.lines[n]}: {unknown_name('case', name, known)}")
        if name in seen:
            raise RockerbogieError(f"{table.file}: rows {seen[name]} and {table.lines[n]} both predict {name}: leave one out")
        seen[name] = table.lines[n]
        if np.isnan(read[0][0][n]) != np.isnan(read[0][1][n]):
            raise RockerbogieError(
                f"{table.file}: row {table.lines[n]}: pitch or roll is missing: give both, or leave both empty"
            )
        values[:, known[name]] = [[column[n] for column in kind] for kind in read]
        low, high = values[1:, known[name]]
        if (np.isnan(low) != np.isnan(high)).any() or (low > high).any():
            raise RockerbogieError(
                f"{table.file}: row {table.lines[n]}: a band needs both ends, low <= high: correct them or leave both empty"
            )
    if not np.isfinite(values[0]).all(axis=1).any():
        raise RockerbogieError(f"{table.file} predicts no case: fill in pitch and roll")
    return values


def check_scale(file: str, predicted: Array, logged: Array) -> None:
    """Raise if predictions are proportional to logged angles by the ratio of radian and degree.

    Args:
        file: name, for the message.
        predicted, logged: (n, 2) rad; NaN where not predicted.

    Raises:
        RockerbogieError: they are.
    """
    known = np.isfinite(predicted).all(axis=1) & np.isfinite(logged).all(axis=1)
    p, q = predicted[known].ravel(), logged[known].ravel()
    if p.size < MIXED_COUNT or not min(np.abs(p).max(), np.abs(q).max()) > 0.0:
        return
    alike = (p @ q) / np.sqrt((p @ p) * (q @ q))
    ratio = np.sqrt((p @ p) / (q @ q))
    for factor, wrong, right in ((np.pi / 180.0, "deg", "rad"), (180.0 / np.pi, "rad", "deg")):
        if alike > ALIKE and abs(np.log(ratio / factor)) < np.log(MIXED):
            raise RockerbogieError(
                f"{file}: the angles are {ratio:.3g} times the logged ones: they are in {right}, but the header has [{wrong}]"
            )


def _angles(table: Table, name: str, *, required: bool) -> Array:
    """Return a column of angles, rad; NaN if it is missing and not required."""
    k = table.find(name)
    if k is None and not required:
        return np.full(len(table.lines), np.nan)
    if k is not None and not table.units[k]:
        raise RockerbogieError(f"{table.file}: column {name!r} has no unit: write {name} [deg] or {name} [rad] in the header")
    values = table.numbers(name)
    beyond = np.flatnonzero(np.abs(values) > np.pi / 2)
    if len(beyond):
        n = int(beyond[0])
        raise RockerbogieError(
            f"{table.file}: row {table.lines[n]}: {name} is {np.degrees(values[n]):.4g} deg, beyond 90 deg: check its unit"
        )
    return values
