"""The errors this package raises for wrong calls. Hard ground never raises: it gives a `Status`."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class RockerbogieError(ValueError):
    """A call that cannot be answered: the message says what, where, and how to mend it."""


class RoverError(RockerbogieError):
    """A rover that cannot be, or that cannot be found."""


class TerrainError(RockerbogieError):
    """Ground that cannot be read or is not a height field."""


class PathError(RockerbogieError):
    """A path that cannot be driven: too few points, not finite, or off the map."""


def expect(value: object, kind: type, name: str, remedy: str) -> None:
    """Raise a sentence where an argument is not what a call was made for, such as a rover's name in a rover's place."""
    if not isinstance(value, kind):
        raise RockerbogieError(f"{name} is {value!r:.60}, not a {kind.__name__}: {remedy}")


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """One sentence for a name that is not there, with the nearest one that is."""
    names = sorted(known)
    near = difflib.get_close_matches(name.lower(), names, n=1, cutoff=0.4)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    return f"no {kind} named {name!r}{hint} Known: {', '.join(names)}."
