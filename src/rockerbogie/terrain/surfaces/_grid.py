"""Nodes for made-up maps, and the sentences for sizes that cannot be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import TerrainError

Array = NDArray[np.float64]

#: Largest made-up map, nodes: 1.6 GB with its spline coefficients.
MOST_NODES = 100_000_000


def finite(**values: float) -> None:
    """Refuse what is not finite."""
    for name, value in values.items():
        if not np.isfinite(value):
            raise TerrainError(f"{name} is {value}; give a finite number")


def positive(**sizes: float) -> None:
    """Refuse what is not finite and above 0."""
    for name, size in sizes.items():
        if not (np.isfinite(size) and size > 0):
            raise TerrainError(f"{name} is {size}; give a finite number above 0")


def span(x: tuple[float, float], y: tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Nodes (cols,) and (rows,) from the low end of each span to its high end, or the last whole cell before it."""
    positive(spacing=spacing)
    finite(xmin=x[0], xmax=x[1], ymin=y[0], ymax=y[1])
    cols, rows = (int(np.floor((high - low) / spacing + 1e-6)) + 1 for low, high in (x, y))
    if min(cols, rows) < 4:
        raise TerrainError(f"a map of {cols} x {rows} nodes is too small: enlarge it or refine the spacing of {spacing:g} m")
    if cols * rows > MOST_NODES:
        raise TerrainError(
            f"a map of {cols} x {rows} nodes has more than {MOST_NODES:g}: shrink it or coarsen the spacing of {spacing:g} m"
        )
    return x[0] + spacing * np.arange(cols, dtype=float), y[0] + spacing * np.arange(rows, dtype=float)


def centred(size: float | tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Nodes (cols,) and (rows,) of a map `size` across with (0, 0) in its middle."""
    try:
        sx, sy = np.broadcast_to(np.asarray(size, dtype=float), (2,))
    except ValueError:
        raise TerrainError(f"size is {size}; give one number or two (x, y), in metres") from None
    positive(size=float(min(sx, sy)))
    return span((-sx / 2, sx / 2), (-sy / 2, sy / 2), spacing)
