"""Wheel-soil forces: limits, symmetry, batch axes, bad input, soils, ruts, grousers."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb

SAND = rb.load_soil("dry-sand")
WHEEL = (0.25, 0.3)
OK = rb.ForceStatus.COMPUTED


def test_forces_have_batch_axes_and_are_the_same_for_any_batch() -> None:
    slip = np.linspace(-1.0, 1.0, 5)[:, None]
    load = np.array([50.0, 200.0, 800.0])
    forces = rb.wheel_soil_forces(SAND, *WHEEL, load, slip, 0.2)
    assert forces.drawbar.shape == forces.status.shape == (5, 3)
    one = rb.wheel_soil_forces(SAND, *WHEEL, 200.0, slip[3, 0], 0.2)
    assert one.drawbar.shape == ()
    assert [one.drawbar, one.side, one.torque, one.sinkage] == [
        forces.drawbar[3, 1], forces.side[3, 1], forces.torque[3, 1], forces.sinkage[3, 1]
    ]  # fmt: skip
    radii = rb.wheel_soil_forces(SAND, [0.2, 0.25], 0.3, 200.0, slip[3, 0], 0.2, passes=[[1], [2]])
    assert radii.sinkage.shape == (2, 2)
    assert radii.drawbar[0, 1] == one.drawbar
    assert rb.wheel_soil_forces(SAND, *WHEEL, [], 0.1).drawbar.shape == (0,)


@pytest.mark.parametrize("name", list(rb.soils()))
def test_forces_in_every_soil_are_plausible(name: str) -> None:
    """Side force opposes the motion; drawbar grows with slip, sinkage with the load."""
    soil = rb.load_soil(name)
    slip = np.linspace(-0.8, 0.8, 17)
    forces = rb.wheel_soil_forces(soil, 0.25, 0.3, 100.0, slip, 0.3)
    assert (forces.status == OK).all()
    assert (forces.side < 0.0).all()
    straight = rb.wheel_soil_forces(soil, 0.25, 0.3, 100.0, slip)
    assert (np.diff(straight.drawbar) > -0.03 * 100.0).all()
    assert straight.drawbar[0] < straight.drawbar[8] < straight.drawbar[-1]
    assert np.abs(straight.side).max() == 0.0
    mirrored = rb.wheel_soil_forces(soil, 0.25, 0.3, 100.0, slip, -0.3)
    assert mirrored.side == pytest.approx(-forces.side, rel=1e-9)
    assert mirrored.drawbar == pytest.approx(forces.drawbar, rel=1e-9)
    deeper = rb.wheel_soil_forces(soil, 0.25, 0.3, 150.0, 0.1)
    assert deeper.sinkage > rb.wheel_soil_forces(soil, 0.25, 0.3, 100.0, 0.1).sinkage > 0.0


def test_hard_soil_approaches_a_rigid_wheel_with_coulomb_friction() -> None:
    """Stiff soil without cohesion has no sinkage, no resistance and friction tan phi."""
    hard = dataclasses.replace(SAND, cohesion=0.0, kphi=2.9e7, exponent=0.5, shear_modulus=2e-4, bulldozing=0.0)
    forces = rb.wheel_soil_forces(hard, 0.25, 0.3, 100.0, [-1.0, 0.0, 0.99])
    assert forces.sinkage.max() < 3e-4
    assert forces.drawbar / 100.0 == pytest.approx([-np.tan(np.radians(28.0)), 0.0, np.tan(np.radians(28.0))], abs=0.03)
    rigid = rb.wheel_soil_forces(rb.Coulomb(0.6), 0.25, 0.3, 100.0, [-1.0, 0.0, 1.0])
    assert rigid.drawbar == pytest.approx([-60.0, 0.0, 60.0], rel=1e-3)
    assert np.abs(rigid.sinkage).max() == 0.0


def test_grousers_pull_more_and_second_passes_sink_less() -> None:
    smooth, lugs = (rb.wheel_soil_forces(SAND, *WHEEL, 300.0, 0.3, grousers=height) for height in (None, 0.02))
    assert lugs.drawbar > smooth.drawbar
    depth = [float(rb.wheel_soil_forces(SAND, *WHEEL, 300.0, 0.0, passes=n).sinkage) for n in (1, 2, 3)]
    assert depth[0] > 3.0 * depth[1] > 3.0 * depth[2] > 0.0
    rut = np.cumsum(depth) / depth[0]
    assert rut == pytest.approx(np.array([1.0, 2.0, 3.0]) ** (1.0 / 3.0), rel=0.06)


def test_gravity_acts_through_bulldozed_soil() -> None:
    earth, moon = (rb.wheel_soil_forces(SAND, *WHEEL, 300.0, 0.1, 0.3, gravity=rb.GRAVITY[name]) for name in ("earth", "moon"))
    assert abs(earth.side) > abs(moon.side)
    assert earth.drawbar == moon.drawbar


@pytest.mark.parametrize("grousers", [0.0, 0.02])
def test_torque_power_covers_drawbar_power(grousers: float) -> None:
    """The motor's power is never below that of drawbar and side force."""
    slip, angle = np.meshgrid(np.linspace(-1.0, 1.0, 21), np.linspace(-1.2, 1.2, 13))
    for soil in rb.soils().values():
        forces = rb.wheel_soil_forces(soil, 0.25, 0.3, 100.0, slip, angle, grousers=grousers)
        rim, vx = 1.0 + np.minimum(slip, 0.0), 1.0 - np.maximum(slip, 0.0)
        lost = forces.torque / 0.25 * rim - forces.drawbar * vx - forces.side * vx * np.tan(angle)
        assert np.nanmin(lost) > -1e-6 * 100.0


def test_statuses_of_wheels_that_have_no_forces() -> None:
    heavy = rb.wheel_soil_forces(SAND, 0.1, 0.02, [10.0, 1e5], 0.1)
    assert heavy.status.tolist() == [OK, rb.ForceStatus.OVERLOADED]
    assert np.isnan([heavy.drawbar[1], heavy.side[1], heavy.torque[1], heavy.sinkage[1]]).all()
    bad = rb.wheel_soil_forces(
        SAND, *WHEEL, [100.0, 100.0, 100.0, -1.0, np.nan, 0.0], [1.01, -1.01, 0.0, 0.0, 0.0, 0.0], [0, 0, 1.6, 0, 0, 0]
    )
    range_, invalid = rb.ForceStatus.OUT_OF_RANGE, rb.ForceStatus.INVALID
    assert bad.status.tolist() == [range_, range_, range_, invalid, invalid, OK]
    assert np.isnan(bad.drawbar[:5]).all()
    assert bad.drawbar[5] == bad.sinkage[5] == 0.0


@pytest.mark.parametrize(
    "change, words",
    [
        ({"cohesion": -1.0}, "cohesion is -1"),
        ({"cohesion": 0.8}, "Pa, not kPa"),
        ({"friction_angle": 28.0}, "rad, not degrees"),
        ({"friction_angle": np.radians(0.49)}, "0.49°: give rad; in a file, degrees"),
        ({"kc": 990e3}, "kc is 990000 .* N and m, not kN"),
        ({"kc": 0.99}, "kc is 0.99 .* N and m, not kN"),
        ({"cohesion": "0"}, "cohesion is '0'"),
        ({"density": True}, "density is True"),
        ({"kphi": 1528.43, "kc": 0.99}, "N and m, not kN"),
        ({"kphi": 1528.43e6}, "N and m, not kN"),
        ({"shear_modulus": 25.0}, "m, not mm"),
        ({"density": 1.52}, "density"),
        ({"density": 15000.0}, "mass, not weight"),
        ({"exponent": -1.0}, "exponent is -1"),
        ({"kphi": np.nan}, "kphi is nan"),
        ({"peak_terms": (0.1,)}, "tuple of 5"),
        ({"pressure": "terzaghi"}, "bekker"),
        ({"slip_speed": "rim"}, "travel"),
    ],
)
def test_impossible_soils_are_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(rb.RockerbogieError, match=words):
        dataclasses.replace(SAND, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "arguments, words",
    [
        ({"radius": 250.0}, "radius is 250 m"),
        ({"width": -0.1}, "width is -0.1"),
        ({"gravity": 0.0}, "gravity is 0"),
        ({"grousers": -0.01}, "grouser height"),
        ({"passes": 0}, "passes is 0"),
        ({"passes": 1.5}, "passes is 1.5"),
        ({"passes": np.nan}, "passes is nan"),
        ({"slip": [0.1, 0.2], "load": [1.0, 2.0, 3.0]}, "broadcast"),
        ({"load": "heavy"}, "must be numbers"),
        ({"soil": "dry-sand"}, "load_soil"),
        ({"soil": 0.6}, "Coulomb"),
    ],
)
def test_wrong_calls_are_refused(arguments: dict[str, object], words: str) -> None:
    given = {"soil": SAND, "radius": 0.25, "width": 0.3, "load": 100.0, "slip": 0.1} | arguments
    with pytest.raises(rb.RockerbogieError, match=words):
        rb.wheel_soil_forces(**given)  # type: ignore[arg-type]


def test_a_slip_curve_without_a_ratio_is_refused() -> None:
    with pytest.raises(rb.RockerbogieError, match="ratio is 0; it must be from 0.001"):
        rb.SlipCurve(0.0, 4.0)


def test_soil_files(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    text = (
        'title = "Mine"\n[strength]\ncohesion_pa = 200\nfriction_angle_deg = 30\ndensity_kg_m3 = 1500\n'
        "[pressure]\nkc = 1000\nkphi = 800000\nexponent = 1\n[shear]\nmodulus_m = 0.02\n"
    )
    file.write_text(text, encoding="utf-8")
    soil = rb.load_soil(file)
    assert (soil.name, soil.title, soil.friction_angle) == ("mine", "Mine", np.radians(30.0))
    for change, words in [
        (("modulus_m", "modulus_mm"), "modulus_m"),
        (("cohesion_pa = 200", ""), "strength.cohesion_pa missing"),
        (("kc = 1000", 'kc = "1000"'), "must be a number"),
        (("kc = 1000", "kc = "), "mine.toml"),
        (("title", "peak_terms = [1]\ntitle"), "peak_terms"),
    ]:
        file.write_text(text.replace(*change), encoding="utf-8")
        with pytest.raises(rb.RockerbogieError, match=words):
            rb.load_soil(file)
    with pytest.raises(rb.RockerbogieError, match="did you mean 'dry-sand'"):
        rb.load_soil("drysand")
    with pytest.raises(rb.RockerbogieError, match="cannot read"):
        rb.load_soil(tmp_path / "none.toml")
    assert {soil.grade for soil in rb.soils().values()} <= {"A", "B", "C"}
    assert all(soil.source for soil in rb.soils().values())
