"""Paths through points that a visitor clicks."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import PathError
from ..motion.path import Path

#: Longest path and most stations of a run in the page: it is computed while the visitor waits.
MOST_METRES = 2_000.0
STATIONS = 600
#: Largest number of points of a path.
MOST_POINTS = 200


def path_through(points: Sequence[tuple[float, float]], radius: float) -> Path:
    """Return a path through points, with corners as wide as there is room.

    Args:
        points: at least two positions, m.
        radius: of the arcs at the corners, m; halved, eight times at most, until the arcs fit.

    Returns:
        The path.

    Raises:
        PathError: fewer than two points, two equal ones in a row, a reversal, or a path that is too long.
    """
    if len(points) < 2:
        raise PathError("a path needs two points: click the terrain to add them")
    for attempt in range(9):
        try:
            path = Path.waypoints(points, radius / 2**attempt)
            break
        except PathError:
            if attempt == 8:
                raise
    if path.length > MOST_METRES:
        raise PathError(f"the path is {path.length:.0f} m long; the page drives at most {MOST_METRES:.0f} m")
    return path


def step_of(path: Path) -> float:
    """Return the distance of stations that gives at most `STATIONS` of them.

    Args:
        path: the path.

    Returns:
        m, at least 0.01.
    """
    return max(0.01, path.length / STATIONS)
