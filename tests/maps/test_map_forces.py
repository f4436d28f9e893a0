"""Layers and limits of forces in maps, routes and the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.maps.limits import BITS, FORCES

HEADINGS = [0.0, 1.1]
WORST = {"required_friction": "worst_friction", "tip_margin": "worst_tip_margin", "max_torque": "worst_torque"}


@pytest.fixture(scope="module")
def rover() -> rb.Rover:
    return rb.load_rover("osr")


@pytest.fixture(scope="module")
def terrain() -> rb.Terrain:
    """Return a slope that steepens along x, with bumps and missing data."""
    x, y = np.meshgrid(np.arange(0.0, 6.0, 0.1), np.arange(0.0, 3.0, 0.1))
    z = 0.12 * x**2 + 0.03 * np.sin(7 * x) * np.cos(9 * y)
    z[:4, :4] = np.nan
    return rb.Terrain.from_array(z, 0.1, interpolation="linear", name="bowl")


@pytest.fixture(scope="module")
def maps(rover: rb.Rover, terrain: rb.Terrain) -> Any:
    return rb.traversability(
        rover, terrain, HEADINGS, 0.3, "none", gravity=rb.GRAVITY["mars"], layers=["status", "exceeded", *FORCES, *WORST.values()]
    )


def test_layers_of_forces_are_those_of_the_poses(rover: rb.Rover, terrain: rb.Terrain, maps: Any) -> None:
    x, y = np.meshgrid(maps.x, maps.y)
    pose = rb.settle(rover, terrain, x, y, maps.heading.values[:, None, None], gravity=rb.GRAVITY["mars"])
    loads = rb.wheel_loads(pose)
    stability, weight = rb.stability(pose), rover.mass * rb.GRAVITY["mars"]
    friction, torque = loads.required_friction, np.abs(loads.torque).max(axis=-1)
    np.testing.assert_allclose(maps.required_friction, friction, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(maps.max_torque, torque, atol=1e-3 * weight * rover.wheel_radius.max())
    above = (maps.tip_margin.values - stability.tip_margin)[np.isfinite(pose.z)]
    assert above.min() > -1e-4  # the accuracy of `stability`
    assert above.max() < 1e-3
    assert maps.attrs["gravity"] == rb.GRAVITY["mars"]
    assert np.isfinite(maps.required_friction.values).mean() + np.isnan(pose.z).mean() > 0.9


def test_summaries_take_the_worst_heading(maps: Any) -> None:
    for name, summary in WORST.items():
        values = maps[name].values
        worst = np.fmin if name == "tip_margin" else np.fmax
        np.testing.assert_array_equal(maps[summary], worst(values[0], values[1]))


def test_layers_that_need_no_limits_do_not_depend_on_them(rover: rb.Rover, terrain: rb.Terrain, maps: Any) -> None:
    layers = ["worst_friction", "tip_margin", "worst_tilt", "worst_clearance"]
    some = rb.traversability(rover, terrain, HEADINGS, 0.3, "curiosity", gravity=rb.GRAVITY["mars"], layers=layers)
    for name in ("worst_friction", "tip_margin"):
        np.testing.assert_array_equal(some[name], maps[name])
    limited = rb.traversability(rover, terrain, HEADINGS, 0.3, "curiosity", layers=[*layers[2:], "worst_exceeded"])
    for name in ("worst_tilt", "worst_clearance"):
        np.testing.assert_array_equal(some[name], limited[name])


@pytest.mark.parametrize("name", FORCES)
def test_a_limit_is_exceeded_beyond_it_and_where_the_value_is_missing(
    rover: rb.Rover, terrain: rb.Terrain, maps: Any, name: str
) -> None:
    values = maps[name].values
    limit = float(np.nanquantile(values[np.isfinite(values)], 0.5))
    bounded = rb.traversability(rover, terrain, HEADINGS, 0.3, rb.Limits(**{name: limit}), gravity=rb.GRAVITY["mars"])
    assert list(bounded.exceeded.attrs["flag_masks"]) == list(BITS.values())
    assert bounded.exceeded.dtype == bounded.worst_exceeded.dtype == np.uint16
    assert name in bounded, "a layer with a limit is usual"
    assert WORST[name] in bounded
    beyond = ~(values >= limit) if name == "tip_margin" else ~(values <= limit)
    settled = (maps.exceeded.values & BITS["unsettled"]) == 0
    assert (((bounded.exceeded.values & BITS[name]) > 0) == beyond)[settled].all()
    assert ((bounded.exceeded.values[~settled]) == BITS["unsettled"]).all()
    assert json.loads(bounded.attrs["limits"])[name] == limit
    assert 0 < (bounded.passable > 0).sum() < (maps.status == 0).any("heading").sum()


def test_a_route_avoids_terrain_that_is_too_slippery(rover: rb.Rover) -> None:
    """Plan over and around a steep hill between start and goal."""
    x, y = np.meshgrid(np.arange(0.0, 10.0, 0.1), np.arange(0.0, 8.0, 0.1))
    z = 1.0 * np.exp(-((x - 5.0) ** 2 + (y - 4.0) ** 2) / 2.0)
    hill = rb.Terrain.from_array(z, 0.1, name="hill")
    ends = (1.5, 4.0), (8.5, 4.0)
    over, around = (
        rb.plan(rb.traversability(rover, hill, 8, 0.5, limits), *ends, rover=rover, tilt_weight=0.0)
        for limits in (rb.Limits(required_friction=1.5), rb.Limits(required_friction=0.2))
    )
    assert abs(over.y - 4.0).max() < 1e-9
    assert abs(around.y - 4.0).max() > 1.0
    pose = rb.settle(rover, hill, around.x, around.y, around.yaw)
    assert rb.wheel_loads(pose).required_friction.max() <= 0.2 + 1e-6


@pytest.mark.parametrize(
    "limits",
    [
        {"required_friction": -0.5},
        {"required_friction": float("nan")},
        {"max_torque": 0.0},
        {"max_torque": True},
        {"tip_margin": 4.0},
    ],
)
def test_limits_out_of_range_are_refused(limits: dict[str, float]) -> None:
    with pytest.raises(rb.RockerbogieError, match=next(iter(limits))):
        rb.Limits(**limits)


def test_the_command_writes_layers_of_forces(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rasterio", reason="needs the geo extra")
    allowed = tmp_path / "limits.toml"
    allowed.write_text("required_friction = 0.4\ntip_margin_deg = 20\nmax_torque_n_m = 9\n")
    out = tmp_path / "hill.tif"
    call = ["map", "surface:rocks", "--rover", "osr", "--headings", "2", "--resolution", "1", "--limits", str(allowed)]
    assert main([*call, "--gravity", "moon", "--json", "-o", str(out)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert {"required_friction", "tip_margin", "max_torque"} < set(answer["exceeded_at_some_heading"])
    made = rb.read_map(out)
    assert set(WORST.values()) < set(made)
    assert made.attrs["gravity"] == rb.GRAVITY["moon"]
    assert json.loads(made.attrs["limits"])["tip_margin"] == pytest.approx(np.radians(20))
    assert made.worst_tip_margin.attrs["units"] == "rad"
