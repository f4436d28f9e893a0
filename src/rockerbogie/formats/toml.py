"""A rover from its own TOML file, with units in the keys, and back."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np

from ..errors import RoverError, unknown_name
from ..rover import Link, Rover
from .keys import KEYS, LINKS, TABLES, Key

#: Larger files are refused before they are parsed.
MAX_BYTES = 1_000_000


def read_toml(text: str, name: str = "rover") -> Rover:
    """A rover from the text of a TOML file.

    Args:
        text: the file's contents.
        name: the rover's name if the file gives none; also said in messages.

    Raises:
        RoverError: not TOML, an unknown key, a value of the wrong kind, or a rover that cannot be.
    """
    if len(text) > MAX_BYTES:
        raise RoverError(f"{name}: {len(text)} characters of TOML; a rover takes a few thousand, the limit is {MAX_BYTES}")
    try:
        tree = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise RoverError(f"{name}: not TOML: {error}") from None
    values = _values(tree, name)
    try:
        return _rover(values, name)
    except RoverError:
        raise
    except (ArithmeticError, TypeError, ValueError) as error:
        raise RoverError(f"{name}: {error}") from None


def _values(tree: dict[str, Any], name: str) -> dict[str, Any]:
    """The file's values by `table.key`, each checked against `KEYS`; arrays as numpy arrays."""
    known = {key.path: key for key in KEYS}
    found: dict[str, Any] = {}
    for table, inside in tree.items():
        if table not in TABLES:
            if table in known:
                found[table] = _checked(known[table], inside, name)
                continue
            raise RoverError(
                f"{name}: {unknown_name('key or table', table, [*TABLES, *(k.path for k in KEYS if not k.table)][1:])}"
            )
        if not isinstance(inside, dict):
            raise RoverError(f"{name}: [{table}] must be a table")
        if table == "link":
            found |= _links(inside, name)
            continue
        for short, value in inside.items():
            path = f"{table}.{short}"
            if path not in known:
                raise RoverError(
                    f"{name}: {unknown_name(f'key in [{table}]', short, [k.name for k in KEYS if k.table == table])}"
                )
            found[path] = _checked(known[path], value, name)
    if found.get("format", 1) != 1:
        raise RoverError(f"{name}: format is {found['format']:g}; this version reads format 1")
    return found


def _links(parts: dict[str, Any], name: str) -> dict[str, Any]:
    keys = {key.name: key for key in KEYS if key.table == "link"}
    found: dict[str, Any] = {}
    for part, inside in parts.items():
        if part not in LINKS:
            raise RoverError(f"{name}: {unknown_name('part under [link]', part, LINKS)}")
        if not isinstance(inside, dict):
            raise RoverError(f"{name}: [link.{part}] must be a table")
        for short in inside:
            if short not in keys:
                raise RoverError(f"{name}: {unknown_name(f'key in [link.{part}]', short, keys)}")
        missing = [short for short in keys if short not in inside]
        if missing:
            raise RoverError(f"{name}: [link.{part}] lacks {', '.join(missing)}: a part needs mass, centre and inertia")
        mass, com, six = (_checked(keys[short], inside[short], name) for short in keys)
        xx, yy, zz, xy, xz, yz = six
        found[f"link.{part}"] = Link(mass, com, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return found


def _checked(key: Key, value: Any, name: str) -> Any:
    """`value` as the kind `key` asks for."""

    def refuse(need: str) -> RoverError:
        return RoverError(f"{name}: {key.path} is {str(value)[:60]}; give {need}: {key.comment}")

    if key.kind == "text":
        if not isinstance(value, str):
            raise refuse("a string")
        return value
    if key.kind == "texts":
        if not (isinstance(value, list) and all(isinstance(v, str) for v in value)):
            raise refuse("a list of strings")
        return value
    if key.kind == "bools":
        items = value if isinstance(value, list) else [value]
        if not (all(isinstance(v, bool) for v in items) and len(items) in (1, 3, 6)):
            raise refuse("true or false, 3 of them or 6")
        return np.array(value, dtype=float)
    shapes = {"number": "", "numbers": "n", "per-wheel": "|3|6"}.get(key.kind, key.kind).split("|")
    array = _numbers(value)
    shape = None if array is None else "x".join(str(n) for n in array.shape)
    if array is None or not (shape in shapes or (shapes == ["n"] and array.ndim == 1)):
        wanted = " or ".join("a number" if s == "" else f"{s} numbers" for s in shapes).replace("n numbers", "a list of numbers")
        raise refuse(wanted)
    return float(array) if key.kind == "number" else array


def _numbers(value: Any) -> np.ndarray | None:
    """An array of floats, or None where `value` holds anything but numbers, or rows of different length."""
    flat = [value]
    for _ in range(3):
        flat = [v for item in flat for v in (item if isinstance(item, list) else [item])]
    if not flat or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in flat):
        return None
    try:
        return np.array(value, dtype=float)
    except (ValueError, OverflowError):
        return None


def _rover(values: dict[str, Any], name: str) -> Rover:
    deg = np.deg2rad
    more: dict[str, Any] = {"name": values.get("name", name), "source": values.get("source", "")}
    for path, argument in (
        ("wheels.width_m", "wheel_width"),
        ("wheels.steers", "steers"),
        ("wheels.names", "wheel_names"),
        ("linkage.steering_offset_m", "steering_offset"),
        ("differential.coefficients", "differential"),
        ("body.box_m", "body_box"),
        ("mass.total_kg", "mass"),
    ):
        if path in values:
            more[argument] = values[path]
    if "differential.ratio" in values:
        more["differential"] = (0.0, -values["differential.ratio"])
    for joint in ("rocker", "bogie"):
        if f"stops.{joint}_deg" in values:
            more[f"{joint}_limits"] = deg(values[f"stops.{joint}_deg"])
    links = [values.get(f"link.{part}") for part in LINKS]
    for argument, part in (("body", links[0]), ("rockers", links[1:3]), ("bogies", links[3:5]), ("wheels", links[5:])):
        given = [link is not None for link in (part if isinstance(part, list) else [part])]
        if any(given) and not all(given):
            raise RoverError(f"{name}: [link] gives only some of the {argument}; give all {len(given)} or none")
        if all(given):
            more[argument] = part
    dh = {path[3:].partition("_")[0]: value for path, value in values.items() if path.startswith("dh.")}
    if dh:
        both = [path for path in values if path.startswith("linkage.") and path != "linkage.steering_offset_m"]
        if both or "wheels.radius_m" in values:
            raise RoverError(f"{name}: [dh] already says {(both or ['wheels.radius_m'])[0]}; give one or the other")
        missing = [f"K{i}" for i in range(3, 12) if f"K{i}" not in dh]
        if missing:
            raise RoverError(f"{name}: [dh] lacks {', '.join(missing)}")
        return Rover.from_dh(**dh | {"K9": float(deg(dh["K9"]))}, **more)
    need = ("wheels.radius_m", "linkage.rocker_pivot_m", "linkage.bogie_pivot_m", "linkage.hubs_m")
    missing = [path for path in need if path not in values]
    if missing:
        raise RoverError(f"{name}: no {', '.join(missing)}: a rover needs its wheel radius, both pivots and its hubs")
    radius, rocker, bogie, hubs = (values[path] for path in need)
    return Rover.from_pivots(wheel_radius=radius, rocker_pivot=rocker, bogie_pivot=bogie, hubs=hubs, **more)
