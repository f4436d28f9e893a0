"""Nodes of generated maps, and checks of their sizes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...arrays import floats, is_number
from ...errors import TerrainError

Array = NDArray[np.float64]

#: Largest generated map, nodes: 1.6 GB with its spline coefficients.
MOST_NODES = 100_000_000


def finite(**values: float) -> None:
    """Check that values are finite.

    Args:
        values: name → value.

    Raises:
        TerrainError: NaN or infinity, with the name.
    """
    for name, value in values.items():
        if not is_number(value):
            raise TerrainError(f"{name} is {value!r:.40}; give a finite number")


def positive(**sizes: float) -> None:
    """Check that sizes are finite and above 0.

    Args:
        sizes: name → value.

    Raises:
        TerrainError: another value, with the name.
    """
    for name, size in sizes.items():
        if not (is_number(size) and size > 0):
            raise TerrainError(f"{name} is {size!r:.40}; give a finite number above 0")


def span(x: tuple[float, float], y: tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Return the nodes of a map over two spans.

    Args:
        x: lowest and highest x, m.
        y: lowest and highest y, m.
        spacing: of the nodes, m.

    Returns:
        (cols,) x and (rows,) y, m: from the low end of each span to the last whole cell within it.

    Raises:
        TerrainError: numbers that are not finite, fewer than 4 nodes a side, or more than `MOST_NODES` nodes.
    """
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
    """Return the nodes of a map with (0, 0) at its centre.

    Args:
        size: side of the map, or (x, y), m.
        spacing: of the nodes, m.

    Returns:
        (cols,) x and (rows,) y, m.

    Raises:
        TerrainError: as `span`, or a size that is not one or two positive numbers.
    """
    try:
        sx, sy = np.broadcast_to(floats(size), (2,))
    except (TypeError, ValueError, OverflowError):
        raise TerrainError(f"size is {size!r:.40}; give one number or two (x, y), in metres") from None
    positive(size=float(min(sx, sy)))
    return span((-sx / 2, sx / 2), (-sy / 2, sy / 2), spacing)
