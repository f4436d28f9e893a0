"""Slip on maps and in plans: detours around soft slopes, bounds of risk, times, energy."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from support.helpers import assert_close

#: Sand of logit(slip) = -3 + 12 sin(slope ahead) + 4 |sin(slope across)|, known well.
SAND = rb.SoilSlip(-3.0, 0.2, 12.0, 4.0, ((0.25, 0.0), (0.0, 0.25)), (0.15, 0.1), 0.02, (0.0, 0.35), (0.0, 0.3))
FIRM = replace(SAND, level=-9.0)
START, GOAL = (-7.0, 0.0), (7.0, 0.0)


@pytest.fixture(scope="module")
def rover():
    return rb.load_rover("curiosity")


@pytest.fixture(scope="module")
def maps(rover):
    """Return the map of a ridge of 14 degrees across the way, with a pass 6 m to the left."""
    x, y = np.meshgrid(np.arange(-12, 12.01, 0.5), np.arange(-12, 14.01, 0.5))
    ridge = 0.4 * (1 + np.cos(np.pi * np.clip(x, -5.0, 5.0) / 5.0))
    z = ridge * np.clip(np.abs(y - 7.0) / 3.0 - 0.5, 0.0, 1.0)
    ground = rb.Terrain.from_array(z, 0.5, origin=(-12.0, -12.0))
    return rb.traversability(rover, ground, headings=8, resolution=1.0)


def planned(maps, rover, **options):
    return rb.plan(maps, START, GOAL, rover=rover, tilt_weight=0.0, **options)


def test_soft_sand_leads_around_the_ridge_and_firm_soil_over_it(maps, rover):
    plain, firm, soft = (planned(maps, rover, slip=s) for s in (None, rb.SlipCost(FIRM), rb.SlipCost(SAND, limit=0.4, risk=0.05)))
    assert_close(firm.x, plain.x, 1e-9, "m", "without slip the route is the shortest")
    assert_close(firm.y, plain.y, 1e-9, "m", "without slip the route is the shortest")
    assert abs(plain.y).max() < 2.5
    assert soft.y.max() >= 4.0, "through the pass"


def test_risk_bounds_every_pose_of_a_route(maps, rover):
    cost = rb.SlipCost(SAND, limit=0.4, risk=0.05)
    layers = rb.slip_layers(maps, cost)
    route = planned(maps, rover, slip=cost)
    worst = 0.0
    for x, y, yaw in zip(route.x, route.y, route.yaw, strict=True):
        heading = np.abs(np.angle(np.exp(1j * (layers["heading"].values - yaw)))).argmin()
        worst = max(worst, float(layers["slip_exceed"][heading].sel(x=x, y=y)))
    assert worst <= cost.risk
    free = planned(maps, rover, slip=rb.SlipCost(SAND, limit=0.4, risk=0.99))
    assert free.distance[-1] <= route.distance[-1]


def test_times_count_the_wheel_travel(maps, rover):
    plain, soft = planned(maps, rover), planned(maps, rover, slip=rb.SlipCost(SAND, risk=0.99))
    firm = planned(maps, rover, slip=rb.SlipCost(FIRM))
    assert_close(firm.time[-1] / plain.time[-1], 1.0, 1e-3, "1", "no slip, no extra time")
    assert soft.time[-1] > plain.time[-1]
    level = rb.SoilSlip(0.0, 1e-6, 0.0, 0.0, ((0.0, 0.0), (0.0, 0.0)), (0.0, 0.0), 1e-12, (0.0, 1.0), (0.0, 1.0))
    half = planned(maps, rover, slip=rb.SlipCost(level))
    assert_close(half.x, plain.x, 1e-9, "m", "slip is 0.5 everywhere: the same route")
    straight = np.abs(np.diff(plain.yaw)) < 1e-9
    assert_close(np.diff(half.time)[straight], 2 * np.diff(plain.time)[straight], 1e-6, "s", "at half the speed")


@pytest.mark.parametrize(("headings", "turn_in_place"), [(16, True), (16, False), (8, False)])
def test_time_of_a_route_is_the_time_that_its_cost_counts(rover, headings, turn_in_place):
    """Legs of 16 headings and arcs cross cells between their poses."""
    ground = rb.Terrain.from_array(np.random.default_rng(0).normal(0.0, 0.15, (49, 53)), 0.5, origin=(-12.0, -12.0))
    rough = rb.traversability(rover, ground, headings=headings, resolution=1.0, limits="none")
    cost = rb.SlipCost(SAND, risk=0.99)
    route = rb.plan(
        rough, START, (7.0, 3.0), rover=rover, slip=cost, tilt_weight=0.0, turn_cost=0.0, turn_in_place=turn_in_place, speed=0.05
    )
    moves = np.hypot(np.diff(route.x), np.diff(route.y)) > 0
    travel = 0.05 * np.diff(route.time)[moves].sum()
    assert travel > 1.01 * route.distance[-1]
    assert_close(travel, route.cost[-1], 1e-5, "m", "expected wheel travel")


def test_energy_avoids_climbs_that_time_accepts(maps, rover):
    time, energy = (planned(maps, rover, slip=rb.SlipCost(FIRM, minimise=m, resistance=0.03)) for m in ("time", "energy"))
    assert np.abs(time.y).max() < 2.5
    assert energy.y.max() >= 5.0, "over the ridge costs its height"


def test_layers_agree_with_the_curve(maps):
    layers = rb.slip_layers(maps, rb.SlipCost(SAND))
    settled = np.isfinite(maps["pitch"].values)
    along = -np.sin(maps["pitch"].values[settled])
    across = np.cos(maps["pitch"].values[settled]) * np.sin(maps["roll"].values[settled])
    assert_close(layers["slip"].values[settled], SAND.slip(along, across)[..., 1], 1e-12, "1", "median")
    assert_close(layers["speed_made_good"].values[settled] * SAND.wheel_travel(along, across), 1.0, 1e-12, "1", "its inverse")
    assert np.isnan(layers["slip"].values[~settled]).all()
    uphill = layers["slip"].sel(heading=0.0, method="nearest").sel(x=-2.0, y=0.0)
    downhill = layers["slip"].sel(heading=0.0, method="nearest").sel(x=2.0, y=0.0)
    assert float(uphill) > 3 * float(downhill)


def test_wheel_travel_is_the_mean_over_the_band():
    x = -0.5 + 0.6 * np.random.default_rng(0).standard_normal(400_000)
    soil = rb.SoilSlip(-0.5, 0.6, 0.0, 0.0, ((0.0, 0.0), (0.0, 0.0)), (0.0, 0.0), 0.0, (0.0, 1.0), (0.0, 1.0))
    slip = 1 / (1 + np.exp(-x))
    assert_close(soil.wheel_travel(0.1), np.mean(1 / (1 - slip)), 0.01, "1", "mean of 1 / (1 - slip)")
    assert_close(soil.exceeding(0.1, 0.0, 0.6), np.mean(slip > 0.6), 0.003, "1", "share beyond the limit")


def test_wrong_calls_give_a_sentence(maps, rover):
    with pytest.raises(rb.RockerbogieError, match="ahead only"):
        planned(maps, rover, slip=rb.SlipCost(SAND), backward=True)
    with pytest.raises(rb.RockerbogieError, match="pitch"):
        planned(maps.drop_vars("pitch"), rover, slip=rb.SlipCost(SAND))
    with pytest.raises(rb.RockerbogieError, match="SlipCost"):
        planned(maps, rover, slip=SAND)
    for wrong in ({"limit": 1.2}, {"limit": "0.8"}, {"risk": 0.0}, {"minimise": "cost"}, {"resistance": 12.0}):
        with pytest.raises(rb.RockerbogieError, match="give"):
            rb.SlipCost(SAND, **wrong)
    with pytest.raises(rb.RockerbogieError, match="soil"):
        rb.SlipCost("sand")


def test_command_reads_a_fitted_soil(maps, tmp_path, capsys):
    rb.write_map(maps, tmp_path / "map.nc")
    soil = tmp_path / "fit_soil.json"
    soil.write_text(json.dumps({"curve": FIRM.to_dict(), "curve_at_end": SAND.to_dict()}))
    assert rb.SoilSlip.from_json(soil) == SAND
    assert rb.SoilSlip.from_json(soil, at_end=False) == FIRM
    call = ["plan", str(tmp_path / "map.nc"), "--start", "-7", "0", "--goal", "7", "0", "--tilt-weight", "0", "--json"]
    assert main([*call, "--soil", str(soil), "--slip-limit", "0.4", "--slip-risk", "0.05"]) == 0
    assert max(json.loads(capsys.readouterr().out)["y"]) >= 4.0
    soil.write_text("{}")
    assert main([*call, "--soil", str(soil)]) == 2
    assert "fit-soil" in capsys.readouterr().err
