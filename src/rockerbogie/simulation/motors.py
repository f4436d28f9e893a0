"""Motors of the simulated rover: rate servos in the hubs, angle servos for steering."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import floats
from ..errors import RockerbogieError
from ..rover.model import Rover

Array = NDArray[np.float64]

#: Gravity of the simulation, m/s² (MuJoCo's default).
GRAVITY = 9.81
#: Inertia of each motor behind its gears, in units of m r² (mass of the rover, wheel radius). It is negligible at rover speeds.
ROTOR_SHARE = 0.7
#: Time constant of the servos, s. Each is a critically damped loop on the joint's angle.
SERVO_TIME = 0.02
#: Default torque limit of a hub in units of m g r: the JPL Open Source Rover's. It drives each wheel by a goBILDA 5203-2402-0027
#: gear motor (nasa-jpl/open-source-rover, parts list), whose maker states a stall torque of 38 kg·cm = 3.73 N·m: 0.40 m g r at
#: 12.7 kg and r = 75 mm. Others: Sawppy's LX-16A servos, 17 kg·cm, 0.61; the 300 N·m of Project Chrono's Curiosity, 0.14.
TORQUE_SHARE = 0.4


def torque_limits(rover: Rover, torque: ArrayLike | None = None) -> Array:
    """Return the torque limit of each hub motor.

    Args:
        rover: its `wheel_torque` is used where `torque` is not given. Where that is inf, its mass and wheel radius give the
            default, `TORQUE_SHARE` m g r.
        torque: a number or (6,), N·m, above 0, or None.

    Returns:
        (6,) N·m.

    Raises:
        RockerbogieError: a torque that is no number above 0, or of another shape.
    """
    if torque is None:
        usual = TORQUE_SHARE * rover.mass * GRAVITY * rover.wheel_radius
        return np.where(np.isfinite(rover.wheel_torque), rover.wheel_torque, usual)
    try:
        limits = floats(torque)
    except (TypeError, ValueError, OverflowError):
        raise RockerbogieError(f"torque is {torque!r:.60}; give N·m, one number or six") from None
    if limits.shape not in ((), (6,)):
        raise RockerbogieError(f"torque has shape {limits.shape}; give N·m, one number or six")
    if not (np.isfinite(limits).all() and (limits > 0).all()):
        raise RockerbogieError(f"torque is {torque!r:.60}; give N·m, finite and above 0")
    return np.broadcast_to(limits, (6,)).copy()


def add_motors(spec: Any, rover: Rover, torque: ArrayLike | None = None) -> None:
    """Add a rate servo to each hub and an angle servo to each steering axis.

    A hub's servo is MuJoCo's `intvelocity`: it integrates the commanded rate to an angle and holds the wheel at that angle, with
    a torque T = kp (commanded angle − angle) − kv rate, limited. Under a constant load the rate has no error, and a wheel
    commanded to 0 rad/s stands still. While the torque is at its limit, the caller must keep the commanded angle from running
    ahead (`limited_angles`).

    Args:
        spec: `mujoco.MjSpec` that holds the rover's joints; it is changed.
        rover: the rover.
        torque: limit of the hub motors, as for `torque_limits`.
    """
    import mujoco

    rotor = ROTOR_SHARE * rover.mass * float(rover.wheel_radius.max()) ** 2  # kg m²
    gains = {"kp": rotor / SERVO_TIME**2, "kv": 2 * rotor / SERVO_TIME}  # N·m/rad, N·m s/rad
    for joint in spec.joints:
        if joint.name.startswith(("wheel_", "steer_")):
            joint.armature = rotor
    for i, (name, limit) in enumerate(zip(rover.wheel_names, torque_limits(rover, torque), strict=True)):
        drive = spec.add_actuator(name=f"wheel_{name}", target=f"wheel_{name}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_intvelocity(**gains)
        drive.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        drive.forcerange = [-limit, limit]
        if rover.steers[i]:
            steer = spec.add_actuator(name=f"steer_{name}", target=f"steer_{name}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
            steer.set_to_position(**gains)


def limited_angles(model: Any, motors: NDArray[np.int64], commanded: Array, angle: Array, rate: Array) -> Array:
    """Limit the commanded angles of the hub servos to those that their torque can hold.

    Args:
        model: compiled `mujoco.MjModel`.
        motors: (6,) indices of the hub motors.
        commanded: (6,) commanded angles, rad.
        angle: (6,) angles of the wheels, rad.
        rate: (6,) rates of the wheels, rad/s.

    Returns:
        (6,) rad: as commanded where the servo's torque is within its limits, else the nearest angle at which it is.
    """
    kp, kv = model.actuator_gainprm[motors, 0], -model.actuator_biasprm[motors, 2]
    low, high = (model.actuator_forcerange[motors] + (kv * rate)[:, None]).T / kp
    return np.clip(commanded, angle + low, angle + high)
