"""Climbing: hub curves, motion, forces and verdicts against independent computations."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, linprog

import rockerbogie as rb
from rockerbogie._kernels.statics.mechanism import BELLY
from rockerbogie.cli import main
from rockerbogie.errors import RockerbogieError
from rockerbogie.figures.climbing import write_climb_film
from rockerbogie.statics.climb import station_balance
from rockerbogie.statics.climb_limits import step_friction
from rockerbogie.statics.contacts import PackedContacts
from rockerbogie.statics.hub_curve import HubCurve
from rockerbogie.statics.planar import planar_rover
from rockerbogie.statics.planar_forces import WEDGED, equal_friction, least_friction, least_torque
from rockerbogie.statics.planar_run import run_over

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))
from compare_climb import Case, free_rover, predict, simulate

ROVERS = ("curiosity", "osr", "rocky7", "sawppy", "elhami-dashti")


def random_profile(seed: int, n: int = 40) -> rb.Profile:
    """Return a rough profile with vertical faces, m."""
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.choice([0.05, 0.1, 0.3], n) * (rng.random(n) < np.arange(n) % 2 + 0.5))  # no two faces in a row
    return rb.obstacles.profile(x, np.cumsum(rng.normal(0.0, 0.06, n)))


def extended(profile: rb.Profile, length: float) -> np.ndarray:
    """Return the vertices x + i z of a profile with level terrain before and after."""
    v = profile.x + 1j * profile.z
    return np.concatenate([[v[0] - length], v, [v[-1] + length]])


def distance_to(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return the distance of points (n,) from a polyline, m."""
    best = np.full(points.size, np.inf)
    for a, b in pairwise(vertices):
        t = np.clip(((points - a) * np.conj(b - a)).real / max(abs(b - a) ** 2, 1e-300), 0, 1)
        best = np.minimum(best, np.abs(points - a - t * (b - a)))
    return best


# -- hub curves ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("radius", [0.03, 0.1, 0.4])
def test_hub_curve_keeps_its_distance_from_the_profile(seed: int, radius: float) -> None:
    profile = random_profile(seed)
    v = extended(profile, 2.0)
    curve = HubCurve(v, radius)
    s = [(k, t) for k in range(curve.pieces) for t in np.linspace(curve.start[k], curve.start[k + 1], 7)]
    hub, normal = np.array([curve.at(*at) for at in s]).T
    assert np.abs(distance_to(hub, v) - radius).max() < 1e-8
    assert np.abs(distance_to(hub - radius * normal, v)).max() < 1e-8
    ends = [(curve.at(k, curve.start[k + 1])[0], curve.at(k + 1, curve.start[k + 1])[0]) for k in range(curve.pieces - 1)]
    assert max(abs(a - b) for a, b in ends) < 1e-7
    assert (np.diff(hub.real) > -1e-9).all()  # a hub never goes back over terrain without overhangs


def test_hub_curve_of_a_step_has_one_arc() -> None:
    curve = HubCurve(np.array([-2.0, 0.0, 0.1j, 2.0 + 0.1j]), 0.25)
    assert curve.kind == [0, 1, 0]
    normal = curve.at(1, curve.start[1])[1]
    assert np.angle(normal) - np.pi / 2 == pytest.approx(np.arccos((0.25 - 0.1) / 0.25), abs=1e-12)


def test_wheel_bridges_a_ditch_narrower_than_its_diameter() -> None:
    curve = HubCurve(np.array([-2.0, 0.0, -5.0j, 0.3 - 5.0j, 0.3, 2.3]), 0.25)
    lowest = min(curve.at(k, curve.start[k])[0].imag for k in range(curve.pieces))
    assert lowest == pytest.approx(np.sqrt(0.25**2 - 0.15**2), abs=1e-12)


# -- motion -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROVERS)
@pytest.mark.parametrize("backward", [False, True])
def test_links_keep_their_lengths(name: str, backward: bool) -> None:
    rover = rb.load_rover(name)
    run = run_over(rover, rb.obstacles.stairs(1.2 * rover.wheel_radius.max(), 0.6 * rover.wheelbase, 2), backward, 100)
    assert run.complete
    rest = run.rover
    pairs = (
        (run.hub[:, 2] - run.hub[:, 1], rest.hub[2] - rest.hub[1]),
        (run.hub[:, 1] - run.pivot, rest.hub[1] - rest.bogie_pivot),
        (run.hub[:, 0] - run.pivot, rest.hub[0] - rest.bogie_pivot),
    )
    for now, then in pairs:
        assert np.abs(np.abs(now) - abs(then)).max() < 1e-10
    assert np.abs(np.abs(run.point - run.hub) - np.array(rest.radius)).max() < 1e-12


def test_positions_agree_with_settle_on_a_ramp() -> None:
    rover = rb.load_rover("elhami-dashti")
    x = np.arange(-3.0, 4.0, 0.02)
    slope, top = 0.2, 1.0
    z = np.clip(x, 0.0, top) * slope
    terrain = rb.Terrain.from_array(np.tile(z, (151, 1)), spacing=0.02, origin=(-3.0, -1.5), interpolation="linear")
    run = rb.climb(rover, rb.obstacles.profile([0.0, top], [0.0, slope * top]), friction=1.0)
    inside = (run.x > -1.5) & (run.x < 2.0)
    pose = rb.settle(rover, terrain, run.x[inside], 0.0, 0.0)
    assert (pose.status == rb.Status.CONVERGED).all()
    assert np.abs(pose.z - run.z[inside]).max() < 2e-6
    assert np.abs(pose.pitch - run.pitch[inside]).max() < 1e-5
    assert np.abs(pose.bogie[:, 0] - run.bogie[inside]).max() < 1e-5


@pytest.mark.parametrize("seed", range(6))
def test_rough_profiles_are_driven_to_their_end_or_to_a_jam(seed: int) -> None:
    rover = rb.load_rover(ROVERS[seed % len(ROVERS)])
    radius = float(rover.wheel_radius.max())
    rough = random_profile(seed)
    profile = rb.obstacles.profile(rough.x * 8.0 * radius, rough.z * 8.0 * radius)
    for direction in ("forward", "backward"):
        run = rb.climb(rover, profile, friction=0.7, direction=direction)
        assert np.abs(np.diff(run.distance)).max() < 0.05 * rover.wheelbase
        passed = (run.hub[-1, :, 0] > profile.x[-1]).all()
        assert passed or not run.climbed
        away = distance_to(run.hub[..., 0].ravel() + 1j * run.hub[..., 1].ravel(), extended(profile, 10.0 * rover.wheelbase))
        assert np.abs(away - np.tile(rover.wheel_radius, run.distance.size)).max() < 1e-7


def test_backward_is_forward_of_the_mirrored_rover() -> None:
    rover = rb.load_rover("sawppy")
    turn = np.array([-1.0, 1.0, 1.0])

    def link(part: rb.Link) -> rb.Link:
        return rb.Link(part.mass, part.com * turn, part.inertia)

    low, high = rover.body_box
    mirrored = rb.Rover.from_pivots(
        wheel_radius=rover.wheel_radius, rocker_pivot=rover.rocker_pivot * turn, bogie_pivot=rover.bogie_pivot * turn,
        hubs=rover.hubs * turn, bogie_limits=-rover.bogie_limits[::-1],
        body_box=[[-high[0], low[1], low[2]], [-low[0], high[1], high[2]]], body=link(rover.body),
        rockers=[link(k) for k in rover.rockers], bogies=[link(k) for k in rover.bogies], wheels=[link(k) for k in rover.wheels],
    )  # fmt: skip
    one = rb.climb(rover, rb.obstacles.step(0.09), friction=0.7, direction="backward")
    two = rb.climb(mirrored, rb.obstacles.step(0.09), friction=0.7)
    assert one.friction_needed == pytest.approx(two.friction_needed, abs=1e-9)
    assert np.allclose(one.pitch, -two.pitch, atol=1e-10)
    assert np.allclose(one.normal, two.normal, atol=1e-7 * rover.mass)
    assert one.verdict == two.verdict


@pytest.mark.parametrize("name", ["curiosity", "osr"])
def test_result_does_not_change_when_the_profile_is_refined(name: str) -> None:
    rover = rb.load_rover(name)
    coarse = rb.obstacles.stairs(0.8 * rover.wheel_radius.max(), rover.wheelbase, 2)
    t = np.linspace(0, coarse.x.size - 1, 31 * (coarse.x.size - 1) + 1)
    fine = rb.obstacles.profile(*(np.interp(t, np.arange(coarse.x.size), v) for v in (coarse.x, coarse.z)))
    a, b = (rb.climb(rover, p, friction=0.7) for p in (coarse, fine))
    assert a.friction_needed == pytest.approx(b.friction_needed, abs=1e-9)
    assert a.verdict == b.verdict


def test_friction_does_not_depend_on_the_station_density(monkeypatch: pytest.MonkeyPatch) -> None:
    rover, step = rb.load_rover("curiosity"), rb.obstacles.step(0.35)
    some = rb.climb(rover, step, friction=0.7).friction_needed
    monkeypatch.setattr("rockerbogie.statics.climb.STATIONS", 600)
    assert rb.climb(rover, step, friction=0.7).friction_needed == pytest.approx(some, abs=1e-6)


# -- forces -------------------------------------------------------------------------------------------------------


def test_front_wheel_at_a_wall_by_hand() -> None:
    """Compare with hand statics: N₁ = μW/(1 + μ²), then the moments about the bogie pivot."""
    rover = rb.load_rover("curiosity")
    run = run_over(rover, rb.obstacles.step(0.6), False, 100)
    k = int(np.flatnonzero(np.abs(run.contact[:, 0].real) > 0.999)[0])  # just off the floor
    pivot, (a, m, e) = run.pivot[k], run.point[k]
    wu, wb = run.rover.upper_mass, run.rover.bogie_mass

    loads = [0.0, 0.0, 0.0]

    def excess(mu: float) -> float:
        wall = mu * (wu + wb) / (1 + mu**2)  # from x: N₁ = μ (N₂ + N₃), and z: μ N₁ + N₂ + N₃ = W
        floor = wall / mu
        # bogie: N₂ (x_m - x_b) + N₃ (x_e - x_b) + μ (N₂ + N₃) z_b = W_b (x_g - x_b)
        drive = mu * floor * pivot.imag
        right = wb * (run.bogie[k] - pivot).real - drive
        n2 = (right - floor * (e - pivot).real) / ((m - pivot).real - (e - pivot).real)
        loads[:] = [wall, n2, floor - n2]
        # upper link about the pivot: N₁ pushes back at height z_a, μ N₁ lifts at x_a
        return wall * (a - pivot).imag + mu * wall * (a - pivot).real - wu * (run.upper[k] - pivot).real

    by_hand = brentq(excess, 0.3, 0.95, xtol=1e-14)
    assert min(loads) > 0.0
    a4, b4 = (part[k : k + 1] for part in station_balance(run))
    assert equal_friction(a4, b4, np.array([True]))[0][0] == pytest.approx(by_hand, abs=1e-10)
    assert least_friction(a4, b4)[0][0] == pytest.approx(by_hand, abs=1e-10)


def stations(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return balance equations and radii of random stations of several rovers."""
    rng = np.random.default_rng(seed)
    parts = []
    for name, back in product(ROVERS, (False, True)):
        rover = rb.load_rover(name)
        r = rover.wheel_radius.max()
        for obstacle in (
            rb.obstacles.step(0.7 * r),
            rb.obstacles.stairs(1.5 * r, 3.5 * r, 3),
            rb.obstacles.ditch(1.7 * r, 3 * r),
        ):
            run = run_over(rover, obstacle, back, 40)
            a, b = station_balance(run)
            radius = np.tile(np.array(run.rover.radius) / run.rover.size, (len(a), 1))
            some = rng.permutation(np.flatnonzero(np.abs(run.contact.real).max(axis=1) > 1e-6))[: count // 30]
            parts.append((a[some], b[some], radius[some]))
    return tuple(np.concatenate(p) for p in zip(*parts, strict=True))  # type: ignore[return-value]


def program(a: np.ndarray, b: np.ndarray, friction: float, radius: np.ndarray) -> float:
    """Return the least largest torque by scipy's linear programming; inf if no forces hold."""
    rows = []
    for i, sign in product(range(3), (1.0, -1.0)):
        cone, most = np.zeros(7), np.zeros(7)
        cone[[i, 3 + i]] = -friction, sign
        most[[3 + i, 6]] = sign * radius[i], -1.0
        rows += [cone, most]
    found = linprog(
        [0.0] * 6 + [1.0], A_ub=np.array(rows), b_ub=np.zeros(len(rows)), A_eq=np.column_stack([a, np.zeros(4)]), b_eq=b,
        bounds=[(0, None)] * 3 + [(None, None)] * 3 + [(0, None)], method="highs",
    )  # fmt: skip
    return float(found.fun) if found.status == 0 else np.inf


def test_least_torque_equals_linear_programming() -> None:
    a, b, radius = stations(60)
    for mu in (0.4, 0.8, 2.0):
        for k in range(len(a)):
            torque, force = least_torque(a[k : k + 1], b[k : k + 1], radius[k], mu)
            expected = program(a[k], b[k], mu, radius[k])
            assert np.isinf(expected) == np.isinf(torque[0]) or abs(least_friction(a[k : k + 1], b[k : k + 1])[0][0] - mu) < 1e-6
            if np.isfinite(expected) and np.isfinite(torque[0]):
                assert torque[0] == pytest.approx(expected, abs=1e-8)
                assert np.abs(a[k] @ force[0] - b[k]).max() < 1e-9
                assert (np.abs(force[0, 3:]) <= mu * force[0, :3] + 1e-8).all()


def test_least_friction_is_the_edge_of_what_linear_programming_can_hold() -> None:
    a, b, radius = stations(240, seed=1)
    mu, force = least_friction(a, b)
    held = np.isfinite(mu)
    assert held.sum() > 100
    for k in range(len(a)):
        if not held[k]:
            assert np.isinf(program(a[k], b[k], 60.0, radius[k]))
            continue
        assert np.abs(a[k] @ force[k] - b[k]).max() < 1e-9
        assert (force[k, :3] >= -1e-9).all()
        assert (np.abs(force[k, 3:]) <= mu[k] * force[k, :3] + 1e-8).all()
        assert np.isfinite(program(a[k], b[k], mu[k] * (1 + 1e-4) + 1e-5, radius[k]))
        assert np.isinf(program(a[k], b[k], mu[k] * (1 - 1e-4) - 1e-5, radius[k])) or mu[k] < 1e-5


def test_wheels_that_press_against_each_other_need_less_friction() -> None:
    """Compare with linear programming where harder pressed wheels need less friction."""
    rover = rb.load_rover("rocky7")
    radius = rover.wheel_radius.max()
    a, b = station_balance(run_over(rover, rb.obstacles.stairs(1.3 * radius, 3.0 * radius, 3), False, 100))
    mu, force = least_friction(a, b)
    total = force[:, :3].sum(axis=1)
    pressed = np.flatnonzero(total > 0.99 * WEDGED)
    assert pressed.size
    for k in pressed:
        assert total[k] == pytest.approx(WEDGED, abs=1e-9)
        assert np.abs(a[k] @ force[k] - b[k]).max() < 1e-9
        assert (np.abs(force[k, 3:]) <= mu[k] * force[k, :3] + 1e-8).all()
        assert holds_pressed(a[k], b[k], mu[k] * (1 + 1e-6))
        assert not holds_pressed(a[k], b[k], mu[k] * (1 - 1e-6))


def holds_pressed(a: np.ndarray, b: np.ndarray, friction: float) -> bool:
    """Return True if forces hold whose normal forces add up to at most `WEDGED` weights."""
    rows = [[1.0] * 3 + [0.0] * 3]
    for i, sign in product(range(3), (1.0, -1.0)):
        row = [0.0] * 6
        row[i], row[3 + i] = -friction, sign
        rows.append(row)
    found = linprog(
        [0.0] * 6, A_ub=rows, b_ub=[WEDGED] + [0.0] * 6, A_eq=a, b_eq=b,
        bounds=[(0, None)] * 3 + [(None, None)] * 3, method="highs",
    )  # fmt: skip
    return bool(found.status == 0)


@pytest.mark.parametrize("name", ["curiosity", "osr"])
def test_least_friction_equals_that_of_the_whole_mechanism(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compare with `wheel_loads`: nine equations, cones in space, no symmetry."""
    rover = rb.load_rover(name)
    run = rb.climb(rover, rb.obstacles.step(1.3 * rover.wheel_radius.max()), friction=0.8)
    keep = np.linspace(0, run.distance.size - 1, 60).astype(int)
    n = keep.size
    q = np.zeros((n, 6))
    q[:, 0], q[:, 2], q[:, 4], q[:, 5] = run.z[keep], run.pitch[keep], run.bogie[keep], run.bogie[keep]
    point, normal = np.zeros((n, 6, 3)), np.zeros((n, 6, 3))
    point[..., 0] = run.contact_point[keep, :, 0] - run.x[keep, None]
    point[..., 1] = rover.hubs[:, 1]
    point[..., 2] = run.contact_point[keep, :, 1] - run.z[keep, None]
    normal[..., [0, 2]] = run.contact_normal[keep]
    none = np.full((1, BELLY, 3), np.nan)
    packed = PackedContacts(
        rover.packed, np.zeros(n), np.zeros((1, 6)), q, point, normal, np.zeros((1, 6, 3)), np.zeros((n, 3), dtype=np.int8),
        none, none,
    )  # fmt: skip
    monkeypatch.setattr("rockerbogie.statics.loads.pack_contacts", lambda pose: packed)
    required = rb.wheel_loads(rb.settle(rover, rb.surfaces.plane(size=8.0), np.zeros(n), 0.0, 0.0)).required_friction
    assert np.isfinite(required).all()
    assert np.abs(required - run.required_friction[keep]).max() < 2e-6


@pytest.mark.parametrize("name", ROVERS)
def test_tractions_do_the_work_of_climbing(name: str) -> None:
    """Compare the work of the motors with the rise of the centre of mass."""
    rover = rb.load_rover(name)
    run = run_over(rover, rb.obstacles.step(1.4 * rover.wheel_radius.max()), False, 400)
    a, b = station_balance(run)
    mu, force = least_friction(a, b)
    move = np.diff(run.hub, axis=0) * np.conj(-1j * run.contact)[1:]  # along the tangent
    rise = np.diff((run.rover.upper_mass * run.upper + run.rover.bogie_mass * run.bogie).imag) / run.rover.mass
    upper, bogie = (-np.diff(np.unwrap(np.angle(v))) for v in (run.hub[:, 0] - run.pivot, run.hub[:, 2] - run.hub[:, 1]))
    turn = np.array(run.rover.radius) * np.stack([upper, bogie, bogie], axis=1)
    mean = 0.5 * (force[1:, 3:] + force[:-1, 3:])
    smooth = np.isfinite(mu[1:] + mu[:-1]) & (np.abs(np.diff(run.contact, axis=0)).max(axis=1) < 0.02)
    # interval by interval, with the tractions of any forces that balance
    assert np.abs(((mean * (move.real - turn)).sum(axis=1) - rise)[smooth]).max() < 2e-5 * run.rover.size


def test_loads_on_level_terrain_are_those_of_wheel_loads() -> None:
    rover = rb.load_rover("rocky7")
    run = rb.climb(rover, rb.obstacles.step(0.02), friction=0.7)
    pose = rb.settle(rover, rb.surfaces.plane(size=4.0), 0.0, 0.0, 0.0)
    loads = rb.wheel_loads(pose, law="vertical")
    assert np.allclose(run.normal[0], loads.normal, atol=1e-6 * rover.mass)
    assert run.required_friction[0] == 0.0


# -- verdicts -----------------------------------------------------------------------------------------------------


def test_steeper_friction_limit_is_met_exactly() -> None:
    rover, step = rb.load_rover("curiosity"), rb.obstacles.step(0.2)
    needed = rb.climb(rover, step, friction=1.0).friction_needed
    assert rb.climb(rover, step, friction=needed).climbed
    short = rb.climb(rover, step, friction=0.999 * needed)
    assert (short.climbed, short.limit, short.phase) == (False, "friction", "rear wheels on the edge")
    assert set(short.wheels) == {"LR", "RR"}


def test_the_torque_of_the_rovers_motors_is_the_default_limit() -> None:
    strong, step = rb.load_rover("curiosity"), rb.obstacles.step(0.25)
    free = rb.climb(strong, step, friction=0.9)
    assert np.isinf(free.torque_limit)
    needed = free.required_torque[free.uphill].max()
    weak = strong.replace(wheel_torque=0.9 * needed)
    stalled = rb.climb(weak, step, friction=0.9)
    assert stalled.limit == "torque"
    assert stalled.torque_limit == pytest.approx(0.9 * needed)
    assert rb.climb(weak, step, friction=0.9, torque=np.inf).climbed
    assert rb.limits_of(weak, friction=0.9).torque_limit == pytest.approx(0.9 * needed)


def test_torque_limit_is_met_exactly() -> None:
    rover, step = rb.load_rover("curiosity"), rb.obstacles.step(0.2)
    free = rb.climb(rover, step, friction=0.9)
    needed = free.required_torque[free.uphill].max()
    assert rb.climb(rover, step, friction=0.9, torque=needed).climbed
    short = rb.climb(rover, step, friction=0.9, torque=0.999 * needed)
    assert short.limit == "torque"
    assert "N m suffice" in short.verdict
    mars = rb.climb(rover, step, friction=0.9, gravity=rb.GRAVITY["mars"])
    assert mars.required_torque[mars.uphill].max() == pytest.approx(needed * rb.GRAVITY["mars"] / rb.GRAVITY["earth"])


def test_each_limit_is_named() -> None:
    rover = rb.load_rover("curiosity")
    step = rb.obstacles.step(0.4)
    assert rb.climb(rover, step, friction=0.9).climbed
    assert rb.climb(rover.replace(bogie_limits=(-0.1, 0.1)), step, friction=0.9).limit == "joint_limit"
    low = rover.replace(body_box=[[-0.6, -0.4, 0.1], [0.7, 0.4, 1.2]], masses="keep")
    assert rb.climb(low, step, friction=0.9).limit == "belly"
    top_heavy = rover.replace(body=rb.Link(rover.body.mass, rover.body.com + (0.0, 0.0, 4.0), rover.body.inertia))
    assert rb.climb(top_heavy, rb.obstacles.ramp(0.6, 3.0), friction=60.0).limit == "tip_over"
    assert rb.climb(rover, rb.obstacles.step(0.4), friction=0.5).limit == "friction"


def test_wheels_that_would_pull_at_equal_slip_are_marked() -> None:
    rover = rb.load_rover("sawppy").replace(
        bogie_limits=(-np.inf, np.inf), rocker_limits=(-np.inf, np.inf), wheel_width=0.0, masses="keep"
    )
    step = rb.obstacles.step(1.59 * float(rover.wheel_radius.max()))
    run = rb.climb(rover, step, friction=0.95, law="equal_slip")
    assert run.climbed
    assert np.array_equal(run.unloaded[run.uphill].any(axis=0), [False, False, True, True, False, False])
    assert "LM and RM carry no load" in run.verdict
    at = np.flatnonzero(run.unloaded[:, 2] & run.uphill)
    assert (run.normal[at, 2] == 0.0).all()
    assert (run.traction[at, 2] == 0.0).all()
    assert not rb.climb(rover, step, friction=0.95).unloaded.any()
    assert run.to_dataset()["unloaded"].dims == ("station", "wheel")


def test_sliding_down_does_not_end_a_climb() -> None:
    rover = rb.load_rover("curiosity")
    down = rb.obstacles.profile([0.0, 4.0], [0.0, -2.0])
    run = rb.climb(rover, down, friction=0.1)
    assert run.climbed
    assert run.slides.any()
    assert not rb.climb(rover, down, friction=0.6).slides.any()


def test_friction_on_a_ramp_is_its_slope_once_all_wheels_are_on_it() -> None:
    rover = rb.load_rover("rocky7")
    run = rb.climb(rover, rb.obstacles.ramp(0.3, 0.6), friction=0.7)
    on = np.abs(np.arctan2(-run.contact_normal[..., 0], run.contact_normal[..., 1]) - 0.3).max(axis=1) < 1e-9
    assert on.sum() > 10
    assert np.abs(run.required_friction[on] - np.tan(0.3)).max() < 1e-9


# -- limits -------------------------------------------------------------------------------------------------------


def test_slopes_are_limited_by_friction_or_tipping() -> None:
    rover = rb.load_rover("curiosity")
    limits = rb.limits_of(rover, friction=0.5)
    for name in ("slope_up", "slope_down", "slope_across"):
        assert getattr(limits, name) == pytest.approx(np.arctan(0.5), abs=4e-4)
        assert limits.why[name] == "friction"
    weight = rover.mass * 9.80665
    assert limits.slope_torque >= weight * np.sin(limits.slope_up) * 0.25 / 6 * (1 - 1e-6)
    half = rb.limits_of(rover, friction=0.5, torque=0.5 * limits.slope_torque)
    assert half.why["slope_up"] == "torque"
    assert half.slope_up < limits.slope_up
    assert half.step_forward <= limits.step_forward


def test_across_slope_tips_where_the_lower_wheels_are() -> None:
    rover = rb.load_rover("curiosity").replace(body_box=[[-0.6, -0.4, 0.6], [0.7, 0.4, 1.2]], masses="keep")
    limits = rb.limits_of(rover, friction=20.0)
    centre = sum(k.mass * k.com for k in rover.links) / rover.mass
    height = centre[2] - float((rover.hubs[:, 2] - rover.wheel_radius).mean())
    # the outer edges of the lower treads carry all: corner wheels are nearer than middle wheels
    track = np.abs(rover.hubs[:, 1]) + rover.wheel_width / 2
    assert np.arctan(track.min() / height) < limits.slope_across < np.arctan(track.max() / height)


def test_across_slope_is_that_of_the_worse_side() -> None:
    rover = rb.load_rover("curiosity").replace(body_box=[[-0.6, -0.4, 0.6], [0.7, 0.4, 1.2]], masses="keep")
    body = rover.body
    left, right = (
        rover.replace(body=rb.Link(body.mass, body.com + [0.0, y, 0.0], body.inertia), masses="keep") for y in (0.2, -0.2)
    )
    found = [rb.limits_of(r, friction=3.0).slope_across for r in (rover, left, right)]
    assert found[1] == pytest.approx(found[2], abs=1e-4)
    assert found[1] < found[0] - 0.03


def test_unequal_masses_of_both_sides_are_added_up() -> None:
    rover = rb.load_rover("curiosity")
    uneven = [rb.Link(w.mass * (1.6, 0.4)[i % 2], w.com, w.inertia) for i, w in enumerate(rover.wheels)]
    heavy_left = rover.replace(wheels=uneven, masses="keep")
    got, expected = planar_rover(heavy_left, False), planar_rover(rover, False)
    for name in ("upper_mass", "bogie_mass", "upper", "bogie"):
        assert getattr(got, name) == pytest.approx(getattr(expected, name), rel=1e-12)


def test_highest_step_is_where_climb_begins_to_fail() -> None:
    rover = rb.load_rover("curiosity")
    limits = rb.limits_of(rover, friction=0.6)
    for direction in ("forward", "backward"):
        size = getattr(limits, f"step_{direction}")
        assert rb.climb(rover, rb.obstacles.step(0.99 * size), friction=0.6, direction=direction).climbed
        failed = rb.climb(rover, rb.obstacles.step(1.01 * size), friction=0.6, direction=direction)
        assert failed.limit == limits.why[f"step_{direction}"]


# -- published facts ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["curiosity", "perseverance"])
def test_walls_need_about_the_published_friction(name: str) -> None:
    rover = rb.load_rover(name)
    forward, backward = (step_friction(rover, [2.0 * rover.wheel_radius.max()], d)[0][0] for d in ("forward", "backward"))
    assert 0.7 < forward < 0.8
    assert backward < forward - 0.15  # the flown rovers climb better backward


def test_open_source_rover_climbs_its_step_but_not_its_stairs() -> None:
    rover, inch = free_rover("osr"), 0.0254
    step = rb.climb(rover, rb.obstacles.step(7.75 * inch), friction=0.61)
    assert step.climbed
    stairs = rb.climb(rover, rb.obstacles.stairs(7.75 * inch, 10 * inch, 4), friction=0.61)
    assert not stairs.climbed
    assert stairs.phase == "front and middle wheels on the face"
    strong = rb.climb(rover, rb.obstacles.stairs(7.75 * inch, 10 * inch, 4), friction=1.5)
    assert strong.phase == "middle and rear wheels on the face"
    assert strong.friction_needed == pytest.approx(13.6, abs=0.05)
    slipping = rb.climb(rover, rb.obstacles.stairs(7.75 * inch, 10 * inch, 4), friction=1.5, law="equal_slip")
    assert slipping.phase == "middle and rear wheels on the face"
    assert np.isinf(slipping.friction_needed)


# -- input and output ---------------------------------------------------------------------------------------------


def test_bad_obstacles_are_refused() -> None:
    o = rb.obstacles
    for make in (
        lambda: o.step(0.0), lambda: o.step(np.nan), lambda: o.step("high"), lambda: o.ditch(1.0, -1.0), lambda: o.ramp(1.6, 1.0),
        lambda: o.stairs(0.1, 0.2, 0), lambda: o.stairs(0.1, 0.2, 2.5), lambda: o.profile([0.0], [0.0]),
        lambda: o.profile([0, 1, 0.5], [0, 0, 0]), lambda: o.profile([0, np.nan], [0, 0]), lambda: o.profile([0, 1], [0, 0, 1]),
        lambda: o.profile([0, 0, 0, 1], [0, 1, 0, 0]),
        lambda: o.profile([[0, 1]], [[0, 1]]), lambda: o.profile(["a", 1], [0, 0]),
    ):  # fmt: skip
        with pytest.raises(rb.TerrainError):
            make()


def test_bad_arguments_are_refused() -> None:
    rover, step = rb.load_rover("osr"), rb.obstacles.step(0.05)
    for change in (
        {"friction": -0.1}, {"friction": np.nan}, {"friction": "0.7"}, {"torque": 0.0}, {"torque": -np.inf},
        {"torque": np.nan}, {"gravity": 0.0}, {"direction": "sideways"}, {"law": "magic"},
    ):  # fmt: skip
        with pytest.raises(RockerbogieError):
            rb.climb(rover, step, **({"friction": 0.7} | change))
    with pytest.raises(RockerbogieError, match="obstacles"):
        rb.climb(rover, 0.2, friction=0.7)
    with pytest.raises(RockerbogieError, match="load_rover"):
        rb.climb("osr", step, friction=0.7)
    nothing = rb.Link(0.0, np.zeros(3), np.zeros((3, 3)))
    massless = replace(rover, body=nothing, rockers=(nothing,) * 2, bogies=(nothing,) * 2, wheels=(nothing,) * 6)
    for function in (lambda: rb.climb(massless, step, friction=0.7), lambda: rb.limits_of(massless, friction=0.7)):
        with pytest.raises(RockerbogieError, match="mass"):
            function()
    crooked = rover.replace(hubs=rover.hubs + np.array([[0.05, 0, 0]] + [[0, 0, 0]] * 5), masses="keep")
    with pytest.raises(RockerbogieError, match="mirror"):
        rb.climb(crooked, step, friction=0.7)


def test_dataset_holds_the_verdict() -> None:
    run = rb.climb(rb.load_rover("osr"), rb.obstacles.step(0.07), friction=0.3)
    data = run.to_dataset()
    assert (data.attrs["climbed"], data.attrs["because"]) == (0, "friction")
    assert data.attrs["fails_at"] == run.distance[run.station]
    assert data["normal"].dims == ("station", "wheel")
    assert data["torque"].attrs["units"] == "N m"
    assert "not climbed" in repr(run)


def test_command_prints_verdicts_and_writes_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plot = tmp_path / "a.png"
    assert main(["climb", "osr", "--step", "0.05", "--plot", str(plot)]) == 0
    assert "climbed" in capsys.readouterr().out
    assert plot.stat().st_size > 10_000
    assert main(["climb", "osr", "--step", "0.07", "--friction", "0.3", "--backward", "--json"]) == 1
    assert '"because": "friction"' in capsys.readouterr().out
    mine = tmp_path / "mine.png"
    mine.write_bytes(b"my picture")
    assert main(["climb", "osr", "--step", "0.05", "--plot", str(mine)]) == 2
    assert mine.read_bytes() == b"my picture"


def test_film_ends_where_the_climb_does(tmp_path: Path) -> None:
    from PIL import Image

    run = rb.climb(rb.load_rover("osr"), rb.obstacles.step(0.07), friction=0.3)
    with pytest.raises(RockerbogieError, match="climb returns"):
        rb.plot.climb("osr")
    assert rb.plot.climb(run, tmp_path / "a.png").axes
    assert rb.plot.steps(run.rover, friction=0.5).axes
    done = []
    file = write_climb_film(tmp_path / "a.gif", run, frames=3, progress=lambda k, n: done.append((k, n)))
    with Image.open(file) as film:
        assert film.n_frames == len(done)
    with pytest.raises(RockerbogieError, match="film"):
        write_climb_film(tmp_path / "a.png", run)


def test_command_refuses_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "p.csv"
    table.write_text("x [m],y [m]\n0,0\n1,1\n")
    for arguments in (
        ["--step", "nan"], ["--step", "0.1", "--ditch", "0.1"], ["--ditch", "1,2,3"], ["--stairs", "0.1,0.2,1.5"],
        ["--ramp", "95,1"], ["--profile", str(table)], ["--plot", "a.png"], ["--step", "0.1", "--film", "a.png"],
        ["--step", "0.1", "--gravity", "pluto"],
    ):  # fmt: skip
        assert main(["climb", "osr", *arguments]) == 2, arguments
        assert capsys.readouterr().err.count("\n") == 1


def test_command_reads_a_profile(tmp_path: Path) -> None:
    table = tmp_path / "kerb.csv"
    table.write_text("x [cm],z [mm]\n0,0\n0,30\n50,30\n")
    assert main(["climb", "osr", "--profile", str(table)]) == 0


@pytest.mark.parametrize(
    ("name", "direction", "height", "friction"),
    [
        ("curiosity", "forward", 0.8, 0.9),
        ("curiosity", "backward", 0.6, 0.38),
        ("osr", "backward", 1.2, 0.55),
        ("osr", "forward", 1.2, 0.9),
    ],
)
def test_verdict_and_axle_agree_with_mujoco(name: str, direction: str, height: float, friction: float) -> None:
    rover = free_rover(name)
    case = Case(rover, direction, height * float(rover.wheel_radius.max()), friction)
    run = predict(case)
    climbed, place = simulate(case)
    assert run.climbed == climbed
    assert place in run.phase
