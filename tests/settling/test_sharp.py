"""Poses on terrain as sharp as the grid allows, each compared with certified brackets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, target
from hypothesis import strategies as st

import rockerbogie as rb
from rockerbogie.terrain.heightfield import crop
from support.certified import FAULTS, certify, faults_of, judge, some
from support.sharp_grounds import FAMILIES, Case, draw_case, reach, spline_nodes

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
    given = [assert_right(draw_case(seed, family, interpolation, 40, missing=seed == 3), "contact", counted=1) for seed in SEEDS]
    assert sum(given) > 20


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
@pytest.mark.parametrize("family", FAMILIES)
def test_poses_at_rest_are_right(family: str, interpolation: str) -> None:
    given = [assert_right(draw_case(seed, family, interpolation, 6, missing=seed == 3), "equilibrium") for seed in SEEDS]
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
    case = draw_case(107, "ripples", "cubic", 250, missing=True)
    pose = rb.settle(case.rover, case.terrain, case.x[k], case.y[k], case.yaw[k], steering=case.steering[k])
    assert pose.status == rb.Status.CONVERGED
    check = rb.verify(pose)
    assert check.known.all()
    assert check.passes(1e-6)


@pytest.mark.parametrize("k", [92, 427])
def test_pose_over_known_terrain_is_found_with_missing_data_bridged(k: int) -> None:
    """Each start that converges on the map itself leads to a pose over missing data."""
    case = draw_case(1011, "plateaus", "linear", 500, missing=True)
    place = {"yaw": case.yaw[k], "steering": case.steering[k]}
    pose = rb.settle(case.rover, case.terrain, case.x[k], case.y[k], **place)
    assert pose.status == rb.Status.CONVERGED
    assert rb.verify(pose).passes(1e-6)
    # A window of the map gives the same bits.
    span, (dx, dy) = reach(case.rover) + 0.5, case.terrain.spacing
    (col, row), (cols, rows) = (
        tuple(int((v - o) / d) for v, o, d in zip(at, case.terrain.origin, (dx, dy), strict=True))
        for at in ((case.x[k] - span, case.y[k] - span), (case.x[k] + span, case.y[k] + span))
    )
    shape = case.terrain.z.shape
    window = crop(case.terrain, (max(row, 0), min(rows, shape[0])), (max(col, 0), min(cols, shape[1])))
    assert window.z.size < case.terrain.z.size
    assert (rb.settle(case.rover, window, case.x[k], case.y[k], **place).q == pose.q).all()


def test_a_pose_that_the_search_misses_is_not_refused_for_missing_data() -> None:
    """The search also fails on the map without missing data, so the status does not blame it."""
    case, k = draw_case(3035, "ripples", "cubic", 500, missing=True), 425
    pose = rb.settle(case.rover, case.terrain, case.x[k], case.y[k], case.yaw[k], steering=case.steering[k])
    assert pose.status in (rb.Status.CONVERGED, rb.Status.NOT_CONVERGED)


def test_bridged_pose_over_missing_data_is_refused() -> None:
    """A pose with a tread over missing data is NO_DATA."""
    z = np.zeros((60, 60))
    z[28:32, 28:32] = np.nan
    rover = rb.load_rover("curiosity")
    x, y = (-hub for hub in rover.hubs[0, :2])  # the wheel's hub is at 0, 0
    for interpolation in ("linear", "cubic"):
        for mode in ("contact", "equilibrium"):
            terrain = rb.Terrain.from_array(z, 0.25, (-7.375, -7.375), interpolation)
            assert rb.settle(rover, terrain, x, y, mode=mode).status == rb.Status.NO_DATA


DITCHES = [  # spacing, m; distance of the ditches, nodes
    (0.01, 60),
    (0.01, 7),
    (0.004, 3),  # more contacts than a solver keeps
]


@pytest.mark.parametrize("dx, period", DITCHES)
def test_contacts_between_ditches_are_counted(dx: float, period: int) -> None:
    """Each piece of plane under a tread, between ditches across the axle, is one contact."""
    rover = rb.load_rover("curiosity")
    columns = np.arange(-int(2.5 / dx), int(2.5 / dx) + 1)
    ditch = columns % period == 0
    terrain = rb.Terrain.from_array(np.where(ditch, -0.01, 0.0) + np.zeros((11, 1)), (dx, 0.6), (columns[0] * dx, -3.0), "linear")
    x = np.linspace(-0.1013, 0.0987, 9)  # no tread ends at the edge of a ditch
    pose = rb.settle(rover, terrain, x, 0.0, np.pi / 2)
    assert (pose.status == rb.Status.CONVERGED).all()
    assert abs(pose.z - pose.z[0]).max() < 1e-9
    hub = x[:, None] - rover.hubs[:, 1]  # heading +y, the left side is at lower x
    expected = np.zeros(hub.shape, dtype=int)
    for c in columns[ditch][:-1] * dx:  # the plane from one ditch to the next
        low, high = (
            np.maximum(hub - rover.wheel_width / 2, c + dx),
            np.minimum(hub + rover.wheel_width / 2, c + (period - 1) * dx),
        )
        expected += low <= high
    assert expected.max() > 1
    np.testing.assert_array_equal(pose.contact_count, expected)


def test_contacts_on_one_wheel_are_counted_when_nodes_are_lowered() -> None:
    """The middle of the line between two contacts may touch although parts of it do not."""
    case = draw_case(13, "nodes", "linear", 500)
    pose = rb.settle(case.rover, case.terrain, case.x[0], case.y[0], case.yaw[0], steering=case.steering[0])
    assert pose.contact_count.tolist() == [1, 2, 1, 2, 1, 1]


def test_contacts_closer_than_a_tenth_of_a_radius_are_counted() -> None:
    """Peaks that each touch, found once for each cell around them, are as many contacts."""
    rover = rb.load_rover("curiosity")
    radius, dx = float(rover.wheel_radius[0]), 0.01
    z = np.zeros((400, 400))
    for hub in rover.hubs[:, :2]:
        for n in (-2, 0, 2):  # along the axle
            z[200 + round(hub[1] / dx) + n, 200 + round(hub[0] / dx)] = 0.005
    assert 2 * dx < 0.1 * radius
    terrain = rb.Terrain.from_array(z, dx, (-200 * dx, -200 * dx), "linear")
    pose = rb.settle(rover, terrain, 0.0, 0.0)
    assert pose.status == rb.Status.CONVERGED
    assert (pose.contact_count == 3).all()
