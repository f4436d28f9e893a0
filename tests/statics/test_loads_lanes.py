"""Lanes of the primal-dual method against the scalar method and plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from test_loads import settled

import rockerbogie as rb
from rockerbogie._kernels.jit.vectors import LANES, NumpyRows
from rockerbogie._kernels.statics import primal_dual
from rockerbogie._kernels.statics.lane_friction import UNSOLVED, friction_batch
from rockerbogie._kernels.statics.lane_rows import CONTACTS, PROBLEM, RAY, RESULT, ROWS, STATE, VECTORS, WHEEL, WHEELS
from rockerbogie.settling.settle import settle_with_contacts
from rockerbogie.statics.contacts import pack_contacts


def random_lanes(rng: np.random.Generator) -> np.ndarray:
    """Return a lane array of random problems, at the start of the way to the central point."""
    rows = np.zeros((ROWS, LANES))
    normal = rng.normal(size=(3, CONTACTS, LANES)) * 0.2
    normal[2] = 1.0
    normal /= np.linalg.norm(normal, axis=0)
    rows[WHEEL.normal : WHEEL.normal + VECTORS] = normal.reshape(VECTORS, LANES)
    rows[WHEEL.point : WHEEL.point + 3 * VECTORS] = rng.normal(size=(3 * VECTORS, LANES))
    rows[WHEEL.on : WHEEL.on + CONTACTS] = 1.0
    rows[PROBLEM.b : PROBLEM.b + 10] = rng.normal(size=(10, LANES))
    rows[PROBLEM.e : PROBLEM.e + 10] = rng.normal(size=(10, LANES))
    rows[PROBLEM.limit + 3], rows[PROBLEM.sign + 3], rows[PROBLEM.cones] = 1.0, 1.0, 7.0
    rows[PROBLEM.target], rows[PROBLEM.free] = 0.1, 1.0
    rows[STATE.force : STATE.force + VECTORS] = 0.3 * normal.reshape(VECTORS, LANES)
    rows[STATE.speed : STATE.speed + VECTORS] = normal.reshape(VECTORS, LANES)
    rows[STATE.y : STATE.y + 8] = 0.5
    rows[RAY.x], rows[RAY.y] = 0.6, 0.8
    rows[STATE.mu], rows[STATE.price] = 0.8, 0.4
    return rows.reshape(-1)


@pytest.mark.parametrize("contacts", [WHEELS, CONTACTS])
def test_compiled_lanes_agree_with_numpy(contacts: int) -> None:
    from rockerbogie._kernels.jit.decorators import njit

    @njit
    def run(lanes: np.ndarray) -> None:
        primal_dual.turn_step(lanes, contacts)

    lanes = random_lanes(np.random.default_rng(1))
    plain = lanes.copy()
    run(lanes)
    with np.errstate(all="ignore"):
        primal_dual.step(NumpyRows(plain), False, contacts)
    np.testing.assert_allclose(lanes, plain, rtol=1e-7, atol=1e-9)
    assert (plain.reshape(ROWS, LANES)[RESULT.alpha] > 0.0).all()


def test_loads_do_not_depend_on_the_other_poses_of_a_batch() -> None:
    pose = settled("osr", 3, 40, "equilibrium", "rocks")
    many = rb.wheel_loads(pose)
    for k in (0, 13, 39):
        one = rb.wheel_loads(rb.settle(pose.rover, pose.terrain, pose.x[k], pose.y[k], pose.yaw[k], mode="equilibrium"))
        np.testing.assert_array_equal(one.normal, many.normal[k])
        np.testing.assert_array_equal(one.friction_bound, many.friction_bound[k])


@pytest.mark.parametrize(("name", "surface"), [("curiosity", "mars"), ("osr", "rocks"), ("elhami-dashti", "rocks")])
def test_contacts_of_lanes_are_those_of_the_pose(name: str, surface: str) -> None:
    """Compare on smooth cells, at ridges and where treads touch along their whole width."""
    pose = settled(name, 5, 400, surface=surface)
    level = rb.surfaces.plane(interpolation="linear")
    for terrain, x, y, yaw in ((pose.terrain, pose.x, pose.y, pose.yaw), (level, np.linspace(-1.0, 1.0, 9), 0.3, 0.7)):
        many, touch = settle_with_contacts(pose.rover, terrain, x, y, yaw, "contact", 9.81)
        assert np.isfinite(touch).all(axis=(1, 2)).mean() > 0.9
        slow, fast = pack_contacts(many), pack_contacts(many, touch)
        np.testing.assert_allclose(fast.point, slow.point, atol=1e-6)  # known to the root of the gap's rounding
        np.testing.assert_allclose(fast.normal, slow.normal, atol=1e-6)
        np.testing.assert_allclose(np.broadcast_to(fast.span, slow.span.shape), slow.span, atol=1e-12)
        assert (slow.span != 0.0).any() == (terrain is level and bool(pose.rover.wheel_width.any()))


def test_contacts_are_kept_only_of_poses_that_lanes_settle() -> None:
    """Compare with `Pose.contacts`: missing data, off the map, equilibrium, cubic terrain."""
    rover, x = rb.load_rover("curiosity"), np.linspace(-9.0, 9.0, 60)
    for interpolation in ("linear", "cubic"):
        ground = rb.surfaces.fractal(2, size=16.0, spacing=1.0, interpolation=interpolation)
        z = ground.z.copy()
        z[8, 9] = np.nan
        holed = rb.Terrain.from_array(z, ground.spacing, ground.origin, interpolation=interpolation)
        for terrain in (ground, holed):
            for mode in ("contact", "equilibrium"):
                pose, touch = settle_with_contacts(rover, terrain, x, 0.5, 0.1, mode, 9.81)
                plain = rb.settle(rover, terrain, x, 0.5, 0.1, mode=mode)
                np.testing.assert_array_equal(pose.q, plain.q)
                assert np.isnan(pose.z).any()
                assert len(touch) == (60 if mode == "contact" and interpolation == "linear" else 0)
                slow, fast = pack_contacts(plain), pack_contacts(pose, touch)
                there = ~np.isnan(pose.z)
                np.testing.assert_allclose(fast.point[there], slow.point[there], atol=1e-6)
                np.testing.assert_allclose(fast.normal[there], slow.normal[there], atol=1e-6)


def test_lanes_prove_the_minimum_where_some_contacts_stay_in_place() -> None:
    """Test terrain on which one pose in thirty has such a contact in the motion of the proof."""
    rover, terrain = rb.load_rover("curiosity"), rb.surfaces.fractal(2, size=80.0, spacing=1.0, interpolation="linear")
    x = np.linspace(-30.0, 30.0, 40)
    pose = rb.settle(rover, terrain, x, x[:, None], 0.0)
    packed, n = pack_contacts(pose), pose.status.size
    field, gap = np.array([[0.0, 0.0, -1.0]]), 1e-7
    force, torque, limit = np.empty((n, 6, 3)), np.empty((n, 6)), np.empty((n, 3))
    required, bound, belly, status = np.empty(n), np.empty(n), np.empty(n), np.empty(n, dtype=np.uint8)
    friction_batch(
        *packed[:9], field, np.zeros(1), gap, force, torque, required, bound, limit, belly, status, 0, 0, n
    )  # fmt: skip
    placed = np.isfinite(pose.z.ravel())
    assert placed.sum() > 1500
    assert (status[placed] == UNSOLVED).mean() < 1e-3
    held = placed & (status != UNSOLVED)
    assert (required - bound)[held].max() < 1.1e-5  # PROVED times gap, and rounding
    stays = np.linalg.norm(force[..., 1:], axis=-1) < 0.99 * required[:, None] * force[..., 0]
    assert stays[held].any(axis=1).mean() > 0.01
