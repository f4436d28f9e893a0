"""Compare odometry of Perseverance on sol 1590 with the rover's own visual odometry.

    python examples/perseverance_sol1590.py FOLDER

Sensors are encoders, steering, differential and attitude. FOLDER holds sol01590_first60.csv (NASA/JPL-Caltech's
drive-primer, Apache-2.0); see docs/odometry.md.
"""

import csv
import sys
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import rockerbogie as rb


def read(file: Path) -> xr.Dataset:
    """Return the drive's log in the package's axes.

    Axes of the file: site x north, y east, z down; body x forward, y right, z down.
    """
    with open(file) as stream:
        rows = list(csv.DictReader(stream))
    column = lambda *names: np.array([[float(row[name]) for name in names] for row in rows])  # noqa: E731
    to_enu, to_flu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]), np.diag([1.0, -1, -1])
    R = to_enu @ Rotation.from_quat(column("QUAT_X", "QUAT_Y", "QUAT_Z", "QUAT_C")).as_matrix() @ to_flu
    place = column("ROVER_X [METERS]", "ROVER_Y [METERS]", "ROVER_Z [METERS]") @ to_enu.T
    steering = np.zeros((len(rows), 6))
    steering[:, [0, 1, 4, 5]] = column(*(f"{w}_STEER [RADIANS]" for w in ("LF", "RF", "LR", "RR")))
    left, right = column("LEFT_DIFFERENTIAL", "RIGHT_DIFFERENTIAL").T
    series = {
        "x": place[:, 0], "y": place[:, 1], "z": place[:, 2], "roll": np.arctan2(R[:, 2, 1], R[:, 2, 2]),
        "pitch": -np.arcsin(R[:, 2, 0]), "yaw": np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0])),
        "rocker": (left - right) / 2, "slip": column("SLIP")[:, 0],
    }  # fmt: skip
    wheels = -column(*(f"{w}_DRIVE" for w in ("LF", "RF", "LM", "RM", "LR", "RR")))  # angles fall ahead
    log = xr.Dataset({name: ("time", values) for name, values in series.items()}, {"time": column("SCLK_REL")[:, 0]})
    return log.assign(wheel_angle=(("time", "wheel"), wheels), steering=(("time", "wheel"), steering))


def difference(track: xr.Dataset, log: xr.Dataset) -> np.ndarray:
    """Return track minus log (n, 3), m."""
    return np.stack([track[k].values - log[k].values for k in "xyz"], axis=-1)


if __name__ == "__main__":
    log, rover = read(Path(sys.argv[1]) / "sol01590_first60.csv"), rb.load_rover("perseverance")
    length = float(np.linalg.norm(np.diff(np.stack([log[k].values for k in "xyz"]), axis=1), axis=0).sum())
    half = log.isel(time=slice(0, 1600))  # the soil is fitted on the first half and tested on the second
    fit = least_squares(
        lambda k: difference(rb.odometry(rover, half, soil=rb.SlopeSlip(*k)), half)[-1], [0.5, 0.5], diff_step=0.05
    )
    soil = rb.SlopeSlip(*fit.x)
    print(f"visual odometry {length:.1f} m; soil from the first half: {soil.along:.2f} along, {soil.across:.2f} across")
    for part, piece in (("whole", log), ("second half", log.isel(time=slice(1600, None)))):
        start = tuple(float(piece[k][0]) for k in "xyz")
        for label, track in (
            ("flat 2-D, wheels' heading", rb.flat_odometry(rover, piece, start=start, heading=False)),
            ("flat 2-D, IMU's heading", rb.flat_odometry(rover, piece, start=start)),
            ("3-D", rb.odometry(rover, piece, start=start)),
            ("3-D with soil", rb.odometry(rover, piece, start=start, soil=soil)),
        ):
            error = float(np.linalg.norm(difference(track, piece)[-1]))
            per_metre = 100 * error / float(track.distance[-1])
            print(f"{part:12s} {label:26s} final error {error:5.2f} m = {per_metre:4.1f} cm per metre driven")
