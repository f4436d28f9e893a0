"""Tests of odometry, slip and commands against MuJoCo and a drive on Mars."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from support.helpers import assert_close, paper_rover

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))


def twist_of(run):
    return np.stack([run[k] for k in ("vx", "vy", "vz", "wx", "wy", "wz")], axis=-1)


def estimated_slip(rover, run):
    return rb.wheel_slip(
        rover, run, twist_of(run), run["wheel_rate"], rocker_rate=run["rocker_rate"], bogie_rates=run["bogie_rate"]
    )


@pytest.fixture(scope="module")
def mars():
    """Four metres over rocks, in rigid-body dynamics."""
    rover, ground = rb.load_rover("curiosity"), rb.surfaces.mars(2)
    path = rb.Path.waypoints([(-5, -4.6), (-3, -4.5), (-1.7, -3)], radius=4.0)
    return rover, ground, rb.simulate(rover, ground, path, 0.2, friction=1.0)


def test_odometry_over_rocks():
    rover, ground = rb.load_rover("curiosity"), rb.surfaces.mars(2)
    start = (-4.0 * np.cos(0.3), -4.0 * np.sin(0.3))  # eight metres: over four, a single rock decides
    run = rb.simulate(rover, ground, rb.Path.straight(start, 0.3, 8.0), 0.1)
    place = np.stack([run[k].values for k in "xyz"], axis=-1)
    length = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
    start = tuple(place[0])

    def drift(track):
        return 100 * np.linalg.norm([float(track[k][-1]) for k in "xyz"] - place[-1]) / length

    blind, mapped = drift(rb.odometry(rover, run, start=start)), drift(rb.odometry(rover, ground, run, start=start))
    flat = drift(rb.flat_odometry(rover, run, start=start))
    print(f"drift over {length:.1f} m: 3-D {blind:.2f} %, with the map {mapped:.2f} %, flat {flat:.2f} %")
    assert blind < 2.0
    assert mapped < 1.5
    assert flat > 1.5 * blind
    for log in (run, run.drop_vars(["rocker", "bogie"])):
        track = rb.odometry(rover, log, start=start)
        error = np.array([float(track[k][-1]) for k in "xyz"]) - place[-1]
        P = track["pose_covariance"][-1].to_numpy()[:3, :3]
        assert 0.02 < error @ np.linalg.solve(P, error) < 11.34, "chi-square of 3 degrees of freedom, 99 %"


def test_slip_over_rocks_equals_that_of_mujoco(mars):
    rover, _, run = mars
    slip = estimated_slip(rover, run)
    on_ground = np.isfinite(run["slip_ratio"].values)
    rms = np.sqrt(np.nanmean((slip.ratio - run["slip_ratio"].values)[on_ground] ** 2))
    assert rms < 0.01, f"RMS of slip ratio off by {rms:.4f}"
    assert_close(
        np.median(np.abs(slip.roll - run["roll_slip"].values)[on_ground]), 0.0, 1e-4, "m/s", "the same velocities, by two ways"
    )


def test_slip_follows_friction_on_a_slope():
    rover = paper_rover()
    ground = rb.surfaces.plane(np.radians(15), np.pi, size=8.0)
    path = rb.Path.straight((-1.0, 0.0), 0.0, 0.6)
    ratio = {}
    for friction in (0.8, 0.28):  # tan(15 deg) = 0.268
        run = rb.simulate(rover, ground, path, 0.05, friction=friction).isel(time=slice(10, None))
        slip = estimated_slip(rover, run)
        off = (slip.ratio - run["slip_ratio"].values)[np.isfinite(run["slip_ratio"].values)]
        assert np.sqrt(np.mean(off**2)) < 0.01, "slip ratio within 0.01 RMS of MuJoCo's"
        ratio[friction] = float(np.nanmean(slip.ratio))
    assert ratio[0.8] < 0.002 < 0.02 < ratio[0.28], f"wheels slip more where friction is less: {ratio}"
    slid = rb.simulate(rover, ground, path, 0.05, friction=0.25)
    assert slid["x"][-1] < slid["x"][0], "below tan(15 deg) it slides down"
    assert slid.attrs["wheel_rate_error_share"] < 0.02, "while its wheels hold their rates"


def test_rates_from_the_terrain_cause_less_slip_than_equal_rates():
    rover, height, speed = paper_rover(), 0.05, 0.05
    x, y = np.arange(-1.0, 2.0, 0.01), np.arange(-0.6, 0.6, 0.01)
    z = np.zeros((len(y), len(x)))
    z[np.ix_(y > 0, (x > 0.3) & (x < 0.8))] = height
    ground = rb.Terrain.from_array(z, 0.01, (x[0], y[0]), "linear")
    path = rb.Path.straight((-0.4, 0.0), 0.0, 1.2)
    equal = rb.drive(rover, ground, path, speed)
    equal["wheel_rate"][:] = speed / rover.wheel_radius
    slipped = [float(np.nansum(np.abs(run["roll_slip"]))) for run in (
        rb.simulate(rover, ground, path, speed), rb.simulate(rover, ground, path, speed, commands=equal)
    )]  # fmt: skip
    assert slipped[1] > 1.5 * slipped[0], f"summed slip {slipped[0]:.3f} as asked, {slipped[1]:.3f} with equal rates"


def test_perseverance_sol_1590(data):
    from perseverance_sol1590 import difference, read

    rover, log = rb.load_rover("perseverance"), read(data("perseverance/sol01590_first60.csv"))
    soil = rb.SlopeSlip(0.58, 0.48)  # fitted on the first half of the drive
    late = log.isel(time=slice(1600, None))
    start = tuple(float(late[k][0]) for k in "xyz")
    error = {
        name: float(np.linalg.norm(difference(track, late)[-1]))
        for name, track in (
            ("flat", rb.flat_odometry(rover, late, start=start)),
            ("3-D", rb.odometry(rover, late, start=start)),
            ("soil", rb.odometry(rover, late, start=start, soil=soil)),
        )
    }
    assert error["soil"] < 0.3, error
    assert error["soil"] < 0.3 * error["3-D"] < 0.3 * error["flat"], error


def test_command_line(tmp_path, capsys):
    rover, ground = rb.load_rover("curiosity"), rb.surfaces.plane(0.1, size=20.0)
    run = rb.drive(rover, ground, rb.Path.straight((-2.0, 0.0), 0.0, 4.0), 0.1, step=0.1)
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    log = str(tmp_path / "run.nc")
    assert main(["odometry", log, "--rover", "curiosity", "-o", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert "3-D" in shown
    assert "flat 2-D" in shown
    assert {f.name for f in (tmp_path / "out").iterdir()} >= {"odometry.png", "odometry.nc", "odometry.csv"}
    assert main(["odometry", log, "--rover", "curiosity", "--json", "--start", "0,0"]) == 0
    for wrong, words in (
        (["nope.csv"], "no log at 'nope.csv'"),
        ([log, "--rover", "curiosity", "--start", "1"], "--start '1': give 2 or 3 finite numbers"),
        ([log, "--rover", "curiosity", "--soil", "a,b"], "--soil 'a,b': give 2 finite numbers"),
        ([log, "--rover", "curiosity", "--name", "a"], "--name 'a' is not a pair"),
    ):
        assert main(["odometry", *wrong]) == 2
        assert words in capsys.readouterr().err


def test_open_loop_commands_report_slip_beside_the_prediction():
    """Only the rear wheels steer: the Jacobians predict the side slip on an arc."""
    rover, ground = paper_rover(), rb.surfaces.plane(size=6.0)
    path = rb.Path.arc((-0.6, 0.0), 0.0, 1.5, 0.6)
    run = rb.drive(rover, ground, path, 0.05)
    played = rb.simulate(rover, ground, path, 0.05, commands=run).isel(time=slice(20, None))
    assert_close(played["wheel_rate_command"][0], run["wheel_rate"][50], 0.05, "rad/s", "the run's own commands are played")
    measured, expected = (played[name].mean("time").values for name in ("side_slip", "side_slip_predicted"))
    fixed = ~rover.steers
    assert_close(measured[fixed], expected[fixed], 5e-3, "m/s", "of 50: the prediction is a least square, friction is Coulomb's")
    assert (np.sign(measured[fixed]) == np.sign(expected[fixed])).all()


def test_drive_writes_an_mcap(tmp_path):
    pytest.importorskip("rosbags", reason="the ros extra is not installed")
    assert main(["drive", "--terrain", "surface:plane", "--path", "-1,0 1,0", "-o", str(tmp_path), "--mcap"]) == 0
    log = rb.read_log(tmp_path / "run.mcap", paper_rover())
    assert log.sizes["time"] == 201
