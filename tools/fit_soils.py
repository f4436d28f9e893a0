"""Fits of soils to public wheel trials: CMU sand, NASA's tilting bed, NASA's single wheel.

Usage: python tools/fit_soils.py DATA, where DATA holds cmu_wheel_trials.csv, nasa_mgru3_slope_slip.csv and
nasa_trec_single_wheel.csv. Each data set is fitted on alternate trials and judged on the others. The CMU trials are also
divided by condition, so that no repetition of a judged trial is fitted. docs/soil.md records the results.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import rockerbogie as rb
from rockerbogie.terrain.soil.fit import TERM_NAMES, WheelFit, WheelTrials, fit_slip_curve, fit_wheel_trials, trial_residuals

#: CMU wheel: radius, width, grouser height, m.
CMU_WHEEL = (0.058, 0.050, 0.005)
#: Largest slip angle of the trials that are fitted: at 90° the wheel sinks deeper than its radius.
CMU_ANGLE = np.radians(61.0)
#: Start of the CMU fit. Angle of repose and density were measured by the authors of the trials.
CMU_START = rb.Soil(
    name="cmu-sand", cohesion=500.0, friction_angle=np.radians(29.0), kc=0.0, kphi=10.0**6.5, exponent=1.3,
    shear_modulus=0.02,
    side_shear_modulus=0.012, density=1330.0, peak=0.3, exit=0.2, slip_speed="travel", exponent_grouser=4.0,
)  # fmt: skip
#: Prior mean and standard deviation of each fitted parameter.
CMU_PRIORS = {
    "stiffness": (6.8, 0.7), "exponent": (1.4, 0.3), "cohesion": (700.0, 500.0),
    "friction_angle": (np.radians(29.0), np.radians(3.5)),
    "shear_modulus": (0.02, 0.01), "side_shear_modulus": (0.012, 0.006), "bulldozing": (1.5, 0.5),
    "peak": (0.25, 0.15), "exit": (0.2, 0.2), "exponent_grouser": (4.0, 3.0), "exit_grouser": (0.0, 3.0),
    **dict.fromkeys(TERM_NAMES, (0.0, 0.4)),
    "exponent.2": (0.4, 0.3), "peak.3": (0.4, 0.3), "exit.3": (-0.5, 0.5),
}  # fmt: skip


#: TREC wheel: radius, width, grouser height, m; load, N.
TREC_WHEEL = (0.25, 0.20, 0.025, 171.7)
#: Start of the TREC fit: pressure and density of a loose sand.
TREC_START = rb.Soil(
    name="trec",
    cohesion=100.0,
    friction_angle=np.radians(37.0),
    kc=0.0,
    kphi=8e5,
    exponent=1.0,
    shear_modulus=0.02,
    density=1700.0,
)
TREC_PRIORS = {
    "friction_angle": (np.radians(37.0), np.radians(5.0)), "shear_modulus": (0.02, 0.01), "exit": (0.3, 0.2),
    "exponent.1": (0.0, 0.3),
}  # fmt: skip
#: Weights: errors of drawbar / load to 30° and above, of side force / load, of sinkage (m).
CMU_ERRORS = (0.03, 0.08, 0.4, 0.002)
#: Each trial is fitted at these loads, in units of its own, with the same ratio of forces to load and the same sinkage: the law
#: must not depend on the load more steeply than the soil does.
CMU_LOADS = (0.96, 1.0, 1.04)


def read(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file, without comments."""
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    return list(csv.DictReader(lines))


def cmu_trials(path: Path) -> tuple[WheelTrials, np.ndarray]:
    """Return the CMU trials to 60° and their slip angles (rad).

    The forces are in the wheel's axes: y backward along its heading, x to the side, z down. Slip is relative to the speed of
    travel. The vertical force of single trials scatters by 6 % at the locked wheel, where the drawbar does not: the load is its
    mean over the trials of one wheel, rate and slip angle.
    """
    rows = [row for row in read(path) if np.radians(float(row["slip_angle_deg"])) < CMU_ANGLE]
    column = {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name != "wheel"}
    grouser = np.array([row["wheel"] == "grouser" for row in rows])
    speed, slip, angle = column["speed_mm_s"] / 1000.0, column["slip"], np.radians(column["slip_angle_deg"])
    rim = np.where(slip < 0.0, speed * (1.0 + slip), speed / (1.0 - np.maximum(slip, 0.0)))
    names = [(row["wheel"], row["wheel_rate_deg_s"], row["slip_angle_deg"]) for row in rows]
    load = np.array(
        [np.mean([-z for z, other in zip(column["force_z_N"], names, strict=True) if other == name]) for name in names]
    )
    trials = WheelTrials(
        radius=CMU_WHEEL[0], width=CMU_WHEEL[1], grousers=np.where(grouser, CMU_WHEEL[2], 0.0), load=load,
        rim=rim, vx=speed * np.cos(angle), vy=speed * np.sin(angle),
        drawbar=-column["force_y_N"], side=-column["force_x_N"], sinkage=-column["z_mm"] / 1000.0,
    )  # fmt: skip
    return trials, angle


def halves(trials: WheelTrials) -> np.ndarray:
    """Return 0 or 1 of each trial: alternate trials in the order of wheel, slip angle and slip."""
    column = trials.arrays()
    keys = [np.round(column[name] / scale) for name, scale in (("rim", 1e-3), ("vy", 1e-3), ("grousers", 1e-3))]
    half = np.empty(keys[0].size, dtype=int)
    half[np.lexsort(keys)] = np.arange(half.size) % 2
    return half


def conditions(path: Path) -> np.ndarray:
    """Return 0 or 1 of each CMU trial: alternate wheels, slip angles and rates."""
    rows = [row for row in read(path) if np.radians(float(row["slip_angle_deg"])) < CMU_ANGLE]
    keys = [(row["wheel"], float(row["slip_angle_deg"]), float(row["wheel_rate_deg_s"])) for row in rows]
    order = sorted(set(keys))
    return np.array([order.index(key) % 2 for key in keys])


def fit_cmu(trials: WheelTrials, angle: np.ndarray, steps: int = 60) -> WheelFit:
    """Return the fit of the CMU sand."""
    rows = np.tile(np.arange(angle.size), len(CMU_LOADS))
    column = trials.take(rows).arrays()
    factor = np.repeat(CMU_LOADS, angle.size)
    for name in ("load", "drawbar", "side"):
        column[name] *= factor
    copies = np.sqrt(len(CMU_LOADS))
    drawbar = np.where(angle[rows] < np.radians(31.0), *CMU_ERRORS[:2]) * copies
    weights = (drawbar, CMU_ERRORS[2] * copies, CMU_ERRORS[3] * copies)
    return fit_wheel_trials(CMU_START, WheelTrials(**column), CMU_PRIORS, weights=weights, steps=steps)


def judge_cmu(soil: rb.Soil, trials: WheelTrials, angle: np.ndarray) -> str:
    """Return the RMS residuals of CMU trials as text."""
    found = trial_residuals(soil, trials)
    small = angle < np.radians(31.0)
    low, high, every = (found.rms(mask) for mask in (small, ~small, small | ~small))
    drawbar = f"{100 * low[0]:.1f} % of the load to 30°, {100 * every[0]:.1f} % to 60° ({100 * high[0]:.1f} % at 60°)"
    rest = f"sinkage {1000 * every[2]:.2f} mm; overloaded {int(found.overloaded.sum())}"
    return f"drawbar {drawbar}; side force {100 * low[1]:.0f} % and {100 * high[1]:.0f} %; {rest}"


def main(folder: Path) -> None:
    """Fit all data sets and print the results."""
    trials, angle = cmu_trials(folder / "cmu_wheel_trials.csv")
    for name, index in (("trials", halves(trials)), ("conditions", conditions(folder / "cmu_wheel_trials.csv"))):
        for half in (0, 1):
            rows = index == half
            fit = fit_cmu(trials.take(rows), angle[rows])
            print(f"CMU, fitted on half {half} of the {name}: {judge_cmu(fit.soil, trials.take(rows), angle[rows])}")
            print(f"CMU, judged on the other: {judge_cmu(fit.soil, trials.take(~rows), angle[~rows])}")
    fit = fit_cmu(trials, angle)
    print(f"CMU, all: {judge_cmu(fit.soil, trials, angle)}")
    for name, value in fit.values.items():
        print(f"  {name:20s} {value:10.5g} ± {fit.deviations[name]:.2g}")
    bed = read(folder / "nasa_mgru3_slope_slip.csv")
    for name in ("A", "B", "AB"):
        rows = [row for row in bed if row["set"] in name]
        ratio = np.tan(np.radians([float(row["slope_deg"]) for row in rows]))
        slip = np.array([float(row["slip_pct"]) for row in rows]) / 100.0
        order = np.argsort(ratio)
        report_curve(f"MGRU3 set {name}", ratio[order], slip[order])
        for law in (logistic, shear):
            errors = held_out(law, ratio[order], slip[order])
            print(f"MGRU3 set {name}, {law.__name__}: slip RMSE {errors[0]:.3f} and {errors[1]:.3f} on the others")
    wheel = read(folder / "nasa_trec_single_wheel.csv")
    ratio = np.tan(np.radians([float(row["traction_angle_deg"]) for row in wheel]))
    slip = np.array([float(row["slip_pct"]) for row in wheel]) / 100.0
    report_curve("TREC wheel", ratio, slip)
    trials = WheelTrials(*TREC_WHEEL, rim=1.0, vx=1.0 - slip, vy=0.0, drawbar=TREC_WHEEL[3] * ratio)
    for half in (0, 1):
        rows = np.arange(slip.size) % 2 == half
        fit = fit_wheel_trials(TREC_START, trials.take(rows), TREC_PRIORS, weights=(0.03, 1.0, 1.0))
        outside = trial_residuals(fit.soil, trials.take(~rows)).rms()[0]
        inside = fit.residuals.rms()[0]
        print(f"TREC wheel, soil: drawbar {100 * inside:.1f} % of the load fitted, {100 * outside:.1f} % on the others")
        print("  " + ", ".join(f"{name} {value:.4g}" for name, value in fit.values.items()))


def logistic(p: np.ndarray, ratio: np.ndarray) -> np.ndarray:
    """Return slip that is logistic in the slope angle; p: angle at slip 0.5 and width, rad."""
    return np.asarray(1.0 / (1.0 + np.exp(-(np.arctan(ratio) - p[0]) / p[1])))


def shear(p: np.ndarray, ratio: np.ndarray) -> np.ndarray:
    """Return the slip at which cohesion-free shear gives a drawbar.

    The shear is Janosi's, under a contact of constant pressure. Slip is 1 beyond the largest drawbar.

    Args:
        p: tangent of the friction angle; shear modulus over contact length.
        ratio: (n,) drawbar over load.
    """
    slip = np.geomspace(1e-6, 1.0, 2000)
    drawbar = p[0] * (1.0 - p[1] / slip * (1.0 - np.exp(-slip / p[1])))
    return np.interp(ratio, drawbar, slip, right=1.0)


def held_out(law: Callable[[np.ndarray, np.ndarray], np.ndarray], ratio: np.ndarray, slip: np.ndarray) -> list[float]:
    """Return the RMS errors of a two-parameter law on alternate points, fitted to the others.

    Of several starts, the fit with the least cost counts.
    """
    found = []
    for half in (0, 1):
        rows = np.arange(slip.size) % 2 == half
        starts = [(a, b) for a in (0.2, 0.3, 0.5, 0.8) for b in (0.03, 0.07, 0.2, 0.5)]
        fits = [
            least_squares(lambda p, rows=rows: law(p, ratio[rows]) - slip[rows], start, bounds=((0.05, 1e-3), (3.0, 5.0)))
            for start in starts
        ]
        best = min(fits, key=lambda fit: fit.cost)
        found.append(float(np.sqrt(np.mean((law(best.x, ratio[~rows]) - slip[~rows]) ** 2))))
    return found


def report_curve(name: str, ratio: np.ndarray, slip: np.ndarray) -> None:
    """Print fits of a slip curve to alternate points, judged on the others."""
    for half in (0, 1):
        rows = np.arange(slip.size) % 2 == half
        curve, inside = fit_slip_curve(ratio[rows], slip[rows])
        outside = np.sqrt(np.mean((curve.slip(ratio[~rows]) - slip[~rows]) ** 2))
        print(f"{name}: D0 {curve.ratio:.4f}, m {curve.power:.3f}; slip RMSE {inside:.3f} fitted, {outside:.3f} on the others")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]))
