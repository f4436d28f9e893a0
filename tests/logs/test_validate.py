"""Predicted against logged attitude: known poses, wrong signs, logs of real rovers."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.figures.validation import validation_figure
from rockerbogie.settling.uncertainty import FACTORS, Doubt, fit_factors, interval_score, sample, stands
from rockerbogie.terrain.roughness import Roughness, draw_ground, missing_roughness, second_difference, wave_numbers
from support.helpers import assert_close

RNG = np.random.default_rng(5)
X, Y, YAW = RNG.uniform(-6, 6, 12), RNG.uniform(-6, 6, 12), RNG.uniform(-np.pi, np.pi, 12)


@pytest.fixture(scope="module")
def rover():
    return rb.load_rover("curiosity")


@pytest.fixture(scope="module")
def ground():
    return rb.surfaces.mars(seed=3)


@pytest.fixture(scope="module")
def pose(rover, ground):
    pose = rb.settle(rover, ground, X, Y, YAW)
    assert (pose.status == 0).all()
    assert np.degrees(pose.roll).std() > 1, "attitudes worth telling apart"
    return pose


def write(path, columns):
    with open(path, "w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*(list(map(str, values)) for values in columns.values()), strict=True))
    return path


def ned(pose, **more):
    """Return a log in NASA's axes: nose up, right side down, yaw clockwise from north, degrees."""
    return {
        "sol": 100 + np.arange(len(pose.x)), "easting_m": pose.x - 1000.0, "northing_m": pose.y + 500.0,
        "pitch_deg": -np.degrees(pose.pitch), "roll_deg": np.degrees(pose.roll), "yaw_deg": 90 - np.degrees(pose.yaw),
    } | more  # fmt: skip


def errors(rover, ground, log, **more):
    return rb.validate(rover, ground, log, draws=0, **more)


def same(found, pose, reason):
    assert_close(found["error"], 0.0, 1e-9, "rad", reason)
    assert_close(found["logged"], np.stack([pose.pitch, pose.roll], axis=-1), 1e-9, "rad", reason)


def test_logs_of_settled_poses_have_zero_error(rover, ground, pose, tmp_path):
    file = write(tmp_path / "log.csv", ned(pose))
    columns = {"place": "sol", "x": "easting_m", "y": "northing_m", "roll": "roll_deg", "pitch": "pitch_deg", "yaw": "yaw_deg"}
    mapping = rb.LogMap(columns, frame="ned", origin=(1000.0, -500.0))
    found = errors(rover, ground, file, mapping=mapping)
    same(found, pose, "angles in degrees, north east down")
    assert list(found["place"].values[:2]) == ["100", "101"]
    assert_close(found["correlation"], 1.0, 1e-12, "1", "the same numbers")
    ours = rb.LogMap({"x": "x", "y": "y", "roll": "roll", "pitch": "-nose_up", "yaw": "yaw"}, units={"yaw": "deg"})
    table = {"x [m]": pose.x, "y [m]": pose.y, "roll [rad]": pose.roll, "nose_up [deg]": -np.degrees(pose.pitch)}
    file = write(tmp_path / "ours.csv", table | {"yaw": np.degrees(pose.yaw)})
    same(errors(rover, ground, file, mapping=ours), pose, "a sign turned, a unit told, units in heads")
    same(errors(rover, ground, pose.to_xarray()), pose, "a Dataset in our axes")


def test_a_quaternion_and_steering_as_perseverance_logs_them(rover, ground, tmp_path):
    turned = np.zeros((len(X), 6))
    turned[:, [0, 1, 4, 5]] = RNG.uniform(-0.5, 0.5, (len(X), 4))
    pose = rb.settle(rover, ground, X, Y, YAW, steering=turned)
    to_ned, to_frd = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]), np.diag([1.0, -1, -1])
    q = Rotation.from_matrix(to_ned @ pose.T_world_body[:, :3, :3] @ to_frd).as_quat()
    columns = {"SCLK_REL": np.arange(len(X)) * 1.5, "ROVER_X [METERS]": Y, "ROVER_Y [METERS]": X}
    columns |= {f"QUAT_{axis}": q[:, k] for k, axis in enumerate("XYZC")}
    columns |= {f"{wheel}_STEER [RADIANS]": turned[:, rover.wheel_names.index(wheel)] for wheel in ("LF", "RF", "LR", "RR")}
    same(errors(rover, ground, write(tmp_path / "drive.csv", columns)), pose, "known by its columns")
    columns["QUAT_C"] = 2 * columns["QUAT_C"]
    with pytest.raises(rb.RockerbogieError, match=r"row \d+ holds a quaternion of length 1\.\d+, not 1"):
        errors(rover, ground, write(tmp_path / "drive.csv", columns))


@pytest.mark.parametrize("role", ["pitch", "roll"])
def test_a_wrong_sign_gives_large_errors(role, rover, ground, pose, tmp_path):
    log = ned(pose, easting_m=pose.x, northing_m=pose.y)
    log[f"{role}_deg"] = -log[f"{role}_deg"]
    found = errors(rover, ground, write(tmp_path / "log.csv", log))  # known by its columns, and so read as NASA's
    assert_close(found["correlation"].sel(channel=role), -1.0, 1e-9, "1", "every sign turned")
    other = {"pitch": "roll", "roll": "pitch"}[role]
    assert float(found["rms"].sel(channel=other)) < 1e-9
    assert_close(found["rms"].sel(channel=role), 2 * np.sqrt(np.mean(getattr(pose, role) ** 2)), 1e-9, "rad", "twice the angle")


def test_mapping_by_file_and_by_options(rover, ground, pose, tmp_path, capsys):
    map_ = tmp_path / "map.toml"
    map_.write_text(
        'frame = "ned"\norigin = [1000, -500]\n[columns]\nplace = "sol"\nx = "easting_m"\ny = "northing_m"\n'
        'roll = "roll_deg"\npitch = "pitch_deg"\nyaw = "yaw_deg"\n'
    )
    file = write(tmp_path / "log.csv", ned(pose))
    same(errors(rover, ground, file, mapping=rb.LogMap.from_toml(map_)), pose, "as the file says")
    surface = rb.surfaces.mars(interpolation="cubic")  # as the command line has it
    place = rb.settle(rover, surface, X, Y, YAW)
    write(file, ned(place))
    call = ["validate", "--terrain", "surface:mars", "--cubic", "--log", str(file), "--draws", "0", "--json"]
    flags = [f"--column={pair}" for pair in ("x=easting_m", "y=northing_m", "roll=roll_deg", "pitch=pitch_deg", "yaw=yaw_deg")]
    for told in (["--mapping", str(map_)], [*flags, "--frame", "ned", "--origin", "1000,-500"]):
        assert main([*call, *told]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert answer["channels"]["pitch"]["rms"] < 1e-9
        assert answer["channels"]["roll"]["rms"] < 1e-9
        assert len(answer["per_place"]) == len(X)
    for told in (
        ["--mapping", str(map_)],
        ["--origin", "1000,-500"],
    ):  # a flag takes precedence over a file and over the known kind
        assert main([*call, *told, "--column", "pitch=-pitch_deg"]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert answer["channels"]["pitch"]["rms"] > np.radians(1)
        assert answer["channels"]["roll"]["rms"] < 1e-9


@pytest.mark.parametrize(
    "change, says",
    [
        ({"roll_deg": None}, "is no log known by its columns .*: say which hold x, y, roll, pitch and yaw"),
        ({"pitch_deg": ["1", "oops"]}, "row 3, column 'pitch_deg' holds 'oops', which is no finite number"),
        ({"yaw_deg": ["", ""]}, "no row in which .* are all finite"),
        ({"easting_m": ["1e6", "1e6"]}, "OFF_MAP at the first.*the map .*check which columns are x and y"),
    ],
)
def test_bad_logs_are_refused(change, says, rover, ground, tmp_path):
    log = {"sol": ["1", "2"], "easting_m": ["0", "1"], "northing_m": ["0", "1"], "pitch_deg": ["0", "0"], "roll_deg": ["0", "0"]}
    log = {name: values for name, values in (log | {"yaw_deg": ["0", "0"]} | change).items() if values is not None}
    with pytest.raises(rb.RockerbogieError, match=says):
        errors(rover, ground, write(tmp_path / "log.csv", log))


def test_bad_mappings_are_refused(rover, ground, pose, tmp_path, capsys):
    file = write(tmp_path / "log.csv", ned(pose))
    good = {"x": "easting_m", "y": "northing_m", "roll": "roll_deg", "pitch": "pitch_deg", "yaw": "yaw_deg"}
    for mapping, says in (
        ({"columns": good | {"pitch": "nick"}}, "log.csv has no column 'nick'; it has sol, easting_m"),
        ({"columns": {k: v for k, v in good.items() if k != "yaw"}}, "does not say which column of log.csv is yaw"),
        ({"columns": good | {"pich": "pitch_deg"}}, "did you mean 'pitch'"),
        ({"columns": good | {"steering_XX": "sol"}}, "no wheel named 'XX'"),
        ({"columns": good, "frame": "nwu"}, "frame 'nwu' is not known; give 'enu' or 'ned'"),
        ({"columns": good, "units": {"yaw": "furlong"}}, "unit 'furlong' of yaw is not known"),
        ({"columns": good, "origin": (0.0, np.nan)}, "origin is"),
        ({"columns": {"quaternion": "q"}}, "give four columns"),
        ({"columns": good | {"quaternion": tuple("abcd")}}, "both quaternion and roll are mapped"),
    ):
        with pytest.raises(rb.RockerbogieError, match=says):
            errors(rover, ground, file, mapping=rb.LogMap(**mapping))
    (tmp_path / "map.toml").write_text('colums = { x = "easting_m" }')
    call = ["validate", "--terrain", "surface:mars", "--log", str(file)]
    for told, says in (
        (["--mapping", str(tmp_path / "map.toml")], "no key named 'colums'; did you mean 'columns'?"),
        (["--mapping", str(tmp_path / "none.toml")], "cannot be read"),
        (["--column", "pitch"], "is not a pair"),
        (["--level", "80"], "give the share a band holds, between 0 and 1"),
        (["--draws", "3"], "give 20 or more, or 0 for no band"),
    ):
        assert main([*call, *told]) == 2
        said = capsys.readouterr().err
        assert says in said
        assert said.count("\n") == 1
    strange = write(tmp_path / "strange.csv", {"east": [0.0], "north": [0.0]})
    assert main([*call[:-1], str(strange), "--frame", "ned"]) == 2
    assert "need the meaning of the columns" in capsys.readouterr().err
    for log, says in (
        (xr.Dataset({"x": ("row", [0.0])}), "the log has no y"),
        (pose.to_xarray().assign(roll=("pose", np.full(len(X), np.nan))), "roll in the log is not finite in row 1"),
        (pose.to_xarray().isel(pose=[]), "no rows"),
    ):
        with pytest.raises(rb.RockerbogieError, match=says):
            errors(rover, ground, log)


def test_missing_roughness_recovers_the_spectrum_of_a_fractal():
    rng, n, spacing, hurst, strength = np.random.default_rng(0), 512, 1.0, 0.7, 1e-3
    k = wave_numbers(n, spacing)
    whole = np.where(k > 0, strength * np.maximum(k, 1e-9) ** (-2 * hurst - 2), 0.0)
    z = draw_ground(rng, whole, spacing)
    found = missing_roughness(rb.Terrain.from_array(z, spacing, interpolation="linear"), np.array([256.0]), np.array([256.0]))
    assert_close(found.hurst, hurst, 0.1, "1", "second differences of a fractal go as r^2H; one field scatters")
    waves = np.array([0.9, 2.0, 3.0])
    assert_close(found.spectrum(waves) / (strength * waves ** (-2 * hurst - 2)), 1.0, 0.35, "1", "carried on past 8 cells")
    assert found.spectrum(np.array([0.5])) == 0, "the model has the waves longer than 8 cells"
    # and grounds drawn from a spectrum have its variance: its integral over wave numbers
    tile = draw_ground(rng, found.spectrum(k), spacing)
    integral = found.spectrum(k).sum() * (2 * np.pi / n / spacing) ** 2 / (2 * np.pi) ** 2
    assert_close(tile.var() / integral, 1.0, 0.05, "1", "Parseval")
    assert second_difference(np.add.outer(np.arange(9.0), 2 * np.arange(9.0)), 2) == 0, "blind to slopes"


def test_draws_without_uncertainty_are_poses_on_the_terrain_itself(rover, ground):
    fine = rb.Terrain.from_array(ground.z[::2, ::2], [2 * s for s in ground.spacing], ground.origin, "linear")
    assert min(fine.spacing) < rover.wheel_radius[0], "so that patches keep its nodes"
    known = Doubt(0.0, 0.0, 1.0, Roughness(0.9, 0.0, 1.0, 0.9))
    node = (float(fine.x[60]), float(fine.y[55]))
    drawn = sample(rover, fine, (*node, 0.4), np.zeros(6), known, np.ones(1), 20, np.random.default_rng(0))
    pose = rb.settle(rover, fine, *node, 0.4)
    assert_close(drawn[0], [float(pose.pitch), float(pose.roll)], 1e-7, "rad", "the same nodes, the same ground")


def test_bands_have_the_stated_coverage_if_the_uncertainty_is_right(rover):
    """Make logs by the same draws: the band at factor 1 contains its share."""
    rng, n = np.random.default_rng(11), 400
    k = wave_numbers(n, 1.0)
    z = draw_ground(rng, np.where(k > 0, 4e-3 * np.maximum(k, 1e-9) ** (-2 * 0.8 - 2), 0.0), 1.0)
    smooth = rb.Terrain.from_array(z, 1.0, interpolation="linear")
    x, y = (a.ravel() for a in np.meshgrid(np.arange(40.0, 360, 60), np.arange(40.0, 360, 60)))
    yaw = rng.uniform(-np.pi, np.pi, len(x))
    doubt = Doubt(1.0, 0.05, 3.0, missing_roughness(smooth, x, y))
    still = np.zeros(6)
    truth = np.array([sample(rover, smooth, p, still, doubt, np.ones(1), 20, rng)[0, 0] for p in zip(x, y, yaw, strict=True)])
    log = xr.Dataset(
        {k: ("row", v) for k, v in (("x", x), ("y", y), ("yaw", yaw), ("pitch", truth[:, 0]), ("roll", truth[:, 1]))}
    )
    heard: list[tuple[int, int]] = []
    found = rb.validate(rover, smooth, log, draws=60, progress=lambda *at: heard.append(at))
    assert heard[-1][0] == heard[-1][1]
    shares = [done / total for done, total in heard]
    assert shares == sorted(shares)
    held, unfitted = float(found["coverage"].mean()), float(found["coverage_unfitted"].mean())
    spread = 3 * np.sqrt(0.8 * 0.2 / (2 * len(x)))
    assert abs(unfitted - 0.8) < spread, unfitted
    assert abs(held - 0.8) < spread + 0.05, held
    assert 0.7 <= found.attrs["factor"] <= 1.42
    shared: list[float] = []
    with pytest.warns(FutureWarning, match="use progress"):
        again = rb.validate(rover, smooth, log, draws=60, advance=shared.append)
    assert shared == shares
    assert found.identical(again), "the same seed, the same bands"
    assert not found.equals(rb.validate(rover, smooth, log, draws=60, seed=1))


def test_factors_are_fitted_on_other_positions_only():
    wanted = np.array([3, 3, 12])  # which factor each place would have by itself; the third lies alone
    scores = (np.arange(len(FACTORS)) - wanted[:, None]) ** 2.0 + 1
    x, y = np.array([0.0, 100.0, 200.0]), np.zeros(3)
    each, whole = fit_factors(scores, x, y, 5.0)
    assert list(each) == [FACTORS[7], FACTORS[7], FACTORS[3]], "the mean of the other two's"
    assert whole == FACTORS[6]
    each, _ = fit_factors(scores, np.array([0.0, 1.0, 200.0]), y, 5.0)
    assert list(each) == [FACTORS[12], FACTORS[12], FACTORS[3]], "a neighbour teaches nothing"
    each, _ = fit_factors(scores, np.zeros(3), y, 5.0)
    assert list(each) == [1.0, 1.0, 1.0], "none to learn from"
    draws = np.random.default_rng(0).standard_normal(20_000)
    by_width = [interval_score(-w, w, draws, 0.8).mean() for w in (1.0, 1.2816, 1.6)]
    assert np.argmin(by_width) == 1, "least for the true 10 and 90 % points"


def test_rows_that_hardly_move_are_one_position():
    x, yaw = np.array([0.0, 0.1, 0.2, 0.7, 0.7, 0.7]), np.radians([179, 181, 179, 179, 179, 150])
    first, stand = stands(x, np.zeros(6), yaw)
    assert list(first) == [0, 3, 5]
    assert list(stand) == [0, 0, 0, 1, 1, 2]


def test_positions_off_the_map_are_not_counted(rover, ground, pose):
    log = pose.to_xarray()
    log["x"].values[3] = 1e4
    found = errors(rover, ground, log)
    assert int(found["status"][3]) == rb.Status.OFF_MAP
    assert np.isnan(found["predicted"][3]).all()
    assert found.attrs["settled"] == len(X) - 1
    assert float(found["rms"].max()) < 1e-9


def test_the_command_writes_the_files_it_names(rover, ground, pose, data, tmp_path, capsys):
    model, log = data("gale/missionDEM.tif"), data("gale/curiosity_waypoints.csv")
    call = ["validate", "--rover", "curiosity", "--terrain", str(model), "--log", str(log), "--draws", "40", "-o", str(tmp_path)]
    assert main(call) == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines()[:-3])) <= 80, "fits a terminal"
    assert "in band" in said
    with open(tmp_path / "validation.csv") as stream:
        rows = list(csv.DictReader(stream))
    with xr.open_dataset(tmp_path / "validation.nc", engine="h5netcdf") as found:
        assert [row["place"] for row in rows] == list(found["place"].values)
        assert_close(
            [float(row["roll_high [deg]"]) for row in rows], np.degrees(found["high"].sel(channel="roll")), 1e-6, "deg", "digits"
        )
        axes = validation_figure(found.load()).axes
    assert len(axes) == 4
    assert {text.get_text() for text in axes[2].texts} >= {"1056"}, "the outlier is named"
    assert "(deg)" in axes[0].get_xlabel()


def test_curiosity_over_its_waypoints(rover, data):
    ground = rb.Terrain.from_raster(data("gale/missionDEM.tif"), interpolation="linear")
    found = rb.validate(rover, ground, data("gale/curiosity_waypoints.csv"))
    assert found.sizes["row"] == 17
    assert found.attrs["settled"] == 17
    median = np.degrees(found["median_absolute_error"])
    assert float(median.sel(channel="pitch")) <= 1.7
    assert float(median.sel(channel="roll")) <= 2.1
    assert 0.7 <= float(found["coverage"].mean()) <= 0.9
    worst = found["place"].values[np.argmax(np.abs(found["error"].sel(channel="roll").values))]
    assert worst == "1056", "the outlier that the documentation names"


def test_perseverance_along_its_drive(data):
    ground = rb.Terrain.from_raster(data("perseverance/site78.tif"), interpolation="linear")
    rover = rb.load_rover("perseverance")
    found = rb.validate(rover, ground, data("perseverance/sol01590_first60.csv"))
    assert found.sizes["row"] == 3127
    rms = np.degrees(found["rms"])
    assert float(rms.sel(channel="pitch")) <= 1.15
    assert float(rms.sel(channel="roll")) <= 0.95
    assert 0.7 <= float(found["coverage"].mean()) <= 0.9
