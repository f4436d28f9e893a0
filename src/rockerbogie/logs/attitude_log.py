"""Logs of attitudes at known positions, read under the names, axes and signs of their teams."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import RockerbogieError, unknown_name
from ..files.tables import UNITS, Table, find_unit, read_columns
from ..rover.model import Rover
from ..rover.rotations import euler_angles
from .sensor_checks import NED

if TYPE_CHECKING:
    import xarray as xr

ATTITUDE = ("roll", "pitch", "yaw")
#: Roles of columns: these, and `steering_` with a wheel's name.
ROLES = ("place", "x", "y", *ATTITUDE, "quaternion")
FRAMES = ("enu", "ned")
#: Largest roll and pitch, rad; a larger one is most likely in degrees.
LARGEST = np.pi / 2 + 1e-6


@dataclass(frozen=True)
class LogMap:
    """Names and meanings of a log's columns.

    Args:
        columns: role -> column. Roles: `place` (a label, such as the sol), `x`, `y` (east and north in the terrain's frame),
            `roll`, `pitch`, `yaw`, or `quaternion` (four columns x, y, z, scalar: body to site), and `steering_LF` and so on
            for the wheels' names (left positive). A minus before a column's name turns its sign.
        frame: axes of roll, pitch, yaw or quaternion. "enu": ours, body x forward, y left, z up over east, north, up. "ned":
            body x forward, y right, z down over north, east, down: pitch is nose up and yaw clockwise from north.
        units: role -> "deg", "rad", "m", …, if neither a header `name [unit]` nor an ending `_deg` gives the unit. Default:
            rad and m.
        origin: (x, y) of the log's origin in the terrain's frame, m.
        name: for messages.
    """

    columns: Mapping[str, str | Sequence[str]]
    frame: Literal["enu", "ned"] = "enu"
    units: Mapping[str, str] = field(default_factory=dict)
    origin: tuple[float, float] = (0.0, 0.0)
    name: str = "mapping"

    def __post_init__(self) -> None:
        for role, column in self.columns.items():
            if role not in ROLES and not role.startswith("steering_"):
                raise RockerbogieError(unknown_name("column to map", role, (*ROLES, "steering_LF")))
            if role == "quaternion" and (isinstance(column, str) or len(column) != 4):
                raise RockerbogieError(f"quaternion is {column!r}: give four columns, x, y, z and the scalar last")
            if role != "quaternion" and not isinstance(column, str):
                raise RockerbogieError(f"{role} is {column!r}: give one column's name")
        twice = [role for role in ATTITUDE if role in self.columns]
        if "quaternion" in self.columns and twice:
            raise RockerbogieError(f"both quaternion and {twice[0]} are mapped, which gives the attitude twice: leave one out")
        if self.frame not in FRAMES:
            raise RockerbogieError(f"frame {self.frame!r} is not known; give 'enu' or 'ned'")
        for role, unit in self.units.items():
            if find_unit(str(unit)) is None:
                raise RockerbogieError(f"unit {unit!r} of {role} is not known; known are {', '.join(UNITS)}")
        if len(self.origin) != 2 or not np.isfinite(self.origin).all():
            raise RockerbogieError(f"origin is {self.origin!r}: give the finite x and y of the log's origin, in metres")

    @classmethod
    def from_toml(cls, file: str | Path) -> LogMap:
        """Read a mapping from a TOML file.

        Keys are `frame = "ned"`, `origin = [x, y]` and the tables `[columns]` and `[units]`.

        Args:
            file: the file.

        Returns:
            The mapping.

        Raises:
            RockerbogieError: no such file, not TOML, or a key that is not one of these.
        """
        path = Path(file)
        try:
            with open(path, "rb") as stream:
                given = tomllib.load(stream)
        except (OSError, ValueError) as error:
            raise RockerbogieError(f"the mapping {str(file)!r} cannot be read: {error}") from None
        for key in given:
            if key not in ("columns", "frame", "units", "origin"):
                raise RockerbogieError(f"{path.name}: {unknown_name('key', key, ('columns', 'frame', 'units', 'origin'))}")
        try:
            origin = tuple(float(v) for v in given.get("origin", (0.0, 0.0)))
            return cls(dict(given.get("columns", {})), given.get("frame", "enu"), dict(given.get("units", {})), origin, path.name)  # type: ignore[arg-type]
        except (TypeError, ValueError) as error:
            raise RockerbogieError(f"{path.name}: {error}") from None

    @property
    def wanted(self) -> list[str]:
        """Every column that the mapping reads."""
        return [name for column in self.columns.values() for name in ([column] if isinstance(column, str) else column)]


#: Logs that need no mapping: runs of this package, waypoints of Curiosity and Perseverance, drives of Perseverance.
KNOWN_LOGS = (
    LogMap({name: name for name in ("x", "y", *ATTITUDE)}, name="rockerbogie"),
    LogMap(
        {"place": "sol", "x": "easting_m", "y": "northing_m", "roll": "roll_deg", "pitch": "pitch_deg", "yaw": "yaw_deg"},
        frame="ned",
        name="curiosity waypoints",
    ),
    LogMap(
        {"place": "site", "x": "easting_m", "y": "northing_m", "roll": "roll_deg", "pitch": "pitch_deg", "yaw": "yaw_deg"},
        frame="ned",
        name="perseverance waypoints",
    ),
    LogMap(
        {
            "place": "SCLK_REL", "x": "ROVER_Y", "y": "ROVER_X", "quaternion": ("QUAT_X", "QUAT_Y", "QUAT_Z", "QUAT_C"),
            **{f"steering_{wheel}": f"{wheel}_STEER" for wheel in ("LF", "RF", "LR", "RR")},
        },
        frame="ned",
        name="perseverance drive",
    ),
)  # fmt: skip


def known_log(file: str | Path) -> LogMap | None:
    """Return the mapping of a log of a known kind.

    Args:
        file: a CSV file.

    Returns:
        The mapping; `None` if the log's columns are those of no known kind.

    Raises:
        RockerbogieError: as for `read_places`.
    """
    return _kind(_read(Path(file)))


def read_places(file: str | Path, rover: Rover, mapping: LogMap | None = None) -> xr.Dataset:
    """Read positions and attitudes of a rover from a CSV with a header line, turned to our axes.

    Rows in which a needed column is empty are left out; `attrs["notes"]` states how many.

    Args:
        file: a CSV; columns may be separated by commas, semicolons or tabs.
        rover: the rover; `steering_` columns have its wheels' names.
        mapping: the meaning of the columns. Default: the log must be of a known kind (`KNOWN_LOGS`): a CSV of
            `rockerbogie drive`, the Curiosity waypoints or the Perseverance drive of docs/validation.md.

    Returns:
        Dataset over `row`: `place` (text), `x`, `y` (m), `roll`, `pitch`, `yaw` (rad, our signs), `steering` (row, wheel).

    Raises:
        RockerbogieError: no such file; a column that is missing or holds text; columns missing from the mapping; roll or
            pitch beyond π/2, as of degrees without a unit.
    """
    import xarray as xr

    table = _read(Path(file))
    known = mapping or _kind(table)
    if known is None:
        raise RockerbogieError(
            f"{table.file} is no log known by its columns ({', '.join(table.names)}): say which hold x, y, roll, pitch and yaw"
        )
    whole = "quaternion" in known.columns
    missing = [role for role in ("x", "y", *(() if whole else ATTITUDE)) if role not in known.columns]
    if missing:
        raise RockerbogieError(f"{known.name} does not say which column of {table.file} is {missing[0]}: name one")
    wheels = {}
    for role in known.columns:
        if role.startswith("steering_"):
            wheel = role.removeprefix("steering_")
            if wheel not in rover.wheel_names:
                raise RockerbogieError(unknown_name("wheel", wheel, rover.wheel_names))
            wheels[wheel] = _column(table, known.columns[role], role, known.units)
    values = {role: _column(table, known.columns[role], role, known.units) for role in ("x", "y")}
    values = {role: array + known.origin[k] for k, (role, array) in enumerate(values.items())}
    parts = {name: _column(table, name, "quaternion", known.units) for name in known.columns.get("quaternion", ())} or {
        role: _column(table, known.columns[role], role, known.units) for role in ATTITUDE
    }
    full = np.isfinite(np.stack([*values.values(), *wheels.values(), *parts.values()])).all(axis=0)
    if not full.any():
        raise RockerbogieError(f"{table.file} has no row in which {', '.join(known.wanted)} are all finite numbers")
    notes = [*table.notes] + ([f"{int((~full).sum())} rows with missing values were left out"] if not full.all() else [])
    rows = np.flatnonzero(full)
    values = {role: array[rows] for role, array in values.items()}
    parts = {name: array[rows] for name, array in parts.items()}
    if whole:
        R = _rotation(list(parts.values()), table, rows)
        values |= dict(zip(ATTITUDE, euler_angles(R if known.frame == "enu" else NED[0] @ R @ NED[1]), strict=True))
    else:
        for role in ("roll", "pitch"):
            _check_tilt(parts[role], role, known, table, rows)
        values |= parts
        if known.frame == "ned":
            values |= {"pitch": -values["pitch"], "yaw": np.pi / 2 - values["yaw"]}
    steering = np.zeros((len(rows), 6))
    for wheel, angle in wheels.items():
        steering[:, rover.wheel_names.index(wheel)] = angle[rows]
    label = known.columns.get("place")
    labels = [str(k + 1) for k in rows] if label is None else [_short(table.text(str(label))[k]) for k in rows]
    data: dict[str, Any] = {name: ("row", array) for name, array in values.items()}
    data |= {"place": ("row", labels), "steering": (("row", "wheel"), steering)}
    attrs: dict[str, Any] = {"log": table.file, "mapping": known.name, "place_is": "row" if label is None else str(label)}
    attrs |= {"left_out": int((~full).sum()), "notes": "\n".join(notes)}
    return xr.Dataset(data, {"row": 1 + rows, "wheel": list(rover.wheel_names)}, attrs)


def _read(path: Path) -> Table:
    """Return the table of a CSV file."""
    try:
        return read_columns(path, cut_off=True)
    except RockerbogieError as error:
        if path.is_file():
            raise
        raise RockerbogieError(f"the log {str(path)!r} cannot be read as CSV: {error}") from None


def _kind(table: Table) -> LogMap | None:
    """Return the known kind of a table, by its columns."""
    return next((known for known in KNOWN_LOGS if all(table.find(name) is not None for name in known.wanted)), None)


def _column(table: Table, name: str | Sequence[str], role: str, units: Mapping[str, str]) -> Array:
    """Return a column (n,) in SI. A minus before the name turns the sign."""
    assert isinstance(name, str)
    turned = name.startswith("-") and table.find(name) is None
    bare = name[1:].strip() if turned else name
    k = table.find(bare)
    if k is None:
        raise RockerbogieError(f"{table.file} has no column {bare!r}; it has {', '.join(table.names)}")
    ending = table.names[k].rpartition("_")[2]
    unit = units.get(role) or table.units[k] or (ending if find_unit(ending) else "")
    if unit and find_unit(unit) is None:
        raise RockerbogieError(f"{table.file}: column {table.names[k]!r} is in {unit!r}, which is not known: give it under units")
    try:
        values = table.numbers(bare, unit)
    except RockerbogieError as error:
        raise RockerbogieError(str(error).replace("is no number", "is no finite number") + f": {role} needs one") from None
    return np.asarray(-values if turned else values)


def _check_tilt(angle: Array, role: str, known: LogMap, table: Table, rows: NDArray[np.int64]) -> None:
    """Raise if a roll or pitch is beyond π/2."""
    beyond = np.flatnonzero(np.abs(angle) > LARGEST)
    if len(beyond):
        n = int(beyond[0])
        column = str(known.columns[role]).removeprefix("-")
        raise RockerbogieError(
            f"{table.file}: row {table.lines[rows[n]]}, column {column!r} gives a {role} of {angle[n]:.4g} rad, beyond π/2: if "
            f"it is in degrees, write {column} [deg] in the header, or give the unit under [units] of a mapping"
        )


def _short(label: str) -> str:
    """Return a label unchanged; a fraction, such as a time, with five digits."""
    try:
        return f"{float(label):.5g}" if "." in label else label
    except ValueError:
        return label


def _rotation(parts: list[Array], table: Table, rows: NDArray[np.int64]) -> Array:
    """Return rotation matrices (n, 3, 3) of quaternions x, y, z, scalar."""
    from scipy.spatial.transform import Rotation

    q = np.stack(parts, axis=-1)
    size = np.linalg.norm(q, axis=1)
    if (np.abs(size - 1) > 0.01).any():
        n = int(np.argmax(np.abs(size - 1)))
        raise RockerbogieError(
            f"{table.file}: row {table.lines[rows[n]]} holds a quaternion of length {size[n]:.3g}, not 1: are these its columns?"
        )
    return np.asarray(Rotation.from_quat(q).as_matrix())
