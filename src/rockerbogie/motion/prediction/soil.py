"""Force tables of a rover's wheels on soil, for predicted drives."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...errors import RockerbogieError
from ...rover.model import Rover
from ...terrain.soil.forces import check_law
from ...terrain.soil.laws import Grousers, WheelLaw
from ...terrain.soil.load import load_soil
from ...terrain.soil.table import ForceTable, tabulate

#: Least and largest load of a table over the rover's weight.
LOADS = (1e-3, 0.5)
#: Wheels run in one rut if their centre lines are closer than this share of their width.
SAME_RUT = 0.5


class SoilTables(NamedTuple):
    """Tables of all soils of a call."""

    tables: Array  # (m, size) packed
    table_of: NDArray[np.int64]  # (soils, 6) table of each wheel
    shape: tuple[int, ...]  # () for one soil, (soils,) for a list
    names: list[str]


def soil_tables(
    rover: Rover, soil: str | WheelLaw | Sequence[str | WheelLaw], gravity: float, grousers: Grousers | float | None, ruts: bool
) -> SoilTables:
    """Return force tables of a rover's wheels.

    Args:
        rover: the rover.
        soil: name of a preset or a law, or a list of them.
        gravity: m/s².
        grousers: as for `wheel_soil_forces`.
        ruts: True if wheels behind others run in their ruts.

    Returns:
        The tables.

    Raises:
        RockerbogieError: an unknown soil, no soil, or loads that a soil cannot carry.
    """
    single = isinstance(soil, str) or not isinstance(soil, Sequence)
    laws = [soil] if single else list(soil)  # type: ignore[arg-type]
    if not laws:
        raise RockerbogieError("soil is an empty list: give names of soils (rockerbogie.soils()) or laws")
    if not (grousers is None or isinstance(grousers, Grousers)):
        grousers = Grousers(grousers)
    weight = rover.mass * gravity
    tables: list[Array] = []
    table_of = np.empty((len(laws), 6), dtype=np.int64)
    known: dict[tuple[object, ...], int] = {}
    passes = _passes(rover) if ruts else np.ones(6, dtype=int)
    for n, law in enumerate(laws):
        checked = check_law(load_soil(law) if isinstance(law, str) else law)
        for i in range(6):
            key = (n, float(rover.wheel_radius[i]), float(rover.wheel_width[i]), int(passes[i]))
            if key not in known:
                known[key] = len(tables)
                tables.append(_table(checked, *key[1:], weight, gravity, grousers).packed)  # type: ignore[arg-type]
            table_of[n, i] = known[key]
    packed = np.zeros((len(tables), max(table.size for table in tables)))
    for row, table in zip(packed, tables, strict=True):
        row[: table.size] = table
    names = [law if isinstance(law, str) else getattr(law, "name", "") or type(law).__name__ for law in laws]
    return SoilTables(packed, table_of, () if single else (len(laws),), names)


@lru_cache(maxsize=64)
def _table(
    law: WheelLaw, radius: float, width: float, passes: int, weight: float, gravity: float, grousers: Grousers | float | None
) -> ForceTable:
    """Return the table of one wheel."""
    if not width > 0.0:
        raise RockerbogieError("wheels of width 0 sink without limit in soil: give the rover a wheel_width above 0")
    loads = (LOADS[0] * weight, LOADS[1] * weight)
    return tabulate(law, radius, width, loads, gravity=gravity, grousers=grousers, passes=passes)


def _passes(rover: Rover) -> NDArray[np.int64]:
    """Return the number of each wheel's pass over its rut on a straight drive forward."""
    x, y, width = rover.hubs[:, 0], rover.hubs[:, 1], rover.wheel_width
    shared = np.abs(y[:, None] - y) < SAME_RUT * np.minimum(width[:, None], width)
    return np.asarray(1 + (shared & (x > x[:, None] + 1e-9)).sum(axis=1))
