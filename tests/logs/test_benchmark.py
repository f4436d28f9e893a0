"""Benchmark on flown attitudes: scores of known predictions, entered files, missing data."""

from __future__ import annotations

import csv
import json
import re
import shutil

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.logs import benchmark
from rockerbogie.logs.benchmark import plane_attitude
from rockerbogie.logs.benchmark_entry import check_scale
from support.helpers import assert_close

X, Y, YAW = np.array([-3.0, 0.0, 2.5, 4.0]), np.array([1.0, -2.0, 3.0, -3.5]), np.array([0.3, 2.0, -1.0, 3.0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a data folder whose log was made from settled poses: the package's error is 0."""
    rasterio = pytest.importorskip("rasterio")
    root = tmp_path_factory.mktemp("data")
    (root / "gale").mkdir()
    z = rb.surfaces.mars(seed=3).height(*np.meshgrid(np.arange(-9.75, 9.8, 0.5), np.arange(-9.75, 9.8, 0.5)))
    about = {"driver": "GTiff", "width": 40, "height": 40, "count": 1, "dtype": "float32", "crs": "EPSG:32633"}
    move = rasterio.transform.from_origin(-10.0, 10.0, 0.5, 0.5)
    with rasterio.open(root / "gale" / "missionDEM.tif", "w", transform=move, **about) as raster:
        raster.write(z[::-1].astype("float32"), 1)
    ground = rb.Terrain.from_raster(root / "gale" / "missionDEM.tif", interpolation="linear")
    pose = rb.settle(rb.load_rover("curiosity"), ground, X, Y, YAW)
    with open(root / "gale" / "curiosity_waypoints.csv", "w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["sol", "easting_m", "northing_m", "pitch_deg", "roll_deg", "yaw_deg"])
        for k in range(len(X)):
            angles = -np.degrees(pose.pitch[k]), np.degrees(pose.roll[k]), 90 - np.degrees(YAW[k])
            writer.writerow([960 + k, X[k], Y[k], *angles])
    return root


def fill(template, file, change):
    """Write a copy of a template with rows changed by `change`; None drops a row."""
    with open(template, newline="") as stream:
        rows = [row for row in map(change, csv.DictReader(stream)) if row is not None]
    with open(file, "w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    return file


@pytest.fixture(scope="module")
def template(folder, tmp_path_factory):
    return rb.write_benchmark_template(tmp_path_factory.mktemp("template") / "cases.csv", folder)


@pytest.fixture(scope="module")
def logged(folder):
    cases = rb.benchmark_mars(folder, draws=0).cases
    return {str(c): np.degrees(cases["logged"].sel(case=c).values) for c in cases["case"].values}


def perfect(logged, shift=0.0):
    """Return a change that fills in the logged angles plus `shift`, degrees."""

    def change(row):
        pitch, roll = logged[row["case"]] + shift
        return {**row, "pitch [deg]": pitch, "roll [deg]": roll}

    return change


def test_package_is_exact_on_a_log_of_its_own_poses(folder):
    result = rb.benchmark_mars(folder, draws=0)
    assert result.contenders == ["rockerbogie", "plane"]
    assert set(result.absent) == {"site78", "sol1590", "sol1294"}
    package, plane = (result.scores.sel(set="gale", contender=by) for by in result.contenders)
    assert_close(package["rms"], 0.0, 1e-9, "rad", "the log holds settled poses")
    assert (plane["rms"] > np.radians(0.1)).all(), "rocks: a plane differs"
    assert int(package["count"]) == len(X)


def test_template_holds_no_truth(template, logged):
    with open(template, newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["case"] for row in rows] == [f"gale/{960 + k}" for k in range(len(X))]
    assert all(not row[name] for row in rows for name in row if name.startswith(("pitch", "roll")))
    assert_close([float(row["x [m]"]) for row in rows], X, 1e-3, "m", "positions")
    difference = np.radians([float(row["yaw [deg]"]) for row in rows]) - YAW
    assert_close(np.sin(difference), 0.0, 1e-5, "1", "headings, up to full turns")


def test_entered_predictions_have_the_error_they_were_given(folder, template, logged, tmp_path):
    file = fill(template, tmp_path / "mine.csv", perfect(logged, 2.0))
    result = rb.benchmark_mars(folder, file, draws=0)
    s = result.scores.sel(set="all", contender="entered")
    assert_close(np.degrees(s["rms"]), 2.0, 1e-9, "deg", "a shift of 2 deg")
    assert_close(np.degrees(s["bias"]), 2.0, 1e-9, "deg", "a shift of 2 deg")
    assert_close(s["correlation"], 1.0, 1e-9, "1", "a shift keeps the correlation")
    assert np.isnan(s["coverage"]).all(), "no bands were entered"


def test_entered_bands_are_scored(folder, template, logged, tmp_path):
    def change(row):
        pitch, roll = logged[row["case"]]
        row = {**row, "pitch [deg]": pitch, "roll [deg]": roll, "pitch_low [deg]": pitch - 1, "pitch_high [deg]": pitch + 1}
        return {**row, "roll_low [deg]": roll + 1, "roll_high [deg]": roll + 3}

    result = rb.benchmark_mars(folder, fill(template, tmp_path / "mine.csv", change), draws=0)
    s = result.scores.sel(set="gale", contender="entered")
    assert s["coverage"].values.tolist() == [1.0, 0.0]
    assert_close(np.degrees(s["interval_score"]), [2.0, 2.0 + 10 * 1.0], 1e-9, "deg", "width, plus ten times the distance")


def test_left_out_cases_are_counted_and_compared_alike(folder, template, logged, tmp_path):
    change = perfect(logged)
    file = fill(template, tmp_path / "mine.csv", lambda row: change(row) if row["case"] != "gale/961" else None)
    s = rb.benchmark_mars(folder, file, draws=0).scores.sel(set="gale", contender="entered")
    assert int(s["count"]) == len(X) - 1
    assert_close(s["rms"], 0.0, 1e-9, "rad", "the logged angles")


def other_case(row):
    return {**row, "pitch [deg]": 1, "roll [deg]": 1, "case": row["case"].replace("gale", "moon")}


def one_ended(row):
    return {**row, "pitch [deg]": 1, "roll [deg]": 1, "roll_low [deg]": 0}


def in_hundreds(row):
    return {**row, "pitch [deg]": 170, "roll [deg]": 1}


def without_unit(row):
    return {"case": row["case"], "pitch": 1, "roll": 1}


def without_roll(row):
    return {"case": row["case"], "pitch [deg]": 1}


def half_filled(row):
    return {**row, "pitch [deg]": 1, "roll [deg]": 1 if row["case"] != "gale/961" else ""}


def not_a_number(row):
    return {**row, "pitch [deg]": "nan", "roll [deg]": 1}


def infinite(row):
    return {**row, "pitch [deg]": "inf", "roll [deg]": 1}


def in_words(row):
    return {**row, "pitch [deg]": "steep", "roll [deg]": 1}


def without_case(row):
    return {"pitch [deg]": 1, "roll [deg]": 1}


def blank_case(row):
    return {**row, "case": "", "pitch [deg]": 1, "roll [deg]": 1}


def filled(**pose):
    """Return a change that predicts 1 deg and replaces or leaves out cells of the pose."""

    def change(row):
        row = {**row, "pitch [deg]": 1, "roll [deg]": 1}
        for name, value in pose.items():
            key = next(k for k in row if k.split(" [")[0] == name)
            row[key] = value(float(row[key])) if callable(value) else value
        return row

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [(filled(x=lambda x: x + 0.5), "row 2: x differs by +0.5 m from that of gale/960, -3.000 m: predict the pose"),
     (filled(y=lambda y: y - 0.1), "row 2: y differs by -0.1 m"),
     (filled(yaw=lambda yaw: 90 - yaw), "row 2: yaw differs by"),
     (filled(yaw=lambda yaw: yaw + 1), "row 2: yaw differs by +1 deg")],
)  # fmt: skip
def test_predictions_of_another_pose_are_refused(folder, template, tmp_path, change, says):
    with pytest.raises(rb.RockerbogieError, match=re.escape(says)):
        rb.benchmark_mars(folder, fill(template, tmp_path / "mine.csv", change), draws=0)


@pytest.mark.parametrize(
    "change",
    [filled(x="", y="", yaw=""), filled(x=lambda x: x + 0.01, yaw=lambda yaw: yaw + 0.1), filled(yaw=lambda yaw: yaw - 360)],
)
def test_predictions_of_the_same_pose_are_taken(folder, template, tmp_path, change):
    result = rb.benchmark_mars(folder, fill(template, tmp_path / "mine.csv", change), draws=0)
    assert int(result.scores["count"].sel(set="gale", contender="entered")) == len(X)


def test_template_names_repeated_places_as_the_benchmark_does(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "data")
    log = tmp_path / "data" / "gale" / "curiosity_waypoints.csv"
    log.write_text(log.read_text().replace("961,", "960,"))
    template = rb.write_benchmark_template(tmp_path / "cases.csv", tmp_path / "data")
    result = rb.benchmark_mars(tmp_path / "data", fill(template, tmp_path / "mine.csv", filled()), draws=0)
    assert int(result.scores["count"].sel(set="gale", contender="entered")) == len(X)
    assert [str(c) for c in result.cases["case"].values[:3]] == ["gale/960#1", "gale/960#2", "gale/962#3"]


def test_pose_columns_are_read_in_their_units(folder, template, logged, tmp_path):
    rows = ["case,x [cm],yaw [rad],pitch [deg],roll [deg]"]
    rows += [f"gale/{960 + k},{100 * X[k]},{YAW[k]},1,1" for k in range(len(X))]
    (tmp_path / "mine.csv").write_text("\n".join(rows) + "\n")
    result = rb.benchmark_mars(folder, tmp_path / "mine.csv", draws=0)
    assert int(result.scores["count"].sel(set="gale", contender="entered")) == len(X)


@pytest.mark.parametrize(
    ("change", "says"),
    [(half_filled, "row 3: pitch or roll is missing"), (not_a_number, "pitch or roll is missing"), (infinite, "inf deg"),
     (in_words, "'steep'"), (without_case, "no column 'case'"), (blank_case, "no case named ''"),
     (other_case, "moon/960"), (one_ended, "both ends"), (in_hundreds, "90 deg"), (without_unit, "unit"), (without_roll, "roll"),
     (lambda row: row, "fill in pitch and roll")],
)  # fmt: skip
def test_wrong_predictions_give_a_sentence(folder, template, tmp_path, change, says):
    with pytest.raises(rb.RockerbogieError, match=says):
        rb.benchmark_mars(folder, fill(template, tmp_path / "mine.csv", change), draws=0)


@pytest.mark.parametrize("line", [2, -1])
@pytest.mark.parametrize(("cells", "says"), [(2, "has 2 cells and the header"), (9, "has 9 cells and the header")])
def test_rows_of_another_width_are_refused(folder, template, tmp_path, line, cells, says):
    file = fill(template, tmp_path / "mine.csv", lambda row: {**row, "pitch [deg]": 1, "roll [deg]": 1})
    lines = file.read_text().splitlines()
    lines[line] = ",".join((lines[line].split(",") + 9 * ["1"])[:cells])
    file.write_text("\n".join(lines))
    with pytest.raises(rb.RockerbogieError, match=f"line {line + 1 if line > 0 else len(lines)} {says}"):
        rb.benchmark_mars(folder, file, draws=0)


@pytest.mark.parametrize(("unit", "factor", "says"), [("deg", np.pi / 180, "in rad"), ("rad", 1.0, "90 deg")])
def test_angles_in_another_unit_than_the_header_are_refused(folder, template, logged, tmp_path, unit, factor, says):
    def change(row):
        pitch, roll = (logged[row["case"]] + [0.3, -0.2]) * factor
        return {"case": row["case"], f"pitch [{unit}]": pitch, f"roll [{unit}]": roll}

    with pytest.raises(rb.RockerbogieError, match=says):
        rb.benchmark_mars(folder, fill(template, tmp_path / "mine.csv", change), draws=0)


def test_small_angles_in_another_unit_are_refused():
    """Check angles below 1.57, whose size alone does not give the unit away."""
    logged = np.radians([[1.0, -0.5], [0.7, 0.2], [-1.2, 0.9], [0.1, 1.4]])
    with pytest.raises(rb.RockerbogieError, match="in deg"):
        check_scale("mine.csv", np.degrees(logged) + 0.1, logged)
    check_scale("mine.csv", 0.3 * logged, logged)
    check_scale("mine.csv", np.zeros_like(logged), logged)
    check_scale("mine.csv", np.full_like(logged, np.nan), logged)


@pytest.mark.parametrize("text", [b"", b"\n\n", b"case,pitch [deg],roll [deg]\n", b"a,b\n1,2\n", bytes(range(256)), None])
def test_files_of_another_kind_give_a_sentence(folder, tmp_path, text):
    file = tmp_path / "mine.csv"
    if text is not None:
        file.write_bytes(text)
    with pytest.raises(rb.RockerbogieError, match="mine.csv"):
        rb.benchmark_mars(folder, file, draws=0)


def test_incomplete_data_are_named(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "data")
    log, raster = tmp_path / "data" / "gale" / "curiosity_waypoints.csv", tmp_path / "data" / "gale" / "missionDEM.tif"
    log.rename(tmp_path / "kept.csv")
    with pytest.raises(rb.RockerbogieError, match=r"gale: no log at gale/curiosity_waypoints.csv; site78: no terrain model"):
        rb.benchmark_mars(tmp_path / "data", draws=0)
    for text, says in (("", "no rows"), ("sol,easting_m,northing_m,pitch_deg,roll_deg,yaw_deg\n960,500,500,1,1,1\n", "OFF_MAP")):
        log.write_text(text)
        with pytest.raises(rb.RockerbogieError, match=says):
            rb.benchmark_mars(tmp_path / "data", draws=0)
    raster.write_bytes(b"x")
    with pytest.raises(rb.RockerbogieError, match="not a raster"):
        rb.benchmark_mars(tmp_path / "data", draws=0)


@pytest.mark.parametrize("draws", [-1, 1.5, "many", None, np.nan, 10**9])
def test_wrong_draws_give_a_sentence(folder, draws):
    with pytest.raises(rb.RockerbogieError, match="draws is"):
        rb.benchmark_mars(folder, draws=draws)


def test_wrong_folders_give_a_sentence(folder, tmp_path):
    with pytest.raises(rb.RockerbogieError, match="data is 3"):
        rb.benchmark_mars(3)
    with pytest.raises(rb.RockerbogieError, match="no folder at"):
        rb.write_benchmark_template(tmp_path / "none" / "cases.csv", folder)


def test_repeated_case_is_refused(folder, tmp_path):
    (tmp_path / "mine.csv").write_text("case,pitch [deg],roll [deg]\ngale/960,1,1\ngale/960,2,2\n")
    with pytest.raises(rb.RockerbogieError, match="rows 2 and 3"):
        rb.benchmark_mars(folder, tmp_path / "mine.csv", draws=0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "mine.csv cannot be read as CSV: No such file or directory"),
        ("", "holds no rows of numbers"),
        ("case,pitch [deg],roll [deg]\n", "holds no rows of numbers below its header"),
        ("a,b\n1,2\n", "has no column 'case'; it has a, b"),
        ("case|pitch [deg]|roll [deg]\ngale/960|1|1\n", "has no column 'case'"),
        ("case,pitch [deg],pitch [deg],roll [deg]\ngale/960,1,1,1\n", "2 columns named 'pitch'"),
        ("case,pitch [deg],roll [deg]\ngale/960,high,1\n", "'high', which is no number"),
        ("case,pitch [deg],roll [deg]\ngale/960,nan,1\n", "pitch or roll is missing"),
        ("case,pitch [deg],roll [deg]\ngale/960,1000,1\n", "pitch is 1000 deg, beyond 90 deg"),
        ("case,pitch [grad],roll [deg]\ngale/960,1,1\n", "'grad', which is not a known unit"),
        ("case,pitch,roll\ngale/960,1,1\n", "has no unit"),
        ("case,pitch [deg],roll [deg]\ngale/9,1,1\n", "no case named 'gale/9'"),
        ("case,pitch [deg],roll [deg]\ngal\xe9,1,1\n", "it is not UTF-8 text"),
    ],
)
def test_wrong_predictions_are_refused_before_poses_are_settled(folder, tmp_path, monkeypatch, text, says):
    monkeypatch.setattr(benchmark, "validate", lambda *_, **__: pytest.fail("the terrains were drawn first"))
    file = tmp_path / "mine.csv"
    if text is not None:
        file.write_bytes(text.encode("latin-1"))
    with pytest.raises(rb.RockerbogieError, match=re.escape(says)):
        rb.benchmark_mars(folder, file)


def test_force_replaces_no_data(folder, tmp_path, capsys):
    log = folder / "gale" / "curiosity_waypoints.csv"
    before = log.read_bytes()
    with pytest.raises(rb.RockerbogieError, match="is the input"):
        rb.write_benchmark_template(log, folder, force=True)
    assert main(["benchmark", "mars", "--data", str(folder), "--write-template", str(log), "--force"]) == 2
    assert "is the input" in capsys.readouterr().err
    assert log.read_bytes() == before
    file = tmp_path / "cases.csv"
    file.write_text("mine")
    assert rb.write_benchmark_template(file, folder, force=True).read_text().startswith("case,rover,terrain,")


def test_missing_data_exit_2(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("ROCKERBOGIE_DATA", raising=False)
    assert main(["benchmark", "mars"]) == 2
    assert "ROCKERBOGIE_DATA" in capsys.readouterr().err
    assert main(["benchmark", "mars", "--data", str(tmp_path / "none")]) == 2
    assert main(["benchmark", "mars", "--data", str(tmp_path)]) == 2
    assert "docs/benchmark.md" in capsys.readouterr().err


def test_command_writes_page_and_keeps_files_of_others(folder, template, logged, tmp_path, capsys):
    file = fill(template, tmp_path / "mine.csv", perfect(logged, 2.0))
    out = tmp_path / "out"
    call = ["benchmark", "mars", "--data", str(folder), "--draws", "0", "--predictions", str(file), "-o", str(out)]
    assert main([*call, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert_close(found["scores"]["gale"]["entered"]["rms"]["pitch"], np.radians(2), 1e-9, "rad", "JSON in rad")
    page = (out / "mars.html").read_text()
    assert "2.00 / 2.00" in page
    assert "data:image/png;base64," in page
    assert len((out / "mars.csv").read_text().splitlines()) == 1 + 2 * len(X)
    assert main(call) == 0, "own files are replaced"
    assert "entered" in capsys.readouterr().out
    (out / "mars.html").write_text("mine")
    assert main(call) == 2
    assert main(["benchmark", "mars", "--data", str(folder), "--write-template", str(file)]) == 2, "holds predictions"


def test_plane_attitude_of_an_inclined_plane():
    ground, rover = rb.surfaces.plane(), rb.load_rover("curiosity")
    z = ground.height(*np.meshgrid(np.linspace(-5, 5, 41), np.linspace(-5, 5, 41)))
    x = np.linspace(-5, 5, 41)
    tilted = rb.Terrain.from_array(z + 0.2 * x + 0.1 * x[:, None], 0.25, origin=(-5, -5))
    yaw = np.array([0.0, 1.0, 2.5])
    pose = rb.settle(rover, tilted, 0.0, 0.0, yaw)
    expected = np.stack([pose.pitch, pose.roll], axis=-1)
    assert_close(plane_attitude(rover, tilted, np.zeros(3), np.zeros(3), yaw), expected, 1e-6, "rad", "a rover on a plane")


def test_published_scores_hold(data):
    root = data("gale/missionDEM.tif").parents[1]
    data("perseverance/waypoints_site78.csv")
    scores = rb.benchmark_mars(root, draws=0).scores.sel(contender="rockerbogie")
    assert_close(np.degrees(scores["rms"].sel(set="gale")), [2.61, 4.97], 0.01, "deg", "docs/benchmark.md")
    assert_close(np.degrees(scores["median_absolute_error"].sel(set="site78")), [0.76, 1.13], 0.01, "deg", "docs/benchmark.md")
    assert (scores["correlation"].sel(set="site78") > 0.94).all()
