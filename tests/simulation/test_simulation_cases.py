"""Tests of wheels under rate control: parked, uphill, round circles; closed forms."""

from __future__ import annotations

import re
import warnings

import mujoco
import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.simulation.mjcf import build_spec
from rockerbogie.simulation.motors import GRAVITY, ROTOR_SHARE, TORQUE_SHARE, torque_limits
from rockerbogie.simulation.rigid_body import Rig
from support.mjcf import load_mjcf

PRESETS = ["elhami-dashti", "perseverance", "curiosity", "rocky7", "osr", "sawppy"]
PATH = rb.Path.straight((0, 0), 0.0, 1.0)
SETTLED = 5.0  # s after which a parked rover no longer sinks into its servos


def incline(degrees: float) -> rb.Terrain:
    """Return a plane that rises towards +x."""
    x = np.arange(-6, 6.01, 0.25)
    return rb.Terrain.from_array(np.tan(np.radians(degrees)) * np.tile(x, (49, 1)), 0.25, (-6, -6), "linear")


def steady(rover: rb.Rover, speed: float, seconds: float) -> xr.Dataset:
    """Return commands for straight ahead at one speed."""
    rate = np.tile(speed / rover.wheel_radius, (2, 1))
    return xr.Dataset(
        {"wheel_rate": (("time", "wheel"), rate), "steering": (("time", "wheel"), np.zeros((2, 6)))}, {"time": [0.0, seconds]}
    )


def travelled(run: xr.Dataset) -> float:
    """Return the distance between the first and the last position, m."""
    return float(np.linalg.norm([run[k][-1] - run[k][0] for k in "xyz"]))


@pytest.mark.parametrize("name", PRESETS)
def test_a_parked_rover_creeps_by_less_than_50_um_per_s(name: str) -> None:
    """15 deg, friction 0.8. The motors together hold m g r sin(15 deg)."""
    rover = rb.load_rover(name)
    run = rb.simulate(rover, incline(15), PATH, commands=steady(rover, 0.0, 15.0), interval=0.5)
    run = run.sel(time=slice(SETTLED, None))
    assert travelled(run) / 10 < 5e-5
    assert np.abs((run["wheel_angle"][-1] - run["wheel_angle"][0]) * rover.wheel_radius).max() < 1e-4, "m: the hubs stand still"
    holding = rover.mass * GRAVITY * rover.wheel_radius[0] * np.sin(np.radians(15))
    assert float(run["wheel_torque"].sum("wheel").mean()) == pytest.approx(holding, rel=3e-3)


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("speed", [0.02, 0.005])
def test_wheels_hold_their_rate_uphill(name: str, speed: float) -> None:
    """15 deg: each wheel within 1 % in every mean over 1 s; the rover advances as they roll."""
    rover = rb.load_rover(name)
    run = rb.simulate(rover, incline(15), PATH, commands=steady(rover, speed, 10.0))
    assert run.attrs["wheel_rate_error"] <= 0.01 * 0.02 / rover.wheel_radius.min()
    if speed == 0.02:
        assert run.attrs["wheel_rate_error_share"] <= 0.01
    late = run.sel(time=slice(2.0, None))
    mean = (late["wheel_rate"] / late["wheel_rate_command"]).mean("time")
    assert np.abs(mean - 1).max() < 0.01
    assert travelled(late) / float(np.ptp(late["time"].values)) == pytest.approx(speed, abs=5e-5 + 0.002 * speed)
    assert run.attrs["torque_limited"] == 0


@pytest.mark.parametrize(("degrees", "friction"), [(24, 1.0), (28, 1.5)])
def test_a_steep_slope_with_enough_friction_is_climbed(degrees: float, friction: float) -> None:
    rover = rb.load_rover("osr")
    run = rb.simulate(rover, incline(degrees), rb.Path.straight((0, 0), 0.0, 0.4), 0.02, friction=friction, interval=0.5)
    assert run.attrs["short_of_end"] < 0.02
    assert run.attrs["wheel_rate_error_share"] < 0.02


def circle(name: str) -> tuple[rb.Rover, float, float, xr.Dataset]:
    """Drive a circle of 2.5 wheelbases open loop; return rover, radius, speed and run."""
    rover = rb.load_rover(name)
    radius, speed = 2.5 * rover.wheelbase, 0.1 * rover.wheelbase
    flat = rb.Terrain.from_array(np.zeros((60, 60)), radius / 6, (-5 * radius, -5 * radius), "linear")
    path = rb.Path.arc((0, -radius), 0.0, radius, 2 * np.pi)
    found = rb.wheel_commands(rover, rb.settle(rover, flat, 0.0, -radius, 0.0), rb.arc(rover, speed, radius))
    table = {"wheel_rate": found.wheel_rates, "steering": found.steering}
    commands = xr.Dataset(
        {k: (("time", "wheel"), np.tile(v, (2, 1))) for k, v in table.items()}, {"time": [0.0, path.length / speed]}
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # also in attrs["warnings"]
        return rover, radius, speed, rb.simulate(rover, flat, path, commands=commands, interval=0.5, friction=1.0)


@pytest.mark.parametrize("name", ["osr", "curiosity", "sawppy"])
def test_a_commanded_circle_closes(name: str) -> None:
    """Wheels that do not steer share an axle line: the circle closes within 1 % of its length."""
    _, radius, _, run = circle(name)
    assert travelled(run) < 0.01 * 2 * np.pi * radius
    assert run.attrs["warnings"] == ""


@pytest.mark.parametrize("name", ["rocky7", "elhami-dashti"])
def test_a_circle_that_needs_slip_is_reported(name: str) -> None:
    """Two fixed axle lines d apart slip by ±d/2 times the yaw rate at least: plane geometry."""
    rover, radius, speed, run = circle(name)
    assert "cannot be driven without slip" in run.attrs["warnings"]
    x = rover.hubs[~rover.steers, 0]
    least = np.sqrt(((x - x.mean()) ** 2).sum() / 6) * speed / radius  # RMS over six wheels if the others roll
    stated = float(re.search(r"by about ([\d.]+) mm/s", run.attrs["warnings"])[1]) * 1e-3
    assert 0.5 * least < stated < 1.05 * least, "least squares shares the slip among all wheels"
    late = run.isel(time=slice(20, -5))
    side, turn = late["side_slip"].to_numpy()[:, ~rover.steers], late["wz"].to_numpy()
    apart = side[:, 2:].mean(axis=1) - side[:, :2].mean(axis=1)  # m/s between the axle lines; NaN if a wheel is off the ground
    assert np.nanmedian(apart / turn) == pytest.approx(x[2:].mean() - x[:2].mean(), rel=0.05), "m: a rigid body's plane motion"
    late = late.mean("time")
    assert 0.85 * speed / radius < float(late["wz"]) < speed / radius, "it turns less than commanded"


def test_motors_at_their_limit_stall_and_are_reported() -> None:
    """97 % of the torque that 15 deg takes: the rover rolls back, and the attributes say so."""
    rover = rb.load_rover("osr")
    torque = 0.97 * rover.mass * GRAVITY * 0.075 * np.sin(np.radians(15)) / 6
    run = rb.simulate(rover, incline(15), PATH, commands=steady(rover, 0.02, 4.0), torque=torque)
    assert run.attrs["torque_limit"] == pytest.approx(torque)
    assert run.attrs["torque_limited"] > 0.9
    assert run.attrs["wheel_rate_error_share"] > 0.5
    assert float(np.abs(run["wheel_torque"]).max()) <= torque * (1 + 1e-12)


def test_a_stalled_wheel_obeys_at_once_when_it_is_free() -> None:
    """Anti-windup: 3 s against a load above its limit store no angle to make up later."""
    rover = rb.load_rover("osr")
    rig = Rig(rover, build_spec(rover, torque=1.0).compile())
    rig.model.opt.gravity[:] = 0
    dof, q = (int(getattr(rig.model.joint("wheel_LM"), k)[0]) for k in ("dofadr", "qposadr"))
    rig.data.qfrc_applied[dof] = -1.05
    for _ in range(150):
        rig.command(np.full(6, 0.5), np.zeros(6))
        rig.step(0.02)
    turned = float(rig.data.qpos[q])
    assert turned < -1.0
    rig.data.qfrc_applied[dof] = 0.0
    for _ in range(50):
        rig.command(np.zeros(6), np.zeros(6))
        rig.step(0.02)
    assert abs(rig.data.qvel[dof]) < 1e-2
    assert abs(rig.data.qpos[q] - turned) < 0.5


def test_the_default_torque_is_the_open_source_rovers() -> None:
    """38 kg·cm of stall torque at 12.7 kg and 75 mm; scaled by m g r for other rovers."""
    assert torque_limits(rb.load_rover("osr"))[0] == pytest.approx(38 * 0.0980665, rel=0.01)
    rover = rb.load_rover("curiosity")
    np.testing.assert_allclose(torque_limits(rover), TORQUE_SHARE * rover.mass * GRAVITY * rover.wheel_radius)
    np.testing.assert_array_equal(torque_limits(rover, 300.0), 300.0)
    np.testing.assert_array_equal(torque_limits(rover.replace(wheel_torque=200.0)), 200.0)
    np.testing.assert_array_equal(torque_limits(rover.replace(wheel_torque=200.0), 300.0), 300.0)


def rolling(degrees: float, seconds: float, name: str = "curiosity") -> tuple[Rig, np.ndarray]:
    """Roll a rover with its motors off down a plane; return it and (n, 3) time, speed, energy."""
    rover = rb.load_rover(name)
    terrain = incline(degrees)
    rig = Rig(rover, build_spec(rover, terrain, friction=1.5).compile())
    rig.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    rig.place(rb.settle(rover, terrain, 3.0, 0.0), 0.0)
    rig.model.actuator_gainprm[rig._wheel_motor] = rig.model.actuator_biasprm[rig._wheel_motor] = 0.0
    rows = []
    for _ in range(round(seconds / 0.1)):
        rig.step(0.1)
        mujoco.mj_forward(rig.model, rig.data)
        rows.append((rig.data.time, np.linalg.norm(rig.data.qvel[:3]), rig.data.energy.sum()))
    return rig, np.array(rows)


def test_free_rolling_is_the_closed_form() -> None:
    """Motors off: g sin(a) / (1 + J / (m r²)) within 1 %; energy kept within 0.5 %."""
    rig, rows = rolling(10, 4.0)
    rover = rig.rover
    spin = sum(link.inertia[1, 1] for link in rover.wheels) + 6 * ROTOR_SHARE * rover.mass * rover.wheel_radius[0] ** 2
    expected = GRAVITY * np.sin(np.radians(10)) / (1 + spin / (rover.mass * rover.wheel_radius[0] ** 2))
    late = rows[rows[:, 0] > 1.0]
    assert np.polyfit(late[:, 0], late[:, 1], 1)[0] == pytest.approx(expected, rel=0.01)
    drop = rover.mass * GRAVITY * np.sin(np.radians(10)) * 0.5 * expected * 4.0**2
    assert np.ptp(late[:, 2]) < 0.005 * drop


def test_motors_do_the_work_of_the_climb() -> None:
    """Up 15 deg at friction 1: the motors' work is m g Δh within 1 %."""
    rover = rb.load_rover("osr")
    run = rb.simulate(rover, incline(15), PATH, commands=steady(rover, 0.02, 15.0), friction=1.0).sel(time=slice(2.0, None))
    power = (run["wheel_torque"] * run["wheel_rate"]).sum("wheel")
    work = float(np.trapezoid(power, run["time"]))
    assert work == pytest.approx(rover.mass * GRAVITY * float(run["z"][-1] - run["z"][0]), rel=0.01)


def test_half_the_time_step_gives_the_same_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    rover, terrain = rb.load_rover("elhami-dashti"), rb.surfaces.paper()
    path = rb.Path.straight((0.6, 0), 0.0, 0.6)
    runs = [rb.simulate(rover, terrain, path, 0.04)]
    monkeypatch.setattr("rockerbogie.simulation.mjcf.TIMESTEP", 0.0025)
    runs.append(rb.simulate(rover, terrain, path, 0.04))
    for name, most in (("x", 2e-3), ("y", 2e-3), ("z", 1e-3), ("pitch", 5e-3), ("roll", 5e-3)):
        assert np.abs(runs[0][name] - runs[1][name]).max() < most, name


@pytest.mark.parametrize("name", ["curiosity", "osr", "elhami-dashti"])
def test_the_differential_holds_on_rocks(name: str) -> None:
    """The exported model, dropped on rocks, for 3 s: |left + right| <= 1e-3 rad."""
    rover, terrain = rb.load_rover(name), rb.surfaces.rocks(seed=4, size=12.0)
    model = load_mjcf(rb.to_mjcf(rover, terrain, region=(-3, -3, 3, 3)))
    data = mujoco.MjData(model)
    worst = turned = 0.0
    for _ in range(600):
        mujoco.mj_step(model, data)
        left, right = (float(data.joint(f"rocker_{side}").qpos[0]) for side in ("left", "right"))
        worst, turned = max(worst, abs(left + right)), max(turned, abs(left))
    assert turned > 0.02, "the rocks turn the rockers"
    assert worst <= 1e-3


@pytest.mark.parametrize(("name", "surface"), [("curiosity", "mars"), ("rocky7", "rough")])
def test_an_export_starts_clear_of_the_terrain_and_settled_by_its_keyframe(name: str, surface: str) -> None:
    rover, terrain = rb.load_rover(name), rb.surfaces.mars() if surface == "mars" else rb.surfaces.rough(2, size=8.0)
    region = (-4.0, -4.0, 4.0, 4.0)
    model = load_mjcf(rb.to_mjcf(rover, terrain, region=region))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0 or data.contact.dist.min() > -1e-3
    mujoco.mj_resetDataKeyframe(model, data, model.key("settled").id)
    mujoco.mj_forward(model, data)
    pose = rb.settle(rover, terrain, 0.0, 0.0)
    assert data.joint("rocker_left").qpos[0] == pytest.approx(float(pose.rocker), abs=1e-5)
    assert data.qpos[2] == pytest.approx(float(pose.z), abs=1e-4)
    assert data.contact.dist.min() > -2e-3, "triangles follow the map within a tenth of a wheel's radius"
    mujoco.mj_step(model, data, nstep=400)
    assert data.body("body").xmat[8] > 0.8, "upright"
    assert np.hypot(*data.qpos[:2]) < 0.05


class TestComparison:
    """Simulated and settled rover with the same wheels in contact."""

    def test_joint_limits_are_those_of_both(self) -> None:
        rover = rb.load_rover("rocky7").replace(bogie_limits=np.radians([-5.0, 5.0]))
        terrain = rb.surfaces.rough(2, size=8.0)
        sim = rb.simulate(rover, terrain, rb.Path.straight((-1, 0), 0.0, 0.8), 0.05)
        assert (sim["status"] == rb.Status.WHEEL_LIFTED).sum() > 20
        result = rb.compare(rb.settle_along(rover, terrain, sim), sim)
        assert result.unlike < 0.15 * sim.sizes["time"]
        assert np.degrees(result["bogie left"].rms) < 0.1
        assert result["pitch"].count == sim.sizes["time"] - result.unlike
        assert f"{result.unlike} records left out" in str(result)
        six = rb.settle(rover, terrain, *(sim[k].values for k in ("x", "y", "yaw")), steering=sim["steering"].values)
        assert np.degrees(np.abs(six.bogie - sim["bogie"].values).max()) > 2, "six contacts would need joints beyond their limits"

    def test_unlike_records_are_left_out(self) -> None:
        rover, terrain = rb.load_rover("rocky7"), rb.surfaces.plane(size=6.0)
        run = rb.drive(rover, terrain, rb.Path.straight((0, 0), 0.0, 0.5))
        other = run.copy(deep=True)
        other["status"][:7] = rb.Status.WHEEL_LIFTED
        other["pitch"][:7] += 0.1
        result = rb.compare(run, other)
        assert result.unlike == 7
        assert result["pitch"].worst == 0


def test_commands_are_assigned_by_wheel_name() -> None:
    rover, terrain = rb.load_rover("osr"), rb.surfaces.plane(size=6.0)
    rate = np.linspace(0.1, 0.2, 6)
    names = list(rover.wheel_names)
    commands = steady(rover, 0.02, 1.0).assign_coords(wheel=names)
    commands["wheel_rate"][:] = rate
    mixed = commands.isel(wheel=[3, 1, 0, 2, 5, 4])
    run = rb.simulate(rover, terrain, PATH, commands=mixed)
    np.testing.assert_allclose(run["wheel_rate_command"][-1], rate)
    with pytest.raises(rb.RockerbogieError, match="are for wheels"):
        rb.simulate(rover, terrain, PATH, commands=commands.assign_coords(wheel=[f"w{n}" for n in names]))
    turned = commands.copy(deep=True)
    turned["steering"].attrs["units"] = "degrees"
    with pytest.raises(rb.RockerbogieError, match="steering are in 'degrees'; give rad"):
        rb.simulate(rover, terrain, PATH, commands=turned)
    dated = commands.assign_coords(time=np.array(["2020-01-01", "2020-01-02"], dtype="datetime64[ns]"))
    with pytest.raises(rb.RockerbogieError, match="give seconds"):
        rb.simulate(rover, terrain, PATH, commands=dated)
