"""Predicted slip tables: against `predict`, symmetry, bands, no motion, files, wrong calls."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.motion.soil_slip import SoilSlip
from rockerbogie.terrain.soil.fit import WheelFit, trial_residuals

MARS = rb.GRAVITY["mars"]
CURVE = SoilSlip(-2.0, 0.3, 8.0, 2.0, ((0.1, 0.0), (0.0, 0.1)), (0.1, 0.0), 0.1, (0.0, 0.3), (0.0, 0.2))


@pytest.fixture(scope="module")
def rover() -> rb.Rover:
    """Return Curiosity."""
    return rb.load_rover("curiosity")


@pytest.mark.parametrize(
    ("soil", "slope", "heading"), [("mer-trench", 12.0, 0.0), ("cmu-sand", 9.0, 50.0), ("grc-1", 15.0, -140.0)]
)
def test_slip_is_that_of_a_predicted_drive(rover: rb.Rover, soil: str, slope: float, heading: float) -> None:
    """Compare with a drive of 5 cm on a cubic plane that rises along y."""
    rise, turn = np.radians([slope, heading])
    table = rb.slip_table(soil, [rise], [turn], rover=rover, gravity=MARS)
    x = np.arange(41.0)
    plane = rb.Terrain.from_array(np.add.outer(np.tan(rise) * x, 0.0 * x), spacing=1.0, interpolation="cubic")
    yaw = np.pi / 2 + np.arctan2(np.sin(turn), np.cos(turn) * np.cos(rise))
    run = rb.predict(
        rover, plane, (20.0, 20.0, yaw), rb.Path.straight((0, 0), 0.0, 0.05), soil=soil, gravity=MARS, step=0.001, details=False
    )
    start, end = run.isel(time=0), run.isel(time=-1)
    moved = np.array([float(end[axis] - start[axis]) for axis in "xyz"])
    ahead = np.array([np.cos(yaw), np.sin(yaw), np.tan(rise) * np.sin(yaw)])
    ahead /= np.linalg.norm(ahead)
    rate = run["wheel_rate"].to_numpy().mean(axis=1) * rover.wheel_radius[0]
    travel = np.trapezoid(rate, run["time"])
    assert float(table["slip"].sel(probability=0.5).item()) == pytest.approx(1.0 - moved @ ahead / travel, abs=2e-3)
    aside = np.cross([0.0, -np.sin(rise), np.cos(rise)], ahead)
    assert float(table["drift"].item()) == pytest.approx(np.arctan2(moved @ aside, moved @ ahead), abs=4e-3)


def test_mirrored_headings_have_equal_slip_and_opposite_drift(rover: rb.Rover) -> None:
    headings = np.radians([30.0, 90.0, 150.0])
    left, right = (rb.slip_table("grc-1", np.radians([8.0, 16.0]), s * headings, rover=rover, gravity=MARS) for s in (1, -1))
    np.testing.assert_allclose(left["slip"], right["slip"], atol=1e-7)
    np.testing.assert_allclose(left["drift"], -right["drift"], atol=1e-7)
    assert (left["drift"] > 0.01).all(), "downhill is to the left of a heading to the left of uphill"


def test_flat_terrain_has_one_slip_for_all_headings(rover: rb.Rover) -> None:
    table = rb.slip_table(["grc-1", "dry-sand"], [0.0], np.radians([0.0, 77.0, 180.0]), rover=rover, gravity=MARS)
    slip = table["slip"].sel(probability=0.5)
    assert float(np.ptp(slip.to_numpy(), axis=-1).max()) < 1e-6
    assert float(np.abs(table["drift"]).max()) < 1e-6


def test_slip_rises_with_slope_until_there_is_no_progress(rover: rb.Rover) -> None:
    """Straight uphill, every preset ends in no progress below 35°, and every slope has a motion."""
    table = rb.slip_table(list(rb.soils()), np.radians(np.arange(0.0, 35.1, 5.0)), [0.0], rover=rover, gravity=MARS)
    slip = table["slip"].sel(probability=0.5).to_numpy()[..., 0]
    assert np.isfinite(slip).all()
    assert (np.diff(slip, axis=1) >= 0.0).all()
    assert (slip[:, -1] == 1.0).all()
    np.testing.assert_array_equal(table["status"].to_numpy()[..., 0] == "no progress", slip == 1.0)
    assert not (slip[:, 0] == 1.0).any()


def test_a_motion_is_found_where_the_rover_just_stands(rover: rb.Rover) -> None:
    """On sand of 17 to 20°, Newton's method alone finds no motion at these headings."""
    slopes, headings = np.radians([17.0, 18.25, 19.5, 20.25, 21.0]), np.radians([0.0, 45.0, 90.0])
    table = rb.slip_table("cmu-sand", slopes, headings, rover=rover, gravity=MARS)
    slip = table["slip"].sel(probability=0.5).to_numpy()[0]
    assert np.isfinite(slip).all()
    assert (np.diff(slip, axis=0) >= 0.0).all()


def test_a_band_contains_the_samples_and_widens_with_their_spread(rover: rb.Rover) -> None:
    base = rb.load_soil("mer-trench")

    def around(spread: float) -> list[rb.Soil]:
        angles = base.friction_angle + spread * np.array([-1.0, 0.0, 1.0])
        return [dataclasses.replace(base, friction_angle=float(angle)) for angle in angles]

    slopes = np.radians([10.0, 15.0])
    table = rb.slip_table({"narrow": around(0.02), "wide": around(0.06)}, slopes, [0.0], rover=rover, gravity=MARS)
    slip = table["slip"].to_numpy()[:, :, 0]
    assert (np.diff(slip, axis=-1) > 0.0).all()
    assert (np.ptp(slip[1], axis=-1) > 2.0 * np.ptp(slip[0], axis=-1)).all()
    alone = rb.slip_table(base, slopes, [0.0], rover=rover, gravity=MARS)
    np.testing.assert_allclose(slip[0, :, 1], alone["slip"].to_numpy()[0, :, 0, 1], rtol=1e-6)


def test_samples_of_a_fit_have_its_covariance() -> None:
    soil = rb.load_soil("grc-1")
    trials = rb.WheelTrials(0.25, 0.3, 0.0, 500.0, 0.1, 0.08, 0.0)
    covariance = np.array([[1e-4, 8e-4], [8e-4, 1e-2]])
    values = {"friction_angle": soil.friction_angle, "stiffness": 6.0}
    fit = WheelFit(soil, values, {}, covariance, 0.0, trial_residuals(soil, trials))
    drawn = np.array([[s.friction_angle, np.log10(s.kphi)] for s in fit.samples(4000)])
    np.testing.assert_allclose(np.cov(drawn.T), covariance, rtol=0.1)
    assert fit.samples(3) == fit.samples(3)
    with pytest.raises(rb.RockerbogieError, match="count is 0"):
        fit.samples(0)


def test_a_soil_that_cannot_carry_the_rover_has_no_slip_and_a_reason(rover: rb.Rover, tmp_path: Path) -> None:
    weak = dataclasses.replace(rb.load_soil("dry-sand"), name="weak", cohesion=0.0, kc=0.0, kphi=2.0e4, exponent=1.0)
    table = rb.slip_table(weak, [0.0, 0.1], [0.0], rover=rover, gravity=rb.GRAVITY["earth"])
    assert np.isnan(table["slip"]).all()
    assert (table["status"] == "overloads").all()
    rows = list(csv.DictReader(rb.write_slip_table(table, tmp_path / "weak.csv").open()))
    assert [row["slip 50 % [1]"] for row in rows] == ["", ""]
    assert [row["status"] for row in rows] == ["overloads"] * 2


def test_a_table_is_written_with_units_and_replaces_no_other_file(rover: rb.Rover, tmp_path: Path) -> None:
    table = rb.slip_table({"grc-1": "grc-1", "log": CURVE}, np.radians([0.0, 10.0]), rover=rover, gravity=MARS)
    file = rb.write_slip_table(table, tmp_path / "slip.csv")
    assert rb.write_slip_table(table, file) == file
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == [
        "soil", "slope [deg]", "heading [deg]", "slip 10 % [1]", "slip 50 % [1]", "slip 90 % [1]", "drift [deg]", "extrapolated",
        "status",
    ]  # fmt: skip
    found = {(row["soil"], row["slope [deg]"], row["heading [deg]"]): row for row in rows}
    assert len(found) == 20
    assert float(found["grc-1", "10", "45"]["slip 50 % [1]"]) == pytest.approx(
        float(table["slip"].sel(soil="grc-1", probability=0.5)[1, 1]), abs=5e-4
    )
    assert found["grc-1", "10", "45"]["slip 10 % [1]"] == ""
    assert float(found["log", "10", "0"]["slip 10 % [1]"]) < float(found["log", "10", "0"]["slip 90 % [1]"])
    (tmp_path / "mine.csv").write_text("a,b\n1,2\n")
    with pytest.raises(rb.RockerbogieError, match="exists"):
        rb.write_slip_table(table, tmp_path / "mine.csv")
    assert (tmp_path / "mine.csv").read_text() == "a,b\n1,2\n"
    with pytest.raises(rb.RockerbogieError, match="cannot write"):
        rb.write_slip_table(table, tmp_path / "no folder" / "slip.csv")
    with pytest.raises(rb.RockerbogieError, match="table is dict, not a slip table"):
        rb.write_slip_table({"slip": 1.0}, tmp_path / "wrong.csv")  # type: ignore[arg-type]
    assert not (tmp_path / "wrong.csv").exists()


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"soils": {}}, "needs a soil"),
        ({"soils": []}, "slip table is"),
        ({"soils": 3.0}, "give a soil's name"),
        ({"soils": {"a": [1.0]}}, "give a soil's name"),
        ({"soils": ["grc-1", "grc-1"]}, "twice"),
        ({"soils": "custard"}, "custard"),
        ({"rover": None}, "depends on the rover"),
        ({"rover": "curiosity"}, "load_rover"),
        ({"rover": rb.load_rover("elhami-dashti")}, "wheels of width 0"),
        ({"slopes": [10.0]}, "degrees"),
        ({"slopes": [-0.1]}, "slopes are"),
        ({"slopes": [np.nan]}, "finite"),
        ({"slopes": "steep"}, "slopes are 'steep'"),
        ({"slopes": []}, "slopes have shape"),
        ({"headings": [45.0]}, "degrees"),
        ({"headings": [[0.1]]}, "shape"),
        ({"quantiles": (0.1, 0.9)}, "no band"),
        ({"quantiles": (0.9, 0.5)}, "ascending"),
        ({"quantiles": 0.5}, "ascending"),
        ({"quantiles": (0.0, 0.5)}, "above 0"),
        ({"gravity": 0.0}, "gravity is 0"),
        ({"gravity": np.nan}, "gravity"),
        ({"torque": -1.0}, "torque is -1"),
        ({"grousers": -0.1}, "grouser height"),
    ],
)
def test_wrong_calls_raise_a_sentence(rover: rb.Rover, changes: dict[str, object], text: str) -> None:
    arguments: dict[str, object] = {"soils": "grc-1", "rover": rover, "slopes": [0.1]} | changes
    with pytest.raises(rb.RockerbogieError, match=text):
        rb.slip_table(**arguments)  # type: ignore[arg-type]


def test_the_command_prints_and_writes_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fit = tmp_path / "fit_soil.json"
    fit.write_text(json.dumps({"curve": CURVE.to_dict(), "curve_at_end": CURVE.to_dict()}))
    call = ["slip-table", "grc-1", str(fit), "-r", "curiosity", "--slopes", "0,10", "--headings", "0,90"]
    out = tmp_path / "out" / "slip.csv"
    assert main([*call, "-o", str(out)]) == 0
    assert "advances" in capsys.readouterr().out
    assert len(out.read_text().splitlines()) == 9
    assert main([*call, "-o", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["status"][0][0] == ["advances", "advances"]
    assert found["slip"][0][1][0][0] is None
    out.write_text("mine")
    assert main([*call, "-o", str(out)]) == 2
    assert out.read_text() == "mine"
    assert main([*call, "-o", str(fit.with_suffix(".csv"))]) == 0


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["custard"], "custard"),
        (["grc-1", "grc-1"], "twice"),
        (["grc-1", "--slopes", "steep"], "--slopes"),
        (["grc-1", "--slopes", "95"], "below 90"),
        (["grc-1", "--headings", "nan"], "--headings"),
        (["grc-1", "--gravity", "pluto"], "pluto"),
        (["grc-1", "-r", "elhami-dashti"], "wheels of width 0"),
        (["grc-1", "-o", "table.txt"], ".csv"),
        (["none.json"], "none.json"),
    ],
)
def test_wrong_options_exit_2(options: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["slip-table", *options]) == 2
    assert text in capsys.readouterr().err
