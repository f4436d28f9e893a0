"""Eqs 6-9 against derivatives of the paper's chain of matrices and against Pinocchio."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.motion.jacobian import JACOBIAN_COLUMNS, SYSTEM_COLUMNS, system_jacobian
from rockerbogie.rover.frames import contact_frames, wheel_frames
from support.helpers import assert_close, paper_rover, random_rover

SHAPES = [(), (1,), (3, 1, 2)]


def random_state(rng, shape, rover):
    angles = SimpleNamespace(
        rocker=np.asarray(rng.uniform(-0.5, 0.5, shape)),
        bogie=rng.uniform(-0.6, 0.6, (*shape, 2)),
        contact_angle=rng.uniform(-1, 1, (*shape, 6)),
    )
    return angles, rng.uniform(-1.2, 1.2, (*shape, 6)) * rover.steers


def uneven(rover: rb.Rover) -> rb.Rover:
    """Return the rover with a nonlinear differential, like that of a bar."""
    return rover.replace(differential=np.array([0.0, -0.97, 0.11, -0.4]))


def eq6(roll: float, side: float, turn: float) -> np.ndarray:
    """Return the motion of the contact frame: forward by rθ + ξ, to the side by η, turned by ζ."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, -s, 0, roll], [s, c, 0, side], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def chain(rover, pose, steering, i, step):
    """Return T_R̄,R of eq. 8 after a step (9,) of the columns' variables, for one pose."""

    def T_body_contact(q):
        turn = np.zeros(6)
        turn[i] = q[3] * rover.steers[i]
        axle = wheel_frames(rover, pose.rocker + q[0], pose.bogie + q[1:3], steering + turn)
        return contact_frames(rover, axle, pose.contact_angle + q[8])[i]

    motion = eq6(rover.wheel_radius[i] * step[4] + step[5], step[6], step[7])
    return T_body_contact(np.zeros(9)) @ motion @ np.linalg.inv(T_body_contact(step))


def differenced(rover, pose, steering, i, h=1e-6):
    """Return J (6, 9) by central differences of the chain."""
    J = np.empty((6, 9))
    for k in range(9):
        step = np.zeros(9)
        step[k] = h
        rate = (chain(rover, pose, steering, i, step) - chain(rover, pose, steering, i, -step)) / (2 * h)
        J[:, k] = [*rate[:3, 3], rate[2, 1], rate[0, 2], rate[1, 0]]
    return J


@pytest.mark.parametrize("shape", SHAPES)
def test_equals_central_differences_of_the_chain(shape):
    rng = np.random.default_rng(4)
    for rover in [paper_rover(), *(uneven(random_rover(rng)) for _ in range(4))]:
        pose, steering = random_state(rng, shape, rover)
        J = rb.wheel_jacobians(rover, pose, steering)
        assert J.shape == (*shape, 6, 6, 9)
        for at in np.ndindex(shape):
            one = SimpleNamespace(rocker=pose.rocker[at], bogie=pose.bogie[at], contact_angle=pose.contact_angle[at])
            for i in range(6):
                expected = differenced(rover, one, steering[at], i)
                assert_close(J[at][i], expected, 1e-7, "(m, rad)/rad", "central differences of eq. 8, h = 1e-6")


def pinocchio_jacobian(pin, rover, pose, steering, i):
    """Return J (6, 9) of wheel i from Pinocchio.

    The tree is R → rocker → bogie → steering → δ → contact → x, y, ζ. In Pinocchio's spatial Jacobian the body is fixed and
    the suspension moves the contact, so that half changes sign.
    """
    model = pin.Model()
    side, hub = i % 2, rover.hubs[i]
    pivot = rover.rocker_pivot[side]
    bogie_pivot = rover.bogie_pivot[side] if i >= 2 else pivot
    post = hub + np.append(rover.steering_offset[i], 0.0)
    place = lambda v: pin.SE3(np.eye(3), np.asarray(v, dtype=float))  # noqa: E731
    parent = 0
    for name, joint, at in [
        ("rocker", pin.JointModelRY(), pivot),
        ("bogie", pin.JointModelRY(), bogie_pivot - pivot),
        ("steering", pin.JointModelRZ(), post - bogie_pivot),
        ("delta", pin.JointModelRY(), hub - post),
        ("x", pin.JointModelPX(), [0, 0, -rover.wheel_radius[i]]),
        ("y", pin.JointModelPY(), [0, 0, 0]),
        ("turn", pin.JointModelRZ(), [0, 0, 0]),
    ]:
        parent = model.addJoint(parent, joint, place(at), name)
    frame = model.addFrame(pin.Frame("contact", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    data = model.createData()
    arm = float(pose.rocker) if side == 0 else float(rover.right_rocker(pose.rocker))
    q = np.array([arm, pose.bogie[side] if i >= 2 else 0.0, steering[i], pose.contact_angle[i], 0.0, 0.0, 0.0])
    S = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.WORLD)
    J = np.zeros((6, 9))
    slope = (
        1.0 if side == 0 else np.polynomial.polynomial.polyval(pose.rocker, np.polynomial.polynomial.polyder(rover.differential))
    )
    J[:, 0] = -S[:, 0] * slope
    if i >= 2:
        J[:, 1 + side] = -S[:, 1]
    J[:, 3] = -S[:, 2] * rover.steers[i]
    J[:, 8] = -S[:, 3]
    J[:, 4], J[:, 5], J[:, 6], J[:, 7] = rover.wheel_radius[i] * S[:, 4], S[:, 4], S[:, 5], S[:, 6]
    return J


@pytest.mark.nojit
def test_equals_pinocchio():
    pin = pytest.importorskip("pinocchio", reason="Pinocchio (pin) is the second opinion; it is not installed")
    rng = np.random.default_rng(5)
    for rover in [paper_rover(), *(uneven(random_rover(rng)) for _ in range(20))]:
        pose, steering = random_state(rng, (), rover)
        J = rb.wheel_jacobians(rover, pose, steering)
        expected = np.stack([pinocchio_jacobian(pin, rover, pose, steering, i) for i in range(6)])
        assert_close(J, expected, 1e-10, "(m, rad)/rad", "the same chain in another library, both analytic")


def test_straight_ahead_on_level_terrain():
    rover = paper_rover()
    level = SimpleNamespace(rocker=0.0, bogie=np.zeros(2), contact_angle=np.zeros(6))
    J = rb.wheel_jacobians(rover, level)
    for i in range(6):
        assert_close(J[i, :, 4], [0.1, 0, 0, 0, 0, 0], 1e-15, "m/rad", "a wheel of 0.1 m radius moves the body forward")
        turn = [rover.hubs[i, 1], -rover.hubs[i, 0], 0, 0, 0, 1]
        assert_close(J[i, :, 7], turn, 1e-15, "m/rad", "turning left about a contact under the hub moves the body across it")
    assert not J[2:, :, 3].any(), "only the paper's rear wheels steer"
    assert JACOBIAN_COLUMNS.index("wheel") == 4


def test_motion_system_stacks_six_wheels():
    rng = np.random.default_rng(6)
    rover = random_rover(rng)
    pose, steering = random_state(rng, (3, 1, 2), rover)
    J, S = rb.wheel_jacobians(rover, pose, steering), system_jacobian(rover, pose, steering)
    rates = rng.normal(size=39)
    assert S.shape == (3, 1, 2, 36, 39)
    named = dict(zip(SYSTEM_COLUMNS, rates, strict=True))
    for i in range(6):
        own = np.array([named[c] if c in named else named[f"{c}_{i}"] for c in JACOBIAN_COLUMNS])
        assert_close((S @ rates)[..., 6 * i : 6 * i + 6], J[..., i, :, :] @ own, 1e-13, "m/s, rad/s", "the same columns")


def test_wrong_calls_are_refused():
    rover = paper_rover()
    level = SimpleNamespace(rocker=0.0, bogie=np.zeros(2), contact_angle=np.zeros(6))
    with pytest.raises(rb.RockerbogieError, match="does not steer"):
        rb.wheel_jacobians(rover, level, [0, 0, 0.1, 0, 0, 0])
    with pytest.raises(rb.RockerbogieError, match=r"contact_angle has shape \(5,\)"):
        rb.wheel_jacobians(rover, SimpleNamespace(rocker=0.0, bogie=np.zeros(2), contact_angle=np.zeros(5)))


@pytest.mark.nojit
def test_given_arrays_are_filled_with_jacobians_and_frames():
    rng = np.random.default_rng(7)
    rover = uneven(random_rover(rng))
    pose, steering = random_state(rng, (5, 7), rover)  # more than one block, and not a whole number of them
    J = rb.wheel_jacobians(rover, pose, steering)
    out, frames = np.full(J.shape, np.nan), np.full((5, 7, 6, 4, 4), np.nan)
    assert rb.wheel_jacobians(rover, pose, steering, out=out, frames=frames) is out
    assert np.array_equal(out, J)
    assert_close(frames, wheel_frames(rover, pose.rocker, pose.bogie, steering), 1e-14, "m", "the same cascade")
    for at in np.ndindex(5, 7):
        one = SimpleNamespace(rocker=pose.rocker[at], bogie=pose.bogie[at], contact_angle=pose.contact_angle[at])
        assert np.array_equal(rb.wheel_jacobians(rover, one, steering[at]), J[at]), "a pose does not depend on its neighbours"


@pytest.mark.nojit
def test_nan_and_very_large_angles():
    rover = paper_rover()
    rng = np.random.default_rng(8)
    pose, steering = random_state(rng, (20,), rover)
    J = rb.wheel_jacobians(rover, pose, steering)
    turns = 2 * np.pi * rng.integers(-(10**6), 10**6, (20, 6))
    pose.contact_angle = pose.contact_angle + turns
    assert_close(rb.wheel_jacobians(rover, pose, steering), J, 1e-8, "m/rad", "whole turns, rounded to 1e-9 rad in the sum")
    pose.rocker[3] = np.nan
    again = rb.wheel_jacobians(rover, pose, steering)
    assert np.isnan(again[3, :, 0, 4]).all()
    assert not again[3, 0, :, 1:3].any(), "a bogie does not carry the rocker's wheel, whatever its angle"
    assert np.isfinite(np.delete(again, 3, axis=0)).all()


def test_arrays_that_cannot_be_filled_are_refused():
    rover = paper_rover()
    level = SimpleNamespace(rocker=np.zeros(3), bogie=np.zeros((3, 2)), contact_angle=np.zeros((3, 6)))
    for out in (np.empty((2, 6, 6, 9)), np.empty((3, 6, 6, 9), dtype=np.float32), np.empty((6, 6, 6, 9))[::2], [0.0]):
        with pytest.raises(rb.RockerbogieError, match=r"numpy.empty\(\(3, 6, 6, 9\)\)"):
            rb.wheel_jacobians(rover, level, out=out)
    with pytest.raises(rb.RockerbogieError, match=r"frames is float64 \(3, 4, 4\)"):
        rb.wheel_jacobians(rover, level, frames=np.empty((3, 4, 4)))


@pytest.mark.nojit
def test_sines_of_many_angles():
    from rockerbogie._kernels.model.sincos import FAR, sincos

    rng = np.random.default_rng(9)
    angle = np.concatenate(
        [rng.normal(0, 1, 2000), rng.uniform(-FAR, FAR, 2000), np.arange(-40, 40) * np.pi / 4, [0.0, -0.0, np.nan]]
    )
    sine, cosine = np.empty_like(angle), np.empty_like(angle)
    sincos(angle, angle.size, sine, cosine)
    assert_close(sine, np.sin(angle), 2.3e-16, "", "two units in the last place of one")
    assert_close(cosine, np.cos(angle), 2.3e-16, "", "two units in the last place of one")
