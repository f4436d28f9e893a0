"""Frames against the paper's own matrices, written out, and against Pinocchio."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rockerbogie as rb
from rockerbogie.rover.frames import DHRow
from rockerbogie.rover.rotations import rotation_x, rotation_y, rotation_z
from support.helpers import assert_close, paper_rover, random_rover

# Table I, metres and radians: the paper gives centimetres and degrees.
K1 = K2 = 0.0
K3, K4, K5, K6, K7, K8, K9, K11 = 0.27, 0.29, 0.29, 0.2846, 0.245, 0.145, np.radians(30.7), 0.125
DOWN, UP = np.radians(-90.0), np.radians(90.0)


def A(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    """Eq. 1."""
    c, s = np.cos, np.sin
    return np.array(
        [
            [c(theta), -s(theta) * c(alpha), s(theta) * s(alpha), a * c(theta)],
            [s(theta), c(theta) * c(alpha), -c(theta) * s(alpha), a * s(theta)],
            [0.0, s(alpha), c(alpha), d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def paper_axles(rho: float, beta1: float, beta2: float, psi1: float, psi2: float) -> np.ndarray:
    """T_R,A1 ... T_R,A6 (6, 4, 4): Table I (repaired) cascaded as eqs 2-4 say."""
    D = A(0.0, K1, K2, DOWN)
    B1 = A(K9 + rho, K3, K6, 0.0)
    B2 = A(K9 - rho, -K3, K6, 0.0)
    S1 = A(rho, K3, -K4, UP)
    S2 = A(-rho, -K3, -K4, UP)
    S3 = A(beta1 - K9, 0.0, -K11, UP)
    S4 = A(beta2 - K9, 0.0, -K11, UP)
    S5 = A(beta1 - K9, 0.0, K7, UP)
    S6 = A(beta2 - K9, 0.0, K7, UP)
    A1 = A(psi1, -K5, 0.0, 0.0)
    A2 = A(psi2, -K5, 0.0, 0.0)
    A3 = A4 = A5 = A6 = A(0.0, -K8, 0.0, 0.0)
    return np.array([D @ S1 @ A1, D @ S2 @ A2, D @ B1 @ S3 @ A3, D @ B2 @ S4 @ A4, D @ B1 @ S5 @ A5, D @ B2 @ S6 @ A6])


def angles(rng: np.random.Generator, shape: tuple[int, ...] = ()) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rocker, bogie and steering angles, as far as a linkage can go and further."""
    return rng.uniform(-1.0, 1.0, shape), rng.uniform(-1.2, 1.2, (*shape, 2)), rng.uniform(-3.0, 3.0, (*shape, 6))


def test_frames_are_the_papers_product() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        rho, (beta1, beta2), psi = float(rng.uniform(-1.0, 1.0)), *angles(rng)[1:]
        psi[2:] = 0.0
        T = rb.wheel_frames(paper_rover(), rho, [beta1, beta2], psi)
        assert_close(T, paper_axles(rho, beta1, beta2, psi[0], psi[1]), 1e-12, "m", "eqs 2-4 of Table I, written out")


def test_axles_at_rest() -> None:
    hubs = rb.wheel_frames(paper_rover(), 0.0, [0.0, 0.0])[:, :3, 3]
    rear, middle, front = (-0.290, 0.27, -0.2900), (0.1197, 0.27, -0.2903), (0.4897, 0.27, -0.2903)
    expected = [np.multiply(p, (1, side, 1)) for p in (rear, middle, front) for side in (1, -1)]
    assert_close(hubs, expected, 5e-5, "m", "where Table I puts the axles, to the digits it was worked out to by hand")
    assert paper_rover().wheel_names == ("LR", "RR", "LM", "RM", "LF", "RF")


def test_contact_frame_is_eq_5() -> None:
    rng = np.random.default_rng(2)
    rover = random_rover(rng)
    axle = rb.wheel_frames(rover, *angles(rng))
    delta = rng.uniform(-np.pi, np.pi, 6)
    for i, T in enumerate(rb.contact_frames(rover, axle, delta)):
        c, s, r = np.cos(delta[i]), np.sin(delta[i]), rover.wheel_radius[i]
        eq5 = np.array([[c, 0, s, -r * s], [0, 1, 0, 0], [-s, 0, c, -r * c], [0, 0, 0, 1]])
        assert_close(T, axle[i] @ eq5, 1e-12, "m", "eq. 5, written out")


def test_body_transform_is_eq_10_mended() -> None:
    x, y, z, fx, fy, fz = np.random.default_rng(3).uniform(-3, 3, 6)
    cx, sx, cy, sy, cz, sz = np.cos(fx), np.sin(fx), np.cos(fy), np.sin(fy), np.cos(fz), np.sin(fz)
    eq10 = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx, x],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx, y],
        [-sy, sx * cy, cx * cy, z],
        [0, 0, 0, 1],
    ]
    assert_close(rb.body_transform(x, y, z, fx, fy, fz), eq10, 1e-15, "m", "Rz(yaw) Ry(pitch) Rx(roll)")


def test_signs() -> None:
    up, ahead, left = np.eye(3)[2], np.eye(3)[0], np.eye(3)[1]
    nose_down = rb.body_transform(0, 0, 0, 0, 0.1, 0)[:3, :3] @ ahead
    assert nose_down[2] < 0, "positive pitch is nose down"
    assert (rb.body_transform(0, 0, 0, 0.1, 0, 0)[:3, :3] @ left)[2] > 0, "positive roll lifts the left side"
    assert (rb.body_transform(0, 0, 0, 0, 0, 0.1)[:3, :3] @ ahead)[1] > 0, "positive yaw turns left"
    rest, turned = (rb.wheel_frames(paper_rover(), rho, [0.0, 0.0])[:, :3, 3] @ up for rho in (0.0, 0.1))
    assert turned[0] > rest[0], "positive rocker angle is nose down on the left: its rear wheel rises"
    assert turned[1] < rest[1], "... and nose up on the right"
    steered = rb.wheel_frames(paper_rover(), 0.0, [0.0, 0.0], [0.1, 0, 0, 0, 0, 0])[0, :3, 0]
    assert steered @ left > 0, "positive steering turns left"


def pinocchio_frames(rover: rb.Rover, rho: float, beta: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """T_body_axle (6, 4, 4) from a Pinocchio model built joint by joint from the pivots."""
    pin: Any = pytest.importorskip("pinocchio", reason="Pinocchio (pip install pin) is the second opinion on frames")
    model = pin.Model()

    def joint(parent: int, kind: Any, place: np.ndarray, name: str) -> int:
        return int(model.addJoint(parent, kind, pin.SE3(np.eye(3), place), name))

    q = np.zeros(10)
    turn = {}
    for s in (0, 1):
        arm = joint(0, pin.JointModelRY(), rover.rocker_pivot[s], f"rocker{s}")
        hang = joint(arm, pin.JointModelRY(), rover.bogie_pivot[s] - rover.rocker_pivot[s], f"bogie{s}")
        turn[arm] = rho if s == 0 else np.polynomial.Polynomial(rover.differential)(rho)
        turn[hang] = beta[s]
        for i in range(s, 6, 2):
            parent, at = (arm, rover.rocker_pivot[s]) if i < 2 else (hang, rover.bogie_pivot[s])
            offset = np.append(rover.steering_offset[i], 0.0)
            post = joint(parent, pin.JointModelRZ(), rover.hubs[i] + offset - at, f"steering{i}")
            turn[post] = psi[i]
            model.addFrame(pin.Frame(f"axle{i}", post, 0, pin.SE3(np.eye(3), -offset), pin.FrameType.OP_FRAME))
    for index, value in turn.items():
        q[model.joints[index].idx_q] = value
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return np.array([data.oMf[model.getFrameId(f"axle{i}")].homogeneous for i in range(6)])


@pytest.mark.parametrize("bogie_ahead", [True, False])
def test_frames_are_pinocchios(bogie_ahead: bool) -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        rover = random_rover(rng, bogie_ahead=bogie_ahead).replace(differential=np.array([0.0, -rng.uniform(0.5, 2), 0, 0.1]))
        rho, beta, psi = angles(rng)
        expected = pinocchio_frames(rover, float(rho), beta, psi)
        assert_close(rb.wheel_frames(rover, rho, beta, psi), expected, 1e-12, "m", "Pinocchio's forward kinematics")


@pytest.mark.parametrize("shape", [(), (1,), (3, 1, 2)])
def test_one_function_for_one_pose_and_many(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(5)
    rover = random_rover(rng)
    rho, beta, psi = angles(rng, shape)
    T = rb.wheel_frames(rover, rho, beta, psi)
    assert T.shape == (*shape, 6, 4, 4)
    C = rb.contact_frames(rover, T, psi)
    assert C.shape == T.shape
    for k in np.ndindex(shape):
        assert_close(T[k], rb.wheel_frames(rover, rho[k], beta[k], psi[k]), 1e-14, "m", "each pose of a batch is its own")
        assert_close(C[k], rb.contact_frames(rover, T[k], psi[k]), 1e-14, "m", "each pose of a batch is its own")


def test_angles_broadcast_together() -> None:
    rho, beta, psi = np.linspace(-0.2, 0.2, 4)[:, None], np.full((3, 2), 0.1), np.zeros(6)
    T = rb.wheel_frames(paper_rover(), rho, beta, psi)
    assert T.shape == (4, 3, 6, 4, 4)
    assert_close(T[2, 1], rb.wheel_frames(paper_rover(), rho[2, 0], beta[1]), 1e-14, "m", "rocker (4, 1) over bogie (3, 2)")


def cascade(rows: list[DHRow], rover: rb.Rover, rho: float, beta: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Return T_body_axle (6, 4, 4) by multiplying the matrices of a D-H table."""
    joint = {"": 0.0, "rocker_left": rho, "rocker_right": float(rover.right_rocker(rho))}
    joint |= {"bogie_left": beta[0], "bogie_right": beta[1], **{f"steering_{i}": psi[i] for i in range(6)}}
    T = {"R": np.eye(4)}
    for row in rows:
        T[row.frame] = T[row.parent] @ A(row.theta + joint[row.joint], row.d, row.a, row.alpha)
    return np.array([T[f"W{i}"] if f"W{i}" in T else T[f"A{i}"] for i in range(1, 7)])


def test_any_rovers_table_gives_its_frames() -> None:
    rng = np.random.default_rng(6)
    for _ in range(100):
        rover = random_rover(rng)
        rho, beta, psi = angles(rng)
        T = cascade(rb.dh_table(rover), rover, float(rho), beta, psi)
        assert_close(rb.wheel_frames(rover, rho, beta, psi), T, 1e-12, "m", "the D-H table is the rover")


def test_the_papers_table_comes_back() -> None:
    rows = {row.frame: row for row in rb.dh_table(paper_rover())}
    table = {  # frame: parent, constant part of θ, what is added to it, d, a, α
        "D": ("R", 0, "", K1, K2, DOWN),
        "B1": ("D", K9, "rocker_left", K3, K6, 0),
        "B2": ("D", K9, "rocker_right", -K3, K6, 0),
        "S1": ("D", 0, "rocker_left", K3, -K4, UP),
        "S2": ("D", 0, "rocker_right", -K3, -K4, UP),
        "S3": ("B1", -K9, "bogie_left", 0, -K11, UP),
        "S4": ("B2", -K9, "bogie_right", 0, -K11, UP),
        "S5": ("B1", -K9, "bogie_left", 0, K7, UP),
        "S6": ("B2", -K9, "bogie_right", 0, K7, UP),
        "A1": ("S1", 0, "steering_0", -K5, 0, 0),
        "A2": ("S2", 0, "steering_1", -K5, 0, 0),
        **{f"A{i}": (f"S{i}", 0, f"steering_{i - 1}", -K8, 0, 0) for i in (3, 4, 5, 6)},
    }
    assert set(rows) == set(table)
    for frame, (parent, theta, joint, d, a, alpha) in table.items():
        row = rows[frame]
        assert (row.parent, row.joint) == (parent, joint)
        got = (row.theta, row.d, row.a, row.alpha)
        assert_close(got, (theta, d, a, alpha), 1e-12, "m", f"row {frame} of Table I")


def test_no_table_without_a_common_pivot_axis() -> None:
    rover = paper_rover()
    skewed = rover.replace(rocker_pivot=rover.rocker_pivot + [[0.0, 0, 0], [0.01, 0, 0]])
    with pytest.raises(rb.RockerbogieError, match="rocker pivots are not on one axis"):
        rb.dh_table(skewed)


@pytest.mark.parametrize(
    ("bogie", "steering", "sentence"),
    [
        ([0.0, 0.0, 0.0], None, r"bogie has shape \(3,\); its last axis must be 2"),
        (0.0, None, r"bogie has shape \(\); its last axis must be 2"),
        ([0.0, 0.0], [0.0, 0.0], r"steering has shape \(2,\); its last axis must be 6"),
        ([0.0, 0.0], [np.nan, 0, 0, 0, 0, 0], "steering holds an angle that is not finite"),
        ([0.0, 0.0], [0, 0, 0.1, 0, 0, -0.1], "wheel LM, RF of rover 'elhami-dashti' does not steer"),
    ],
)
def test_wrong_angles_are_refused(bogie: Any, steering: Any, sentence: str) -> None:
    with pytest.raises(rb.RockerbogieError, match=sentence):
        rb.wheel_frames(paper_rover(), 0.0, bogie, steering)


def test_elementary_rotations_turn_the_right_way() -> None:
    x, y, z = np.eye(3)
    for turn, start, end in ((rotation_x, y, z), (rotation_y, z, x), (rotation_z, x, y)):
        assert_close(turn(np.pi / 2) @ start, end, 1e-15, "", "right-handed")


def test_attitude_is_scipys_zyx_and_urdfs_rpy() -> None:
    roll, pitch, yaw = np.random.default_rng(7).uniform(-1.5, 1.5, (3, 20))
    R = rb.body_transform(0, 0, 0, roll, pitch, yaw)[:, :3, :3]
    moving = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1)).as_matrix()
    fixed = Rotation.from_euler("xyz", np.stack([roll, pitch, yaw], axis=1)).as_matrix()
    assert_close(R, moving, 1e-15, "", "docs/conventions.md: scipy's ZYX")
    assert_close(R, fixed, 1e-15, "", "URDF's rpy: roll, pitch, yaw about fixed axes")
