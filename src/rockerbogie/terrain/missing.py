"""Search of stored values for undeclared missing data, and for heights in steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import TerrainError

Array = NDArray[np.float64]

HUGE = 1e20  # stored values from here on are never heights: ISIS NULL -3.4e38, netCDF 9.97e36, Surfer 1.7e38, 1e20
#: Heights of one file span less than this, m: Mars spans 30 km from Hellas to Olympus Mons.
MOST_RELIEF = 100e3
#: Values that files store for missing data. ISIS uses the lowest 17 values of 16 bits.
NAMED = frozenset(
    {sign * value for value in (999.0, 9999.0, 99999.0, 999999.0, 9999999.0, 9999.9, 32767.0, 2147483647.0) for sign in (-1, 1)}
    | {float(-32768 + k) for k in range(17)}
    | {-10000.0, -100000.0, -1e6, 65535.0, -2147483648.0, 4294967295.0, -1e10, 1e10}
)
NEAR = 0.01  # relative: a value of `NAMED` is a height if another height is closer to it than this
ALONE = (10.0, 2.0)  # m, and multiple of the range of all other heights: an extreme value further from them is no height
CLIFF = 2.0  # m/m: a steeper slope between a value and its neighbours is not terrain
KEPT = 8  # number of extreme values that are compared
SAMPLE = 50_000  # number of values in which steps are searched
STEP_NOTE = math.radians(0.5)  # rad: steps that are steeper than this between neighbouring cells cause a warning


@dataclass
class Screening:
    """Search for undeclared missing data and for steps, in one pass over a file's stored values."""

    name: str  # of the file, for messages
    spacing: tuple[float, float]  # m, between the file's columns and between its rows
    scale: float  # heights are scale · stored + offset, m
    offset: float
    lowest: set[float] = field(default_factory=set)  # the `KEPT` lowest stored values so far
    highest: set[float] = field(default_factory=set)
    huge: set[float] = field(default_factory=set)
    borders: dict[float, list[int]] = field(default_factory=dict)  # value -> [pixels, borders, steep borders]
    rows: list[NDArray[Any]] = field(default_factory=list)  # sample for steps
    sampled: int = 0

    def add(self, raw: Any) -> None:
        """Add the next rows to the search.

        Args:
            raw: (rows, cols) masked array of stored values.
        """
        values = np.asarray(raw.data)
        known = ~np.ma.getmaskarray(raw)
        if values.dtype.kind == "f":
            with np.errstate(invalid="ignore"):
                large = known & ~(np.abs(values) < HUGE)
            if large.any():
                strange = values[large]
                self.huge |= {float(v) for v in np.unique(strange[~np.isnan(strange)])[:KEPT]}
                known &= ~large
        found = values if known.all() else values[known]
        if found.size == 0:
            return
        low, high = self._extremes(found, 1), self._extremes(found, -1)
        self.lowest = set(sorted(self.lowest | low)[:KEPT])
        self.highest = set(sorted(self.highest | high)[-KEPT:])
        for value in (0.0, *NAMED):
            if min(low) <= value <= max(high):
                self._add_borders(values, known, value)
        for row in range(len(values) // 2, len(values), 1 + len(values) // 8):
            if self.sampled < SAMPLE and known[row].all():
                self.rows.append(values[row, :SAMPLE].copy())
                self.sampled += self.rows[-1].size

    def _extremes(self, found: NDArray[Any], sign: int) -> set[float]:
        """Return the lowest (sign 1) or highest (-1) values, until two lie close together."""
        ends: list[float] = []
        pick = np.min if sign > 0 else np.max
        while found.size and len(ends) < KEPT + len(NAMED):
            ends.append(float(pick(found)))
            far = len(ends) < 2 or abs(ends[-1] - ends[-2]) * abs(self.scale) >= ALONE[0]
            if not (far or ends[-1] in NAMED):
                break
            found = found[found > ends[-1]] if sign > 0 else found[found < ends[-1]]
        return set(ends)

    def _add_borders(self, values: NDArray[Any], known: NDArray[np.bool_], value: float) -> None:
        """Count the pixels of a value, their borders with others, and the steep borders."""
        same = known & (values == value)
        if not same.any():
            return
        counts = self.borders.setdefault(value, [0, 0, 0])
        counts[0] += int(same.sum())
        for axis, step in ((1, self.spacing[0]), (0, self.spacing[1])):
            first, second = (np.take(same, range(*span), axis) for span in ((0, same.shape[axis] - 1), (1, same.shape[axis])))
            border = (first != second) & np.take(known, range(same.shape[axis] - 1), axis)
            border &= np.take(known, range(1, same.shape[axis]), axis)
            rise = np.abs(np.diff(values.astype(np.float64), axis=axis)[border]) * abs(self.scale)
            counts[1] += rise.size
            counts[2] += int((rise > CLIFF * step).sum())

    def fills(self) -> tuple[float, ...]:
        """Return the stored values that mean missing data beyond those declared.

        These are values beyond `HUGE`, values of `NAMED` with cliffs around them, and extremes far from all other heights.

        Returns:
            In ascending order; empty if none is found.
        """
        found: set[float] = set(self.huge)
        found |= {
            value
            for value, (_, borders, steep) in self.borders.items()
            if value != 0 and steep >= 0.9 * borders and self._named_alone(value)
        }
        rest = sorted((self.lowest | self.highest) - found)
        while len(rest) > 2:
            low, high = rest[1] - rest[0], rest[-1] - rest[-2]
            side = 0 if low >= high else -1
            others = (rest[-1] - rest[1]) if side == 0 else (rest[-2] - rest[0])
            gap = max(low, high)
            if not (others > 0 and gap * abs(self.scale) >= ALONE[0] and gap > ALONE[1] * others):
                break
            found.add(rest.pop(side))
        return tuple(sorted(found))

    def check_relief(self, fills: tuple[float, ...]) -> None:
        """Check that the heights are a planet's.

        Args:
            fills: the result of the method `fills`.

        Raises:
            TerrainError: heights that span more than `MOST_RELIEF`.
        """
        ends = [self.scale * v + self.offset for v in self.lowest | self.highest if v not in fills]
        if ends and max(ends) - min(ends) > MOST_RELIEF:
            raise TerrainError(
                f"{self.name} has heights from {min(ends):.6g} to {max(ends):.6g} m, more relief than any planet: the file is "
                "damaged, its unit is wrong, or missing data is not declared (gdal_edit.py -a_nodata VALUE)"
            )

    def _named_alone(self, value: float) -> bool:
        """Return True if no extreme height outside `NAMED` lies close to a value of `NAMED`."""
        others = [v for v in self.lowest | self.highest if v not in NAMED]
        return all(abs(v - value) > NEAR * abs(value) for v in others)

    def notes(self, fills: tuple[float, ...]) -> list[str]:
        """Return warnings about undeclared missing data and about heights in steps.

        Args:
            fills: the result of the method `fills`.

        Returns:
            One sentence per warning.
        """
        notes = []
        if fills:
            listed = ", ".join(f"{v:.10g}" for v in fills[:4]) + (", …" if len(fills) > 4 else "")
            heights = [v for v in self.lowest | self.highest if v not in fills]
            span = ""
            if heights:
                ends = sorted(self.scale * v + self.offset for v in (min(heights), max(heights)))
                span = f", far from its other heights ({ends[0]:.6g} to {ends[1]:.6g} m)"
            notes.append(
                f"{self.name} stores {listed}{span}, without declaring it as missing data; taken as missing. To declare it, "
                f"use gdal_edit.py -a_nodata"
            )
        pixels, borders, steep = self.borders.get(0.0, [0, 0, 0])
        if 0.0 not in fills and borders and steep >= 0.9 * borders:
            notes.append(
                f"{self.name} stores exactly 0 in {pixels} pixels, with cliffs around them: if 0 means missing data, declare it "
                f"with gdal_edit.py -a_nodata 0 {self.name}, or make the file again with gdalwarp -dstnodata nan"
            )
        step = self._step(fills)
        angle = math.atan2(step, min(self.spacing))
        if angle > STEP_NOTE:
            notes.append(
                f"heights of {self.name} come in steps of {step:.3g} m, which is {math.degrees(angle):.2g}° from one cell to the "
                f"next: angles of a rover may be wrong by up to that"
            )
        return notes

    def _step(self, fills: tuple[float, ...]) -> float:
        """Return the step of which all heights are multiples, m; 0 if there is none."""
        rows = [row.astype(np.float64) for row in self.rows if not np.isin(row, fills).any()]
        if not rows:
            return 0.0
        values = np.unique(np.concatenate(rows))
        fewest = 2 if self.rows[0].dtype.kind in "iu" else 6  # integers are rounded by their type; floats must show it
        if not fewest <= len(values) <= self.sampled / 2:
            return 0.0
        start, least = values[0], float(np.diff(values).min())
        step = float(values[-1] - start) / max(round((values[-1] - start) / least), 1)
        multiple = (values - start) / step
        if not np.abs(multiple - np.rint(multiple)).max() < 0.05:
            return 0.0
        uneven = np.concatenate([np.abs(np.diff(row, 2)) > 0.5 * step for row in rows])
        return step * abs(self.scale) if uneven.size and uneven.mean() > 0.02 else 0.0
