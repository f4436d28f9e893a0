"""Exceptions for wrong calls. Difficult terrain raises none of them: it gives a `Status`."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Iterable


class RockerbogieError(ValueError):
    """Wrong call. The message states the fault, its position and the remedy."""


class RoverError(RockerbogieError):
    """Rover parameters that are impossible, or a rover that cannot be found."""


class TerrainError(RockerbogieError):
    """Terrain that cannot be read, or that is not a height field."""


class TerrainWarning(UserWarning):
    """Warning of a doubtful terrain file: missing data, coarse steps, stretched map."""


class PathError(RockerbogieError):
    """Path that cannot be driven: too few points, not finite, or off the map."""


def expect(value: object, kind: type, name: str, remedy: str) -> None:
    """Check the type of an argument, such as a rover that is given by its name.

    Args:
        value: the argument.
        kind: the class it must be an instance of.
        name: the argument's name.
        remedy: end of the message.

    Raises:
        RockerbogieError: the argument is of another type.
    """
    if not isinstance(value, kind):
        raise RockerbogieError(f"{name} is {value!r:.60}, not a {kind.__name__}: {remedy}")


def require(purpose: str, extra: str, *modules: str, error: type[RockerbogieError] = RockerbogieError) -> None:
    """Check that the packages of an optional extra can be imported.

    Args:
        purpose: subject of the message, such as "reading a raster".
        extra: name of the extra in pyproject.toml.
        modules: modules to import, such as "rasterio".
        error: class of the error.

    Raises:
        RockerbogieError: a package is missing, or is installed and cannot be loaded.
    """
    for module in modules:
        try:
            importlib.import_module(module)
        except ModuleNotFoundError:
            package = module.partition(".")[0]
            raise error(f"{purpose} needs {package}: pip install 'rockerbogie[{extra}]'") from None
        except ImportError as fault:
            reason = " ".join(str(fault).split())
            raise error(f"{purpose} needs {module}, which is installed but cannot be loaded: {reason}") from None


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """Return a message for an unknown name, with the most similar known name.

    Args:
        kind: noun for what is named, such as "surface".
        name: the unknown name.
        known: all known names.

    Returns:
        One sentence that suggests a name and lists all of them.
    """
    names = sorted(known)
    return f"no {kind} named {name!r}{did_you_mean(name, names) or '.'} Known: {', '.join(names)}."


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence that suggests the known name most similar to an unknown one.

    Args:
        name: the unknown name.
        known: all known names.

    Returns:
        For example "; did you mean 'osr'?"; "" if no known name is similar.
    """
    lower = {known_name.lower(): known_name for known_name in known}
    near = difflib.get_close_matches(name.lower(), lower, n=1, cutoff=0.4)
    return f"; did you mean {lower[near[0]]!r}?" if near else ""
