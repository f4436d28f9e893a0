"""Poses on terrain as sharp as the grid allows, each compared with certified brackets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, target
from hypothesis import strategies as st

import rockerbogie as rb
from support.certified import FAULTS, certify, faults_of, judge, some
from support.sharp_grounds import FAMILIES, Case, draw_case, spline_nodes

SEEDS = (0, 3)  # of the second, the terrain has missing data


def assert_right(case: Case, mode: str, counted: int = 0) -> int:
    """Fail if any pose of a case has a fault; return how many poses were given."""
    pose, verdict = judge(case, mode, counted)
    assert verdict.unproved == 0
    for fault in FAULTS:
        bad = verdict.bad[fault]
        k = int(bad.argmax())
        assert bad[k] == 0, (
            f"{fault}: {(bad > 0).sum()} poses, worst {bad[k]:.3g} at pose {k} ({rb.Status(int(pose.status[k])).name}, {mode}) "
            "of "
            f"draw_case({case.seed}, {case.family!r}, {case.terrain.interpolation!r}, {len(case.x)}), rover {case.rover.name}"
        )
    return int(verdict.given.sum())


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
@pytest.mark.parametrize("family", FAMILIES)
def test_poses_in_contact_are_right(family: str, interpolation: str) -> None:
    given = [assert_right(draw_case(seed, family, interpolation, 40, holes=seed == 3), "contact", counted=1) for seed in SEEDS]
    assert sum(given) > 20


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
@pytest.mark.parametrize("family", FAMILIES)
def test_poses_at_rest_are_right(family: str, interpolation: str) -> None:
    given = [assert_right(draw_case(seed, family, interpolation, 6, holes=seed == 3), "equilibrium") for seed in SEEDS]
    assert sum(given) > 2


RIPPLES = [  # wavelengths along x and y, x, y, yaw: treads of these poses were once 2 to 6 cm deep in the ground
    (1.1, 0.9, 6.42, 14.89, 0.0),
    (1.0, 0.6, 5.24, 7.01, -1.6),
    (1.0, 0.6, 9.96, 4.06, -1.55),
]


def on_ripples(amplitude: float, lx: float, ly: float, x: object, y: object, yaw: object) -> Case:
    """Return Curiosity at places (n,) on two crossed sine waves, on 0.25 m cells."""
    j, i = np.mgrid[:80, :80] * 0.25
    z = amplitude * (np.sin(2 * np.pi * i / lx) + np.sin(2 * np.pi * j / ly))
    px, py, heading = np.broadcast_arrays(*(np.atleast_1d(np.asarray(a, dtype=float)) for a in (x, y, yaw)))
    return Case(0, "ripples", rb.load_rover("curiosity"), rb.Terrain.from_array(z, 0.25), px, py, heading, np.zeros((px.size, 6)))


@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
@pytest.mark.parametrize("place", RIPPLES)
def test_poses_on_ripples_are_right(place: tuple[float, ...], mode: str) -> None:
    assert assert_right(on_ripples(0.1, *place), mode, counted=1) == 1


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    st.floats(0.02, 0.25), st.floats(0.53, 2.0), st.floats(0.53, 2.0), st.floats(4, 15), st.floats(4, 15), st.floats(-3.2, 3.2)
)  # fmt: skip
def test_no_ripples_are_found_where_a_gap_is_wrong(
    amplitude: float, lx: float, ly: float, x: float, y: float, yaw: float
) -> None:
    near = np.random.default_rng(0).normal(0, 0.05, (3, 8))
    case = on_ripples(amplitude, lx, ly, x + near[0], y + near[1], yaw + near[2])
    pose = case.settle()
    settled = some(pose, np.isfinite(pose.z))
    if settled.status.size:
        b = certify(settled)
        off = np.maximum(b.gap_low - settled.gap, settled.gap - b.gap_high).max()
        deep = -b.gap_high.min()
        target(float(np.log10(max(off, deep, 1e-17))), label="log10 of the discrepancy or depth, m")
    assert_right(case, "contact")


def test_faults_are_seen() -> None:
    """A pose moved into the ground or out of it, or with one wrong number, is reported."""
    case = draw_case(0, "coefficients", "cubic", 20)
    pose = case.settle()
    right = some(pose, pose.status == rb.Status.CONVERGED)
    assert right.status.size > 3
    assert all((bad == 0).all() for bad in faults_of(right, certify(right)).values())
    for fault, move in (("deep", -2e-6), ("far", 2e-6)):
        moved = replace(right, q=right.q + move * np.eye(6)[0])
        assert (faults_of(moved, certify(moved))[fault] > 1e-6).all()
    b = certify(right)
    for fault in ("gap", "clearance"):
        for sign in (1, -1):
            shifted = {f"{fault}_{end}": getattr(b, f"{fault}_{end}") + sign * 3e-8 for end in ("low", "high")}
            assert (faults_of(right, replace(b, **shifted))[fault] > 1e-8).all()


def test_certificates_agree() -> None:
    """Brackets by the library and by the oracle, which share no code, overlap."""
    for interpolation in ("cubic", "linear"):
        case = draw_case(5, "coefficients", interpolation, 20)
        pose = case.settle()
        settled = some(pose, np.isfinite(pose.z))
        one, other = certify(settled, "verify"), certify(settled, "oracle")
        for name in ("gap", "clearance"):
            low = np.maximum(getattr(one, f"{name}_low"), getattr(other, f"{name}_low"))
            high = np.minimum(getattr(one, f"{name}_high"), getattr(other, f"{name}_high"))
            assert (low <= high + 1e-12).all()


def test_spline_has_the_coefficients_drawn() -> None:
    """Away from the edge, the spline has the coefficients that its heights were made from."""
    c = np.random.default_rng(0).normal(size=(62, 52))
    terrain = rb.Terrain.from_array(spline_nodes(c), 0.1)
    level = terrain.meta[rb._kernels.model.ground.META_Z]
    inner = (slice(26, -26), slice(22, -22))
    assert abs(terrain.grid + level - c)[inner].max() < 1e-9


@pytest.mark.parametrize("k", [14, 33])
def test_missing_data_met_on_the_way_is_no_reason_to_refuse(k: int) -> None:
    """Some starts lead to poses over missing data, another one to a pose over known terrain."""
    case = draw_case(107, "ripples", "cubic", 250, holes=True)
    pose = rb.settle(case.rover, case.terrain, case.x[k], case.y[k], case.yaw[k], steering=case.steering[k])
    assert pose.status == rb.Status.CONVERGED
    check = rb.verify(pose)
    assert check.known.all()
    assert check.passes(1e-6)
