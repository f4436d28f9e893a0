"""The paper's own solution: its equations, its agreement with `settle`, and its page."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.bench.paper.baseline import fsolve_settle, paper_contact_angles
from rockerbogie.rover.frames import contact_frames
from support.helpers import assert_close, paper_rover

ROOT = Path(__file__).resolve().parents[3]
ROVER = paper_rover()
ROUGH = rb.surfaces.rough(7, size=8.0)


def positions(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return random x, y (m) and yaw (rad), each (n,), on ROUGH."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, n), rng.uniform(-3, 3, n), rng.uniform(-np.pi, np.pi, n)


def uphill(pose: rb.Pose) -> np.ndarray:
    """Return the slope Γ (..., 6) at the contacts along the body's heading."""
    slope = pose.terrain.gradient(pose.contact_point[..., 0], pose.contact_point[..., 1])
    return slope[..., 0] * np.cos(pose.yaw)[..., None] + slope[..., 1] * np.sin(pose.yaw)[..., None]


def test_level_terrain_gives_the_paper_s_pose_at_joint_angles_near_0() -> None:
    pose = fsolve_settle(ROVER, rb.surfaces.plane(), 0.3, -0.2, 1.0)
    assert pose.status == rb.Status.CONVERGED
    expected = [0.0, -0.000562, 0.0, 0.000562, 0.000562]
    assert_close(pose.q[1:], expected, 1e-6, "rad", "the 0.3 mm in the paper's own constants")


def test_contact_below_the_hub_is_exact_on_level_terrain_and_too_low_on_a_slope() -> None:
    level = rb.surfaces.plane()
    assert_close(
        fsolve_settle(ROVER, level, 0.3, -0.2, 1.0, contact="hub").q, rb.settle(ROVER, level, 0.3, -0.2, 1.0).q, 1e-6, "m, rad",
        "the contact is below the hub there, except for the body's tilt of 0.03 deg",
    )  # fmt: skip
    slope = np.tan(0.2)
    ramp = rb.Terrain.from_array(np.arange(-50, 51) * 0.1 * slope * np.ones((101, 1)), 0.1, (-5, -5))
    high, exact = fsolve_settle(ROVER, ramp, 0, 0, contact="hub"), rb.settle(ROVER, ramp, 0, 0)
    short = ROVER.wheel_radius[0] * (1 / np.cos(0.2) - 1)
    assert_close(exact.z - high.z, short, 1e-4, "m", "the vertical distance from hub to terrain is r / cos of the slope, not r")


def test_the_solution_satisfies_eqs_11_to_16() -> None:
    """The equations are evaluated with wheel and contact frames at the solution's own angles."""
    pose = fsolve_settle(ROVER, ROUGH, *positions(20))
    assert (pose.status == rb.Status.CONVERGED).all()
    axle = pose.T_world_body[:, None] @ rb.wheel_frames(ROVER, pose.rocker, pose.bogie)
    delta = np.zeros((20, 6))
    for _ in range(200):  # fixed point: each angle depends on the slope at its own contact
        contact = contact_frames(ROVER, axle, delta)[..., :3, 3]
        slope = ROUGH.gradient(contact[..., 0], contact[..., 1])
        gamma = slope[..., 0] * np.cos(pose.yaw)[:, None] + slope[..., 1] * np.sin(pose.yaw)[:, None]
        rho, beta = pose.rocker, pose.bogie
        arm = np.stack([rho, -rho, rho + beta[:, 0], -rho + beta[:, 1], rho + beta[:, 0], -rho + beta[:, 1]], axis=-1)
        delta = -np.arctan(gamma) - pose.pitch[:, None] - arm
    assert_close(paper_contact_angles(ROVER, pose, gamma), delta, 1e-12, "rad", "eqs 14-16, written out")
    assert_close(contact[..., 2], ROUGH.height(contact[..., 0], contact[..., 1]), 1e-9, "m", "eqs 13")


def test_on_smooth_terrain_the_pose_is_exact_except_for_the_approximate_angles() -> None:
    at = positions(60)
    exact, paper, rim = (
        rb.settle(ROVER, ROUGH, *at),
        fsolve_settle(ROVER, ROUGH, *at),
        fsolve_settle(ROVER, ROUGH, *at, contact="rim"),
    )
    assert (exact.status == rb.Status.CONVERGED).all()
    assert_close(paper.q[:, 0], exact.z, 1e-6, "m", "an angle off by 0.4 deg lifts a wheel by r Δ²/2 = 2 µm at most")
    assert_close(paper.q[:, 1:], exact.q[:, 1:], 1e-5, "rad", "2 µm over the wheelbase")
    off = np.abs(paper_contact_angles(ROVER, exact, uphill(exact)) - exact.contact_angle)
    assert 1e-4 < off.max() < np.radians(0.5)  # the angles are approximate under roll
    apart = np.abs(rim.q - exact.q)
    assert 1e-5 < apart.max() < 2e-3  # 23 points are 8 deg apart: up to r (4 deg)² / 2 = 0.25 mm per wheel


def test_the_page_s_formula_gives_the_exact_angle() -> None:
    pose = rb.settle(ROVER, rb.surfaces.rough(2, size=8.0, min_radius=1.0), *positions(200))
    slope = pose.terrain.gradient(pose.contact_point[..., 0], pose.contact_point[..., 1])
    c, s = np.cos(pose.yaw)[:, None], np.sin(pose.yaw)[:, None]
    roll, pitch = pose.roll[:, None], pose.pitch[:, None]
    gamma, aside = slope[..., 0] * c + slope[..., 1] * s, slope[..., 1] * c - slope[..., 0] * s
    seen, across = np.tan(np.arctan(gamma) + pitch), aside / (np.cos(pitch) - gamma * np.sin(pitch))
    suspension = -paper_contact_angles(ROVER, pose, 0.0) - pitch
    delta = -np.arctan(seen / (np.cos(roll) + across * np.sin(roll))) - suspension
    assert_close(delta, pose.contact_angle, 1e-7, "rad", "n·t = 0, solved for a wheel that is not steered")
    off = paper_contact_angles(ROVER, pose, gamma) - pose.contact_angle
    guess = seen * roll * (roll / 2 - across) / (1 + seen**2)
    assert np.abs(off).max() > np.radians(0.2)
    assert np.corrcoef(off.ravel(), guess.ravel())[0, 1] > 0.99
    assert np.abs(off - guess).max() < 0.25 * np.abs(off).max()


def test_at_the_concave_corner_the_paper_uses_one_of_two_contacts() -> None:
    terrain, x = rb.surfaces.paper(), np.arange(1.2, 1.6, 0.01)  # the right rear wheel is at the foot of the ramp
    paper, exact = fsolve_settle(ROVER, terrain, x, 0.0), rb.settle(ROVER, terrain, x, 0.0)
    sunk = paper.gap.min(axis=-1)
    assert -0.0035 < sunk.min() < -0.001
    off = np.abs(paper.q - exact.q)
    assert off[sunk > -1e-5].max() < 1e-5
    assert off[sunk < -1e-3].max() > 1e-3


def test_poses_that_cannot_be_computed_are_nan_with_a_status() -> None:
    z = np.zeros((60, 60))
    z[20:24, 40:44] = np.nan
    terrain = rb.Terrain.from_array(z, 0.1, interpolation="linear")
    pose = fsolve_settle(ROVER, terrain, [3.0, 0.1, 90.0, 4.0], [3.0, 3.0, 3.0, 2.4])
    assert pose.status.tolist() == [rb.Status.CONVERGED, rb.Status.OFF_MAP, rb.Status.OFF_MAP, rb.Status.NO_DATA]
    assert np.isnan(pose.q).all(axis=-1).tolist() == [False, True, True, True]
    cliff = fsolve_settle(ROVER, rb.surfaces.step(1.0, size=10), np.linspace(0.3, 1.5, 13), 0.0)
    lost = cliff.status == rb.Status.NOT_CONVERGED
    assert 0 < lost.sum() < 13  # a wall of 1 m: it does not converge at some positions
    assert np.array_equal(np.isnan(cliff.q).all(axis=-1), lost)


def test_shapes_broadcast() -> None:
    pose = fsolve_settle(ROVER, rb.surfaces.plane(0.1), np.zeros((2, 1)), 0.0, [0.0, 1.0, 2.0])
    assert pose.shape == (2, 3)
    assert pose.contact_angle.shape == (2, 3, 6)


def test_unknown_contact_is_refused() -> None:
    with pytest.raises(rb.RockerbogieError, match="contact 'edge' is not known; give 'hub', 'point' or 'rim'"):
        fsolve_settle(ROVER, ROUGH, 0, 0, contact="edge")  # type: ignore[arg-type]
    with pytest.raises(rb.RockerbogieError, match="points is 0"):
        fsolve_settle(ROVER, ROUGH, 0, 0, contact="rim", points=0)


def test_the_page_s_tables_equal_the_output_of_the_example(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(ROOT / "examples" / "contact_angles.py"))
    printed = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    page = (ROOT / "docs" / "contact_angles.md").read_text(encoding="utf-8")
    stated = [line for line in page.splitlines() if line.startswith("|")]
    assert len(printed) == 13
    for now, said in zip(printed, stated, strict=True):
        for a, b in zip(now.split("|"), said.split("|"), strict=True):
            try:
                assert float(a) == pytest.approx(float(b), rel=0.2, abs=1e-4)  # a last digit may differ between machines
            except ValueError:
                assert a == b
