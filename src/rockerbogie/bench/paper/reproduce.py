"""Reproduction of the paper's section III: both runs, figures 6 to 9, film, data and report."""

from __future__ import annotations

import inspect
import math
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np

from ...figures.style import save
from ...motion.drive import drive, to_csv
from ...motion.path import Path
from ...rover.formats import load_rover
from ...rover.model import Rover
from ...simulation.compare import PRINTED, Comparison, compare, settle_along
from ...simulation.simulate import simulate_plan
from ...terrain import surfaces
from ...terrain.heightfield import Terrain
from .claims import Claim, Crossing, check_claims
from .figures import angles_figure, arrivals, figure_6, figures_7_to_9
from .film import crossing_gif
from .report import ErrorRow, Picture, write_report

if TYPE_CHECKING:
    import xarray as xr

#: Called with the name of the current part and the share done, 0 to 1.
Progress = Callable[[str, float], None]

ROVER = "elhami-dashti"
#: The paper gives the speed and the ramps' slope. The start and the length of the bumps are chosen, as are all sizes in
#: `surfaces.paper`. The path ends with the rear wheels 0.3 m beyond the bumps.
SPEED = 0.02  # m/s
BUMP_START, BUMP_LENGTH, DISTANCE = 1.0, 2.0, 3.6  # m
STEP = 0.002  # m
FIGURE_6_AT = 1.25  # m along the path

#: Greatest RMS difference of model and simulation, deg and (z) mm; greatest difference of an angle in any record, deg.
RMS_LIMITS = {"roll": 0.01, "pitch": 0.03, "rocker": 0.01, "bogie left": 0.04, "bogie right": 0.04, "z": 1.5}
WORST_LIMIT = 0.15


@dataclass(frozen=True)
class Reproduction:
    """Result of a reproduction: errors against the simulation, statements, and the report.

    Each statement is a pair: decided from the model's run, and from the simulation's.
    """

    errors: list[ErrorRow]
    claims: list[tuple[Claim, Claim]]
    report: FilePath

    @property
    def close(self) -> bool:
        """True if the model is within every limit."""
        return all(row.within for row in self.errors)


def reproduce(folder: FilePath, progress: Progress = lambda what, share: None, *, rover: Rover | None = None) -> Reproduction:
    """Reproduce section III into a folder.

    Args:
        folder: folder of the files; it must exist. Files with the names in `OUTPUTS` are overwritten.
        progress: called with the name of the current part and the share done, 0 to 1.
        rover: a rover to cross the bumps in place of the paper's. Bumps, path and speed are then scaled by the ratio of the
            wheelbases, or of the widths if that is greater; the paper's statements and limits are left out.

    Returns:
        Errors against the simulation, the statements, and the report.
    """
    own = rover is None
    rover = load_rover(ROVER) if rover is None else rover
    scale = 1.0 if own else _scale(rover)
    terrain = surfaces.paper(run_in=BUMP_START, length=BUMP_LENGTH) if own else _scaled_bumps(scale)
    path, speed = Path.straight((0.0, 0.0), 0.0, scale * DISTANCE), scale * SPEED

    progress("kinematic model", 0.0)
    began = time.perf_counter()
    run = drive(rover, terrain, path, speed, step=scale * STEP)
    model_time = time.perf_counter() - began
    began = time.perf_counter()
    sim = simulate_plan(
        rover, terrain, path, run, progress=lambda done, total: progress("rigid-body simulation", 0.05 + 0.65 * done / total)
    )
    sim_time = time.perf_counter() - began

    progress("data", 0.7)
    for name, data in (("model", run), ("simulation", sim)):
        data.to_netcdf(folder / f"{name}.nc", engine="h5netcdf")
        to_csv(data, folder / f"{name}.csv")
    progress("figures", 0.72)
    beside = settle_along(rover, terrain, sim)
    _draw_figures(folder, rover, terrain, run, sim, beside, scale)
    crossing_gif(folder / "crossing.gif", rover, terrain, run, progress=lambda share: progress("film", 0.8 + 0.2 * share))

    errors = error_rows(compare(beside, sim), sim.sizes["time"], limited=own)
    ends = (BUMP_START, BUMP_START + BUMP_LENGTH)
    model, simulated = (check_claims(Crossing.of(rover, terrain, data, *ends)) if own else [] for data in (run, sim))
    claims = list(zip(model, simulated, strict=True))
    at = f"{scale * FIGURE_6_AT:.3g} m"
    write_report(
        folder / "report.html",
        lead=(
            f"{'The rover of Elhami and Dashti' if own else f'Rover {rover.name}'}, driven {scale * DISTANCE:.3g} m straight "
            f"ahead at {100 * speed:.3g} cm/s, its right wheels over "
            "slopes of 16.7° and its left wheels over a sinusoidal hill: by the kinematic model, and by a rigid-body simulation "
            "in MuJoCo."
        ),
        errors=errors,
        claims=claims,
        pictures=[Picture(folder / name, alt, caption.replace("1.25 m", at)) for name, alt, caption in _PICTURES],
        facts=_facts(rover, terrain, run, sim, model_time, sim_time),
        data=_DATA,
    )
    return Reproduction(errors, claims, folder / "report.html")


def _scale(rover: Rover) -> float:
    """Return the ratio of a rover's size to the paper's: of wheelbases, or of widths if greater."""
    paper = load_rover(ROVER)
    broad = [float(np.abs(each.hubs[:, 1]).max()) for each in (rover, paper)]
    return max(rover.wheelbase / paper.wheelbase, broad[0] / broad[1])


def _scaled_bumps(scale: float) -> Terrain:
    """Return the paper's bumps, all lengths times `scale`."""
    default = {key: parameter.default for key, parameter in inspect.signature(surfaces.paper).parameters.items()}
    kept = ("ramp_slope", "interpolation")
    lengths = {key: scale * value for key, value in default.items() if key not in kept}
    return surfaces.paper(**lengths | {"run_in": scale * BUMP_START, "length": scale * BUMP_LENGTH})


def _draw_figures(
    folder: FilePath, rover: Rover, terrain: Terrain, run: xr.Dataset, sim: xr.Dataset, beside: xr.Dataset, scale: float
) -> None:
    """Write figures 6 to 9 as PNG files."""
    save(figure_6(rover, terrain, run, scale * FIGURE_6_AT), folder / "figure6.png", dpi=180)
    for name, (title, curves) in figures_7_to_9(rover).items():
        save(angles_figure(title, curves, run, sim, beside, arrivals(rover, scale * BUMP_START)), folder / f"{name}.png")


def error_rows(comparison: Comparison, records: int, *, limited: bool = True) -> list[ErrorRow]:
    """Return the errors of the main channels, in degrees and millimetres.

    Args:
        comparison: of the two runs.
        records: number of records that must have a difference.
        limited: set the limits of the paper's rover.

    Returns:
        One row per channel of `RMS_LIMITS`; NaN if fewer than `records` records have a difference.
    """
    rows = []
    for name, limit in RMS_LIMITS.items():
        channel = comparison[name]
        unit, factor = PRINTED[channel.unit]
        rms, worst = (factor * v if channel.count == records else math.nan for v in (channel.rms, channel.worst))
        limits = (limit, WORST_LIMIT if unit == "deg" else None) if limited else (None, None)
        rows.append(ErrorRow(name, unit, rms, worst, *limits))
    return rows


def _facts(
    rover: Rover, terrain: Terrain, run: xr.Dataset, sim: xr.Dataset, model_time: float, sim_time: float
) -> dict[str, str]:
    """Return the settings and versions that the report lists: name → value."""
    rows, cols = terrain.z.shape
    return {
        "Rover": f"{rover.name}, {rover.mass:.1f} kg (the mass is chosen: the paper gives none); {rover.source}",
        "Terrain": (
            f"{cols} × {rows} nodes, {1e3 * terrain.spacing[0]:.2f} mm apart, {terrain.interpolation}. The paper gives the "
            f"slope of 16.7° and no other size. Chosen: bumps {BUMP_LENGTH:g} m long from X = {BUMP_START:g} m, a hill 0.3 m "
            "high, ramps 0.2 m high"
        ),
        "Signs": "x forward, y left, z up; roll left side up positive, pitch, rocker and bogie nose down positive; contact "
        "angles from the wheel's own link, ahead of the axle negative",
        "Kinematic model": f"{run.sizes['time']} poses, {model_time:.2f} s; {run.attrs['status_summary']}",
        "Simulation": (
            f"{float(sim['time'][-1]):.0f} s of driving in {sim_time:.1f} s; {sim.attrs['source']}; {sim.attrs['status_summary']}"
        ),
        "Made with": ", ".join(f"{name} {version(name)}" for name in ("rockerbogie", "numpy", "numba", "mujoco"))
        + f", Python {platform.python_version()}, {platform.machine()}",
    }


_PICTURES = (
    (
        "figure6.png",
        "The rover climbing: left wheels on a smooth hill, right wheels on a ramp.",
        "Figure 6. The terrain, and the rover at a distance of 1.25 m. In all figures left is blue and right is vermilion.",
    ),
    ("crossing.gif", "The rover crosses both bumps while its angles are plotted below.", "The crossing, by the kinematic model."),
    (
        "figure7.png",
        "Pitch and roll over the distance, model and simulation side by side, their difference below.",
        "Figure 7. Pitch and roll. Dashed lines: distances at which each axle is above the start of the bumps.",
    ),
    (
        "figure8.png",
        "Rocker and bogie angles over the distance, model and simulation side by side, their difference below.",
        "Figure 8. Rocker and bogie joint angles.",
    ),
    (
        "figure9.png",
        "Contact angles of the front wheels over the distance, model and simulation side by side, their difference below.",
        "Figure 9. Contact angles of the front wheels. In the simulation, the contact is the point with "
        "the greatest contact force on each wheel; it scatters by 1 to 2 mm.",
    ),
)
_DATA = {
    f"{name}.{kind}": f"the {what}'s run, {how}"
    for name, what in (("model", "kinematic model"), ("simulation", "simulation"))
    for kind, how in (("nc", "NetCDF, with units and long names"), ("csv", "CSV"))
}
#: Names of all files that `reproduce` writes.
OUTPUTS = (*(name for name, _, _ in _PICTURES), *_DATA, "report.html")
