"""Compare 3-D and flat 2-D odometry over 20 m of Mars-like terrain in rigid-body dynamics.

    python examples/odometry_on_mars.py

The first heading of the path is 0, at which a track without a heading sensor starts.
"""

import warnings

import numpy as np

import rockerbogie as rb

rover, path = rb.load_rover("curiosity"), rb.Path.waypoints([(-9, -5), (-3, -5), (2, 2), (9, 3)], radius=4.0)
for seed in (1, 2, 3):
    terrain = rb.surfaces.mars(seed)
    run = rb.simulate(rover, terrain, path, speed=0.1, interval=0.2, friction=1.0)
    start = tuple(float(run[k][0]) for k in "xyz")
    length = float(np.linalg.norm(np.diff(np.stack([run[k] for k in "xyz"]), axis=1), axis=0).sum())
    tilt_only = run.drop_vars("yaw")
    no_attitude = run.drop_vars(["roll", "pitch", "yaw"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rb.LogWarning)  # of missing sensors
        tracks = {
            "3-D, no map": rb.odometry(rover, None, run, start=start),
            "3-D, with the map": rb.odometry(rover, terrain, run, start=start),
            "3-D, roll and pitch only, no map": rb.odometry(rover, None, tilt_only, start=start),
            "3-D, no attitude, with the map": rb.odometry(rover, terrain, no_attitude, start=start),
            "3-D, no attitude, no map": rb.odometry(rover, None, no_attitude, start=start),
            "flat 2-D, IMU's heading": rb.flat_odometry(rover, run, start=start),
            "flat 2-D, wheels' heading": rb.flat_odometry(rover, run, start=start, heading=False),
        }
    for label, track in tracks.items():
        error = np.array([float(track[k][-1] - run[k][-1]) for k in "xyz"])
        drift = 100 * np.linalg.norm(error) / length
        print(f"mars({seed}) {label:34s} final error {error.round(3)} m, {drift:5.2f} % of {length:.1f} m", flush=True)
    twist = np.stack([run[k] for k in ("vx", "vy", "vz", "wx", "wy", "wz")], axis=-1)
    slip = rb.wheel_slip(rover, run, twist, run["wheel_rate"], rocker_rate=run["rocker_rate"], bogie_rates=run["bogie_rate"])
    moving = np.abs(run["wheel_rate"].values) > 1e-3  # the slip ratio of a stopped wheel is not defined
    off = (slip.ratio - run["slip_ratio"].values)[moving]
    print(f"mars({seed}) slip ratio of wheel_slip minus MuJoCo's: RMS {np.sqrt(np.nanmean(off**2)):.4f}", flush=True)
