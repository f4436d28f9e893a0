"""Benchmark of predicted attitudes against flown ones on Mars (docs/benchmark.md)."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..files.outputs import check_outputs
from ..files.version import __version__
from ..rover.formats import load_rover
from ..rover.model import Rover
from ..settling.uncertainty import interval_score, stands
from ..terrain.heightfield import Terrain
from .attitude_log import read_places
from .benchmark_entry import ENDS, check_scale, read_predictions
from .validate import CHANNELS, validate

if TYPE_CHECKING:
    import xarray as xr

#: Environment variable with the folder of the data.
DATA_VARIABLE = "ROCKERBOGIE_DATA"
#: Nominal share of values in a band.
LEVEL = 0.8
PACKAGE, PLANE, ENTERED = "rockerbogie", "plane", "entered"


@dataclass(frozen=True)
class CaseSet:
    """Group of cases with one rover, one terrain model and one log."""

    name: str
    rover: str
    terrain: str  # file below the data folder
    logs: tuple[str, ...]  # files below it; the first that exists is read
    title: str


SETS = (
    CaseSet("gale", "curiosity", "gale/missionDEM.tif", ("gale/curiosity_waypoints.csv",), "Curiosity, Gale, sols 960-1073"),
    CaseSet(
        "site78", "perseverance", "perseverance/site78.tif", ("perseverance/waypoints_site78.csv",),
        "Perseverance, site 78, sols 1510-1595",
    ),
    CaseSet(
        "sol1590", "perseverance", "perseverance/site78.tif",
        ("perseverance/sol01590.csv", "perseverance/sol01590_first60.csv"), "Perseverance, drive of sol 1590",
    ),
    CaseSet(
        "sol1294", "perseverance", "perseverance/sol01294.tif",
        ("perseverance/sol01294.csv", "perseverance/sol01294_first60.csv"), "Perseverance, drive of sol 1294",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class MarsBenchmark:
    """Result of `benchmark_mars`.

    `cases` over `case` and `channel` (pitch, roll), rad: `logged`; over `contender` too: `predicted`, `low`, `high`; `x`, `y`
    (m), `yaw` (rad), `set` and `place` of each case. `scores` over `set`, `contender` and `channel`: see `benchmark_mars`.
    """

    cases: xr.Dataset
    scores: xr.Dataset
    absent: dict[str, str] = field(default_factory=dict)  # set -> reason why it is not scored

    @property
    def contenders(self) -> list[str]:
        """Return the contenders: rockerbogie, plane, and entered if predictions were given."""
        return [str(name) for name in self.scores["contender"].to_numpy()]


@dataclass(frozen=True)
class _Loaded:
    """Files of one set, read."""

    about: CaseSet
    rover: Rover
    terrain: Terrain
    places: xr.Dataset


def benchmark_mars(
    data: str | Path | None = None,
    predictions: str | Path | None = None,
    *,
    draws: int = 400,
    seed: int = 0,
    progress: Callable[[int, int], object] | None = None,
) -> MarsBenchmark:
    """Score predicted pitch and roll against those flown on Mars.

    Contenders are the settled rover (`rockerbogie`), a plane through the terrain below the six wheels (`plane`), and another
    program's predictions (`entered`). Rows of a drive at one position count once. Bilinear terrain, published dimensions,
    nothing tuned; the relief factor of a band is fitted on positions more than 5 m away (see `validate`).

    Args:
        data: folder with `gale/` and `perseverance/`; default: the environment variable ROCKERBOGIE_DATA. Sets whose files
            are missing are left out and listed in `absent`.
        predictions: CSV in the form of `write_benchmark_template`, with columns `case`, `pitch [deg]`, `roll [deg]` and, if
            the program has bands, `pitch_low`, `pitch_high`, `roll_low`, `roll_high`: the central 80 %.
        draws: random terrains per case; 0 for no bands.
        seed: seed of the draws.
        progress: called with (steps done, steps in all).

    Returns:
        A `MarsBenchmark`. Its `scores` hold, over `set` (and `all`), `contender` and `channel`: `rms`, `bias`,
        `median_absolute_error`, `rms_package` (the package on the same cases), rad; `correlation`; `coverage` of the 80 %
        bands and their `interval_score`, rad; `count`, the number of cases predicted. NaN where there is no band.

    Raises:
        RockerbogieError: no data; a file that cannot be read; predictions of unknown or repeated cases, of other
            poses than the cases', or out of range.
    """
    import xarray as xr

    loaded, absent = _load(data)
    file = None if predictions is None else Path(predictions)
    entered = None if file is None else read_predictions(file, {k: v for one in loaded for k, v in _poses(one).items()})
    parts = []
    for k, one in enumerate(loaded):
        found = validate(one.rover, one.terrain, one.places, level=LEVEL, draws=draws, seed=seed)
        parts.append(_scored_cases(one, found))
        if progress is not None:
            progress(k + 1, len(loaded))
    cases = xr.concat(parts, "case", coords="minimal", compat="override", join="override", combine_attrs="drop")
    if file is not None and entered is not None:
        check_scale(file.name, entered[0], cases["logged"].to_numpy())
        own = _entered(entered, cases)
        cases = xr.concat([cases, own], "contender", data_vars="minimal", coords="minimal", compat="override")
    cases.attrs = {"source": f"rockerbogie {__version__} benchmark mars", "level": LEVEL, "draws": draws, "seed": seed}
    return MarsBenchmark(cases, _scores(cases), absent)


def write_benchmark_template(file: str | Path, data: str | Path | None = None, *, force: bool = False) -> Path:
    """Write the cases of the benchmark as a CSV to fill in, without logged attitudes.

    Columns: `case`, `rover`, `terrain` (file below the data folder), `x [m]`, `y [m]` of the body's reference point in the
    terrain's frame, `yaw [deg]` counter-clockwise from +x, and empty `pitch [deg]` (nose down positive), `roll [deg]` (left
    side up positive) and ends of their 80 % bands.

    Args:
        file: the CSV to write.
        data: folder of the data, as for `benchmark_mars`.
        force: replace an existing file.

    Returns:
        The file.

    Raises:
        RockerbogieError: no data, or the file exists.
    """
    path = Path(file)
    if not path.parent.is_dir():
        raise RockerbogieError(f"no folder at {str(path.parent)!r}: make it, or give another name")
    if path.exists() and not force:
        raise RockerbogieError(f"{str(path)!r} exists and may hold predictions: give another name")
    check_outputs([path], data_files(data), force=force)
    loaded, _ = _load(data)
    wanted = [*CHANNELS, *(f"{channel}_{end}" for channel in CHANNELS for end in ENDS)]
    with open(path, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["case", "rover", "terrain", "x [m]", "y [m]", "yaw [deg]", *(f"{name} [deg]" for name in wanted)])
        for one in loaded:
            for name, (x, y, yaw) in _poses(one).items():
                pose = (f"{x:.3f}", f"{y:.3f}", f"{np.degrees(yaw):.4f}")
                writer.writerow([name, one.about.rover, one.about.terrain, *pose, *("" for _ in wanted)])
    return path


def data_files(data: str | Path | None = None) -> list[Path]:
    """Return the files that `benchmark_mars` can read.

    Args:
        data: as for `benchmark_mars`.

    Returns:
        Paths of terrain models and logs that exist.

    Raises:
        RockerbogieError: no data folder.
    """
    folder = _folder(data)
    return [file for about in SETS for name in (about.terrain, *about.logs) if (file := folder / name).is_file()]


def _folder(data: str | Path | None) -> Path:
    """Return the folder of the data, or raise."""
    given = data if data is not None else os.environ.get(DATA_VARIABLE)
    if not given:
        raise RockerbogieError(
            f"the benchmark needs a folder with gale/ and perseverance/: give data (--data DIR) or set {DATA_VARIABLE}; "
            "docs/benchmark.md lists the files and their sources"
        )
    if not isinstance(given, str | os.PathLike):
        raise RockerbogieError(f"data is {given!r:.60}; give the path of the folder that holds gale/ and perseverance/")
    folder = Path(given)
    if not folder.is_dir():
        raise RockerbogieError(f"no data folder at {str(given)!r}: give the folder that holds gale/ and perseverance/")
    return folder


def _load(data: str | Path | None) -> tuple[list[_Loaded], dict[str, str]]:
    """Return the sets whose files exist, and the reasons why the others are left out."""
    folder = _folder(data)
    loaded, absent = [], {}
    for about in SETS:
        files = []
        for kind, names in (("terrain model", (about.terrain,)), ("log", about.logs)):
            found = next((folder / name for name in names if (folder / name).is_file()), None)
            if found is None:
                absent[about.name] = f"no {kind} at {names[0]}"
                break
            files.append(found)
        else:
            rover = load_rover(about.rover)
            terrain = Terrain.from_raster(files[0], interpolation="linear")
            loaded.append(_Loaded(about, rover, terrain, read_places(files[1], rover)))
    if not loaded:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in absent.items())
        raise RockerbogieError(f"{str(folder)!r} holds no complete set of the benchmark ({reasons}): see docs/benchmark.md")
    return loaded, absent


def _positions(places: xr.Dataset) -> Any:
    """Return the first row of each position."""
    return stands(*(places[name].to_numpy() for name in ("x", "y", "yaw")))[0]


def _names(one: _Loaded) -> list[str]:
    """Return the names of the cases of a set, which differ."""
    places = one.places["place"].to_numpy()[_positions(one.places)]
    names = [f"{one.about.name}/{place}" for place in places]
    return names if len(set(names)) == len(names) else [f"{name}#{k + 1}" for k, name in enumerate(names)]


def _poses(one: _Loaded) -> dict[str, tuple[float, float, float]]:
    """Return x, y (m) and yaw (rad) of the cases of a set, by name."""
    rows = _positions(one.places)
    x, y, yaw = (one.places[name].to_numpy()[rows].tolist() for name in ("x", "y", "yaw"))
    return dict(zip(_names(one), zip(x, y, yaw, strict=True), strict=True))


def _scored_cases(one: _Loaded, found: xr.Dataset) -> xr.Dataset:
    """Return the cases of one set with predictions of package and plane."""
    import xarray as xr

    rows = _positions(one.places)
    at = found.isel(row=rows)
    shape = (len(rows), len(CHANNELS))
    plane = plane_attitude(one.rover, one.terrain, *(at[name].to_numpy() for name in ("x", "y", "yaw")))
    missing = np.full(shape, np.nan)
    bands = [at[end].to_numpy() if end in at else missing for end in ENDS]
    rad = {"units": "rad"}
    over = ("contender", "case", "channel")
    return xr.Dataset(
        {
            "logged": (("case", "channel"), at["logged"].to_numpy(), rad | {"long_name": "logged attitude"}),
            "predicted": (over, np.stack([at["predicted"].to_numpy(), plane]), rad | {"long_name": "predicted attitude"}),
            "low": (over, np.stack([bands[0], missing]), rad | {"long_name": "low end of the 80 % band"}),
            "high": (over, np.stack([bands[1], missing]), rad | {"long_name": "high end of the 80 % band"}),
            **{name: ("case", at[name].to_numpy(), at[name].attrs) for name in ("x", "y", "yaw", "place")},
            "set": ("case", [one.about.name] * len(rows)),
        },
        {"case": _names(one), "channel": list(CHANNELS), "contender": [PACKAGE, PLANE]},
    )


def plane_attitude(rover: Rover, terrain: Terrain, x: Array, y: Array, yaw: Array) -> Array:
    """Compute pitch and roll of the least-squares plane through the terrain below the six hubs.

    Args:
        rover: the rover; the hubs are those of its reference pose.
        terrain: the terrain model.
        x, y: (n,) m.
        yaw: (n,) rad.

    Returns:
        (n, 2) pitch and roll, rad; NaN if the terrain has no data under a hub.
    """
    hubs = np.asarray(rover.hubs, dtype=float)[:, :2]
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    z = terrain.height(x[:, None] + c * hubs[:, 0] - s * hubs[:, 1], y[:, None] + s * hubs[:, 0] + c * hubs[:, 1])
    design = np.column_stack([hubs, np.ones(len(hubs))])
    slope = z @ np.linalg.pinv(design).T
    return np.stack([-np.arctan(slope[:, 0]), np.arctan(slope[:, 1] * np.cos(np.arctan(slope[:, 0])))], axis=-1)


def _entered(values: Array, cases: xr.Dataset) -> xr.Dataset:
    """Return another program's predictions (3, cases, 2) as a contender."""
    import xarray as xr

    over = ("contender", "case", "channel")
    made = {name: (over, values[k : k + 1]) for k, name in enumerate(("predicted", *ENDS))}
    others = [name for name in cases.data_vars if name not in made]
    return xr.Dataset(made, {"contender": [ENTERED]}).assign(cases[others])


def _scores(cases: xr.Dataset) -> xr.Dataset:
    """Return the scores of each contender on each set and on all cases."""
    import xarray as xr

    names = [*dict.fromkeys(str(name) for name in cases["set"].to_numpy()), "all"]
    contenders = cases["contender"].to_numpy()
    logged = cases["logged"].to_numpy()
    shape = (len(names), len(contenders), len(CHANNELS))
    keys = ("rms", "rms_package", "bias", "median_absolute_error", "correlation", "coverage", "interval_score")
    out = {key: np.full(shape, np.nan) for key in keys}
    count = np.zeros(shape[:2], dtype=np.int64)
    for i, name in enumerate(names):
        rows = np.full(len(logged), True) if name == "all" else cases["set"].to_numpy() == name
        for j in range(len(contenders)):
            predicted, low, high = (cases[key].to_numpy()[j] for key in ("predicted", *ENDS))
            used = rows & np.isfinite(predicted).all(axis=1)
            count[i, j] = used.sum()
            if not used.any():
                continue
            error = predicted[used] - logged[used]
            out["rms"][i, j] = np.sqrt((error**2).mean(axis=0))
            out["bias"][i, j] = error.mean(axis=0)
            out["median_absolute_error"][i, j] = np.median(np.abs(error), axis=0)
            package = cases["predicted"].to_numpy()[0][used] - logged[used]
            out["rms_package"][i, j] = np.sqrt(np.nanmean(package**2, axis=0))
            for c in range(len(CHANNELS)):
                if min(predicted[used, c].std(), logged[used, c].std()) > 0:
                    out["correlation"][i, j, c] = np.corrcoef(predicted[used, c], logged[used, c])[0, 1]
                banded = used & np.isfinite(low[:, c])
                if banded.any():
                    ends = low[banded, c], high[banded, c], logged[banded, c]
                    out["coverage"][i, j, c] = ((ends[0] <= ends[2]) & (ends[2] <= ends[1])).mean()
                    out["interval_score"][i, j, c] = interval_score(*ends, LEVEL).mean()
    rad = ("rms", "rms_package", "bias", "median_absolute_error", "interval_score")
    dims = ("set", "contender", "channel")
    variables: dict[str, Any] = {key: (dims, out[key], {"units": "rad" if key in rad else "1"}) for key in keys}
    variables["count"] = (dims[:2], count, {"units": "1", "long_name": "cases predicted"})
    return xr.Dataset(variables, {"set": names, "contender": contenders, "channel": list(CHANNELS)})
