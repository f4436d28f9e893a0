"""Predictions of another program that enter the benchmark, read from a CSV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError, unknown_name
from ..files.tables import Table, read_columns
from .validate import CHANNELS

#: Predictions are in the wrong unit if their cosine with the logged angles is above ALIKE, and the ratio of their sizes is
#: that of radian and degree within a factor MIXED; at least MIXED_COUNT angles must be predicted.
ALIKE, MIXED, MIXED_COUNT = 0.6, 2.0, 6
#: A row is for another pose if it differs by more from its case, m and rad.
MOVED, TURNED = 0.05, np.radians(0.5)
ENDS = ("low", "high")


def read_predictions(file: Path, cases: Mapping[str, tuple[float, float, float]]) -> Array:
    """Read predicted pitch and roll, and the ends of their bands.

    Args:
        file: CSV in the form of `write_benchmark_template`.
        cases: x, y (m) and yaw (rad) of the benchmark's cases, by name.

    Returns:
        (3, cases, 2) rad: prediction, low and high end; NaN where there are none.

    Raises:
        RockerbogieError: a file that cannot be read or predicts no case; unknown or repeated cases; x, y or
            yaw of another pose than the case's; angles out of range.
    """
    table = read_columns(file)
    names, known = table.text("case"), {name: k for k, name in enumerate(cases)}
    values = np.full((3, len(known), len(CHANNELS)), np.nan)  # predicted, low, high
    poses = _poses(table)
    read = [[_angles(table, f"{channel}{end}", required=not end) for channel in CHANNELS] for end in ("", "_low", "_high")]
    seen: dict[str, int] = {}
    for n, name in enumerate(names):
        if name not in known:
            raise RockerbogieError(f"{table.file}: row {table.lines[n]}: {unknown_name('case', name, known)}")
        if name in seen:
            raise RockerbogieError(f"{table.file}: rows {seen[name]} and {table.lines[n]} both predict {name}: leave one out")
        seen[name] = table.lines[n]
        _check_pose(f"{table.file}: row {table.lines[n]}", poses[n], name, cases[name])
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


def _poses(table: Table) -> Array:
    """Return x, y (m) and yaw (rad) of each row, (n, 3); NaN where they are not given."""
    poses = np.full((len(table.lines), 3), np.nan)
    for c, (name, unit) in enumerate((("x", "m"), ("y", "m"), ("yaw", "deg"))):
        k = table.find(name)
        if k is not None:
            poses[:, c] = table.numbers(name, table.units[k] or unit)
    return poses


def _check_pose(row: str, pose: Array, name: str, case: tuple[float, float, float]) -> None:
    """Raise if a row is for another pose than its case.

    Args:
        row: file and row, for the message.
        pose: (3,) x, y (m), yaw (rad) of the row; NaN where not given.
        name: name of the case.
        case: x, y (m), yaw (rad) of the case.
    """
    x, y, yaw = pose - np.array(case)
    turn = (yaw + np.pi) % (2.0 * np.pi) - np.pi
    for what, off, most, there in (
        ("x", x, MOVED, f"{case[0]:.3f} m"),
        ("y", y, MOVED, f"{case[1]:.3f} m"),
        ("yaw", turn, TURNED, f"{np.degrees(case[2]):.4g} deg"),
    ):
        if abs(off) > most:
            amount = f"{np.degrees(off):+.4g} deg" if what == "yaw" else f"{off:+.4g} m"
            raise RockerbogieError(
                f"{row}: {what} differs by {amount} from that of {name}, {there}: predict the pose of --write-template, "
                f"or leave out the column {what} if it has another meaning"
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
