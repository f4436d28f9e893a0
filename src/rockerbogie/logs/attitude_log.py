"""Logs of places: where a rover stood and how it lay, read by whatever names, axes and signs its team uses."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, unknown_name
from ..rotations import euler_angles
from ..rover.model import Rover
from ..tables import HEAD, PLAIN, SCALES

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

ATTITUDE = ("roll", "pitch", "yaw")
#: What a column can be: these, and `steering_` with a wheel's name.
ROLES = ("place", "x", "y", *ATTITUDE, "quaternion")
SPELT = {"meters": "m", "metres": "m", "meter": "m", "metre": "m", "radians": "rad", "radian": "rad"}
SPELT |= {"degrees": "deg", "degree": "deg", "°": "deg"}
FRAMES = ("enu", "ned")


@dataclass(frozen=True)
class LogMap:
    """What a log calls its columns, and what they mean.

    Args:
        columns: role -> column. Roles: `place` (a label, such as the sol), `x`, `y` (east and north in the terrain's frame),
            `roll`, `pitch`, `yaw`, or `quaternion` (four columns x, y, z, scalar: body to site), and `steering_LF` and so on
            for the wheels' names (left positive). A minus before a column's name turns its sign.
        frame: of roll, pitch, yaw or quaternion. "enu": ours, body x forward, y left, z up over east, north, up. "ned": body
            x forward, y right, z down over north, east, down, so that pitch is nose up and yaw clockwise from north.
        units: role -> "deg", "rad", "m", ..., where neither a head `name [unit]` nor an ending `_deg` tells. Else rad and m.
        origin: (x, y) in the terrain's frame that the log's x and y count from, m.
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
            raise RockerbogieError(f"both quaternion and {twice[0]} are mapped, and would tell the attitude twice: leave one out")
        if self.frame not in FRAMES:
            raise RockerbogieError(f"frame {self.frame!r} is not known; give 'enu' or 'ned'")
        for role, unit in self.units.items():
            if _plain_unit(str(unit)) is None:
                raise RockerbogieError(f"unit {unit!r} of {role} is not known; known are {', '.join((*PLAIN[1:], *SCALES))}")
        if len(self.origin) != 2 or not np.isfinite(self.origin).all():
            raise RockerbogieError(f"origin is {self.origin!r}: give the finite x and y that the log counts from, in metres")

    @classmethod
    def from_toml(cls, file: str | Path) -> LogMap:
        """The mapping in a file: `frame = "ned"`, `origin = [x, y]`, a table `[columns]`, a table `[units]`.

        Raises:
            RockerbogieError: no such file, not TOML, or a key that means nothing here.
        """
        path = Path(file)
        try:
            with open(path, "rb") as stream:
                told = tomllib.load(stream)
        except (OSError, ValueError) as error:
            raise RockerbogieError(f"the mapping {str(file)!r} cannot be read: {error}") from None
        for key in told:
            if key not in ("columns", "frame", "units", "origin"):
                raise RockerbogieError(f"{path.name}: {unknown_name('key', key, ('columns', 'frame', 'units', 'origin'))}")
        try:
            origin = tuple(float(v) for v in told.get("origin", (0.0, 0.0)))
            return cls(dict(told.get("columns", {})), told.get("frame", "enu"), dict(told.get("units", {})), origin, path.name)  # type: ignore[arg-type]
        except (TypeError, ValueError) as error:
            raise RockerbogieError(f"{path.name}: {error}") from None

    @property
    def wanted(self) -> list[str]:
        """Every column it reads."""
        return [name for column in self.columns.values() for name in ([column] if isinstance(column, str) else column)]


#: Logs known as they are: a run of our own, NASA's waypoints of Curiosity, the drives of Perseverance's drive-primer.
KNOWN_LOGS = (
    LogMap({name: name for name in ("x", "y", *ATTITUDE)}, name="rockerbogie"),
    LogMap(
        {"place": "sol", "x": "easting_m", "y": "northing_m", "roll": "roll_deg", "pitch": "pitch_deg", "yaw": "yaw_deg"},
        frame="ned",
        name="curiosity waypoints",
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
    """The mapping of a log known by its columns; nothing for any other. Errors as for `read_places`."""
    return _Table.read(Path(file)).kind()


def read_places(file: str | Path, rover: Rover, mapping: LogMap | None = None) -> xr.Dataset:
    """Where a rover stood and how it lay, from a CSV with a line of heads, turned to our axes.

    Args:
        mapping: what the columns mean. Without one the log must be of a kind known by its columns (`KNOWN_LOGS`): a CSV of
            `rockerbogie drive`, the Curiosity waypoints or the Perseverance drive of docs/validation.md.

    Returns:
        Dataset over `row`: `place` (text), `x`, `y` (m), `roll`, `pitch`, `yaw` (rad, our signs), `steering` (row, wheel).

    Raises:
        RockerbogieError: no such file; a column that is not there or holds no number; columns missing from the mapping.
    """
    import xarray as xr

    table = _Table.read(Path(file))
    known = mapping or table.kind()
    if known is None:
        raise RockerbogieError(
            f"{table.file} is no log known by its columns ({', '.join(table.heads)}): say which hold x, y, roll, pitch and yaw"
        )
    whole = "quaternion" in known.columns
    missing = [role for role in ("x", "y", *(() if whole else ATTITUDE)) if role not in known.columns]
    if missing:
        raise RockerbogieError(f"{known.name} does not say which column of {table.file} is {missing[0]}: name one")
    values = {role: table.column(known.columns[role], role, known.units) for role in ("x", "y")}
    values = {role: array + known.origin[k] for k, (role, array) in enumerate(values.items())}
    if whole:
        R = _rotation([table.column(name, "quaternion", known.units) for name in known.columns["quaternion"]], table.file)
        values |= _angles(R if known.frame == "enu" else _TO_ENU @ R @ _TO_FLU)
    else:
        values |= {role: table.column(known.columns[role], role, known.units) for role in ATTITUDE}
        if known.frame == "ned":
            values |= {"pitch": -values["pitch"], "yaw": np.pi / 2 - values["yaw"]}
    steering = np.zeros((len(table.rows), 6))
    for role in known.columns:
        if role.startswith("steering_"):
            wheel = role.removeprefix("steering_")
            if wheel not in rover.wheel_names:
                raise RockerbogieError(unknown_name("wheel", wheel, rover.wheel_names))
            steering[:, rover.wheel_names.index(wheel)] = table.column(known.columns[role], role, known.units)
    label = known.columns.get("place")
    labels = [str(k + 1) for k in range(len(table.rows))] if label is None else [_short(text) for text in table.text(str(label))]
    data: dict[str, Any] = {name: ("row", array) for name, array in values.items()}
    data |= {"place": ("row", labels), "steering": (("row", "wheel"), steering)}
    attrs = {"log": table.file, "mapping": known.name, "place_is": "row" if label is None else str(label)}
    return xr.Dataset(data, {"row": np.arange(1, len(labels) + 1), "wheel": list(rover.wheel_names)}, attrs)


@dataclass(frozen=True)
class _Table:
    """A CSV as text: heads without their units, the units, the rows."""

    file: str
    heads: list[str]
    units: list[str]
    rows: list[list[str]]

    @classmethod
    def read(cls, path: Path) -> _Table:
        try:
            with open(path, newline="", encoding="utf-8-sig") as stream:
                rows = [row for row in csv.reader(stream) if row]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise RockerbogieError(f"the log {str(path)!r} cannot be read as CSV: {error}") from None
        if len(rows) < 2:
            raise RockerbogieError(f"{path.name} holds no rows below a line of heads")
        matches = [HEAD.match(head) for head in rows[0]]
        heads = [m[1] if m else "" for m in matches]
        return cls(path.name, heads, [(m[2] or "") if m else "" for m in matches], rows[1:])

    def kind(self) -> LogMap | None:
        return next((known for known in KNOWN_LOGS if all(self.has(name) for name in known.wanted)), None)

    def has(self, name: str) -> bool:
        return self._find(name) is not None

    def _find(self, name: str) -> int | None:
        """A column by its head, with or without the unit in brackets."""
        bare = HEAD.match(name)
        wanted = bare[1] if bare else name
        return self.heads.index(wanted) if wanted in self.heads else None

    def text(self, name: str) -> list[str]:
        k = self._find(name)
        if k is None:
            raise RockerbogieError(f"{self.file} has no column {name!r}; it has {', '.join(self.heads)}")
        return [row[k].strip() if k < len(row) else "" for row in self.rows]

    def column(self, name: str | Sequence[str], role: str, units: Mapping[str, str]) -> Array:
        """Numbers (n,) in SI; a minus before the name turns the sign, unless the log has that very name."""
        assert isinstance(name, str)
        turned = name.startswith("-") and not self.has(name)
        bare = name[1:].strip() if turned else name
        cells = self.text(bare)
        k = self._find(bare)
        assert k is not None
        told = units.get(role) or self.units[k] or self._ending(k)
        unit = _plain_unit(told)
        if unit is None:
            raise RockerbogieError(
                f"{self.file}: column {self.heads[k]!r} is in {told!r}, which is not known: give it under units"
            )
        values = np.empty(len(cells))
        for n, cell in enumerate(cells):
            try:
                values[n] = float(cell)
            except ValueError:
                values[n] = np.nan
            if not np.isfinite(values[n]):
                raise RockerbogieError(
                    f"{self.file}: row {n + 2}, column {self.heads[k]!r} holds {cell!r}, which is no finite number: "
                    f"{role} needs one in every row"
                )
        return np.asarray((-1.0 if turned else 1.0) * values * SCALES.get(unit, 1.0))

    def _ending(self, k: int) -> str:
        ending = self.heads[k].rpartition("_")[2]
        return ending if _plain_unit(ending) else ""


def _short(label: str) -> str:
    """A label as it stands, but for a fraction, such as a time: five digits of it."""
    try:
        return f"{float(label):.5g}" if "." in label else label
    except ValueError:
        return label


def _plain_unit(unit: str) -> str | None:
    """The unit as `SCALES` and `PLAIN` spell it; nothing if it is not known. `METERS` is as good as `m`."""
    short = SPELT.get(unit.strip().lower(), unit.strip())
    return short if short in SCALES or short in PLAIN else None


_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_TO_FLU = np.diag([1.0, -1.0, -1.0])


def _rotation(parts: list[Array], file: str) -> Array:
    from scipy.spatial.transform import Rotation

    q = np.stack(parts, axis=-1)
    size = np.linalg.norm(q, axis=1)
    if (np.abs(size - 1) > 0.01).any():
        n = int(np.argmax(np.abs(size - 1)))
        raise RockerbogieError(f"{file}: row {n + 2} holds a quaternion of length {size[n]:.3g}, not 1: are these its columns?")
    return np.asarray(Rotation.from_quat(q).as_matrix())


def _angles(R: Array) -> dict[str, Array]:
    """Roll, pitch, yaw (n,) of R = Rz(yaw) Ry(pitch) Rx(roll)."""
    return dict(zip(("roll", "pitch", "yaw"), euler_angles(R), strict=True))
