"""Draw docs/img/perseverance_sol1590.png and print its numbers.

python docs/draw_odometry.py FOLDER_OF_THE_LOG
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import xarray as xr

import rockerbogie as rb
from rockerbogie.figures.style import INK, LEFT, RIGHT, figure, look

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from perseverance_sol1590 import read

OUT = Path(__file__).parent / "img" / "perseverance_sol1590.png"
#: Length of rim over which slip is computed, m: about the distance between two updates of the visual odometry.
WINDOW = 1.0
#: Soil, fitted on the first half of the drive by the example.
SOIL = rb.SlopeSlip(0.58, 0.48)


def slip_of(log: xr.Dataset, rover: rb.Rover, place: np.ndarray) -> np.ndarray:
    """Return slip (n,) by `wheel_slip`, over the last WINDOW of rim.

    It is the length of the mean slip vector of six wheels over their mean rim speed; NaN while turning on the spot.
    """
    time, angle = log["time"].values, log["wheel_angle"].values
    rim = rover.wheel_radius[0] * np.concatenate([[0], np.cumsum(np.abs(np.diff(angle, axis=0)).mean(axis=1))])
    spot = np.abs(log["steering"].values[:, :2]).min(axis=1) > 0.8  # wheels set to turn on the spot
    out = np.full(len(time), np.nan)
    for k in range(len(time)):
        a = int(np.searchsorted(rim, rim[k] - WINDOW))
        if rim[k] < WINDOW or spot[a : k + 1].any() or rim[k] - rim[k - 1] < 1e-3:
            continue
        dt, m = time[k] - time[a], (a + k) // 2
        attitude = (float(log[name][m]) for name in ("roll", "pitch", "yaw"))
        R = rb.body_transform(0, 0, 0, *attitude)[:3, :3]
        v = R.T @ (place[k] - place[a]) / dt
        turning = R.T @ [0, 0, float(log["yaw"][k] - log["yaw"][a]) / dt]
        state = rb.SimpleStance(float(log["rocker"][m]), np.zeros(2), np.zeros(6), log["steering"].values[m])
        spin = (angle[k] - angle[a]) / dt
        slip = rb.wheel_slip(rover, state, [*v, *turning], spin, rocker_rate=0.0, bogie_rates=np.zeros(2))
        out[k] = np.hypot(slip.roll.mean(), slip.side.mean()) / np.abs(rover.wheel_radius * spin).mean()
    return out


def agreement(slip: np.ndarray, log: xr.Dataset, lag: float) -> tuple[float, float, int]:
    """Return correlation, RMS difference and count against the log's slip `lag` s before."""
    logged = np.interp(log["time"].values - lag, log["time"].values, log["slip"].values)
    both = np.isfinite(slip)
    rms = float(np.sqrt(np.mean((slip[both] - logged[both]) ** 2)))
    return float(np.corrcoef(slip[both], logged[both])[0, 1]), rms, int(both.sum())


def main(folder: Path) -> None:
    """Compute four tracks and two estimates of slip, print agreements, and draw them."""
    log, rover = read(folder / "sol01590_first60.csv"), rb.load_rover("perseverance")
    soil = rb.odometry(rover, log, soil=SOIL)
    tracks = {
        "visual odometry (the log's position)": (log, INK, "-", 3.5),
        "flat 2-D, wheels' heading": (rb.flat_odometry(rover, log, heading=False), "#CC79A7", ":", 1.6),
        "flat 2-D, IMU's heading": (rb.flat_odometry(rover, log), "#E69F00", "--", 1.6),
        "3-D": (rb.odometry(rover, log), LEFT, "-", 1.6),
        "3-D with soil": (soil, RIGHT, "-", 1.6),
    }
    measured, predicted = (slip_of(log, rover, np.stack([way[k].values for k in "xyz"], axis=-1)) for way in (log, soil))
    for label, slip in (("from the visual odometry's track", measured), ("from soil and attitude", predicted)):
        for lag in (0.0, 30.0):
            r, rms, n = agreement(slip, log, lag)
            print(f"slip {label:34s} against the log's {lag:2.0f} s before: correlation {r:.2f}, RMS {rms:.3f}, n = {n}")
    logged = log["slip"].values[np.isfinite(measured)]
    print(f"logged slip at these rows: mean {logged.mean():.2f}, standard deviation {logged.std():.3f}")
    plain, flipped = tracks["3-D"][0], rb.odometry(rover, None, log.assign(rocker=-log["rocker"]))
    moved = np.linalg.norm([float(plain[k][-1] - flipped[k][-1]) for k in "xyz"])
    print(f"the other sign of the differential moves the final position by {moved:.2f} m")
    with look():
        fig = figure(9.0, 9.5)
        plan, side, slips = fig.subplots(3, 1, height_ratios=(1.7, 0.9, 1.0))
        for label, (way, colour, style, width) in tracks.items():
            look_of = {"color": colour, "ls": style, "lw": width, "alpha": 0.35 if way is log else 1.0, "label": label}
            plan.plot(way["x"], way["y"], **look_of)
            side.plot(log["time"], way["z"], **look_of)
        plan.set(xlabel="east (m)", ylabel="north (m)", title="Perseverance, sol 1590, the first 60 %: from above")
        plan.set_aspect("equal", adjustable="datalim")
        plan.legend(loc="upper right")
        side.set(xlabel="time (s)", ylabel="height (m)", title="Height")
        slips.plot(log["time"], log["slip"], color=INK, lw=3.5, alpha=0.35, label="logged")
        slips.plot(log["time"], measured, color=LEFT, label=f"wheel_slip on the visual odometry's track, over {WINDOW:g} m")
        slips.plot(log["time"], predicted, color=RIGHT, label="from soil and attitude")
        slips.set(xlabel="time (s)", ylabel="slip (1)", ylim=(0, 0.5), title="Slip, length of its vector")
        slips.legend(loc="upper right", ncols=2)
        fig.align_ylabels()
    fig.savefig(OUT)
    print(OUT)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
