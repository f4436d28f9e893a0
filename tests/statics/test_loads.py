"""Contact forces against closed forms, a conic solver and the balance of every body."""

from __future__ import annotations

import clarabel
import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray

import rockerbogie as rb
from rockerbogie.rover.rotations import rotation_y
from rockerbogie.statics.loads import _spread

Array = NDArray[np.float64]
SIDE = np.array([0, 1, 0, 1, 0, 1])
LAWS = ("least_friction", "equal_torque", "equal_slip", "frictionless_sides", "vertical")


def level_rover(ahead: float = 0.0) -> rb.Rover:
    """Return a rover of one wheel spacing whose mass is in the body, at (2 x1 + x2) / 3 + ahead."""
    x1, x2, x3 = -0.5, 0.0, 0.5  # rocker wheel, middle wheel, bogie's other wheel: the front is the bogie's end
    body = rb.Link(100.0, np.array([(x1 + 2 * (x2 + x3) / 2) / 3 + ahead, 0.0, 0.3]), np.eye(3))
    light = rb.Link(0.0, np.zeros(3), np.zeros((3, 3)))
    return rb.Rover.from_pivots(
        wheel_radius=0.1,
        rocker_pivot=(0.0, 0.4, 0.3),
        bogie_pivot=((x2 + x3) / 2, 0.4, 0.2),
        hubs=[(x1, 0.4, 0.1), (x2, 0.4, 0.1), (x3, 0.4, 0.1)],
        body=body,
        rockers=[light] * 2,
        bogies=[light] * 2,
        wheels=[light] * 6,
    )


def link_wrenches(pose: rb.Pose, loads: rb.WheelLoads, k: int, gravity: Array | None = None) -> Array:
    """Return the nine sums that must vanish.

    Force and moment on the whole, moments of the rockers and of both bogies about their pivots.
    Written from the geometry alone, with every link apart and the pivots' inner forces eliminated by hand. Gravity, (3,) m/s², is
    Earth's by default.
    """
    rover, R, o = pose.rover, pose.T_world_body[k, :3, :3], pose.T_world_body[k, :3, 3]
    arms = (pose.rocker[k], rover.right_rocker(pose.rocker[k]))
    y = R[:, 1]
    axle = rb.wheel_frames(rover, pose.rocker[k], pose.bogie[k], pose.steering[k])
    g = np.array([0.0, 0.0, -rb.GRAVITY["earth"]]) if gravity is None else gravity
    whole, rocker, bogie = np.zeros(6), np.zeros(2), np.zeros(2)
    pivot = [R @ rover.rocker_pivot[s] for s in (0, 1)]
    bogie_pivot_point = [pivot[s] + R @ rotation_y(arms[s]) @ (rover.bogie_pivot[s] - rover.rocker_pivot[s]) for s in (0, 1)]

    def add(p: Array, f: Array, side: int, on_rocker: bool, on_bogie: bool) -> None:
        whole[:3] += f
        whole[3:] += np.cross(p, f)
        if on_rocker:
            rocker[side] += y @ np.cross(p - pivot[side], f)
        if on_bogie:
            bogie[side] += y @ np.cross(p - bogie_pivot_point[side], f)

    add(R @ rover.body.com, rover.body.mass * g, 0, False, False)
    for s in (0, 1):
        link = rover.rockers[s]
        add(pivot[s] + R @ rotation_y(arms[s]) @ (link.com - rover.rocker_pivot[s]), link.mass * g, s, True, False)
        link = rover.bogies[s]
        turn = rotation_y(arms[s] + pose.bogie[k, s])
        add(bogie_pivot_point[s] + R @ turn @ (link.com - rover.bogie_pivot[s]), link.mass * g, s, True, True)
    for i in range(6):
        link = rover.wheels[i]
        add(R @ (axle[i, :3, 3] + axle[i, :3, :3] @ (link.com - rover.hubs[i])), link.mass * g, SIDE[i], True, i >= 2)
        if loads.normal[k, i] != 0.0:
            n = pose.contact_normal[k, i]
            t = np.cross(R @ axle[i, :3, 1], n)
            t /= np.linalg.norm(t)
            f = loads.normal[k, i] * n + loads.traction[k, i] * t + loads.side[k, i] * np.cross(n, t)
            add(pose.contact_point[k, i] - o, f, SIDE[i], True, i >= 2)
    # the differential ties the rockers: the moment that it puts on the right one, it takes from the left one
    slope = float(np.polynomial.polynomial.polyval(pose.rocker[k], np.polynomial.polynomial.polyder(rover.differential)))
    return np.concatenate([whole, [rocker[0] + slope * rocker[1]], bogie]) + [*np.zeros(6), *loads.joint_torque[k]]


def settled(name: str, seed: int, count: int, mode: str = "contact", surface: str = "mars") -> rb.Pose:
    """Return random settled poses of a preset."""
    rover = rb.load_rover(name)
    terrain = getattr(rb.surfaces, surface)(seed=seed)
    rng = np.random.default_rng(seed)
    low, high = terrain.x[0] + rover.wheelbase, terrain.x[-1] - rover.wheelbase
    x, y = rng.uniform(low, high, (2, count))
    return rb.settle(rover, terrain, x, y, rng.uniform(-np.pi, np.pi, count), mode=mode)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["curiosity", "rocky7", "elhami-dashti"])
def test_every_body_balances(name: str, law: str) -> None:
    pose = settled(name, 3, 60)
    loads = rb.wheel_loads(pose, law=law)
    held = np.flatnonzero(loads.status == rb.LoadStatus.BALANCED)
    assert held.size >= (40 if law in ("least_friction", "vertical") else 10)
    weight = pose.rover.mass * rb.GRAVITY["earth"]
    for k in held:
        assert np.abs(link_wrenches(pose, loads, k)).max() < 1e-9 * weight


def test_equilibrium_balances_with_wheels_off_the_ground_and_joints_at_limits() -> None:
    pose = settled("curiosity", 4, 300, "equilibrium", "rocks")
    loads = rb.wheel_loads(pose)
    special = (pose.wheel_lifted.any(axis=-1) | (pose.joint_stop != 0).any(axis=-1)) & (loads.status == 0)
    weight = pose.rover.mass * rb.GRAVITY["earth"]
    for k in np.flatnonzero(special & (loads.belly == 0.0)):
        assert np.abs(link_wrenches(pose, loads, k)).max() < 1e-9 * weight
        assert (loads.normal[k, pose.wheel_lifted[k]] == 0.0).all()


def test_loads_are_equal_where_the_closed_form_says_so() -> None:
    pose = rb.settle(level_rover(), rb.surfaces.plane(), 0.0, 0.0)
    for law in LAWS:
        loads = rb.wheel_loads(pose, law=law)
        W = 100.0 * rb.GRAVITY["earth"]
        if law != "least_friction":
            np.testing.assert_allclose(loads.normal / W, 1 / 6, atol=1e-12)
        assert loads.required_friction < 1e-8


def test_a_load_shifted_ahead_follows_the_closed_form() -> None:
    e, p, W = 0.06, 0.5, 100.0 * rb.GRAVITY["earth"]
    pose = rb.settle(level_rover(e), rb.surfaces.plane(), 0.0, 0.0)
    for law in ("vertical", "equal_torque", "equal_slip", "frictionless_sides"):
        n = rb.wheel_loads(pose, law=law).normal
        # the bogie, here in front, carries two thirds of W and what the shift adds; half of it on each of its wheels
        share = W / 3 * (1 + e / p)
        np.testing.assert_allclose([n[0] + n[1], n[2] + n[3], n[4] + n[5]], [W - 2 * share, share, share], atol=1e-12 * W)


@pytest.mark.parametrize("name", ["curiosity", "sawppy"])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("heading", [0.0, 0.3, 2.0])
def test_wide_wheels_carry_the_same_on_both_sides_of_level_terrain(name: str, interpolation: str, heading: float) -> None:
    rover = rb.load_rover(name)
    pose = rb.settle(rover, rb.surfaces.plane(interpolation=interpolation), 0.01, 0.02, heading, mode="equilibrium")
    weight = rover.mass * rb.GRAVITY["earth"]
    thin = rb.settle(rover.replace(wheel_width=0.0, masses="keep"), pose.terrain, 0.01, 0.02, heading, mode="equilibrium")
    for forces in (pose.support, *(rb.wheel_loads(pose, law=law).normal for law in ("vertical", "equal_torque"))):
        np.testing.assert_allclose(forces[0::2], forces[1::2], rtol=0.0, atol=1e-9 * weight)
        np.testing.assert_allclose(forces, thin.support, rtol=0.0, atol=1e-9 * weight)


def test_least_friction_of_wide_wheels_is_that_of_the_whole_line() -> None:
    """On a slope that the middles of the treads cannot hold, forces at their lower ends do."""
    rover = level_rover().replace(wheel_width=0.2, masses="keep")
    limit, outer = np.arctan2(0.4, 0.3), np.arctan2(0.5, 0.3)
    for slope in (0.5 * limit, 0.5 * (limit + outer)):
        loads = rb.wheel_loads(rb.settle(rover, plane(slope), 0.0, 0.0, 0.5 * np.pi))
        assert loads.required_friction == pytest.approx(np.tan(slope), abs=1e-6)
        assert loads.required_friction - loads.friction_bound < 1e-6
        up, down = loads.normal[0::2].sum(), loads.normal[1::2].sum()
        assert up + down == pytest.approx(rover.mass * rb.GRAVITY["earth"] * np.cos(slope), rel=1e-9)


@pytest.mark.parametrize("pitch", [10.0, -25.0, 35.0])
def test_friction_on_a_plane_is_the_tangent_of_its_slope(pitch: float) -> None:
    for yaw in (0.0, 0.7, np.pi / 2):
        pose = rb.settle(rb.load_rover("curiosity"), plane(np.radians(pitch)), 0.0, 0.0, yaw)
        loads = rb.wheel_loads(pose)
        assert loads.required_friction == pytest.approx(np.tan(np.radians(abs(pitch))), abs=1e-7)
        assert loads.required_friction - loads.friction_bound < 1e-6


def plane(slope: float) -> rb.Terrain:
    """Return a plane that rises by `slope` along x."""
    x = np.linspace(-5, 5, 41)
    return rb.Terrain.from_array(np.tile(np.tan(slope) * x, (41, 1)), 0.25, origin=(-5, -5), interpolation="linear")


def conic(columns: Array, b: Array, mu: float) -> float:
    """Return by how much the cones of μ must widen until forces balance b; at most 0 if some do."""
    P, q = sp.csc_matrix((19, 19)), np.zeros(19)
    q[18] = 1.0
    rows, right, cones = [np.hstack([columns.reshape(9, 18), np.zeros((9, 1))])], [b], [clarabel.ZeroConeT(9)]
    for i in range(6):
        block = np.zeros((3, 19))
        block[0, 3 * i] = block[0, 18] = -mu
        block[1, 3 * i + 1] = block[2, 3 * i + 2] = -1.0
        rows.append(block)
        right.append(np.zeros(3))
        cones.append(clarabel.SecondOrderConeT(3))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    A = sp.csc_matrix(np.vstack(rows))
    return float(clarabel.DefaultSolver(P, q, A, np.concatenate(right), cones, settings).solve().x[18])


def unit_columns(pose: rb.Pose, k: int) -> tuple[Array, Array]:
    """Return the sums of unit forces (9, 6, 3) and of the negative weight (9,)."""
    one = rb.wheel_loads(pose)
    zero = {"traction": np.zeros_like(one.normal), "side": np.zeros_like(one.normal), "normal": np.zeros_like(one.normal)}

    def with_force(kind: str | None, i: int) -> rb.WheelLoads:
        parts = {name: array.copy() for name, array in zero.items()}
        if kind:
            parts["normal"][k, i] = 1e-30  # the contact is in use
            parts[kind][k, i] = 1.0
        names = ("torque", "required_friction", "friction_bound", "belly", "joint_torque")
        return rb.WheelLoads(**parts, **{n: np.zeros_like(getattr(one, n)) for n in names}, status=one.status, law="vertical")

    weight = link_wrenches(pose, with_force(None, 0), k)
    columns = np.zeros((9, 6, 3))
    for i in range(6):
        for c, kind in enumerate(("normal", "traction", "side")):
            columns[:, i, c] = link_wrenches(pose, with_force(kind, i), k) - weight
    return columns, -weight


@pytest.mark.parametrize("name", ["curiosity", "sawppy", "osr"])
def test_least_friction_agrees_with_a_conic_solver(name: str) -> None:
    pose = settled(name, 7, 12, surface="rocks")
    loads = rb.wheel_loads(pose)
    seen = 0
    for k in np.flatnonzero((loads.status == 0) & (loads.required_friction > 0.01)):
        columns, b = unit_columns(pose, k)
        scale = np.abs(columns[3:]).max()
        columns[3:] /= scale
        b = b / np.abs(b[2]) / np.array([1, 1, 1, *[scale] * 6])
        mu = float(loads.required_friction[k])
        assert conic(columns, b, mu + 2e-6) < 1e-9  # it holds
        assert conic(columns, b, mu - 2e-6) > 0.0  # and less does not
        seen += 1
    assert seen >= 3


def test_least_friction_is_proved_minimal() -> None:
    for name, surface in (("curiosity", "mars"), ("perseverance", "rocks"), ("osr", "rocks")):
        loads = rb.wheel_loads(settled(name, 11, 2000, surface=surface))
        held = loads.status == rb.LoadStatus.BALANCED
        assert held.mean() > 0.95
        gap = (loads.required_friction - loads.friction_bound)[held]
        assert gap.min() > 0.0
        assert (gap < 1e-6).mean() > 0.998
        assert gap.max() < 1e-4


@pytest.mark.parametrize(("name", "slopes"), [("sawppy", (55.0, 56.0, 57.0, 61.0)), ("osr", (55.0, 57.0, 60.0))])
def test_friction_is_found_up_to_the_slope_at_which_the_rover_tips(name: str, slopes: tuple[float, ...]) -> None:
    rover, found = rb.load_rover(name).replace(wheel_width=0.0, masses="keep"), []  # the conic solver's contacts are points
    for slope in slopes:
        pose = rb.settle(rover, plane(np.radians(slope)), 0.0, 0.0, [0.4])
        loads = rb.wheel_loads(pose)
        mu = float(loads.required_friction[0])
        found.append(np.isfinite(mu))
        margin = float(rb.stability(pose, friction=50.0).tip_angle[0])
        if mu == np.inf:
            assert loads.status[0] == rb.LoadStatus.NOT_HELD
            assert margin < np.radians(0.1)  # no coefficient up to 64 holds, so none up to 50
            continue
        assert margin > 0.0 or mu > 50.0
        assert 0.0 < mu - loads.friction_bound[0] < 1e-6 * mu
        columns, b = unit_columns(pose, 0)
        scale = np.abs(columns[3:]).max()
        columns[3:] /= scale
        b = b / np.abs(b[2]) / np.array([1, 1, 1, *[scale] * 6])
        assert conic(columns, b, 1.0001 * mu) < 1e-8
        assert conic(columns, b, 0.9999 * mu) > 1e-8
    assert found[0]
    assert not found[-1]


def test_torque_of_a_locked_wheel_is_traction_times_radius() -> None:
    pose = rb.settle(rb.load_rover("sawppy"), plane(0.3), 0.0, 0.0)
    loads = rb.wheel_loads(pose, law="equal_torque")
    np.testing.assert_allclose(loads.torque, loads.traction * pose.rover.wheel_radius, rtol=1e-9)
    assert np.ptp(loads.torque) < 1e-9 * loads.torque.max()
    assert loads.traction.sum() == pytest.approx(pose.rover.mass * rb.GRAVITY["earth"] * np.sin(0.3), rel=1e-9)


def test_gravity_scales_forces_and_leaves_friction() -> None:
    pose = settled("curiosity", 3, 20)
    earth, mars = rb.wheel_loads(pose), rb.wheel_loads(pose, gravity=rb.GRAVITY["mars"])
    ratio = rb.GRAVITY["mars"] / rb.GRAVITY["earth"]
    np.testing.assert_allclose(mars.required_friction, earth.required_friction, atol=2e-6)
    np.testing.assert_allclose(mars.normal.sum(axis=-1), earth.normal.sum(axis=-1) * ratio, rtol=1e-4)


def test_acceleration_downhill_needs_no_friction_and_drawbar_adds_to_traction() -> None:
    pose = rb.settle(rb.load_rover("curiosity"), plane(0.3), 0.0, 0.0)
    g = rb.GRAVITY["earth"]
    slide = np.array([-np.cos(0.3), 0.0, -np.sin(0.3)]) * g * np.sin(0.3)
    assert rb.wheel_loads(pose, acceleration=slide).required_friction < 1e-6
    flat = rb.settle(rb.load_rover("curiosity"), plane(0.0), 0.0, 0.0)
    loads = rb.wheel_loads(flat, drawbar=500.0, law="equal_torque")
    assert loads.traction.sum() == pytest.approx(500.0, rel=1e-9)


def test_bad_input_is_a_sentence_or_a_status() -> None:
    pose = settled("curiosity", 3, 4)
    for wrong in ({"law": "magic"}, {"gravity": 0.0}, {"gravity": -1.0}, {"gravity": np.nan}, {"drawbar": [1.0, 2.0]},
                  {"acceleration": [1.0, 2.0]},
                  {"acceleration": [0.0, 0.0, -rb.GRAVITY["earth"]]}, {"drawbar": "much"}):  # fmt: skip
        with pytest.raises(rb.RockerbogieError):
            rb.wheel_loads(pose, **wrong)
    for wrong, text in (({"drawbar": np.nan}, "drawbar holds 1 values that are not finite"),
                        ({"drawbar": "3"}, "drawbar must be numbers, not '3'"),
                        ({"acceleration": 0.0}, r"acceleration has shape \(\); its last axis must be 3"),
                        ({"acceleration": [True, False, True]}, "acceleration must be numbers")):  # fmt: skip
        with pytest.raises(rb.RockerbogieError, match=text):
            rb.wheel_loads(pose, **wrong)
    with pytest.raises(rb.RockerbogieError):
        rb.wheel_loads("pose")  # type: ignore[arg-type]
    assert (rb.wheel_loads(pose, acceleration=[0.0, 0.0, 1e300]).status == rb.LoadStatus.NOT_CONVERGED).all()  # no warning either
    off = rb.settle(pose.rover, pose.terrain, 1e4, 0.0)
    loads = rb.wheel_loads(off)
    assert loads.status == rb.LoadStatus.NO_POSE
    assert np.isnan(loads.normal).all()
    assert np.isnan(loads.required_friction)


@pytest.mark.parametrize("value", [0.0, np.zeros(5), np.broadcast_to(1.0, 5), np.broadcast_to(1.0, ())])
def test_forces_reach_kernels_in_the_one_form_that_they_are_compiled_for(value: np.ndarray) -> None:
    got = _spread("drawbar", value, (5,))
    assert got.flags.carray, "a read-only array would compile the kernel again, which takes a minute"
    assert got.shape in ((1,), (5,))


def test_batch_shapes_and_single_pose_agree() -> None:
    rover, terrain = rb.load_rover("curiosity"), rb.surfaces.mars(seed=3)
    x = np.linspace(6.0, 9.0, 6).reshape(2, 3)
    many = rb.wheel_loads(rb.settle(rover, terrain, x, 7.0, 0.2))
    assert many.normal.shape == (2, 3, 6)
    assert many.joint_torque.shape == (2, 3, 3)
    for at in np.ndindex(2, 3):
        one = rb.wheel_loads(rb.settle(rover, terrain, x[at], 7.0, 0.2))
        np.testing.assert_array_equal(one.normal, many.normal[at])
