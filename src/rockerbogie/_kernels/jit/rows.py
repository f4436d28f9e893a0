"""Layout of lane arrays: groups of rows placed one after another."""

from __future__ import annotations

from typing import TypeVar

Rows = TypeVar("Rows", bound=tuple[int, ...])


def place_rows(kind: type[Rows], start: int) -> tuple[Rows, int]:
    """Place the rows of a group one after another.

    Args:
        kind: NamedTuple whose default values are the sizes of its rows.
        start: start of the first row.

    Returns:
        The group, with the start of each row as its values, and the number after the last row.
    """
    starts = [start]
    for size in kind._field_defaults.values():  # type: ignore[attr-defined]
        starts.append(starts[-1] + size)
    return kind(*starts[:-1]), starts[-1]  # type: ignore[arg-type]
