"""Colour maps and legends for the colour-blind, without matplotlib."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Array
from ...errors import RockerbogieError, unknown_name
from .mesh import colour_of

#: Colours of a map at equal steps from its low to its high end: viridis and cividis (CC0), and the soil of the figures.
_STOPS = {
    "viridis": "#440154 #482878 #3e4a89 #31688e #26828e #1f9e89 #35b779 #6ece58 #b5de2b #fde725",
    "cividis": "#00224e #123570 #3b496c #575d6d #707173 #8a8678 #a59c74 #c3b369 #e1cc55 #fee838",
    "terrain": "#5f4b3c #7d6350 #9a7c63 #b5957a #cdae92 #e0c7ae #eedfcd #f8f2e8",
}
#: Colour of missing data in a layer, where the terrain itself is known.
MISSING = colour_of("#9a9a9a")
#: Number of colours in a table.
TABLE = 256


class Legend(NamedTuple):
    """Meaning of the colours of a terrain mesh."""

    label: str
    units: str
    low: float  # value of the first colour
    high: float  # value of the last colour
    colours: Array  # (k, 3) from low to high, or one of each class
    classes: tuple[str, ...] = ()  # meaning of each colour; empty for a continuous scale


def colour_table(name: str) -> Array:
    """Return the colours of a map.

    Args:
        name: viridis, cividis or terrain.

    Returns:
        (256, 3) from low to high, 0 to 1.

    Raises:
        RockerbogieError: another name.
    """
    if name not in _STOPS:
        raise RockerbogieError(unknown_name("colour map", name, _STOPS))
    stops = np.array([colour_of(code) for code in _STOPS[name].split()])
    at = np.linspace(0, len(stops) - 1, TABLE)
    return np.stack([np.interp(at, np.arange(len(stops)), stops[:, k]) for k in range(3)], axis=1)


def colours_of(values: ArrayLike, legend: Legend) -> Array:
    """Return the colours of values.

    Args:
        values: (...) in the units of the legend; indices from 0 for a legend with classes.
        legend: the scale.

    Returns:
        (..., 3) red, green, blue, 0 to 1; grey for NaN.
    """
    v = np.asarray(values, dtype=float)
    last = len(legend.colours) - 1
    with np.errstate(invalid="ignore"):
        share = v if legend.classes else (v - legend.low) / max(legend.high - legend.low, 1e-300) * last
        index = np.clip(np.where(np.isfinite(share), share, 0.0), 0, last).round().astype(int)
    return np.where(np.isfinite(v)[..., None], legend.colours[index], MISSING)
