"""Layout of the flat arrays of odometry: readings of an interval, weights, track."""

from __future__ import annotations

# Readings of an interval; NaN where a sensor gives none. Angles are those midway, rates the means over the interval.
R_WHEEL = 0  # (6,) wheel rates, rad/s
R_STEERING = 6  # (6,) rad
R_STEERING_RATE = 12  # (6,) rad/s, 0 if not measured
R_ROCKER = 18  # rad
R_BOGIE = 19  # (2,) rad
R_ROCKER_RATE = 21  # rad/s
R_BOGIE_RATE = 22  # (2,) rad/s
R_GYRO = 24  # (3,) angular velocity in the body frame, rad/s
R_TILT_RATE = 27  # (2,) rates of roll and pitch, rad/s
R_TILT = 29  # (2,) roll and pitch, rad
R_SIZE = 31

# Weights: standard deviations, and the shares of the speed they grow with.
W_ROLL, W_SIDE, W_LIFT, W_LEAST = 0, 1, 2, 3  # shares of the speed; the least, m/s
W_JOINT_RATE, W_GYRO, W_TILT_RATE = 4, 5, 6  # rad/s
W_PRIOR_JOINT, W_PRIOR_TILT, W_PRIOR_LEAST = 7, 8, 9  # rad per wheelbase travelled; the least, rad/s
W_WHEELBASE = 10  # m
W_ROUNDS = 11  # iterations between contact angles and velocities
W_STANDING, W_STEEPEST, W_OUTLIER = 12, 13, 14  # m/s; sine; standard deviations
W_SOIL = 15  # (2,) slip per unit of slope, along and across the wheel
W_SIZE = 17

# Noise of a track.
N_SLIP_LENGTH, N_SLIP_TIME = 0, 1  # m, s
N_ATTITUDE = 2  # (3,) rad
N_SHARED = 5  # variance of the length, relative to its square
N_SIZE = 6

# State of a track.
T_ROTATION = 0  # (3, 3) body to world
T_MOVED = 9  # (3,) displacement from the start, m
T_COVARIANCE = 12  # (6, 6) of position and rotation about fixed axes, m² and rad²
T_FLAT, T_LENGTH = 48, 49  # horizontal length, and length in three dimensions, m
T_START = 50  # (3,) position of the start, m
T_SIZE = 53
