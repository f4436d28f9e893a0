"""Predicted drives: balance, energy, limits, symmetry, batches and wrong calls."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie._kernels.jit.parallel import threads
from rockerbogie.errors import PathError, RockerbogieError


def tilted(degrees: float, interpolation: str = "cubic") -> rb.Terrain:
    """Return a plane of 40 m that rises along y."""
    rise = np.arange(41) * np.tan(np.radians(degrees))
    return rb.Terrain.from_array(np.add.outer(rise, np.zeros(41)), spacing=1.0, interpolation=interpolation, name="slope")  # type: ignore[arg-type]


def rates(rate: float) -> xr.Dataset:
    """Return commands of one wheel rate, rad/s, for 10 s."""
    values = {"wheel_rate": (("time", "wheel"), np.full((2, 6), rate)), "steering": (("time", "wheel"), np.zeros((2, 6)))}
    return xr.Dataset(values, {"time": [0.0, 10.0]})


@pytest.fixture(scope="module")
def rover() -> rb.Rover:
    """Return Curiosity."""
    return rb.load_rover("curiosity")


@pytest.fixture(scope="module")
def waves() -> rb.Terrain:
    """Return smooth waves of 10 m, 0.4 m high, in both directions."""
    x = np.arange(0.0, 40.1, 0.5)
    z = 0.4 * np.add.outer(np.sin(0.6 * x), np.cos(0.5 * x))
    return rb.Terrain.from_array(z, spacing=0.5, interpolation="cubic", name="waves")


def test_motor_work_is_height_gain_plus_dissipation(rover: rb.Rover, waves: rb.Terrain) -> None:
    run = rb.predict(rover, waves, (8.0, 9.0, 0.4), rb.Path.arc((0, 0), 0.0, 12.0, 0.9), friction=0.7, tolerance=1e-7)
    assert run.attrs["end"] == "REACHED_END"
    work, loss, gain = (run[name].to_numpy() for name in ("motor_work", "dissipation", "height_gain"))
    assert np.abs(work - loss - gain).max() <= 1e-6 * np.abs(work).max()
    assert (np.diff(loss) > 0).all()
    assert np.ptp(gain) > 500.0


@pytest.mark.parametrize("law", [{"friction": 0.7}, {"soil": "dry-sand"}])
def test_energies_balance_to_the_tolerance_on_rocks(law: dict[str, object]) -> None:
    rocks = rb.surfaces.rocks(seed=1, size=16.0, spacing=0.1, smallest=0.2)
    start = np.random.default_rng(3).uniform(-3.0, 3.0, (6, 3))
    for name in ("sawppy", "perseverance"):
        rover, path = rb.load_rover(name), rb.Path.straight((0, 0), 0.0, 1.5)
        run = rb.predict(rover, rocks, start, path, tolerance=1e-6, details=False, **law)  # type: ignore[arg-type]
        assert rb.DriveEnd.INACCURATE not in {rb.DriveEnd(code) for code in run["end"].to_numpy()}
        missing = abs(run["motor_work"] - run["dissipation"] - run["height_gain"]).max().item()
        # where a contact jumps, a step is divided, and each of its parts may miss the step's tolerance
        allowed = 2e-6 if "friction" in law else 5e-6
        assert missing <= allowed * rover.mass * rb.GRAVITY["earth"] * 1.5


def test_forces_balance_the_weight_at_every_station(rover: rb.Rover, waves: rb.Terrain) -> None:
    run = rb.predict(rover, waves, (8.0, 9.0, 0.4), rb.Path.straight((0, 0), 0.0, 5.0), friction=0.7)
    pose = rb.settle(rover, waves, run["x"], run["y"], run["yaw"], steering=run["steering"])
    axle = np.einsum("...ij,...wj->...wi", pose.T_world_body[..., :3, :3], pose.axle_frames[..., :3, 1])
    ahead = np.cross(axle, pose.contact_normal)
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
    left = np.cross(pose.contact_normal, ahead)
    parts = ((run["normal_force"], pose.contact_normal), (run["traction"], ahead), (run["side_force"], left))
    total = sum((np.asarray(size)[..., None] * direction).sum(axis=1) for size, direction in parts)
    np.testing.assert_allclose(total, [[0.0, 0.0, rover.mass * rb.GRAVITY["earth"]]] * len(total), atol=1e-3)


def test_slip_tends_to_zero_with_friction(rover: rb.Rover) -> None:
    x = np.arange(0.0, 40.1, 0.5)
    ridges = rb.Terrain.from_array(0.4 * np.add.outer(np.zeros(81), np.sin(0.6 * x)), spacing=0.5, interpolation="cubic")
    path = rb.Path.straight((0, 0), 0.0, 6.0)
    run = rb.predict(rover, ridges, (8.0, 9.0, 0.0), path, friction=[0.5, 5.0, 50.0, 500.0])
    slip = np.abs(run["roll_slip"] / (rover.wheel_radius * run["wheel_rate"])).max(dim=("time", "wheel")).to_numpy()
    np.testing.assert_allclose(slip[2:] * [50.0, 500.0], slip[1] * 5.0, rtol=0.01)
    assert slip[-1] < 1e-6
    np.testing.assert_allclose(run["x"][3, -1], 14.0, atol=1e-5)


def test_wheels_that_must_slip_on_rocks_meet_the_law_of_friction() -> None:
    rover, rocks = rb.load_rover("perseverance"), rb.surfaces.rocks(0.1, 1, size=40.0, spacing=0.05, largest=0.3)
    rates = np.tile(0.04 / rover.wheel_radius, (2, 1))
    table = {"wheel_rate": (("time", "wheel"), rates), "steering": (("time", "wheel"), np.zeros((2, 6)))}
    start = np.array([[k - 3.0, 3.0 - k, 0.8 * k] for k in range(6)])
    run = rb.predict(rover, rocks, start, xr.Dataset(table, {"time": [0.0, 250.0]}), friction=0.8, step=0.25, details=False)
    assert (run["end"] == 0).all()
    slip = np.hypot(run["roll_slip"], run["side_slip"])
    share = np.hypot(run["traction"], run["side_force"]) / (0.8 * run["normal_force"])
    error = np.abs(share - slip / np.hypot(slip, 1e-3 * 0.04)).where(run["normal_force"] > 1.0).max("wheel")
    assert (slip > 0.004).any("wheel").mean() > 0.5
    assert (error < 1e-6).mean() > 0.995


def test_straight_up_a_slope_creeps_as_the_law_states(rover: rb.Rover) -> None:
    run = rb.predict(rover, tilted(10.0), (20.0, 8.0, np.pi / 2), rb.Path.straight((0, 0), 0.0, 4.0), friction=0.8, speed=0.05)
    share = np.tan(np.radians(10.0)) / 0.8
    creep = 1e-3 * share / np.sqrt(1.0 - share**2)
    rim = 0.05 / np.cos(np.radians(10.0))
    np.testing.assert_allclose(-run["roll_slip"] / rim, creep, rtol=1e-6)
    np.testing.assert_allclose(run["traction"] / run["normal_force"], np.tan(np.radians(10.0)), rtol=1e-9)


def test_a_mirrored_drive_is_the_mirror_image(rover: rb.Rover) -> None:
    rng = np.random.default_rng(5)
    z = rng.normal(scale=0.03, size=(61, 61))
    ground = rb.Terrain.from_array(z, spacing=0.5, origin=(-15.0, -15.0), interpolation="cubic")
    mirror = rb.Terrain.from_array(z[::-1].copy(), spacing=0.5, origin=(-15.0, -15.0), interpolation="cubic")
    left = rb.predict(rover, ground, (-3.0, 0.3, 0.2), rb.Path.arc((0, 0), 0.0, 9.0, 0.4), friction=0.6)
    right = rb.predict(rover, mirror, (-3.0, -0.3, -0.2), rb.Path.arc((0, 0), 0.0, 9.0, -0.4), friction=0.6)
    for name, sign in (("x", 1.0), ("y", -1.0), ("yaw", -1.0), ("motor_work", 1.0), ("dissipation", 1.0)):
        np.testing.assert_allclose(left[name], sign * right[name], rtol=1e-6, atol=1e-7)
    swap = [1, 0, 3, 2, 5, 4]
    np.testing.assert_allclose(left["normal_force"], right["normal_force"].isel(wheel=swap), rtol=1e-4, atol=1e-3)


def test_a_drive_on_turned_terrain_is_turned(rover: rb.Rover) -> None:
    z = np.random.default_rng(6).normal(scale=0.03, size=(61, 61))
    ground = rb.Terrain.from_array(z, spacing=0.5, origin=(-15.0, -15.0), interpolation="cubic")
    turned = rb.Terrain.from_array(np.rot90(z, -1).copy(), spacing=0.5, origin=(-15.0, -15.0), interpolation="cubic")
    path = rb.Path.arc((0, 0), 0.0, 9.0, 0.4)
    one = rb.predict(rover, ground, (-3.0, 0.3, 0.2), path, friction=0.6)
    other = rb.predict(rover, turned, (-0.3, -3.0, 0.2 + np.pi / 2), path, friction=0.6)
    np.testing.assert_allclose(one["x"], other["y"], atol=1e-7)
    np.testing.assert_allclose(one["y"], -other["x"], atol=1e-7)
    np.testing.assert_allclose(one["motor_work"], other["motor_work"], rtol=1e-6, atol=1e-5)


def test_a_weak_motor_slows_down_and_the_others_pull(rover: rb.Rover) -> None:
    path, start = rb.Path.straight((0, 0), 0.0, 2.0), (20.0, 8.0, np.pi / 2)
    free = rb.predict(rover, tilted(10.0), start, path, friction=0.9)
    torque = np.full(6, np.inf)
    torque[0] = 0.3 * float(free["wheel_torque"][0, 0])
    weak = rb.predict(rover, tilted(10.0), start, path, friction=0.9, torque=torque)
    assert weak.attrs["end"] == "REACHED_END"
    np.testing.assert_allclose(weak["wheel_torque"][:, 0], torque[0], rtol=1e-9)
    assert (weak["wheel_rate"][:, 0] < weak["wheel_rate_command"][:, 0]).all()
    assert float(weak["wheel_torque"][0, 1:].sum()) > float(free["wheel_torque"][0, 1:].sum())


@pytest.mark.parametrize("law", [{"friction": 0.8}, {"soil": "grc-1"}])
def test_a_rover_climbs_until_all_motors_together_are_too_weak(rover: rb.Rover, law: dict[str, object]) -> None:
    start, path = (20.0, 8.0, np.pi / 2), rb.Path.straight((0, 0), 0.0, 0.5)

    def climb(torque: float) -> xr.Dataset:
        return rb.predict(rover, tilted(15.0), start, path, torque=torque, step=0.1, details=False, **law)  # type: ignore[arg-type]

    free = climb(np.inf)
    needed = free["wheel_torque"][0].to_numpy()
    np.testing.assert_allclose(climb(1.01 * needed.max())["wheel_torque"], free["wheel_torque"], rtol=1e-6)
    enough = 1.01 * needed.mean()  # on rigid terrain, the sum of torques is that of the slope; on soil, slip changes it a little
    weak = climb(enough)
    assert weak.attrs["end"] == "REACHED_END"
    assert weak["wheel_torque"].max() <= enough * (1.0 + 1e-9)
    assert climb(0.95 * needed.mean()).attrs["end"] == "STALLS"


@pytest.mark.parametrize(
    ("degrees", "friction", "torque", "end"),
    [(25.0, 0.3, None, "SLIDES"), (15.0, 0.9, 20.0, "STALLS"), (5.0, 0.8, None, "OFF_MAP")],
)
def test_a_drive_that_cannot_continue_names_the_reason(
    rover: rb.Rover, degrees: float, friction: float, torque: float | None, end: str
) -> None:
    run = rb.predict(
        rover, tilted(degrees), (20.0, 34.0, np.pi / 2), rb.Path.straight((0, 0), 0.0, 12.0), friction=friction, torque=torque
    )
    assert run.attrs["end"] == end
    assert run.attrs["reached_end"] == 0
    assert np.isfinite(run["x"]).all()


def test_a_step_is_halved_where_only_a_shorter_one_has_a_motion() -> None:
    """At these two starts, a stage of a full step meets a rock's face, where no motion balances."""
    rover, terrain = rb.load_rover("curiosity"), rb.surfaces.mars(seed=3)
    start = [[0.507086, 9.623901, -1.356905], [-3.277659, 5.159020, 2.280589]]
    run = rb.predict(rover, terrain, start, rb.Path.straight((0, 0), 0.0, 5.0), friction=0.6, record=0.5, details=False)
    assert (run["ends_because"] == "all commands were driven").all()
    assert np.isfinite(run["x"]).all()


def test_rollouts_have_the_same_bits_for_any_number_of_threads(rover: rb.Rover) -> None:
    ground = rb.surfaces.rocks(0.05, 1, size=12.0, spacing=0.1, smallest=0.2, largest=0.3)
    rng = np.random.default_rng(0)
    start = np.column_stack([rng.uniform(-1, 1, (40, 2)), rng.uniform(-3, 3, 40)])
    friction = rng.uniform(0.5, 0.9, 40)
    path = rb.Path.straight((0, 0), 0.0, 1.0)
    runs = []
    for count in (1, 2):
        with threads(count):
            runs.append(rb.predict(rover, ground, start, path, friction=friction, details=False))
    assert runs[0].identical(runs[1])
    alone = rb.predict(rover, ground, start[7], path, friction=friction[7], details=False)
    np.testing.assert_array_equal(runs[0]["x"][7, : alone.sizes["time"]], alone["x"])


def test_recorded_commands_repeat_the_drive(rover: rb.Rover) -> None:
    path = rb.Path.straight((0, 0), 0.0, 2.0)
    run = rb.predict(rover, tilted(8.0), (10.0, 10.0, 0.3), path, friction=0.8, speed=0.05)
    again = rb.predict(rover, tilted(8.0), (10.0, 10.0, 0.3), run[["wheel_rate", "steering"]], friction=0.8)
    np.testing.assert_allclose(again["x"][-1], run["x"][-1], atol=1e-6)
    np.testing.assert_allclose(again["y"][-1], run["y"][-1], atol=1e-6)


def test_rates_that_change_alone_continue_from_the_same_pose(rover: rb.Rover) -> None:
    terrain, start = rb.surfaces.fractal(3), (0.0, 0.0, 0.4)
    run = rb.predict(rover, terrain, start, rb.Path.straight((0, 0), 0.4, 1.0), friction=0.8, speed=0.05)
    commands = run[["wheel_rate", "steering"]].copy(deep=True)
    commands["wheel_rate"][:] = 0.4
    same = rb.predict(rover, terrain, start, commands, friction=0.8)
    commands["wheel_rate"][commands.sizes["time"] // 2 :] += 1e-12
    changed = rb.predict(rover, terrain, start, commands, friction=0.8)
    for name in ("x", "y", "z", "roll", "rocker", "clearance", "normal_force", "wheel_torque", "slip_ratio", "status"):
        np.testing.assert_allclose(changed[name], same[name], rtol=1e-6, atol=1e-8, err_msg=name)


def test_records_are_a_subset_of_all_steps(rover: rb.Rover) -> None:
    path = rb.Path.straight((0, 0), 0.0, 3.0)
    every = rb.predict(rover, tilted(8.0), (10.0, 10.0, 0.3), path, friction=0.8, step=0.1)
    some = rb.predict(rover, tilted(8.0), (10.0, 10.0, 0.3), path, friction=0.8, step=0.1, record=0.5)
    np.testing.assert_array_equal(some["x"], every["x"][::5])
    np.testing.assert_array_equal(some["time"], every["time"][::5])


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"friction": None}, "give either friction="),
        ({"friction": -0.5}, "friction is -0.5"),
        ({"friction": np.nan}, "not finite"),
        ({"friction": True}, "friction is True; give numbers"),
        ({"start": ["0", "0", "0"]}, "start is .* give numbers: x"),
        ({"tolerance": True}, "tolerance is True"),
        ({"tolerance": np.inf}, "tolerance is inf"),
        ({"torque": "3"}, "torque is '3'"),
        ({"step": 50.0}, "step is 50 m; give at most the wheelbase, .* m .is it in millimetres"),
        ({"start": (1.0, 2.0)}, "x \\(m\\), y \\(m\\) and yaw"),
        ({"start": (1.0, np.inf, 0.0)}, "not finite"),
        ({"commands": "straight"}, "give a Path"),
        ({"commands": []}, "give a Path"),
        ({"torque": -3.0}, "torque is -3.0"),
        ({"gravity": 0.0}, "gravity is 0 m/s²; give 0.001 to 100"),
        ({"speed": 0.0}, "speed is 0.0"),
        ({"speed": 40.0}, "mm/s"),
        ({"step": -1.0}, "step is -1.0"),
        ({"step": 1e-9}, "give a longer step"),
        ({"friction": [0.5, 0.6], "start": np.zeros((3, 3))}, "do not broadcast"),
        ({"friction": []}, "no drive"),
        ({"start": np.zeros((0, 3))}, "no drive"),
        ({"commands": rates(100.0)}, "deg/s"),
        ({"friction": None, "soil": "dry-sand", "grousers": 10.0}, "grouser height is 10 m; it must be from 0 to 1 m"),
    ],
)
def test_wrong_calls_raise_a_sentence(rover: rb.Rover, changes: dict[str, object], text: str) -> None:
    arguments: dict[str, object] = {"start": (10.0, 10.0, 0.0), "commands": rb.Path.straight((0, 0), 0.0, 1.0), "friction": 0.5}
    arguments |= changes
    with pytest.raises((RockerbogieError, PathError), match=text):
        rb.predict(rover, tilted(0.0), **arguments)  # type: ignore[arg-type]


def test_a_rover_on_sand_slips_more_on_steeper_slopes_and_keeps_the_energy_balance(rover: rb.Rover) -> None:
    slips = []
    for degrees in (0.0, 6.0, 12.0):
        run = rb.predict(
            rover, tilted(degrees), (20.0, 8.0, np.pi / 2), rb.Path.straight((0, 0), 0.0, 2.0), soil="dry-sand", gravity=3.71
        )
        assert run.attrs["end"] == "REACHED_END"
        last = run.isel(time=-1)
        assert abs(last["motor_work"] - last["dissipation"] - last["height_gain"]) <= 1e-6 * float(last["motor_work"])
        slips.append(float(run["slip_ratio"].mean()))
        assert (run["sinkage"] > 0.0).all()
    assert 0.0 < slips[0] < slips[1] < slips[2] < 1.0


def test_a_rover_parks_on_sand_between_two_drives(rover: rb.Rover) -> None:
    def drive(rate: list[float], time: list[float]) -> xr.Dataset:
        values = {"wheel_rate": (("time", "wheel"), np.repeat(np.array(rate)[:, None], 6, axis=1))}
        commands = xr.Dataset(values | {"steering": (("time", "wheel"), np.zeros((len(time), 6)))}, {"time": time})
        return rb.predict(rover, tilted(5.0), (20.0, 8.0, np.pi / 2), commands, soil="grc-1", gravity=3.71)

    stop = drive([0.0, 0.0, 0.2, 0.2, 0.0, 0.0, 0.2, 0.2], [0.0, 5.0, 5.001, 10.0, 10.001, 15.0, 15.001, 20.0])
    assert stop.attrs["end"] == "REACHED_END"
    parked = np.hypot(np.diff(stop["x"]), np.diff(stop["y"]))[(stop["wheel_rate_command"][:-1] == 0.0).all(axis=1)]
    assert parked.size > 4
    assert parked.max() < 1e-4
    assert stop["y"][-1] - 8.0 > 0.3
    balance = stop["motor_work"] - stop["dissipation"] - stop["height_gain"]
    assert abs(balance).max() <= 1e-6 * stop["motor_work"].max()


def test_a_soil_without_a_name_is_recorded_as_soil(rover: rb.Rover) -> None:
    soil = dataclasses.replace(rb.load_soil("grc-1"), name="")
    run = rb.predict(rover, tilted(0.0), (20.0, 8.0, 0.0), rb.Path.straight((0, 0), 0.0, 0.2), soil=soil)
    assert run.attrs["law"] == "soil Soil"
    assert "law_exceeded" in run


def test_forces_on_sand_are_those_of_the_soil_law(rover: rb.Rover) -> None:
    run = rb.predict(
        rover, tilted(10.0), (20.0, 8.0, 0.4), rb.Path.straight((0, 0), 0.0, 1.0), soil="dry-sand", gravity=3.71, ruts=False
    )
    last = run.isel(time=-1)
    exact = rb.wheel_soil_forces(
        rb.load_soil("dry-sand"), float(rover.wheel_radius[0]), float(rover.wheel_width[0]), last["normal_force"].to_numpy(),
        last["slip_ratio"].to_numpy(), last["slip_angle"].to_numpy(), gravity=3.71,
    )  # fmt: skip
    scale = float(last["normal_force"].max())
    np.testing.assert_allclose(last["traction"], exact.drawbar, atol=0.01 * scale)
    np.testing.assert_allclose(last["side_force"], exact.side, atol=0.01 * scale)
    np.testing.assert_allclose(last["wheel_torque"], exact.torque, atol=0.01 * scale * float(rover.wheel_radius[0]))


def test_rollouts_take_lists_of_soils_and_commands(rover: rb.Rover) -> None:
    paths = [rb.Path.straight((0, 0), 0.0, 1.0), rb.Path.arc((0, 0), 0.0, 5.0, 0.1)]
    run = rb.predict(
        rover, tilted(5.0), np.array([[10.0, 10.0, 0.0]]), paths, soil=["dry-sand", "lunar-lrv-b"], gravity=3.71, details=False
    )
    assert run.sizes["run"] == 2
    assert list(run["soil"].to_numpy()) == ["dry-sand", "lunar-lrv-b"]
    assert np.isfinite(run["x"][0]).all()
    assert np.isnan(run["x"][1, -1])
    assert run["ends_because"][1] == "all commands were driven"


def test_a_soil_that_cannot_carry_the_rover_ends_the_drive(rover: rb.Rover) -> None:
    """Check soil in which the wheels would slide back at full depth."""
    weak = dataclasses.replace(rb.load_soil("dry-sand"), name="weak", cohesion=0.0, kc=0.0, kphi=2.0e4, exponent=1.0)
    for degrees in (0.0, 10.0):
        run = rb.predict(rover, tilted(degrees), (20.0, 8.0, np.pi / 2), rb.Path.straight((0, 0), 0.0, 1.0), soil=weak)
        assert run.attrs["end"] == "OVERLOADS"
        assert run.sizes["time"] == 0


def test_wheels_outside_the_soil_law_are_marked(rover: rb.Rover) -> None:
    path = rb.Path.straight((0, 0), 0.0, 0.5)
    runs = [
        rb.predict(rover, tilted(degrees), (20.0, 18.0, np.pi / 2), path, soil="dry-sand", gravity=3.71, details=False)
        for degrees in (5.0, 20.0)
    ]
    assert not runs[0]["law_exceeded"].any()
    assert runs[1]["law_exceeded"].all(), "the rover slides back"
    assert (runs[1]["y_rate"] < 0.0).all()
    assert "law_exceeded" not in rb.predict(rover, tilted(5.0), (20.0, 18.0, 0.0), path, friction=0.8)


def test_commands_at_dates_are_refused() -> None:
    """Check that nanoseconds of dates are not taken as seconds."""
    rates = np.full((2, 6), 0.5)
    commands = xr.Dataset(
        {"wheel_rate": (("time", "wheel"), rates), "steering": (("time", "wheel"), 0.0 * rates)},
        {"time": np.array(["2030-01-01T00:00:00", "2030-01-01T00:00:10"], dtype="datetime64[ns]")},
    )
    with pytest.raises(rb.RockerbogieError, match="give seconds"):
        rb.predict(rb.load_rover("osr"), rb.surfaces.plane(), (0.0, 0.0, 0.0), commands, friction=0.7)
