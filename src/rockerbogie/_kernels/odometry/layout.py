"""Layout of the flat arrays of odometry: readings, weights, track, commands."""

from __future__ import annotations

# Row of the filter: the readings at one time, NaN where a sensor gives none.
S_WHEEL = 0  # (6,) wheel rates, rad/s, or wheel angles, rad
S_STEERING = 6  # (6,) rad
S_ROCKER = 12  # rad
S_BOGIE = 13  # (2,) rad
S_ATTITUDE = 15  # (3,) roll, pitch and yaw, rad; yaw without wraps
S_GYRO = 18  # (3,) angular velocity in the body frame, rad/s
S_TURN = 21  # (3,) rotation vector, summed over the rows, rad
S_TIME = 24  # s
S_SIZE = 25

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
N_HEIGHT = 6  # variance of the body's height above the mean plane of its wheels, m²
N_DOUBT_LENGTH, N_DOUBT = 7, 8  # rolled distance over which slip is averaged, m; share of the rim speed from which it is doubted
N_SIZE = 9

# State of a track.
T_ROTATION = 0  # (3, 3) body to world
T_MOVED = 9  # (3,) displacement from the start, m
T_COVARIANCE = 12  # (6, 6) of position and rotation about fixed axes, m² and rad²
T_FLAT, T_LENGTH = 48, 49  # horizontal length, and length in three dimensions, m
T_START = 50  # (3,) position of the start, m
T_SLIP, T_RIM = 53, 54  # RMS roll slip and rim speed of six wheels, averaged over the last rolled distance, m/s
T_DOUBTED = 55  # (3,) displacement during which the wheels contradicted each other, m
T_SIZE = 58

# Commands of a pose.
C_TURN = 0  # (6,) steering at which no wheel slips sideways, not limited, rad
C_MOTION = 6  # (9,) twist, m/s and rad/s, and rates of rocker and bogies at the limited steering, rad/s
C_RATE = 15  # (6,) wheel rates at the limited steering, rad/s
C_SIDE_SLIP = 21  # (6,) slip across the wheels there, m/s
C_TURN_SLIP = 27  # (6,) turn slip about z of the contact frame there, rad/s
C_SIZE = 33

# Equations of a twist from sensors, in order: their standard deviations.
E_ALONG, E_ACROSS, E_OFF = 0, 6, 12  # (6,) each, of the contacts, m/s
E_JOINT = 18  # (3,) rates of rocker and bogies, rad/s
E_GYRO = 21  # (3,) rad/s
E_TILT = 24  # (2,) rates of roll and pitch, rad/s
E_PRIOR_JOINT = 26  # (3,) about 0, for joints without a reading
E_PRIOR_TILT = 29  # (2,) about 0, of roll and pitch, without gyro and inclinometer
E_SIZE = 31
