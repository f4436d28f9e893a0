"""State of the simulated rover: set its pose, command its motors, step and record it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..rover.model import Rover
from ..rover.rotations import quaternion_angles
from ..settling.pose import Pose
from .mjcf import SIDES
from .motors import limited_angles

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Joints of the suspension, in the order of `Record.hinge`.
HINGES = [f"{part}_{side}" for part in ("rocker", "bogie") for side in SIDES]


@dataclass(frozen=True)
class Record:
    """State and forces at one time; SI and radians, wheels in the paper's order."""

    time: float
    body_pose: Array  # (7,) x, y, z and quaternion w, x, y, z of the body
    body_velocity: Array  # (6,) of the body: linear in the world, angular in its own frame
    hinge: Array  # (4,) angles of HINGES
    hinge_rate: Array  # (4,)
    steering: Array  # (6,)
    wheel_angle: Array  # (6,)
    wheel_rate: Array  # (6,)
    wheel_motion: Array  # (6, 6) of each wheel in the world: velocity of its hub, angular velocity
    wheel_torque: Array  # (6,) of the hub motors
    contact_normal: Array  # (6, 3)
    contact_point: Array  # (6, 3) world, of the largest contact force on each wheel; NaN without contact
    contact_force: Array  # (6,) sum of the forces along the contact normals
    body_force: float  # the same for the body's box
    wheel_rate_command: Array  # (6,)
    wheel_angle_command: Array  # (6,) integral of the commanded rates
    steering_command: Array  # (6,)


class Rig:
    """Compiled model of `mjcf.build_spec` with its state; wheels in the paper's order."""

    def __init__(self, rover: Rover, model: Any) -> None:
        import mujoco

        names = rover.wheel_names
        turning = [name for name, steers in zip(names, rover.steers, strict=True) if steers]
        self.rover, self.model, self.data = rover, model, mujoco.MjData(model)
        self._hinge_q = _indices("qposadr", [model.joint(name) for name in HINGES])
        self._hinge_v = _indices("dofadr", [model.joint(name) for name in HINGES])
        self._steer_q = _indices("qposadr", [model.joint(f"steer_{name}") for name in turning])
        self._wheel_q = _indices("qposadr", [model.joint(f"wheel_{name}") for name in names])
        self._wheel_v = _indices("dofadr", [model.joint(f"wheel_{name}") for name in names])
        self._steer_motor = _indices("id", [model.actuator(f"steer_{name}") for name in turning])
        self._wheel_motor = _indices("id", [model.actuator(f"wheel_{name}") for name in names])
        self._wheel_act = model.actuator_actadr[self._wheel_motor]
        self._geoms = _indices("id", [model.geom(name) for name in (*(f"wheel_{n}" for n in names), "body")])
        self._command = np.zeros((2, 6))
        self._commanded_angle = np.zeros(6)

    def place(self, pose: Pose, lift: float) -> None:
        """Set the rover to one settled pose, without velocity, its steering held.

        Args:
            pose: one pose.
            lift: height above it, m.
        """
        import mujoco

        data, T = self.data, pose.T_world_body
        mujoco.mj_resetData(self.model, data)
        data.qpos[:3] = T[:3, 3] + (0.0, 0.0, lift)
        mujoco.mju_mat2Quat(data.qpos[3:7], np.ascontiguousarray(T[:3, :3]).ravel())
        data.qpos[self._hinge_q] = [pose.rocker, self.rover.right_rocker(pose.rocker), *pose.bogie]
        data.qpos[self._steer_q] = pose.steering[self.rover.steers]
        self._commanded_angle[:] = 0.0
        self.command(np.zeros(6), pose.steering)

    def command(self, wheel_rate: Array, steering: Array) -> None:
        """Command the motors, until the next command.

        Args:
            wheel_rate: (6,) rates of the hubs, rad/s.
            steering: (6,) steering angles, rad.
        """
        data = self.data
        self._command = np.stack([wheel_rate, steering])
        data.ctrl[self._wheel_motor] = wheel_rate
        data.ctrl[self._steer_motor] = steering[self.rover.steers]
        state = data.qpos[self._wheel_q], data.qvel[self._wheel_v]
        data.act[self._wheel_act] = limited_angles(self.model, self._wheel_motor, data.act[self._wheel_act], *state)

    def step(self, seconds: float) -> None:
        """Advance the simulation.

        Args:
            seconds: time to advance, rounded to a multiple of the time step, s.

        Raises:
            RockerbogieError: the simulation became unstable.
        """
        import mujoco

        count = round(seconds / self.model.opt.timestep)
        mujoco.mj_step(self.model, self.data, nstep=count)
        self._commanded_angle = self._commanded_angle + count * self.model.opt.timestep * self._command[0]
        unstable = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
        if any(self.data.warning[int(kind)].number for kind in unstable):
            raise RockerbogieError(
                f"the simulation became unstable within {self.data.time:.2f} s: drive more slowly or over smoother terrain"
            )

    @property
    def heading(self) -> tuple[float, float, float]:
        """x, y (m) and yaw (rad) of the body."""
        x, y, _, qw, qx, qy, qz = self.data.qpos[:7]
        return float(x), float(y), quaternion_angles(qw, qx, qy, qz)[2]

    @property
    def hubs(self) -> Array:
        """(6, 3) hubs in the world at the last step, m."""
        return np.asarray(self.data.geom_xpos[self._geoms[:6]])

    @property
    def wheel_torque(self) -> Array:
        """(6,) torques of the hub motors at the last step, N·m."""
        return np.asarray(self.data.actuator_force[self._wheel_motor])

    @property
    def torque_limit(self) -> Array:
        """(6,) torque limits of the hub motors, N·m."""
        return np.asarray(self.model.actuator_forcerange[self._wheel_motor, 1])

    @property
    def upright(self) -> float:
        """Cosine of the angle between the body's z and the vertical."""
        _, qx, qy, _ = self.data.qpos[3:7]
        return float(1 - 2 * (qx**2 + qy**2))

    def contact_normals(self) -> Array:
        """Return the contact normal of each wheel, from the terrain into the wheel.

        Returns:
            (6, 3) unit vectors; the mean weighted by force if a wheel has several contacts; (0, 0, 1) if it has none or
            their forces cancel.
        """
        push = self._push()[:, :6]
        normal = np.reshape(self.data.contact.frame, (-1, 9))[:, :3]
        mean = push.T @ (normal * np.sign(normal[:, 2:]))
        size = np.linalg.norm(mean, axis=1, keepdims=True)
        return np.where(size > 0.0, mean / np.where(size > 0.0, size, 1.0), [0.0, 0.0, 1.0])

    def _push(self) -> Array:
        """Return the normal force of each contact on the six wheels and the body's box.

        Returns:
            (contacts, 7) N.
        """
        contact = self.data.contact
        touches = (np.reshape(contact.geom, (-1, 2))[:, None, :] == self._geoms[:, None]).any(axis=-1)
        return np.where(touches, self.data.efc_force[contact.efc_address][:, None], 0.0)

    def _wheel_motion(self) -> Array:
        """Return each wheel's motion in the world at the last step.

        Returns:
            (6, 6) velocity of its hub, m/s, and angular velocity, rad/s.
        """
        import mujoco

        spin_first = np.zeros((6, 6))
        for found, geom in zip(spin_first, self._geoms[:6], strict=True):
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_GEOM, geom, found, 0)
        return np.roll(spin_first, 3, axis=1)

    def record(self) -> Record:
        """Return state and forces at the present time.

        Returns:
            The record.
        """
        import mujoco

        data = self.data
        mujoco.mj_forward(self.model, data)  # contacts and forces of this very state
        steering = np.zeros(6)
        steering[self.rover.steers] = data.qpos[self._steer_q]
        push = self._push()
        force = push.sum(axis=0)
        point = np.full((6, 3), np.nan)
        touching = force[:6] > 0
        if touching.any():
            point[touching] = np.reshape(data.contact.pos, (-1, 3))[push[:, :6].argmax(axis=0)[touching]]
        return Record(
            time=data.time, body_pose=data.qpos[:7].copy(), body_velocity=data.qvel[:6].copy(),
            hinge=data.qpos[self._hinge_q], hinge_rate=data.qvel[self._hinge_v],
            steering=steering, wheel_angle=data.qpos[self._wheel_q], wheel_rate=data.qvel[self._wheel_v],
            wheel_motion=self._wheel_motion(), wheel_torque=self.wheel_torque, contact_normal=self.contact_normals(),
            contact_point=point, contact_force=force[:6], body_force=float(force[6]),
            wheel_rate_command=self._command[0], wheel_angle_command=self._commanded_angle,
            steering_command=self._command[1],
        )  # fmt: skip


def _indices(field: str, elements: list[Any]) -> Indices:
    """Return one index of each named element.

    Args:
        field: name of the index, such as "qposadr".
        elements: named views of a model's elements.

    Returns:
        (n,) indices.
    """
    return np.array([int(np.ravel(getattr(element, field))[0]) for element in elements], dtype=np.int64)
