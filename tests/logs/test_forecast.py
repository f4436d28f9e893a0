"""Slip forecast and fit: known soils, future rows, calibration, drives on Mars."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import xarray as xr
from scipy.special import expit

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.logs.slip_bank import SlipBank
from rockerbogie.logs.slip_log import _corrections, _updates, last_of_each
from support.helpers import assert_close

DRIVES = ("sol01590", "sol01294")


@pytest.fixture(scope="module")
def rover():
    return rb.load_rover("perseverance")


@pytest.fixture(scope="module")
def drives(data, rover):
    """Return the slip logs of both drives, first 60 %."""
    return {name: rb.read_slip_log(data(f"perseverance/{name}_first60.csv"), rover) for name in DRIVES}


def made(slip, along=0.2, across=0.1, spacing=1.0, rows=4):
    """Return a log with one measurement per `spacing` metres and `rows` rows to each."""
    n = len(slip)
    column = np.full(n * rows, np.nan)
    column[rows - 1 :: rows] = slip
    distance = spacing * (1 + np.arange(n * rows)) / rows
    shape = np.ones(n * rows)
    data = {"time": 25.0 * distance, "distance": distance, "slip": column, "along": along * shape, "across": across * shape}
    return xr.Dataset({name: ("row", values) for name, values in data.items()})


def walk(seed, n=200, change=0.05, error=0.02, start=-1.0):
    """Return slips whose logit is a random walk between −2.5 and 1.5, with errors."""
    rng = np.random.default_rng(seed)
    free = start + np.cumsum(np.sqrt(change) * rng.standard_normal(n))
    folded = np.abs((free + 2.5 + 4.0) % 8.0 - 4.0) - 2.5
    return expit(folded + np.sqrt(error) * rng.standard_normal(n))


def later_changed(log, row):
    """Return the log with all rows after `row` changed."""
    later = np.arange(log.sizes["row"]) > row
    changed = {name: log[name].where(~later, -0.3 * log[name] + 0.1) for name in ("slip", "along", "across")}
    return log.assign(changed)


@pytest.fixture(scope="module")
def whole(rover):
    """Return a log and the forecast of all its rows."""
    log = made(walk(1, 60))
    return log, rb.forecast_slip(rover, None, log)


@pytest.mark.parametrize("row", [40, 81, 123, 200])
def test_future_rows_do_not_change_a_forecast(rover, whole, row):
    log, whole = whole
    other = rb.forecast_slip(rover, None, later_changed(log, row))
    short = rb.forecast_slip(rover, None, log.isel(row=slice(0, row + 1)))
    past = int((whole["row"] <= row + 1).sum())
    for name in ("mean", "quantile", "exceed", "warning", "known", "distance"):
        assert (whole[name][:past].values == other[name][:past].values).all(), name
        assert (whole[name][:past].values == short[name].values).all(), name


@pytest.mark.parametrize("name", DRIVES)
def test_future_rows_of_a_file_do_not_change_a_forecast(data, rover, drives, tmp_path, name):
    lines = data(f"perseverance/{name}_first60.csv").read_text().splitlines(keepends=True)
    whole = rb.forecast_slip(rover, None, drives[name])
    for share in (0.5, 0.93):
        cut = tmp_path / f"{share}.csv"
        cut.write_text("".join(lines[: int(share * len(lines))]))
        short = rb.forecast_slip(rover, None, cut)
        n = short.sizes["step"]
        assert n > 5
        for key in ("row", "mean", "exceed", "known"):
            assert_close(whole[key][:n], short[key], 0.0, "1", f"{key} of the first {share:.0%}")


def test_no_ramp_between_updates_reveals_the_next_update():
    time = np.arange(0.0, 100.0, 0.125)
    knots = {10.3: 0.15, 33.0: 0.2, 55.71: 0.12, 80.2: 0.5}
    slip = np.interp(time, list(knots), list(knots.values()))
    found = _updates(time, slip)
    for at, value in knots.items():
        near = [row for row in found if abs(time[row] - at) < 1.0]
        assert 0 <= time[near[-1]] - at <= 0.4, "known when the second line is seen"
        assert_close(found[near[-1]], value, 1e-9, "1", "an update is where the lines meet")
        assert all(abs(found[row] - value) < 2e-3 for row in near)
    assert all(min(abs(time[row] - at) for at in knots) < 1.0 for row in found), "no value from within a ramp"


def test_corrected_positions_give_slip():
    distance = np.array([0.0, 0.5, 1.0, 1.0, 1.5, 2.0, 2.0, 3.0, 3.0])
    time = np.array([0.0, 10, 20, 50, 60, 70, 100, 120, 150])
    along = np.array([0.0, 0.45, 0.9, 0.6, 1.05, 1.5, 0.9, 1.8, 1.7])
    position = np.stack([along, 0 * along, 0 * along], axis=-1)
    steered = np.zeros(len(time), dtype=bool)
    found = _corrections(time, distance, position, steered)
    assert_close([found[k] for k in (3, 6, 8)], [0.4, 0.7, 0.2], 1e-9, "1", "1 - displacement / wheel travel")
    steered[7] = True
    assert set(_corrections(time, distance, position, steered)) == {3, 6}, "a turn on the spot is no measurement"


def test_values_of_the_same_travel_are_one_measurement(rover):
    log = made([0.1, 0.2, 0.3, 0.25, 0.3])
    double = log.copy(deep=True)
    double["slip"].values[6] = 0.9  # 0.25 m before the value of 2 m: a value of the same travel, replaced by it
    assert last_of_each(double["distance"].values, double["slip"].values).tolist() == [3, 7, 11, 15, 19]
    last = rb.forecast_slip(rover, None, double).isel(step=-1)
    plain = rb.forecast_slip(rover, None, log).isel(step=-1)
    assert abs(float(last["mean"] - plain["mean"])) < 0.02


def test_bands_hold_their_share_on_random_walks(rover):
    logs = [made(walk(seed, 150)) for seed in (1, 2, 3)]
    scores = [rb.score_forecast(rb.forecast_slip(rover, None, log), log) for log in logs]
    coverage = np.mean([s["coverage"] for s in scores], axis=0)
    assert (coverage > 0.75).all()
    assert (coverage < (0.88, 0.92)).all()  # the measurements are exactly 1 m apart: the second band expects 0.1 m of scatter


def test_band_of_the_next_metre_of_the_log_narrows_where_the_known_slip_is_held(rover):
    forecast = rb.forecast_slip(rover, None, made(walk(1, 40)))
    width = (forecast["held_quantile"][:, -1] - forecast["held_quantile"][:, 0]).values[40:]
    measured = np.isfinite(made(walk(1, 40))["slip"].values[forecast["row"].values - 1])[40:]
    assert width[measured].max() < 0.5 * width[~measured].min()
    one = forecast.isel(step=0)
    assert_close(one["held_mean"], one["known"], 0.02, "1", "the known slip is held for about a metre")


def test_forecast_beats_the_last_value_where_measurements_are_noisy(rover):
    log = made(walk(4, 150, change=0.0025, error=0.1))
    rmse = rb.score_forecast(rb.forecast_slip(rover, None, log), log)["rmse"].sel(target="next measurement")
    assert float(rmse.sel(by="forecast")) < 0.88 * float(rmse.sel(by="last measurement"))


def test_forecast_equals_the_last_value_on_a_pure_random_walk(rover):
    log = made(walk(5, 150, change=0.1, error=0.0))
    rmse = rb.score_forecast(rb.forecast_slip(rover, None, log), log)["rmse"].sel(target="next measurement")
    assert_close(rmse.sel(by="forecast") / rmse.sel(by="last measurement"), 1.0, 0.05, "1", "no forecast can be better")


def test_growing_slip_is_warned_of_in_time_and_firm_soil_never(rover):
    rng = np.random.default_rng(0)
    firm = np.clip(0.2 + 0.03 * rng.standard_normal(80), 0.05, 1)
    quiet = rb.forecast_slip(rover, None, made(firm))
    assert not quiet["warning"].any()
    digging = np.concatenate([firm[:20], expit(np.linspace(-1.2, 2.0, 14))])
    log = made(digging)
    score = rb.score_forecast(rb.forecast_slip(rover, None, log), log)
    assert score.attrs["lead"] >= 2.0
    assert score.attrs["false_warnings"] == 0


def test_steeper_slope_ahead_raises_the_forecast(rover):
    n = 12
    z = np.zeros((41, 121))
    x = np.linspace(-2, 10, 121)
    z[:] = np.where(x > 5.0, np.tan(np.radians(20)) * (x - 5.0), 0.0)
    terrain = rb.Terrain.from_array(z, 0.1, origin=(-2.0, -2.0), interpolation="linear")
    log = made(np.full(n, 0.2), along=0.0, across=0.0, spacing=0.35, rows=1)
    here = {"x": log["distance"].values, "y": np.zeros(n), "yaw": np.zeros(n), "heading": np.ones(n)}
    log = log.assign({name: ("row", values) for name, values in here.items()})
    with_map, without = (rb.forecast_slip(rover, ground, log)["mean"].values for ground in (terrain, None))
    assert_close(with_map[:5], without[:5], 1e-6, "1", "level terrain ahead")
    assert with_map[-1] > without[-1] + 0.005, "the ramp begins under the front wheels"


def hill_log(rover, terrain, attitude):
    """Return a log of a drive along x on a hill, with the attitude or with positions only."""
    n = 24
    x, zero = 0.5 + 0.35 * np.arange(n), np.zeros(n)
    pose = rb.settle(rover, terrain, x, 0.0, 0.0)
    along, across = -np.sin(pose.pitch), np.cos(pose.pitch) * np.sin(pose.roll)
    log = made(expit(-2.5 + 8.0 * along), along=0.0, across=0.0, spacing=0.35, rows=1)
    if attitude:
        return log.assign(along=("row", along), across=("row", across))
    places = {"x": x, "y": zero, "yaw": zero, "heading": zero + 1}
    return log.drop_vars(["along", "across"]).assign({name: ("row", values) for name, values in places.items()})


def test_map_gives_the_slope_where_the_log_has_positions_alone(rover):
    z = np.tile(0.6 * np.cos(np.linspace(-2, 10, 121) * 0.6), (41, 1))
    terrain = rb.Terrain.from_array(z, 0.1, origin=(-2.0, -2.0), interpolation="linear")
    measured, placed = (hill_log(rover, terrain, attitude) for attitude in (True, False))
    fits = [rb.fit_soil(rover, ground, log) for ground, log in ((None, measured), (terrain, placed))]
    assert_close(fits[1].curve.gain_along, fits[0].curve.gain_along, 1e-12, "1", "the same slopes")
    assert fits[1].curve.gain_along > 4.0
    with pytest.raises(rb.RockerbogieError, match="give a map"):
        rb.fit_soil(rover, None, placed)
    assert np.isfinite(rb.forecast_slip(rover, terrain, placed)["mean"]).all()


def test_log_with_positions_and_no_heading_is_a_drive_forward(rover):
    z = np.tile(0.6 * np.cos(np.linspace(-2, 10, 121) * 0.6), (41, 1))
    terrain = rb.Terrain.from_array(z, 0.1, origin=(-2.0, -2.0), interpolation="linear")
    placed = hill_log(rover, terrain, False)
    fits = [rb.fit_soil(rover, terrain, log) for log in (placed, placed.drop_vars("heading"))]
    assert fits[0].curve.gain_along == fits[1].curve.gain_along
    assert np.isfinite(rb.forecast_slip(rover, terrain, placed.drop_vars("heading"))["mean"]).all()


def test_rows_without_position_have_no_slope(rover):
    terrain = rb.Terrain.from_array(np.zeros((41, 121)), 0.1, origin=(-2.0, -2.0), interpolation="linear")
    log = hill_log(rover, terrain, False)
    log["x"][:6] = np.nan
    assert np.isfinite(rb.forecast_slip(rover, terrain, log)["mean"]).all()
    with pytest.raises(rb.RockerbogieError, match="6 of 24 rows have no slope"):
        rb.fit_soil(rover, terrain, log)


def test_fit_refuses_positions_beside_the_map(rover):
    level = {
        name: rb.Terrain.from_array(np.zeros((41, n)), 0.1, origin=(start, -2.0), interpolation="linear")
        for name, start, n in (("whole", -2.0, 121), ("half", -2.0, 81), ("elsewhere", 50.0, 81))
    }
    log = hill_log(rover, level["whole"], False)
    with pytest.raises(rb.RockerbogieError, match="12 of 24 rows have no slope"):
        rb.fit_soil(rover, level["half"], log)
    with pytest.raises(rb.RockerbogieError, match="give a map"):
        rb.fit_soil(rover, level["elsewhere"], log)


def test_probability_agrees_with_random_draws():
    bank = SlipBank()
    for slip in (0.4, 0.5, 0.6, 0.62):
        bank.advance(1.0)
        bank.measure(slip, 0.2, False)
    rng, n = np.random.default_rng(3), 400_000
    k = rng.choice(len(bank.weight), n, p=bank.weight)
    level, growth, P00, P01, P11 = (values[k] for values in bank.ahead(1.0))
    first = level + np.sqrt(P00) * rng.standard_normal(n)
    speed = growth + P01 / P00 * (first - level) + np.sqrt(np.maximum(P11 - P01**2 / P00, 0)) * rng.standard_normal(n)
    grows = bank.growing[k] > 0
    second = first + grows * speed + np.sqrt(bank.change[k]) * rng.standard_normal(n)
    seen = [v + np.sqrt(bank.error[k]) * rng.standard_normal(n) for v in (first, second)]
    share = np.mean(np.maximum(*seen) > np.log(0.8 / 0.2))
    assert_close(bank.exceeding(1.0, 0.2, 0.8), share, 0.003, "1", "the same probability by drawing")
    mean, quantile = bank.moments(1.0, 0.2, np.array([0.1, 0.5, 0.9]))
    assert_close(mean, expit(seen[0]).mean(), 0.002, "1", "mean")
    assert_close(quantile, np.quantile(expit(seen[0]), [0.1, 0.5, 0.9]), 0.003, "1", "quantiles")


def test_fit_recovers_a_known_slip_curve(rover):
    rng = np.random.default_rng(7)
    n, rows = 80, 4
    log = made(np.zeros(n), rows=rows)
    along, across = (np.repeat(rng.uniform(*limits, n), rows) for limits in ((-0.1, 0.35), (-0.3, 0.3)))
    slope = along[rows - 1 :: rows], np.abs(across[rows - 1 :: rows])
    slip = expit(-2.5 + 8.0 * slope[0] + 3.0 * slope[1] + 0.1 * rng.standard_normal(n))
    column = log["slip"].values.copy()
    column[rows - 1 :: rows] = slip
    log = log.assign(slip=("row", column), along=("row", along), across=("row", across))
    fit = rb.fit_soil(rover, None, log)
    sigma = np.sqrt(np.diag(fit.curve.gain_covariance))
    assert sigma.max() < 0.5
    assert abs(fit.curve.gain_along - 8.0) < 3 * sigma[0]
    assert abs(fit.curve.gain_across - 3.0) < 3 * sigma[1]
    assert_close(fit.slip(0.25, 0.0)[1], expit(-0.5), 0.03, "1", "the curve itself")
    assert (np.diff(fit.slip(0.25, 0.1)) > 0).all(), "quantiles ascend"
    past = fit.data["gain_past_sigma"].values
    assert (np.diff(past, axis=0) <= 1e-12).all(), "gains are constant: past data only make them surer"
    table = rb.slip_table({"sand": fit}, np.radians([0, 10, 20]), np.radians([0, 90, 180]))
    assert_close(table["slip"].sel(soil="sand")[2, 0, 1], fit.slip(np.sin(np.radians(20)))[1], 1e-12, "1", "uphill")
    assert not bool(table["outside"].sel(soil="sand")[1, 0])
    assert bool(table["outside"].sel(soil="sand")[2, 2]), "steep downhill is not in the log"


def wrong(**changes):
    return made(walk(1, 10)).assign({name: ("row", values) for name, values in changes.items()})


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (wrong(slip=np.full(40, np.nan)), "no slip"),
        (wrong(slip=np.full(40, 20.0)), "percent"),
        (wrong(distance=np.arange(40.0)[::-1]), "decreases"),
        (wrong().drop_vars("distance"), "distance"),
        (wrong(distance=1e3 * made(walk(1, 10))["distance"].values), "distance in metres"),
        (wrong().drop_vars("slip"), "no slip"),
        (wrong().isel(row=slice(0, 0)), "no rows"),
        (wrong(slip=np.full(40, "0.2 or so")), "of type"),
        (wrong(along=np.full(40, 15.0)), "sine of the slope"),
        ([0.1, 0.2], "not a Dataset"),
    ],
)
def test_wrong_logs_give_a_sentence(rover, log, says):
    with pytest.raises(rb.RockerbogieError, match=says):
        rb.forecast_slip(rover, None, log)


@pytest.mark.parametrize(
    "arguments",
    [
        {"limit": 1.5},
        {"limit": "0.8"},
        {"threshold": 0.0},
        {"quantiles": (0.9, 0.1)},
        {"quantiles": 0.5},
        {"every": -1.0},
        {"every": None},
    ],
)
def test_wrong_arguments_give_a_sentence(rover, arguments):
    with pytest.raises(rb.RockerbogieError, match="give"):
        rb.forecast_slip(rover, None, made(walk(1, 10)), **arguments)


def test_fit_needs_measurements_and_slope(rover):
    with pytest.raises(rb.RockerbogieError, match="4 or more"):
        rb.fit_soil(rover, None, made([0.1, 0.2]))
    with pytest.raises(rb.RockerbogieError, match="attitude"):
        rb.fit_soil(rover, None, made(walk(1, 10)).drop_vars(["along", "across"]))
    with pytest.raises(rb.RockerbogieError, match="slopes"):
        rb.slip_table(rb.fit_soil(rover, None, made(walk(1, 10))), [20.0])


def write_plain(file, n=30, **more):
    """Write a CSV of a drive with slip that is held between updates."""
    slip = np.repeat(walk(6, n), 4)
    columns = {"time [s]": np.arange(4 * n) * 6.0, "slip [1]": slip, "distance [m]": 0.25 * np.arange(4 * n)} | more
    with open(file, "w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return file


def test_command_writes_its_files(tmp_path, capsys):
    tilt = np.full(120, -12.0) + 3 * np.sin(np.arange(120) / 9)
    file = write_plain(tmp_path / "log.csv", **{"pitch [deg]": tilt, "roll [deg]": np.zeros(120)})
    out = tmp_path / "out"
    assert main(["fit-soil", str(file), "-o", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["measurements"] == 30
    assert json.loads((out / "fit_soil.json").read_text())["curve"]["gain_along"] == found["curve"]["gain_along"]
    assert (out / "fit_soil.png").stat().st_size > 10_000
    with open(out / "slip_table.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["heading [deg]"] for row in rows} == {"0", "45", "90", "135", "180"}
    assert main(["fit-soil", str(file), "-o", str(out)]) == 0, "own files are replaced"
    assert "logit(slip)" in capsys.readouterr().out
    (out / "forecast.csv").write_text("mine")
    assert main(["fit-soil", str(file), "-o", str(out)]) == 2
    assert main(["fit-soil", str(tmp_path / "none.csv")]) == 2


def test_log_without_attitude_has_a_forecast_and_no_curve(tmp_path, capsys):
    assert main(["fit-soil", str(write_plain(tmp_path / "log.csv")), "-o", str(tmp_path / "out")]) == 0
    assert "no slip curve" in capsys.readouterr().out
    assert not (tmp_path / "out" / "slip_table.csv").exists()


def test_degrees_without_a_unit_are_refused(tmp_path, rover):
    file = write_plain(tmp_path / "log.csv", pitch=np.full(120, 12.0), roll=np.zeros(120))
    with pytest.raises(rb.RockerbogieError, match="deg"):
        rb.read_slip_log(file, rover)


def test_published_scores_of_the_drives_hold(rover, drives):
    scores = [rb.score_forecast(rb.forecast_slip(rover, None, log), log) for log in drives.values()]
    for target, last, fitted in (("next measurement", 0.76, 0.55), ("log over the next metre", 0.68, 0.40)):
        counts = np.array([int(s["count"].sel(target=target)) for s in scores])
        squares = np.array([s["rmse"].sel(target=target).values ** 2 for s in scores])
        rmse = dict(zip(scores[0]["by"].values, np.sqrt(counts @ squares / counts.sum()), strict=True))
        assert rmse["forecast"] < last * rmse["last metre"]
        assert rmse["forecast"] < fitted * rmse["slope only"]
        assert rmse["forecast"] < rmse["last measurement"]
    held = [s["coverage"].sel(target="next measurement").item() * int(s["count"][0]) for s in scores]
    assert 0.75 < sum(held) / sum(int(s["count"][0]) for s in scores) < 0.85
    for score in scores:
        assert 0.75 < float(score["coverage"].sel(target="log over the next metre")) < 0.85
        rmse = score["rmse"].sel(target="log over the next metre")
        assert float(rmse.sel(by="forecast")) < 0.75 * float(rmse.sel(by=["last metre", "slope only"]).min())
    assert [s.attrs["false_warnings"] for s in scores] == [0, 0]
    assert [s.attrs["warnings"] for s in scores] == [0, 1]


def test_slope_slip_of_another_place_is_wrong_by_a_factor_of_four(rover, drives):
    end = rb.fit_soil(rover, None, drives["sol01294"]).data.isel(measurement=slice(-4, None))
    predicted = np.hypot(0.57 * end["along"], 0.47 * end["across"])
    assert_close(float(end["slip"].mean() / predicted.mean()), 4.0, 0.2, "1", "docs/odometry.md")


@pytest.mark.parametrize(("sol", "warnings", "false"), [("01286", 3, 2), ("01295", 1, 1)])
def test_published_warnings_on_tables_of_steps(data, rover, sol, warnings, false):
    log = rb.read_slip_log(data(f"perseverance/slip_steps/sol{sol}_slip.csv"), rover)
    attrs = rb.score_forecast(rb.forecast_slip(rover, None, log), log).attrs
    assert (attrs["warnings"], attrs["false_warnings"]) == (warnings, false)
