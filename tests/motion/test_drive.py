"""Drives: stations, rates, symmetries, steering, errors and files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.motion.drive import ackermann, drive_rates, to_csv
from rockerbogie.settling.dataset import RUN_VARIABLES
from support.helpers import assert_close, paper_rover

ROVER = paper_rover()
ROUGH = rb.surfaces.rough(3, size=8.0)
ARC = rb.Path.arc((-1, -0.5), 0.3, 2.0, 1.2)
SHIFTS = ("x", "y", "z", "roll", "pitch", "yaw", "rocker", "bogie")


@pytest.fixture(scope="module")
def crossing() -> xr.Dataset:
    """Return the run of the paper's section III."""
    return rb.drive(ROVER, rb.surfaces.paper(), rb.Path.straight((0, 0), 0, 4.0))


def test_stations_are_settled_poses() -> None:
    run = rb.drive(ROVER, ROUGH, ARC, step=0.05)
    at = ARC.sample(run.distance.values)
    pose = rb.settle(ROVER, ROUGH, at.x, at.y, at.yaw, steering=run.steering.values)
    assert (pose.status == rb.Status.CONVERGED).all()
    for name in ("z", "roll", "pitch", "rocker", "bogie", "contact_angle", "contact_point", "gap", "clearance", "status"):
        assert_close(run[name], getattr(pose, name), 0, RUN_VARIABLES[name][1], "the same poses")
    assert_close(np.diff(run.distance), ARC.length / 48, 1e-12, "m", "even steps of at most 0.05 m, the end included")
    assert_close(run.time, run.distance / 0.02, 1e-12, "s", "2 cm/s")


def test_the_dataset_describes_itself(crossing: xr.Dataset) -> None:
    assert set(crossing.data_vars) == set(RUN_VARIABLES)
    for name, variable in crossing.variables.items():
        if name not in ("wheel", "side", "axis"):
            assert variable.attrs["units"]
            assert variable.attrs["long_name"]
    assert crossing.bogie.dims == ("time", "side")
    assert crossing.contact_point.dims == ("time", "wheel", "axis")
    assert crossing.wheel.values.tolist() == list(ROVER.wheel_names)
    assert crossing.attrs["rover"] == "elhami-dashti"
    assert crossing.attrs["terrain"] == "paper"
    assert crossing.attrs["speed"] == 0.02
    assert rb.__version__ in crossing.attrs["source"]
    assert crossing.attrs["status_summary"] == "401 of 401 stations settled"


def test_the_paper_s_crossing_has_the_described_angles(crossing: xr.Dataset) -> None:
    pitch, roll = np.degrees(crossing.pitch.values), np.degrees(crossing["roll"].values)
    assert_close(crossing.gap, 0, 1e-6, "m", "six wheels in contact at every station")
    assert pitch[:10] == pytest.approx(-0.0322, abs=1e-4)  # the paper's own 0.3 mm
    assert pitch[crossing.distance < 1.6].max() < 0.1  # climbs nose up over the first half
    first = (crossing.distance > 0.55) & (crossing.distance < 1.1)
    assert roll[first].max() < 0  # both negative when the front wheels reach the bumps: the ramp begins the steeper
    assert pitch.min() < -10
    assert pitch.max() > 10  # and comes down
    assert roll.max() > 1  # the left hill is the higher: left side up
    level = crossing.sel(side="right").bogie.values[crossing.distance < 0.4]
    assert_close(level, 0.000562, 1e-6, "rad", "the right bogie keeps its angle while its wheels are on one plane")


@pytest.mark.parametrize(
    ("rover", "terrain"),
    [(ROVER, ROUGH), (rb.load_rover("rocky7").replace(wheel_width=np.zeros(6)), rb.surfaces.rough(5, size=8.0, min_radius=0.5))],
    ids=["paper's", "rocky7 on discs"],
)
@pytest.mark.parametrize("path", [ARC, rb.Path.from_arrays([-1, 0, 1], [0, 0.5, 0.4], [0.2, 0.6, 0.1])], ids=["arc", "log"])
def test_rates_are_the_derivatives_of_the_poses(rover: rb.Rover, terrain: rb.Terrain, path: rb.Path) -> None:
    """Compare rates with fourth-order differences, with the steering held."""
    h, speed = 2e-4, 0.05
    s = np.linspace(5 * h, path.length - 5 * h, 400)
    s = s[np.abs(s[:, None] - path.distance).min(axis=1) > 3 * h]

    def pose_at(shift: float) -> rb.Pose:
        at = path.sample(s + shift)
        return rb.settle(rover, terrain, at.x, at.y, at.yaw)

    poses = {k: pose_at(k * h) for k in (-2, -1, 1, 2)}
    rates = drive_rates(pose_at(0.0), path.sample(s), speed)
    for name in SHIFTS:
        at = {k: getattr(p, name) for k, p in poses.items()}
        difference = (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12 * h) * speed
        assert_close(rates[f"{name}_rate"], difference, 2e-6 * max(1.0, np.abs(difference).max()), "1/s", f"d {name} / dt")


def test_wide_wheels_have_rates_except_where_contacts_change_edges() -> None:
    rover, terrain = rb.load_rover("perseverance"), rb.surfaces.rough(3, size=14.0, min_radius=0.6, spacing=0.03)
    s = np.arange(0, ARC.length, 1e-3)
    at = ARC.sample(s)
    pose = rb.settle(rover, terrain, at.x, at.y, at.yaw)
    rates = drive_rates(pose, at, speed=1.0)
    for name in ("z", "roll", "pitch", "rocker"):
        difference = np.gradient(getattr(pose, name), s)
        off = np.abs(rates[f"{name}_rate"] - difference)[1:-1]
        assert np.quantile(off, 0.9) < 0.01 * np.abs(difference).max()  # at the others a contact jumps from edge to edge


def test_wheel_rates_match_the_length_of_the_slope() -> None:
    slope = np.radians(20)
    run = rb.drive(ROVER, rb.surfaces.plane(slope, size=20), rb.Path.straight((-1, 0), 0, 2), speed=0.1)
    assert_close(
        run.wheel_rate, 0.1 / np.cos(slope) / 0.1, 1e-9, "rad/s", "the horizontal distance is cos 20° of the length of the slope"
    )


@pytest.mark.parametrize(
    ("path", "mirrored"),
    [
        (ARC, rb.Path.arc((-1, 0.5), -0.3, 2.0, -1.2)),
        (rb.Path.waypoints([(-2, -1), (1, -1), (1.5, 2)], 0.8), rb.Path.waypoints([(-2, 1), (1, 1), (1.5, -2)], 0.8)),
    ],
    ids=["arc", "waypoints"],
)
def test_a_mirror_mirrors_the_drive(path: rb.Path, mirrored: rb.Path) -> None:
    """Compare a drive with its mirror image: some variables change sign, sides are exchanged."""
    x0, _, _, y1 = ROUGH.bounds
    here = rb.drive(ROVER, ROUGH, path, step=0.03)
    there = rb.drive(ROVER, rb.Terrain.from_array(ROUGH.z[::-1], ROUGH.spacing, (x0, -y1)), mirrored, step=0.03)
    for name in ("x", "z", "pitch", "clearance", "status", "x_rate", "z_rate", "pitch_rate"):
        assert_close(there[name], here[name], 1e-9, RUN_VARIABLES[name][1], "the same in the mirror")
    for name in ("y", "yaw", "roll", "rocker", "y_rate", "roll_rate", "yaw_rate", "rocker_rate"):
        assert_close(there[name], -here[name], 1e-9, RUN_VARIABLES[name][1], "the opposite sign in the mirror")
    for name in ("bogie", "bogie_rate"):
        assert_close(there[name], here[name].values[:, ::-1], 1e-9, RUN_VARIABLES[name][1], "left and right bogie are exchanged")
    for name, sign in (("contact_angle", 1), ("wheel_rate", 1), ("contact_angle_rate", 1), ("steering", -1)):
        assert_close(there[name], sign * swapped(here[name]), 1e-7, RUN_VARIABLES[name][1], "and so are the wheels")


def swapped(per_wheel: xr.DataArray) -> np.ndarray:
    """Return values (time, 6) with left and right wheels exchanged."""
    return per_wheel.values[:, [1, 0, 3, 2, 5, 4]]


@pytest.mark.parametrize("aspect", [0.0, 2.0, -1.2])
def test_a_tilted_plane_tilts_the_drive(aspect: float) -> None:
    slope = np.radians(20)
    flat = rb.drive(ROVER, rb.surfaces.plane(), ARC, step=0.1)
    tilted = rb.drive(ROVER, rb.surfaces.plane(slope, aspect), ARC, step=0.1)
    normal = np.array([np.sin(slope) * np.cos(aspect), np.sin(slope) * np.sin(aspect), np.cos(slope)])
    up = up_axis(tilted)
    assert_close(
        up @ normal, up_axis(flat)[:, 2], 1e-9, "-", "the body's attitude relative to the plane is that on level terrain"
    )
    for name in ("rocker", "bogie"):
        assert_close(tilted[name], flat[name], 1e-8, "rad", "joint angles do not depend on tilt")
    above = (tilted.z + np.tan(slope) * (tilted.x * np.cos(aspect) + tilted.y * np.sin(aspect))) * np.cos(slope)
    assert_close(above, flat.z, 1e-4, "m", "as high above the plane, measured across it; 0.6 mrad of pitch moves it by 0.2 mm")


def up_axis(run: xr.Dataset) -> np.ndarray:
    """Return the body's z axis (time, 3) in the world."""
    T = rb.body_transform(*(run[name] for name in ("x", "y", "z", "roll", "pitch", "yaw")))
    return T[:, :3, 2]


# -- steering ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["elhami-dashti", "perseverance", "osr", "sawppy"])
@pytest.mark.parametrize(("curvature", "crab"), [(0.4, 0.0), (-1.1, 0.0), (0.0, 0.3), (0.7, -0.4), (5.0, 0.0)])
def test_ackermann_leaves_no_side_slip_on_wheels_that_steer(name: str, curvature: float, crab: float) -> None:
    rover = rb.load_rover(name)
    steering = ackermann(rover, curvature, crab)
    assert (steering[~rover.steers] == 0).all()
    assert (np.abs(steering) <= np.pi / 2 + 1e-12).all()
    place = rover.hubs[:, :2] + rover.steering_offset
    velocity = np.stack([np.cos(crab) - curvature * place[:, 1], np.sin(crab) + curvature * place[:, 0]], axis=-1)
    across = -np.sin(steering) * velocity[:, 0] + np.cos(steering) * velocity[:, 1]
    assert_close(across[rover.steers], 0, 1e-12, "m/m", "each rolls along its own circle")


def test_ackermann_is_0_on_straight_paths_and_mirrors() -> None:
    rover = rb.load_rover("perseverance")
    assert not ackermann(rover, 0.0).any()
    assert not ackermann(rover, 0.0, np.pi).any()  # backwards
    left, right = ackermann(rover, [0.3, -0.3])
    assert_close(left[[1, 0, 3, 2, 5, 4]], -right, 1e-12, "rad", "a right turn is a left turn mirrored")
    assert left[0] > 0 > left[4]  # front wheels turn in, rear wheels out
    assert ackermann(rover, np.zeros((2, 3))).shape == (2, 3, 6)


def test_paths_steer_and_given_steering_is_kept() -> None:
    run = rb.drive(ROVER, ROUGH, ARC, step=0.1)
    assert_close(run.steering, np.tile(ackermann(ROVER, 0.5), (run.sizes["time"], 1)), 1e-12, "rad", "an arc of 2 m radius")
    held = rb.drive(ROVER, ROUGH, ARC, step=0.1, steering=np.zeros(6))
    assert not held.steering.any()
    backwards = rb.drive(ROVER, ROUGH, rb.Path.from_arrays([1, 0], [0, 0], [0, 0]), step=0.1)
    assert not backwards.steering.any()
    assert_close(backwards.x_rate, -0.02, 1e-12, "m/s", "it moves along the path")
    assert (backwards.wheel_rate < 0).all()


# -- the edges --------------------------------------------------------------------------------------------------------


def test_stations_off_the_map_are_nan_with_a_status() -> None:
    run = rb.drive(ROVER, ROUGH, rb.Path.straight((2, 0), 0, 3), step=0.01)
    off = run.status.values == rb.Status.OFF_MAP
    assert 0 < off.sum() < off.size
    assert np.diff(off.astype(int)).tolist().count(1) == 1  # from one station on
    for name in ("z", "roll", "rocker", "bogie", "contact_angle", "z_rate", "bogie_rate", "wheel_rate"):
        assert np.isnan(run[name].values[off]).all()
    assert np.isfinite(run.z.values[~off]).all()
    assert np.isfinite(run.z_rate.values[~off]).all()
    first = run.distance.values[off][0]
    assert run.attrs["status_summary"] == f"{(~off).sum()} of 301 stations settled, {off.sum()} OFF_MAP (first at {first:.2f} m)"


def test_missing_data_gives_no_data() -> None:
    z = np.array(ROUGH.z)
    z[195:205, 240:250] = np.nan
    run = rb.drive(ROVER, rb.Terrain.from_array(z, ROUGH.spacing, ROUGH.origin), rb.Path.straight((-1, 0.27), 0, 2), step=0.02)
    assert "NO_DATA (first at" in run.attrs["status_summary"]
    assert set(run.status.values.tolist()) == {rb.Status.CONVERGED, rb.Status.NO_DATA}


@pytest.mark.parametrize("start", [(50, 0), (3.9, 0)], ids=["far off", "body on the map, wheels off it"])
def test_a_path_wholly_off_the_map_is_refused(start: tuple[float, float]) -> None:
    with pytest.raises(rb.PathError, match=r"lies wholly off the map, which spans \(-4, -4\) to \(4, 4\) m"):
        rb.drive(ROVER, ROUGH, rb.Path.straight(start, 0, 1))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"speed": 0}, "speed is 0 m/s; give one above 0"),
        ({"speed": -0.1}, "to drive backwards, give a path whose yaw points back"),
        ({"speed": np.nan}, "speed is nan"),
        ({"step": 0}, "step is 0 m"),
        ({"step": np.inf}, "step is inf m"),
        ({"step": 1e-9}, "more than 200,000 stations: give a longer step"),
        ({"steering": np.zeros(5)}, r"steering has shape \(5,\); give \(6,\) or \(241, 6\)"),
        ({"steering": np.zeros((7, 6))}, "one row a station"),
        ({"steering": [np.nan, 0, 0, 0, 0, 0]}, "not finite"),
        ({"steering": [0, 0, 0.1, 0, 0, 0]}, "LM of rover 'elhami-dashti' does not steer"),
    ],
)
def test_bad_arguments_are_refused(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(rb.RockerbogieError, match=sentence):
        rb.drive(ROVER, ROUGH, ARC, **options)  # type: ignore[arg-type]


# -- files ------------------------------------------------------------------------------------------------------------


def test_netcdf_gives_back_the_run(crossing: xr.Dataset, tmp_path: Path) -> None:
    crossing.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as again:
        xr.testing.assert_identical(again, crossing)


def test_csv_holds_every_number_under_a_stable_name(tmp_path: Path) -> None:
    run = rb.drive(ROVER, ROUGH, rb.Path.straight((3, 0), 0, 0.9), step=0.1)
    file = tmp_path / "run.csv"
    to_csv(run, file)
    lines = file.read_text(encoding="utf-8").splitlines()
    header = lines[0].split(",")
    by_wheel = ("LR", "RR", "LM", "RM", "LF", "RF")
    assert header == [
        "time [s]", "distance [m]",
        "x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]", "rocker [rad]",
        "bogie_left [rad]", "bogie_right [rad]",
        *(f"steering_{w} [rad]" for w in by_wheel),
        *(f"contact_angle_{w} [rad]" for w in by_wheel),
        *(f"contact_point_{w}_{a} [m]" for w in by_wheel for a in "xyz"),
        *(f"gap_{w} [m]" for w in by_wheel),
        "clearance [m]", "status [1]",
        "x_rate [m/s]", "y_rate [m/s]", "z_rate [m/s]", "roll_rate [rad/s]", "pitch_rate [rad/s]", "yaw_rate [rad/s]",
        "rocker_rate [rad/s]", "bogie_rate_left [rad/s]", "bogie_rate_right [rad/s]",
        *(f"contact_angle_rate_{w} [rad/s]" for w in by_wheel),
        *(f"wheel_rate_{w} [rad/s]" for w in by_wheel),
        *(f"side_slip_{w} [m/s]" for w in by_wheel),
    ]  # fmt: skip
    table = np.genfromtxt(file, delimiter=",", skip_header=1)
    assert table.shape == (run.sizes["time"], len(header))
    assert np.isnan(table).any()  # it leaves the map
    for name, column in (
        ("z [m]", run.z),
        ("contact_point_LM_y [m]", run.contact_point.sel(wheel="LM", axis="y")),
        ("status [1]", run.status),
    ):
        assert_close(table[:, header.index(name)], column, 1e-9, "m", "ten digits")


def test_csv_that_cannot_be_written_is_an_error(crossing: xr.Dataset, tmp_path: Path) -> None:
    with pytest.raises(rb.RockerbogieError, match="cannot write .*no/run.csv': No such file or directory"):
        to_csv(crossing, tmp_path / "no" / "run.csv")
