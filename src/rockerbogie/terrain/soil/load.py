"""Soils by preset name and from TOML files."""

from __future__ import annotations

import os
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import RockerbogieError, unknown_name
from .laws import Soil

DEGREE = float(np.pi / 180.0)
#: Keys of a soil's TOML file: field of Soil and factor to SI; factor None: text.
KEYS: dict[str, tuple[str, float | None]] = {
    "title": ("title", None),
    "source": ("source", None),
    "grade": ("grade", None),
    "strength.cohesion_pa": ("cohesion", 1.0),
    "strength.friction_angle_deg": ("friction_angle", DEGREE),
    "strength.destructive_angle_deg": ("destructive_angle", DEGREE),
    "strength.density_kg_m3": ("density", 1.0),
    "pressure.law": ("pressure", None),
    "pressure.kc": ("kc", 1.0),
    "pressure.kphi": ("kphi", 1.0),
    "pressure.exponent": ("exponent", 1.0),
    "pressure.exponent_terms": ("exponent_terms", 1.0),
    "pressure.exponent_grouser": ("exponent_grouser", 1.0),
    "shear.modulus_m": ("shear_modulus", 1.0),
    "shear.modulus_angle_m_per_rad": ("shear_modulus_angle", 1.0),
    "shear.side_modulus_m": ("side_shear_modulus", 1.0),
    "shear.side_modulus_angle_m_per_rad": ("side_shear_modulus_angle", 1.0),
    "contact.peak": ("peak", 1.0),
    "contact.peak_terms": ("peak_terms", 1.0),
    "contact.exit": ("exit", 1.0),
    "contact.exit_terms": ("exit_terms", 1.0),
    "contact.exit_grouser": ("exit_grouser", 1.0),
    "contact.slip_speed": ("slip_speed", None),
    "shear.coupled": ("coupled", None),
    "side.bulldozing": ("bulldozing", 1.0),
    "rut.exponent": ("rut_exponent", 1.0),
}
#: Keys that a file must have.
REQUIRED = (
    "strength.cohesion_pa", "strength.friction_angle_deg", "strength.density_kg_m3", "pressure.kc", "pressure.kphi",
    "pressure.exponent", "shear.modulus_m",
)  # fmt: skip
#: Largest file, bytes.
MAX_BYTES = 100_000


def soils() -> dict[str, Soil]:
    """Return the package's soils by name.

    Returns:
        Soils by name, each with its source and grade.
    """
    return {name: load_soil(name) for name in _presets()}


def load_soil(name_or_path: str | Path) -> Soil:
    """Return a soil by the name of a preset, or from a TOML file.

    Args:
        name_or_path: a name of `soils()`, or the path of a .toml file.

    Returns:
        The soil.

    Raises:
        RockerbogieError: no such preset or file, or parameters that are missing, negative, out of range or in wrong units.
    """
    known = _presets()
    if not isinstance(name_or_path, str | os.PathLike):
        raise RockerbogieError(f"{name_or_path!r:.60} names no soil: give a preset ({', '.join(known)}) or the path of a file")
    path = known.get(str(name_or_path), Path(name_or_path))
    if path.suffix.lower() != ".toml" and not path.is_file():
        raise RockerbogieError(f"{unknown_name('soil', str(name_or_path), known)} Or give the path of a .toml file.")
    try:
        if path.stat().st_size > MAX_BYTES:
            raise RockerbogieError(f"{path.name}: larger than {MAX_BYTES / 1000:.0f} kB, which is no soil file")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise RockerbogieError(f"cannot read soil file {str(path)!r}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise RockerbogieError(f"{path.name}: it is not UTF-8 text") from None
    return read_soil(text, path.stem)


def read_soil(text: str, name: str) -> Soil:
    """Return a soil from the text of a TOML file.

    Args:
        text: the text.
        name: of the soil, also for messages.

    Returns:
        The soil.

    Raises:
        RockerbogieError: as `load_soil`.
    """
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RockerbogieError(f"{name}.toml: {error}") from None
    found = _flat(tree)
    for key in found:
        if key not in KEYS:
            raise RockerbogieError(f"{name}.toml: {unknown_name('key', key, KEYS)}")
    missing = [key for key in REQUIRED if key not in found]
    if missing:
        raise RockerbogieError(f"{name}.toml: {', '.join(missing)} missing")
    return Soil(name=name, **{KEYS[key][0]: _value(name, key, value) for key, value in found.items()})


def _value(name: str, key: str, value: object) -> Any:
    """Return the value of a key in SI units."""
    field, factor = KEYS[key]
    if field.endswith("_terms"):
        if isinstance(value, list) and all(isinstance(item, int | float) and not isinstance(item, bool) for item in value):
            return tuple(float(item) for item in value)
        raise RockerbogieError(f"{name}.toml: {key} is {value!r:.60}; it must be a list of numbers")
    wanted: Any = bool if field == "coupled" else str if factor is None else (int, float)
    if not isinstance(value, wanted) or (isinstance(value, bool) and field != "coupled"):
        kind = "true or false" if wanted is bool else "text" if wanted is str else "a number"
        raise RockerbogieError(f"{name}.toml: {key} is {value!r:.40}; it must be {kind}")
    return value if factor is None else float(value) * factor


def _presets() -> dict[str, Path]:
    """Return the files of the package's soils by name."""
    root = Path(str(files("rockerbogie.terrain.soil").joinpath("presets")))
    return {file.stem: file for file in sorted(root.glob("*.toml"))}


def _flat(tree: dict[str, Any]) -> dict[str, Any]:
    """Return the keys of a TOML tree as `table.key`."""
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        flat.update({f"{key}.{name}": item for name, item in value.items()} if isinstance(value, dict) else {key: value})
    return flat
