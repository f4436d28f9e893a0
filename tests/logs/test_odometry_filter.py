"""The odometry filter gives the numbers of odometry of the whole record, row by row."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.odometry.frames import rim_contacts
from rockerbogie.logs import steps
from rockerbogie.logs.channels import LogReport
from rockerbogie.logs.readings import Readings
from rockerbogie.motion.body_twist import RatePrior, SensorNoise, body_twist
from rockerbogie.motion.jacobian import SimpleStance
from rockerbogie.rover.frames import contact_frames, wheel_frames
from rockerbogie.rover.rotations import body_transform
from support.helpers import assert_close

JOINTS, IMU = ("wheel_angle", "wheel_rate", "steering", "rocker", "bogie"), ("roll", "pitch", "yaw", "gyro")
BASE = ("wheel_rate", "steering", "rocker", "bogie")


@pytest.fixture(scope="module")
def rover():
    return rb.load_rover("curiosity")


@pytest.fixture(scope="module")
def run(rover):
    """Return a run over rocks with wheel rates that do not quite fit, and a gyro."""
    found = rb.drive(rover, rb.surfaces.mars(seed=1), rb.Path.arc((0.0, 0.0), 0.0, 3.0, 0.7), speed=0.05)
    noise = np.random.default_rng(3)
    found["wheel_rate"] = found["wheel_rate"] * noise.uniform(0.95, 1.05, found["wheel_rate"].shape)
    found["gyro"] = ("time", "axis"), noise.normal(0.0, 0.01, (found.sizes["time"], 3))
    return found


def row(log, k):
    """Return joints and IMU of row k of a log."""
    return tuple({name: log[name].values[k] for name in names if name in log} for names in (JOINTS, IMU))


def fed(made, log, rows=None):
    """Return the estimates that a filter confirms over the rows of a log."""
    found = []
    for k in range(log.sizes["time"]) if rows is None else rows:
        made.update(float(log["time"][k]), *row(log, k))
        found += made.confirmed
    return found


def quiet_odometry(*args, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rb.LogWarning)
        return rb.odometry(*args, **options)


def arrays(estimates, track):
    """Yield name, values of the filter and those of the batch."""
    yield "position", np.stack([e.position for e in estimates]), np.stack([track[k] for k in "xyz"], axis=-1)
    # a level start is known only with the second row, whose readings count half
    yield "attitude", np.stack([e.attitude[:2] for e in estimates])[1:], np.stack([track["roll"], track["pitch"]], axis=-1)[1:]
    yield "pose covariance", np.stack([e.pose_covariance for e in estimates]), track["pose_covariance"].values
    later = estimates[1:]
    yield "twist", np.stack([e.twist for e in later]), track["twist"].values[1:]
    yield "twist covariance", np.stack([e.twist_covariance for e in later]), track["twist_covariance"].values[1:]
    yield "roll slip", np.stack([e.roll_slip for e in later]), track["roll_slip"].values[1:]
    yield "side slip", np.stack([e.side_slip for e in later]), track["side_slip"].values[1:]
    yield "contact angle", np.stack([e.contact_angle for e in later]), track["contact_angle"].values[1:]
    yield "distance", np.array([e.distance_3d for e in estimates]), track["distance_3d"].values
    yield "slip share", np.array([e.slip_share for e in estimates]), track["slip_share"].values


@pytest.mark.parametrize(
    "sensors",
    [
        (*BASE, "roll", "pitch", "yaw"),
        (*BASE, "roll", "pitch", "gyro"),
        (*BASE, "gyro"),
        (*BASE, "yaw"),
        ("wheel_rate", "steering", "roll", "pitch"),
        ("wheel_rate", "steering"),
    ],
    ids=" ".join,
)
def test_the_filter_equals_the_batch_bit_by_bit(rover, run, sensors):
    log = run[list(sensors)]
    track = quiet_odometry(rover, None, log, start=(1.0, -2.0, 0.5))
    made = rb.OdometryFilter(rover, start=(1.0, -2.0, 0.5))
    for name, ours, theirs in arrays(fed(made, log), track):
        assert np.array_equal(ours, theirs), f"{name} differs by {np.abs(ours - theirs).max():.2g}"


def test_the_filter_with_soil_equals_the_batch(rover, run):
    log, soil = run[[*BASE, "roll", "pitch", "yaw"]], rb.SlopeSlip(0.5, 0.3)
    track = quiet_odometry(rover, None, log, soil=soil)
    for name, ours, theirs in arrays(fed(rb.OdometryFilter(rover, soil=soil), log), track):
        assert np.array_equal(ours, theirs), name


def test_the_filter_smooths_encoder_counts_as_the_batch(rover, run):
    grid = 2 * np.pi / 360
    rate, dt = run["wheel_rate"].values, np.diff(run["time"].values)[:, None]
    angle = np.concatenate([np.zeros((1, 6)), np.cumsum(0.5 * (rate[1:] + rate[:-1]) * dt, axis=0)])
    log = run[["steering", "rocker", "bogie", "roll", "pitch", "yaw"]].assign(
        wheel_angle=(("time", "wheel"), np.round(angle / grid) * grid)
    )
    track = quiet_odometry(rover, None, log)
    made = rb.OdometryFilter.for_log(rover, log)
    assert made.window > 4
    found = fed(made, log)
    live = made.estimate
    assert len(found) < log.sizes["time"], "rows wait for later ones"
    found += made.finish()
    assert len(found) == log.sizes["time"]
    for name, ours, theirs in arrays(found, track):
        assert_close(ours, theirs, 1e-11, "SI", name)
    assert_close(live.position, found[-1].position, 2e-3, "m", "the live estimate spans the waiting rows in one step")


@pytest.mark.parametrize("counts", [None, 360])
def test_a_saved_filter_continues_bit_by_bit(rover, run, counts):
    log = run[[*BASE, "roll", "pitch", "yaw"]]
    options = {} if counts is None else {"window": 9}
    whole, first = rb.OdometryFilter(rover, **options), rb.OdometryFilter(rover, **options)
    cut = log.sizes["time"] // 2
    want = fed(whole, log)
    found = fed(first, log, range(cut))
    second = rb.OdometryFilter.from_state(rover, json.loads(json.dumps(first.state())))
    found += fed(second, log, range(cut, log.sizes["time"]))
    assert len(found) == len(want)
    assert all(
        np.array_equal(a.T, b.T) and np.array_equal(a.pose_covariance, b.pose_covariance)
        for a, b in zip(found, want, strict=True)
    )
    assert np.array_equal(second.estimate.T, whole.estimate.T)


def test_the_kernel_solves_the_equations_of_body_twist(rover, run):
    """Compare one round with `body_twist` on the plane of the hubs, solved by another method."""
    s = Readings.of(rover, run[[*BASE, "roll", "pitch", "yaw"]], LogReport())
    weights = steps.weights_of(rover, steps.UNKNOWN_SLOPE, 0.0)
    weights[steps.at.W_ROUNDS] = 1
    found = steps.interval_motion(rover, weights, s.packed())
    axle = rb.wheel_frames(rover, s.rocker, s.bogie, s.steering)
    normal = np.repeat(found.normal[:, None], 6, axis=1)
    delta = np.arctan2((normal * axle[..., :3, 0]).sum(axis=-1), (normal * axle[..., :3, 2]).sum(axis=-1))
    pose = SimpleStance(s.rocker, s.bogie, delta, s.steering, 0.0, 0.0, normal)
    speed = np.median(np.abs(rover.wheel_radius * s.wheel_rates), axis=1, keepdims=True)
    slip = steps.ROLL_SHARE * speed + steps.LEAST_SLIP
    noise = SensorNoise(roll_slip=slip, side_slip=slip, lift=steps.UNKNOWN_SLOPE * speed + steps.LEAST_SLIP)
    want = body_twist(rover, pose, **s.measured, noise=noise, prior=RatePrior())
    assert_close(found.motion[:, :6], want.twist, 1e-12, "SI", "twist by singular values")
    assert_close(found.covariance[:, :6, :6], want.covariance, 1e-12, "SI", "covariance")
    assert_close(found.residual, want.residual, 1e-12, "m/s", "residual")


def test_a_missing_imu_leaves_the_wheels_to_turn_the_rover(rover, run):
    """Continue the track without attitude; the next reading sets the attitude again."""
    log = run[[*BASE, "roll", "pitch", "yaw"]]
    made, full = rb.OdometryFilter(rover), rb.OdometryFilter(rover)
    n, yaw = log.sizes["time"], []
    for k in range(n):
        joints, imu = row(log, k)
        full.update(float(log["time"][k]), joints, imu)
        away = n // 3 <= k < n // 2
        made.update(float(log["time"][k]), joints, None if away else imu)
        yaw.append(made.estimate.attitude[2] - full.estimate.attitude[2])
        assert np.linalg.eigvalsh(made.estimate.pose_covariance).min() > -1e-12
    assert 0.0 < np.abs(yaw[n // 2 - 1]) < 0.1
    assert_close(yaw[n // 2 :], 0.0, 1e-12, "rad", "the measured heading is used again")
    apart = np.linalg.norm(made.estimate.position - full.estimate.position)
    assert apart < 0.03 * full.estimate.distance


def test_a_late_imu_continues_the_heading(rover, run):
    log = run[[*BASE, "roll", "pitch", "yaw"]]
    made, before = rb.OdometryFilter(rover), None
    for k in range(log.sizes["time"]):
        joints, imu = row(log, k)
        made.update(float(log["time"][k]), joints, None if k < 20 else imu | {"yaw": imu["yaw"] + 2.0})
        heading = made.estimate.attitude[2]
        assert before is None or abs(heading - before) < 0.05, "no jump by the offset of the sensor"
        before = heading


def test_the_tip_margin_is_near_that_of_the_settled_pose(rover, run):
    ground = rb.surfaces.mars(seed=1)
    made = rb.OdometryFilter(rover)
    fed(made, run[[*BASE, "roll", "pitch", "yaw"]])
    e = made.estimate
    k = run.sizes["time"] - 1
    pose = rb.settle(rover, ground, *(float(run[name][k]) for name in ("x", "y", "yaw")), steering=run["steering"].values[k])
    assert_close(e.tip_margin, rb.stability(pose).tip_margin, np.radians(3.0), "rad", "settled on the map")


def test_readings_that_are_too_large_count_as_missing(rover):
    made, without = rb.OdometryFilter(rover), rb.OdometryFilter(rover)
    for k in range(3):
        wheels = {"wheel_rate": np.full(6, 0.2)}
        made.update(float(k), wheels | {"rocker": 1e300}, {"roll": 1e300, "pitch": 0.0, "yaw": -1e300})
        without.update(float(k), wheels, {"pitch": 0.0})
    assert np.isfinite(made.estimate.position).all()
    assert np.array_equal(made.estimate.T, without.estimate.T)


def test_contacts_of_the_tip_margin_are_those_of_the_frames(rover):
    chance = np.random.default_rng(5)
    for _ in range(20):
        roll, pitch, yaw = chance.uniform(-0.5, 0.5, 3) * (1.0, 1.0, 6.0)
        joints, angle = chance.uniform(-0.3, 0.3, 9), chance.uniform(-0.5, 0.5, 6)
        joints[:6] *= rover.steers
        T = body_transform(1.0, 2.0, 3.0, roll, pitch, yaw)
        q, normal, point = np.empty(6), np.empty((6, 3)), np.empty((6, 3))
        found = rim_contacts(rover.packed, rover.steers, T, joints, angle, q, normal, point)
        frames = contact_frames(rover, wheel_frames(rover, joints[6], joints[7:], joints[:6]), angle)
        assert_close(np.array([found, *q]), np.array([yaw, 0.0, roll, pitch, *joints[6:]]), 1e-12, "rad", "angles")
        assert_close(normal, frames[:, :3, 2] @ T[:3, :3].T, 1e-12, "", "normals")
        assert_close(point, frames[:, :3, 3] @ T[:3, :3].T, 1e-12, "m", "points from the body's reference point")


@pytest.mark.parametrize(
    "joints, imu, t, message",
    [
        ({}, None, 1.0, "neither wheel_angle nor wheel_rate"),
        ({"wheel_rate": np.ones(5)}, None, 1.0, "wheel_rate is .* give 6 numbers"),
        ({"wheel_rate": np.full(6, np.nan)}, None, 1.0, "finite"),
        ({"wheel_rate": np.ones(6)}, None, 0.0, "greater than that of the last row"),
        ({"wheel_rate": np.ones(6)}, {"heading": 1.0}, 1.0, "may hold roll, pitch, yaw, gyro"),
        ({"wheel_angle": np.ones(6)}, None, 1.0, "changes between"),
        ({"wheel_rate": np.full(6, 1e300)}, None, 1.0, "below 1e9"),
        ({"wheel_rate": np.ones(6)}, None, 1e-300, "greater than that of the last row"),
        ({"wheel_rate": np.ones(6)}, None, "now", "t is 'now'"),
        ({"wheel_rate": np.ones(6)}, None, None, "t is None"),
        (None, None, 1.0, "joints is None; give a dict"),
        ([1, 2], None, 1.0, "joints is .*; give a dict"),
        ({"wheel_rate": np.ones(6)}, np.zeros(3), 1.0, "imu is array.*; give a dict"),
        ({"wheel_rate": np.full(6, 1j)}, None, 1.0, "wheel_rate is .* give 6 numbers"),
        ({"wheel_rate": np.ones(6, dtype=bool)}, None, 1.0, "wheel_rate is .* give 6 numbers"),
        ({"wheel_rate": ["1"] * 6}, None, 1.0, "wheel_rate is .* give 6 numbers"),
        ({"wheel_rate": np.ones(6), "rocker": 10**400}, None, 1.0, "rocker is .* give 1 numbers"),
    ],
)
def test_wrong_rows_are_refused(rover, joints, imu, t, message):
    made = rb.OdometryFilter(rover)
    made.update(0.0, {"wheel_rate": np.ones(6)})
    with pytest.raises(rb.RockerbogieError, match=message):
        made.update(t, joints, imu)
    made.update(2.0, {"wheel_rate": np.ones(6)})


def stuck(run, at, rows, spread):
    """Return a log whose rover stands for `rows` rows from row `at` on while its wheels turn."""
    index = np.concatenate([np.arange(at), np.full(rows, at), np.arange(at, run.sizes["time"])])
    log = run[[*BASE, "roll", "pitch", "yaw", "x", "y", "z"]].isel(time=index)
    step = float(run["time"][1] - run["time"][0])
    log = log.assign_coords(time=step * np.arange(len(index)))
    own = 1.0 + spread * np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0])
    log["wheel_rate"][at : at + rows] = run["wheel_rate"].values.mean() * own
    return log


@pytest.mark.parametrize("name", ["curiosity", "osr"])
def test_wheels_that_spin_on_a_stuck_rover_are_doubted(name):
    """Let all wheels turn at rates of their own for 2 m of rim while the rover stands."""
    rover = rb.load_rover(name)
    terrain = rb.surfaces.mars(seed=1, k=0.0)
    run = rb.drive(rover, terrain, rb.Path.straight((0.0, 0.0), 0.0, 4.0), speed=0.05)
    at, rows = run.sizes["time"] // 2, 200
    log = stuck(run, at, rows, 0.5)
    start = tuple(float(log[k][0]) for k in "xyz")
    found = fed(rb.OdometryFilter(rover, start=start), log)
    doubted = np.array([e.doubted for e in found])
    true = np.stack([log[k].values for k in "xyz"], axis=-1)
    error = np.linalg.norm([e.position for e in found] - true, axis=1)
    sigma = np.array([np.sqrt(np.linalg.eigvalsh(e.pose_covariance[:3, :3])[-1]) for e in found])
    assert error[at + rows - 1] > 1.0, "the wheels roll 2 m"
    first, last = np.flatnonzero(doubted)[[0, -1]]
    step = np.linalg.norm(found[at + 20].position - found[at + 10].position) / 10.0
    assert at <= first <= at + 0.25 * rover.wheelbase / step, "within a quarter wheelbase of rim"
    assert doubted[first : at + rows].all()
    assert last <= at + rows + 1.5 * rover.wheelbase / step, "the slip before is forgotten"
    assert (error < 2.0 * sigma + 0.25 * rover.wheelbase).all(), "until it is doubted, the displacement is believed"
    assert error[-1] < 1.5 * sigma[-1] < 1.5 * 1.5 * error[-1]
    track = quiet_odometry(rover, None, log.drop_vars(["x", "y", "z"]), start=start)
    assert np.array_equal(track["pose_covariance"].values[-1], found[-1].pose_covariance)


def test_equal_slip_of_all_wheels_is_not_doubted(rover):
    """Let six wheels turn alike: the readings are those of a rover that drives over a plane."""
    made = rb.OdometryFilter(rover)
    level = dict.fromkeys(IMU[:3], 0.0)
    for k in range(100):
        made.update(0.1 * k, {"wheel_angle": np.full(6, 0.02 * k), "rocker": 0.0, "bogie": (0.0, 0.0)}, level)
    assert made.estimate.slip_share < 1e-6
    assert not made.estimate.doubted


def test_a_rover_that_stands_is_not_doubted(rover):
    made = rb.OdometryFilter(rover)
    for k in range(10):
        made.update(0.1 * k, {"wheel_angle": np.zeros(6)})
    assert made.estimate.slip_share == 0.0
    assert not made.estimate.doubted


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"window": True}, "window is True"),
        ({"window": 10**9}, "window is 1000000000; .* 10,000"),
        ({"joint_error": np.nan}, "joint_error is nan"),
        ({"joint_error": "a"}, "joint_error is 'a'"),
        ({"start": "abc"}, "start is 'abc'"),
        ({"start": None}, "start is None"),
        ({"soil": (0.5, 0.3)}, "SlopeSlip"),
    ],
)
def test_wrong_options_are_refused(rover, options, message):
    with pytest.raises(rb.RockerbogieError, match=message):
        rb.OdometryFilter(rover, **options)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1j, "0.5", None, True, [0.5, 0.3]])
def test_a_slip_that_is_not_a_number_is_refused(wrong):
    for given in ((wrong, 0.3), (0.5, wrong)):
        with pytest.raises(rb.RockerbogieError, match=r"SlopeSlip\(.*: give two numbers, along and across"):
            rb.SlopeSlip(*given)


def test_infinite_readings_count_as_missing(rover):
    found = []
    for missing in (np.inf, np.nan):
        made = rb.OdometryFilter(rover)
        for k in range(4):
            joints = {"wheel_angle": np.full(6, 0.1 * k), "rocker": missing, "bogie": (missing, missing)}
            made.update(0.1 * k, joints, {"roll": missing, "pitch": 0.0, "yaw": 0.0})
        found.append(made.estimate)
    assert np.array_equal(found[0].T, found[1].T)
    assert np.isfinite(found[0].T).all()


def test_wrong_states_are_refused(rover):
    state = rb.OdometryFilter(rover).state()
    with pytest.raises(rb.RockerbogieError, match="of rover 'curiosity', not of 'osr'"):
        rb.OdometryFilter.from_state(rb.load_rover("osr"), state)
    with pytest.raises(rb.RockerbogieError, match="version"):
        rb.OdometryFilter.from_state(rover, {})
    with pytest.raises(rb.RockerbogieError, match="incomplete"):
        rb.OdometryFilter.from_state(rover, {k: v for k, v in state.items() if k != "rows"})
    made = rb.OdometryFilter(rover)
    made.update(0.0, {"wheel_angle": np.zeros(6)})
    saved = made.state()
    nowhere = saved["track"][:9] + [None] + saved["track"][10:]
    late = [saved["rows"][0][:24] + [None]]
    for wrong in (
        {"track": nowhere}, {"track": None}, {"rows": []}, {"rows": late}, {"rows": saved["rows"] * 2}, {"base": -1, "at": -1},
        {"aided": [-1.0, 0.0]}, {"unaided": [None, 0.0]}, {"by_rate": "no"}, {"base": 1e400}, {"yaw_offset": "a"},
    ):  # fmt: skip
        with pytest.raises(rb.RockerbogieError, match="incomplete or damaged"):
            rb.OdometryFilter.from_state(rover, saved | wrong)
    for wrong in ({"at": 5}, {"aided": [1.0]}, {"measured": [True]}, {"smoothed": [1.0]}, {"rows": made.state()["rows"] * 30}):
        with pytest.raises(rb.RockerbogieError, match="incomplete or damaged"):
            rb.OdometryFilter.from_state(rover, made.state() | wrong)
