"""Reader of a rover's TOML file, with units in its keys; `toml_write` writes it."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RoverError, unknown_name
from ..differential import DifferentialBar
from ..model import Link, Rover
from .limits import check_size
from .safe_xml import LARGEST
from .toml_keys import KEYS, LINKS, TABLES, Key

#: Larger files are refused before they are parsed.
MAX_CHARACTERS = 1_000_000
#: Keys that go straight to an argument of `Rover.from_pivots`.
ARGUMENTS = {
    "name": "name",
    "source": "source",
    "wheels.radius_m": "wheel_radius",
    "wheels.width_m": "wheel_width",
    "wheels.torque_n_m": "wheel_torque",
    "wheels.steers": "steers",
    "wheels.names": "wheel_names",
    "linkage.rocker_pivot_m": "rocker_pivot",
    "linkage.bogie_pivot_m": "bogie_pivot",
    "linkage.hubs_m": "hubs",
    "linkage.steering_offset_m": "steering_offset",
    "differential.coefficients": "differential",
    "body.box_m": "body_box",
    "mass.total_kg": "mass",
}
NEEDED = ("wheels.radius_m", "linkage.rocker_pivot_m", "linkage.bogie_pivot_m", "linkage.hubs_m")
BAR = ("differential.bar_pivot_m", "differential.bar_end_m", "differential.horn_m")


def read_toml(text: str, name: str = "rover") -> Rover:
    """Return the rover of a TOML text.

    Args:
        text: the file's contents.
        name: the rover's name if the file gives none; used in messages.

    Returns:
        The rover.

    Raises:
        RoverError: not TOML, an unknown key, a value of the wrong kind, or an impossible rover.
    """
    values = read_values(text, name)
    rover = _rover(values, name)
    check_size(rover, name)
    return rover


def read_values(text: str, name: str) -> dict[str, Any]:
    """Return a file's values by `table.key`, each of the kind of its key.

    Parts under [link] are returned as `Link`s.

    Args:
        text: the file's contents.
        name: the file's name, for messages.

    Returns:
        Values by key, in the units that the keys name (`_deg`: degrees); keys outside a table have no prefix.

    Raises:
        RoverError: not TOML, an unknown key, or a value of the wrong kind.
    """
    if len(text) > MAX_CHARACTERS:
        raise RoverError(f"{name}: {len(text)} characters of TOML; a rover takes a few thousand, the limit is {MAX_CHARACTERS}")
    try:
        tree = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # the parser's own errors are ValueErrors
        raise RoverError(f"{name}: not TOML: {error}") from None
    return _values(tree, name)


def _values(tree: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the values of parsed TOML by `table.key`, checked."""
    known = {key.path: key for key in KEYS}
    top = [key.name for key in KEYS if not key.table] + [table for table in TABLES if table]
    found: dict[str, Any] = {}
    for word, value in tree.items():
        if word not in top:
            raise RoverError(f"{name}: {unknown_name('key or table', word, top)}")
        if word in known:
            found[word] = _checked(known[word], value, name)
            continue
        if not isinstance(value, dict):
            raise RoverError(f"{name}: {word} must be a table: write [{word}]")
        if word == "link":
            found |= _links(value, name)
            continue
        for short, inside in value.items():
            path = f"{word}.{short}"
            if path not in known:
                raise RoverError(f"{name}: {unknown_name(f'key in [{word}]', short, [k.name for k in KEYS if k.table == word])}")
            found[path] = _checked(known[path], inside, name)
    if found.get("format", 1) != 1:
        raise RoverError(f"{name}: format is {found['format']:g}; this version reads format 1")
    return found


def _links(parts: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the parts under [link] by `link.name`, checked."""
    keys = {key.name: key for key in KEYS if key.table == "link"}
    found: dict[str, Any] = {}
    for part, inside in parts.items():
        if part not in LINKS:
            raise RoverError(f"{name}: {unknown_name('part under [link]', part, LINKS)}")
        if not isinstance(inside, dict):
            raise RoverError(f"{name}: link.{part} must be a table: write [link.{part}]")
        for short in inside:
            if short not in keys:
                raise RoverError(f"{name}: {unknown_name(f'key in [link.{part}]', short, keys)}")
        missing = [short for short in keys if short not in inside]
        if missing:
            raise RoverError(f"{name}: [link.{part}] lacks {', '.join(missing)}: a part needs mass, centre and inertia")
        mass, com, (xx, yy, zz, xy, xz, yz) = (_checked(keys[short], inside[short], name) for short in keys)
        found[f"link.{part}"] = Link(mass, com, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return found


def _checked(key: Key, value: Any, name: str) -> Any:
    """Return `value` as the kind of `key`."""
    items = value if isinstance(value, list) else [value]
    if key.kind == "text":
        good, need, result = isinstance(value, str), "a string", value
    elif key.kind == "texts":
        good, need, result = isinstance(value, list) and all(isinstance(v, str) for v in items), "a list of strings", value
    elif key.kind == "bools":
        good = all(isinstance(v, bool) for v in items) and len(items) in (1, 3, 6)
        need, result = (
            "true or false, 3 of them or 6",
            np.array(items if len(items) > 1 else items[0], dtype=float) if good else None,
        )
    else:
        shapes = {"number": "", "numbers": "n", "per-wheel": "|3|6"}.get(key.kind, key.kind).split("|")
        array = _numbers(value)
        shape = None if array is None else "x".join(str(n) for n in array.shape)
        good = array is not None and (shape in shapes or (shapes == ["n"] and array.ndim == 1))
        need = " or ".join({"": "a number", "n": "a list of numbers"}.get(s, f"{s} numbers") for s in shapes)
        result = float(array) if array is not None and array.ndim == 0 and key.kind == "number" else array
    if not good:
        raise RoverError(f"{name}: {key.path} is {str(value)[:60]}; give {need}: {key.comment}")
    return result


def _numbers(value: Any) -> NDArray[np.float64] | None:
    """Return an array of floats, None if a value is no array of numbers.

    Numbers above `LARGEST` and rows of different length are refused too.
    """
    flat = [value]
    for _ in range(2):
        flat = [v for item in flat for v in (item if isinstance(item, list) else [item])]
    if not flat or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in flat):
        return None
    try:
        array = np.array(value, dtype=float)
    except (ValueError, OverflowError):
        return None
    return array if (np.isinf(array) | (np.abs(array) <= LARGEST)).all() else None


def arguments(values: dict[str, Any], name: str) -> dict[str, Any]:
    """Return arguments of `Rover.from_pivots`.

    Args:
        values: from `read_values`.
        name: the file's name, for messages.

    Returns:
        Arguments by name, in metres and radians.

    Raises:
        RoverError: a differential or links that are given twice, or in part.
    """
    more = {argument: values[path] for path, argument in ARGUMENTS.items() if path in values}
    more |= _differential(values, name)
    for joint in ("rocker", "bogie"):
        if f"stops.{joint}_deg" in values:
            more[f"{joint}_limits"] = np.deg2rad(values[f"stops.{joint}_deg"])
    return more | _parts(values, name)


def _rover(values: dict[str, Any], name: str) -> Rover:
    """Return the rover of a file's values, from [linkage] or from [dh]."""
    more = {"name": name} | arguments(values, name)
    constants = {path[3:].partition("_")[0]: value for path, value in values.items() if path.startswith("dh.")}
    if not constants:
        missing = [path for path in NEEDED if path not in values]
        if missing:
            raise RoverError(f"{name}: no {', '.join(missing)}: a rover needs its wheel radius, both pivots and its hubs")
        return Rover.from_pivots(**more)
    twice = [path for path in NEEDED if path in values]
    if twice:
        raise RoverError(f"{name}: [dh] already gives {twice[0]}; give one or the other")
    missing = [f"K{i}" for i in range(3, 12) if f"K{i}" not in constants]
    if missing:
        raise RoverError(f"{name}: [dh] lacks {', '.join(missing)}")
    return Rover.from_dh(**constants | {"K9": float(np.deg2rad(constants["K9"]))}, **more)


def _differential(values: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the differential as an argument of `Rover.from_pivots`, if the file gives it."""
    bar = [values[path] for path in BAR if path in values]
    ways = [bool(bar), "differential.ratio" in values, "differential.coefficients" in values]
    if sum(ways) > 1:
        raise RoverError(f"{name}: [differential] is given in {sum(ways)} ways; give one of ratio, coefficients or a bar")
    if "differential.ratio" in values:
        return {"differential": (0.0, -values["differential.ratio"])}
    if not bar:
        return {}
    if len(bar) < len(BAR):
        raise RoverError(f"{name}: a differential bar needs {', '.join(path.partition('.')[2] for path in BAR)}")
    pivot, end, horn = (tuple(float(v) for v in part) for part in bar)
    return {"differential": DifferentialBar((pivot[0], pivot[1]), (end[0], end[1], end[2]), (horn[0], horn[1], horn[2]))}


def _parts(values: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the rover's own links as arguments, if the file gives them."""
    links = [values.get(f"link.{part}") for part in LINKS]
    more: dict[str, Any] = {} if links[0] is None else {"body": links[0]}
    for argument, some in (("rockers", links[1:3]), ("bogies", links[3:5]), ("wheels", links[5:])):
        given = sum(link is not None for link in some)
        if 0 < given < len(some):
            raise RoverError(f"{name}: [link] gives {given} of the {len(some)} {argument}; give all or none")
        if given:
            more[argument] = some
    return more
