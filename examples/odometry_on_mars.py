"""Compare 3-D and planar odometry over 20 m of Mars-like terrain in rigid-body dynamics."""

import numpy as np

import rockerbogie as rb

rover, path = rb.load_rover("curiosity"), rb.Path.waypoints([(-9, -5), (-3, -4.5), (2, 2), (9, 3)], radius=4.0)
for seed in (1, 2, 3):
    ground = rb.surfaces.mars(seed)
    run = rb.simulate(rover, ground, path, speed=0.1, interval=0.2, friction=1.0)
    start = tuple(float(run[k][0]) for k in "xyz")
    length = float(np.linalg.norm(np.diff(np.stack([run[k] for k in "xyz"]), axis=1), axis=0).sum())
    for label, track in (
        ("3-D, no map", rb.odometry(rover, run, start=start)),
        ("3-D, with the map", rb.odometry(rover, ground, run, start=start)),
        ("flat, IMU's heading", rb.flat_odometry(rover, run, start=start)),
        ("flat, wheels' heading", rb.flat_odometry(rover, run, start=start, heading=False)),
    ):
        error = np.array([float(track[k][-1] - run[k][-1]) for k in "xyz"])
        drift = 100 * np.linalg.norm(error) / length
        print(f"mars({seed}) {label:22s} ends {error.round(3)} m off, {drift:5.2f} % of {length:.1f} m")
    twist = np.stack([run[k] for k in ("vx", "vy", "vz", "wx", "wy", "wz")], axis=-1)
    slip = rb.wheel_slip(rover, run, twist, run["wheel_rate"], rocker_rate=run["rocker_rate"], bogie_rates=run["bogie_rate"])
    moving = np.abs(run["wheel_rate"].values) > 1e-3  # the slip ratio of a stopped wheel is not defined
    off = (slip.ratio - run["slip_ratio"].values)[moving]
    print(f"mars({seed}) slip ratio by wheel_slip against MuJoCo's: RMS {np.sqrt(np.nanmean(off**2)):.4f}")
