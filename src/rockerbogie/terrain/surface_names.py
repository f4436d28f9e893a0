"""Built-in surfaces by name and parameters: `surface:rocks?k=0.1&seed=3`."""

from __future__ import annotations

import inspect
import math
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl

from ..errors import TerrainError, unknown_name

if TYPE_CHECKING:
    from .heightfield import Terrain

#: Parameters that are angles: in degrees on the command line, in radians in Python.
ANGLES = frozenset({"slope", "aspect", "direction", "ramp_slope", "max_slope", "rms_slope"})
#: Parameters that text cannot express, or that have their own option.
_LEFT_OUT = frozenset({"base", "interpolation"})


def build_surface(text: str, interpolation: str | None) -> Terrain:
    """Return the surface `NAME` or `NAME?parameter=value&…`.

    Args:
        text: what follows `surface:`; angles in degrees, lengths in metres, a size as 20 or 20,10.
        interpolation: "linear" or "cubic"; None for the surface's own.

    Returns:
        The terrain.

    Raises:
        TerrainError: an unknown surface or parameter, or a value that is not a number.
    """
    from . import surfaces

    name, question, query = text.partition("?")
    if name not in surfaces.__all__:
        raise TerrainError(unknown_name("surface", name, surfaces.__all__))
    known = parameters(name)
    values: dict[str, Any] = {}
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=True) if question and query else []
    except ValueError:
        raise TerrainError(f"surface:{text} is not NAME?parameter=value&parameter=value; {listing(name)}") from None
    for key, value in pairs:
        if key not in known:
            raise TerrainError(f"surface {name!r} has no parameter {key!r}; {listing(name)}")
        values[key] = _value(name, key, value, known[key])
    if interpolation is not None:
        values["interpolation"] = interpolation
    made: Terrain = getattr(surfaces, name)(**values)
    return made


def parameters(name: str) -> dict[str, Any]:
    """Return the parameters of a surface and their default values (SI, rad).

    Args:
        name: of the surface.

    Returns:
        Name → default value, SI and rad.
    """
    from . import surfaces

    signature = inspect.signature(getattr(surfaces, name))
    return {key: parameter.default for key, parameter in signature.parameters.items() if key not in _LEFT_OUT}


def listing(name: str) -> str:
    """Return a sentence with the parameters of a surface and their default values, as typed.

    Args:
        name: of the surface.

    Returns:
        The sentence; angles in degrees.
    """
    shown = []
    for key, value in parameters(name).items():
        if isinstance(value, tuple):
            text = ",".join(f"{part:g}" for part in value)
        else:
            text = f"{math.degrees(value):.4g} (degrees)" if key in ANGLES else f"{value:.4g}"
        shown.append(f"{key}={text}")
    return f"surface:{name} takes " + ", ".join(shown)


def _value(name: str, key: str, text: str, default: Any) -> Any:
    """Return a parameter's value in SI units."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if not numbers or not all(map(math.isfinite, numbers)) or len(numbers) > (2 if key == "size" else 1):
        kind = "one or two numbers, as in size=20,10" if key == "size" else "a number"
        raise TerrainError(f"surface:{name}: {key} is {text!r}; give {kind}; {listing(name)}")
    if key == "size":
        return numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1])
    if isinstance(default, int) and not isinstance(default, bool):
        if numbers[0] != int(numbers[0]):
            raise TerrainError(f"surface:{name}: {key} is {text!r}; give a whole number")
        return int(numbers[0])
    return math.radians(numbers[0]) if key in ANGLES else numbers[0]
