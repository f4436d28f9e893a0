"""Tests of simulated runs: the paper's crossing against the model, and their variables."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.simulation.compare import Comparison

SPEED = 0.02
FLAT = rb.Terrain.from_array(np.zeros((100, 100)), 0.1, (-3.0, -5.0), name="flat")


@pytest.fixture(scope="module")
def crossing() -> xr.Dataset:
    """The paper's rover over the paper's ground, 3.6 m at 2 cm/s."""
    return rb.simulate(rb.load_rover("elhami-dashti"), rb.surfaces.paper(), rb.Path.straight((0, 0), 0.0, 3.6), SPEED)


@pytest.fixture(scope="module")
def apart(crossing: xr.Dataset) -> Comparison:
    """The kinematic model settled at the crossing's own x, y and yaw, against it."""
    return rb.compare(rb.settle_along(rb.load_rover("elhami-dashti"), rb.surfaces.paper(), crossing), crossing)


@pytest.fixture(scope="module")
def turning() -> xr.Dataset:
    """Return a run of Rocky 7 along an arc on level terrain."""
    return rb.simulate(rb.load_rover("rocky7"), FLAT, rb.Path.arc((0, 0), 0.2, 1.5, 0.8), 0.05)


class TestCrossing:
    """Section III of the paper."""

    @pytest.mark.parametrize(
        ("channel", "most_deg"), [("roll", 0.01), ("pitch", 0.03), ("rocker", 0.01), ("bogie left", 0.04), ("bogie right", 0.04)]
    )
    def test_angles(self, apart: Comparison, channel: str, most_deg: float) -> None:
        assert np.degrees(apart[channel].rms) < most_deg
        assert np.degrees(apart[channel].worst) < 0.15

    def test_height(self, apart: Comparison) -> None:
        assert apart["z"].rms < 1.5e-3
        assert apart["z"].worst < 2e-4  # 0.11 mm of it is what soft contacts give

    def test_contact_angles(self, apart: Comparison) -> None:
        """Contact angles agree within the facets, except at jumps between faces (16 deg)."""
        for name in ("LR", "RR", "LM", "RM", "LF", "RF"):
            assert np.degrees(apart[f"contact angle {name}"].rms) < 0.6
            assert apart[f"contact angle {name}"].count == 1801

    def test_the_rover_reaches_the_end_of_the_path(self, crossing: xr.Dataset) -> None:
        assert crossing.attrs["status_summary"] == "1801 of 1801 stations settled"
        assert crossing["x"][-1] == pytest.approx(3.6, abs=0.02)
        assert float(np.abs(crossing["x"] - SPEED * crossing["time"]).max()) < 0.03
        assert float(np.abs(crossing["y"]).max()) < 0.08  # the body sways by 0.39 m · sin(10 deg)
        assert np.degrees(float(np.abs(crossing["yaw"]).max())) < 3

    def test_wheel_rates_are_those_of_the_kinematics(self, crossing: xr.Dataset) -> None:
        """Rates agree with `drive` there: half of them within 3 %, 99 % within 15 %."""
        run = rb.drive(rb.load_rover("elhami-dashti"), rb.surfaces.paper(), rb.Path.straight((0, 0), 0.0, 3.6), SPEED, step=0.002)
        planned = np.stack([np.interp(crossing["x"], run["x"], run["wheel_rate"][:, k]) for k in range(6)], axis=-1)
        share = np.abs(crossing["wheel_rate"].values / planned - 1)[10:]  # from a standing start
        assert np.median(share) < 0.03
        assert np.quantile(share, 0.99) < 0.15

    def test_rates_are_those_of_the_angles(self) -> None:
        """Rates 0.02 s apart sum up to their coordinates within 0.05 deg and 0.5 mm."""
        path = rb.Path.straight((0.6, 0), 0.0, 0.7)
        crossing = rb.simulate(rb.load_rover("elhami-dashti"), rb.surfaces.paper(), path, SPEED, interval=0.02)
        for name in ("x", "y", "z", "roll", "pitch", "yaw", "rocker", "bogie"):
            rate = crossing[f"{name}_rate"].values
            steps = (rate[1:] + rate[:-1]) / 2 * np.diff(crossing["time"].values).reshape(-1, *[1] * (rate.ndim - 1))
            error = np.cumsum(steps, axis=0) - (crossing[name].values[1:] - crossing[name].values[0])
            most = 5e-4 if name in "xyz" else np.radians(0.05)
            assert np.abs(error).max() < most, name

    def test_twist_is_the_velocity_in_the_body(self, crossing: xr.Dataset) -> None:
        T = rb.body_transform(*(crossing[name].values for name in ("x", "y", "z", "roll", "pitch", "yaw")))
        twist = np.stack([crossing[name].values for name in ("vx", "vy", "vz")], axis=-1)
        world = np.stack([crossing[f"{name}_rate"].values for name in "xyz"], axis=-1)
        np.testing.assert_allclose(np.einsum("nij,nj->ni", T[:, :3, :3], twist), world, atol=1e-12)

    def test_contact_forces_sum_to_the_weight(self, crossing: xr.Dataset) -> None:
        """On the flat: the forces add up to the weight, and every tread is 0.1 mm in."""
        flat = crossing.sel(time=10.0, method="nearest")
        assert float(flat["contact_force"].sum()) == pytest.approx(rb.load_rover("elhami-dashti").mass * 9.81, rel=1e-3)
        assert float(flat["gap"].min()) > -2e-4
        assert float(flat["gap"].max()) < 0

    def test_every_variable_has_units(self, crossing: xr.Dataset) -> None:
        assert all({"units", "long_name"} <= set(crossing[name].attrs) for name in crossing.data_vars)
        run = rb.drive(rb.load_rover("elhami-dashti"), FLAT, rb.Path.straight((0, 0), 0.0, 0.5))
        assert set(run.data_vars) <= set(crossing.data_vars)
        assert all(run[name].dims == crossing[name].dims for name in run.data_vars)


def test_an_arc_is_followed(turning: xr.Dataset) -> None:
    path = rb.Path.arc((0, 0), 0.2, 1.5, 0.8)
    at = path.sample(np.minimum(turning["time"].values * 0.05, path.length))
    assert np.hypot(turning["x"] - at.x, turning["y"] - at.y).max() < 0.02
    assert np.degrees(np.abs(turning["yaw"] - at.yaw).max()) < 3
    assert float(turning["z"].std()) < 1e-4


def test_the_same_commands_lead_to_the_same_position(turning: xr.Dataset) -> None:
    """Recorded commands, open loop from the same start, end within 1 cm and 0.5 deg."""
    commands = xr.Dataset({"wheel_rate": turning["wheel_rate_command"], "steering": turning["steering_command"]})
    commands = commands.assign_coords(time=turning["time"] + 5.0)
    again = rb.simulate(rb.load_rover("rocky7"), FLAT, rb.Path.straight((0, 0), 0.2, 0.1), 0.05, commands=commands)
    assert again.sizes["time"] == turning.sizes["time"]
    end, same = again.isel(time=-1), turning.isel(time=-1)
    assert np.hypot(end["x"] - same["x"], end["y"] - same["y"]) < 0.01
    assert abs(np.degrees(end["yaw"] - same["yaw"])) < 0.5


def test_tipping_is_reported() -> None:
    side = rb.surfaces.plane(np.radians(52), np.pi / 2)
    run = rb.simulate(rb.load_rover("rocky7"), side, rb.Path.straight((-1, 0), 0.0, 2.0), 0.05, friction=2.0)
    assert run["status"][-1] == rb.Status.TIPPED
    assert float(run["time"][-1]) < 30


def test_commands_that_lead_off_the_map_are_reported() -> None:
    """Open loop over the rim: it ends there, and says so."""
    commands = xr.Dataset(
        {"wheel_rate": (("time", "wheel"), np.full((2, 6), 3.0)), "steering": (("time", "wheel"), np.zeros((2, 6)))},
        {"time": [0.0, 60.0]},
    )
    run = rb.simulate(rb.load_rover("rocky7"), FLAT, rb.Path.straight((5.5, 0), 0.0, 0.5), commands=commands)
    assert run["status"][-1] == rb.Status.OFF_MAP
    assert 6.0 < float(run["x"][-1]) < 7.0
    assert float(run["time"][-1]) < 15
    assert "speed" not in run.attrs


def test_a_drive_shorter_than_its_interval() -> None:
    run = rb.simulate(rb.load_rover("rocky7"), FLAT, rb.Path.straight((0, 0), 0.0, 0.001), 0.05)
    assert run.sizes["time"] == 2


def test_a_rover_that_does_not_arrive_is_reported() -> None:
    rover, way = rb.load_rover("rocky7"), rb.Path.straight((0, 0), 0.0, 0.5)
    assert rb.simulate(rover, FLAT, way, 0.1).attrs["short_of_end"] < 0.02, "within a step of the follower"
    stuck = rb.simulate(rover, FLAT, way, 0.1, friction=0.0)
    assert stuck.attrs["short_of_end"] == pytest.approx(0.5, abs=0.02), "wheels without friction spin on the spot"


def test_progress_is_reported() -> None:
    heard: list[tuple[int, int]] = []
    rb.simulate(rb.load_rover("rocky7"), FLAT, rb.Path.straight((0, 0), 0.0, 0.05), 0.05, progress=lambda *at: heard.append(at))
    assert heard == [(k, 10) for k in range(1, 11)]


def orders(values: np.ndarray, time: list[float], dim: str = "wheel") -> xr.Dataset:
    """Commands, the same numbers for rates and steering."""
    return xr.Dataset(dict.fromkeys(("wheel_rate", "steering"), (("time", dim), values)), {"time": time})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"speed": 0.0}, "speed is 0.0 m/s"),
        ({"interval": -1.0}, "interval is -1.0 s"),
        ({"friction": -0.1}, "friction is -0.1"),
        (
            {"path": rb.Path.straight((0, 0), 0.0, 8.0)},
            r"6\.\d\d m along the path, .* a wheel is over missing data or off the map",
        ),
        ({"commands": xr.Dataset({"wheel_rate": (("time", "wheel"), np.zeros((2, 6)))})}, "commands hold no steering, time"),
        ({"commands": orders(np.full((2, 6), np.nan), [0, 1])}, "six finite numbers"),
        ({"commands": orders(np.zeros((2, 4)), [0, 1])}, r"shape \(2, 4\)"),
        ({"commands": orders(np.zeros((2, 6)), [1, 1])}, "2 times; give two or more, each later"),
        ({"commands": orders(np.zeros((2, 6)), [0, 1], "motor")}, "dims .*motor"),
        ({"commands": orders(np.ones((2, 6)), [0, 1])}, "does not steer"),
    ],
)
def test_invalid_calls_are_refused(change: dict[str, object], says: str) -> None:
    call: dict[str, object] = {"path": rb.Path.straight((0, 0), 0.0, 1.0), "speed": 0.05} | change
    with pytest.raises(rb.RockerbogieError, match=says):
        rb.simulate(rb.load_rover("rocky7"), FLAT, **call)  # type: ignore[arg-type]


class TestCompare:
    @pytest.fixture
    def run(self) -> xr.Dataset:
        return rb.drive(rb.load_rover("rocky7"), FLAT, rb.Path.straight((0, 0), 0.0, 1.0))

    def test_a_run_compared_with_itself_has_no_difference(self, run: xr.Dataset) -> None:
        result = rb.compare(run, run)
        assert all(c.rms == c.worst == 0 and c.count == 101 for c in result.channels)
        assert len(result.channels) == 12

    def test_inserted_differences_are_measured(self, run: xr.Dataset) -> None:
        other = run.copy(deep=True)
        other["z"][:] += 0.001
        other["bogie"][30, 1] -= 0.02
        other["contact_angle"][:, 0] += 2 * np.pi
        other["contact_angle"][:50, 3] = np.nan
        result = rb.compare(run, other)
        assert result["z"].rms == pytest.approx(0.001)
        assert result["bogie right"].worst == pytest.approx(0.02)
        assert result["bogie right"].rms == pytest.approx(0.02 / np.sqrt(101))
        assert result["bogie right"].worst_at == pytest.approx(0.3)
        assert result["contact angle LF"].worst < 1e-12
        assert result["contact angle RM"].count == 51
        assert result.to_dict()["z"] == {
            "unit": "m",
            "rms": result["z"].rms,
            "worst": result["z"].worst,
            "worst_at": 0.0,
            "count": 101,
        }
        assert "z                     1.0000    1.0000 mm" in str(result)

    def test_settle_along_a_drive_equals_the_drive(self, run: xr.Dataset) -> None:
        assert rb.compare(rb.settle_along(rb.load_rover("rocky7"), FLAT, run), run)["pitch"].worst == 0

    def test_runs_are_compared_at_equal_positions_only(self, run: xr.Dataset) -> None:
        rover, ground = rb.load_rover("rocky7"), rb.surfaces.rough(2, size=8.0)
        run = rb.drive(rover, ground, rb.Path.straight((0, 0), 0.0, 1.0))
        aside = rb.drive(rover, ground, rb.Path.straight((0, 0.25), 0.0, 1.0), step=0.02)
        assert rb.compare(run, aside)["pitch"].worst == 0  # settled where the other stands, they are one
        for data in (run, aside):
            data.encoding.clear()  # as after reading from a file
        with pytest.raises(rb.RockerbogieError, match="101 and 51 records.*settle_along"):
            rb.compare(run, aside)
        with pytest.raises(rb.RockerbogieError, match=r"are up to 0\.25 m and 0 deg apart.*settle_along"):
            rb.compare(run, run.assign(y=run["y"] + 0.25))
        assert rb.compare(run, run.assign(yaw=run["yaw"] + 2 * np.pi))["roll"].worst == 0
