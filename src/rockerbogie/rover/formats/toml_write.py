"""Writer of a rover's TOML file, and the JSON schema of such files."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ...arrays import Array
from ..model import Rover
from .toml_keys import KEYS, LINKS, TABLES, Key

#: Lines of a new file that are commented out, to be filled in if they apply.
EXAMPLES = {
    "title": '"..."',
    "grade": '"C"',
    "wheels.torque_n_m": "3.7",
    "differential.ratio": "1.0",
    "differential.bar_pivot_m": "[0.0, 1.1]",
    "differential.bar_end_m": "[0.0, 0.8, 1.1]",
    "differential.horn_m": "[0.3, 0.8, 1.1]",
}


def to_toml(rover: Rover, *, options: bool = False) -> str:
    """Return the rover as TOML.

    Only the left side is written if the right mirrors it; links only if no rule of thumb gives them.

    Args:
        rover: the rover.
        options: also list, commented out, the keys that are not used.

    Returns:
        TOML text.
    """
    values = _values(rover)
    lines = ["#:schema ./rover.schema.json", f"# {TABLES['']}", ""]
    for table, purpose in TABLES.items():
        keys = [key for key in KEYS if key.table == table]
        given = [(key, values[key.path]) for key in keys if key.path in values]
        spare = [key for key in keys if options and key.path not in values and key.path in EXAMPLES]
        if table == "link":
            lines += _link_lines(rover, keys) if "mass.total_kg" not in values else []
            continue
        if not given and not spare:
            continue
        if table:
            lines += [f"[{table}]", f"# {purpose}"]
        rows = [(f"{key.name} = {text}", key.comment) for key, text in given]
        rows += [(f"# {key.name} = {EXAMPLES[key.path]}", key.comment) for key in spare]
        width = max((len(row) for row, _ in rows if "\n" not in row), default=0)
        lines += [f"{row:<{width}}  # {comment}" if "\n" not in row else f"# {comment}\n{row}" for row, comment in rows] + [""]
    return "\n".join(lines).rstrip() + "\n"


def _values(rover: Rover) -> dict[str, str]:
    """Return the rover's values by `table.key`, as TOML."""
    values = {
        "format": "1",
        "name": json.dumps(rover.name, ensure_ascii=False),
        "wheels.radius_m": _list(_alike(rover.wheel_radius)),
        "wheels.width_m": _list(_alike(rover.wheel_width)),
        "wheels.steers": json.dumps(_alike(rover.steers).tolist()),
        "wheels.names": json.dumps(rover.wheel_names, ensure_ascii=False),
        "linkage.rocker_pivot_m": _list(_one_side(rover.rocker_pivot)),
        "linkage.bogie_pivot_m": _list(_one_side(rover.bogie_pivot)),
        "linkage.hubs_m": _list(_one_side(rover.hubs)),
        "body.box_m": _list(rover.body_box),
    }
    if rover.source:
        values["source"] = json.dumps(rover.source, ensure_ascii=False)
    if np.isfinite(rover.wheel_torque).all():
        values["wheels.torque_n_m"] = _list(_alike(rover.wheel_torque))
    if rover.steering_offset.any():
        values["linkage.steering_offset_m"] = _list(_one_side(rover.steering_offset))
    for joint, stops in (("rocker", rover.rocker_limits), ("bogie", rover.bogie_limits)):
        if np.isfinite(stops).any():
            values[f"stops.{joint}_deg"] = _list(np.rad2deg(stops))
    if rover.differential[2:].any():
        values["differential.coefficients"] = _list(rover.differential)
    elif rover.differential[1] != -1:
        values["differential.ratio"] = _number(-rover.differential[1])
    for total in (float(round(rover.mass, 9)), rover.mass):
        if _by_rule(rover, total):
            values["mass.total_kg"] = _number(total)
            break
    return values


def _by_rule(rover: Rover, total: float) -> bool:
    """Return True if the rover's links are the rule of thumb's for a total mass (kg)."""
    shape = ("wheel_radius", "wheel_width", "rocker_pivot", "bogie_pivot", "hubs", "body_box")
    typical = Rover.from_pivots(**{name: getattr(rover, name) for name in shape}, mass=total)
    own, ruled = (np.array([[k.mass, *k.com, *k.inertia.ravel()] for k in r.links]) for r in (rover, typical))
    return bool(np.allclose(own, ruled, rtol=1e-14, atol=1e-15))


def _link_lines(rover: Rover, keys: list[Key]) -> list[str]:
    """Return the lines of TOML for masses, centres of mass and inertias, one table a link.

    The keys are those of each table, with the comments that stand above them.
    """
    lines = [f"# {TABLES['link']}"]
    lines += [f"#   {key.name}: {key.comment}" for key in keys]
    for name, link in zip(LINKS, rover.links, strict=True):
        six = link.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        values = (_number(link.mass), _list(link.com), _list(six))
        lines += [f"[link.{name}]", *(f"{key.name} = {text}" for key, text in zip(keys, values, strict=True)), ""]
    return lines


def _alike(per_wheel: Any) -> Any:
    """Return one value for equal wheels, one a pair for equal pairs, else one a wheel."""
    if (per_wheel == per_wheel[0]).all():
        return per_wheel[0]
    return per_wheel[::2] if np.array_equal(per_wheel[::2], per_wheel[1::2]) else per_wheel


def _one_side(points: Array) -> Array:
    """Return the left side of points (2 or 6, ...) if the right mirrors it; else all."""
    left, right = points[::2], points[1::2]
    mirror = np.array([1.0, -1.0, 1.0])[: points.shape[1]]
    return (left[0] if len(left) == 1 else left) if np.array_equal(left * mirror, right) else points


def _number(value: float) -> str:
    """Return a number as TOML text that reads back to the same value; −0 becomes 0."""
    return repr(float(value) + 0.0)


def _list(array: Array) -> str:
    """Return an array as TOML, each row on its own line if there are several."""
    if array.ndim == 0:
        return _number(float(array))
    if array.ndim == 1:
        return "[" + ", ".join(_number(v) for v in array) + "]"
    return "[\n" + "".join(f"  {_list(row)},\n" for row in array) + "]"


def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a rover's TOML file.

    Editors use it to check a file while it is written.

    Returns:
        The schema, to be written as JSON.
    """
    properties: dict[str, Any] = {}
    for key in KEYS:
        entry = {**_kind(key.kind), "description": key.comment}
        if not key.table:
            properties[key.name] = entry
            continue
        table = properties.setdefault(
            key.table, {"type": "object", "description": TABLES[key.table], "additionalProperties": False}
        )
        if key.table == "link":
            parts = table.setdefault("properties", {})
            for part in LINKS:
                own = parts.setdefault(part, {"type": "object", "additionalProperties": False, "properties": {}, "required": []})
                own["properties"][key.name] = entry
                own["required"].append(key.name)
        else:
            table.setdefault("properties", {})[key.name] = entry
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A rover for rockerbogie",
        "description": TABLES[""],
        "type": "object",
        "additionalProperties": False,
        "properties": properties,
        "anyOf": [{"required": ["wheels", "linkage"]}, {"required": ["dh"]}],
    }


def _kind(kind: str) -> dict[str, Any]:
    """Return the JSON schema of a kind of value."""
    number: dict[str, Any] = {"type": "number"}

    def rows(shape: str) -> dict[str, Any]:
        if not shape:
            return number
        count, _, rest = shape.partition("x")
        return {"type": "array", "items": rows(rest), "minItems": int(count), "maxItems": int(count)}

    simple: dict[str, dict[str, Any]] = {
        "text": {"type": "string"},
        "texts": {"type": "array", "items": {"type": "string"}, "minItems": 6, "maxItems": 6},
        "number": number,
        "numbers": {"type": "array", "items": number, "minItems": 2},
    }
    if kind in simple:
        return simple[kind]
    if kind == "bools":
        one = {"type": "boolean"}
        return {"anyOf": [one, *({"type": "array", "items": one, "minItems": n, "maxItems": n} for n in (3, 6))]}
    return {"anyOf": [rows(shape) for shape in ("|3|6" if kind == "per-wheel" else kind).split("|")]}
