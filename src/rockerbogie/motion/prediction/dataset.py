"""Dataset of predicted drives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..._kernels.dynamics import record as kernel
from ..._kernels.dynamics.evaluate import C_STEERING
from ...arrays import Array
from ...files.version import __version__
from ...rover.model import Rover
from ...rover.rotations import body_transform
from ...settling.dataset import AXES, DISTANCE, RUN_VARIABLES, SCENE, TWIST_VARIABLES
from ...settling.pose import Pose
from ...settling.status import Status
from ...terrain.heightfield import Terrain
from ..path import Path
from ..slip import slip_ratio
from .commands import PackedCommands
from .outcome import STATUS_AFTER, TEXT, DriveEnd
from .soil import LOADS

if TYPE_CHECKING:
    import xarray as xr

#: Variables of a predicted drive besides those of `drive`: dims, units, long name.
EXTRA: dict[str, tuple[tuple[str, ...], str, str]] = {
    **TWIST_VARIABLES,
    "roll_slip": (("wheel",), "m/s", "slip of the tread along the wheel's heading, positive if it moves further than it rolls"),
    "slip_ratio": (("wheel",), "1", "rim speed minus hub speed along the wheel's heading, divided by the larger"),
    "slip_angle": (("wheel",), "rad", "angle from the wheel's heading to the direction of travel of its contact, to the left"),
    "sinkage": (("wheel",), "m", "depth of the wheel in the soil"),
    "normal_force": (("wheel",), "N", "contact force along the contact normal"),
    "traction": (("wheel",), "N", "contact force along the heading of the wheel, forward positive"),
    "side_force": (("wheel",), "N", "contact force across the heading of the wheel, left positive"),
    "wheel_torque": (("wheel",), "N m", "torque of the hub motor, forward positive"),
    "wheel_rate_command": (("wheel",), "rad/s", "commanded rate of the hub motor"),
    "wheel_lifted": (("wheel",), "1", "1 if the wheel carries no load; `gap` is its height above the terrain"),
    "law_exceeded": (
        ("wheel",),
        "1",
        "on soil: 1 if the axle moves against the wheel's turning, or the load is above the table; forces are extrapolated",
    ),
    "motor_work": ((), "J", "work of the motors since the start"),
    "dissipation": ((), "J", "work lost by slip since the start"),
    "height_gain": ((), "J", "gain of potential energy since the start"),
    "x_command": ((), "m", "x that the commands would lead to without slip"),
    "y_command": ((), "m", "y that the commands would lead to without slip"),
    "yaw_command": ((), "rad", "yaw that the commands would lead to without slip"),
}
STANDING = 1e-3  # of the rim speed: an axle that moves back by less stands still
BLOCKS = {
    "wheel_rate": kernel.R_WHEEL,
    "wheel_rate_command": kernel.R_COMMAND,
    "normal_force": kernel.R_LOAD,
    "traction": kernel.R_TRACTION,
    "side_force": kernel.R_SIDE,
    "wheel_torque": kernel.R_TORQUE,
    "roll_slip": kernel.R_ROLL_SLIP,
    "side_slip": kernel.R_SIDE_SLIP,
    "sinkage": kernel.R_SINKAGE,
}
#: A wheel counts as off the ground if its load is below this share of the rover's weight.
LIFTED_SHARE = 1e-4
#: Variables that are left out with details=False.
DETAILS = ("contact_angle", "contact_point", "gap", "clearance")


def prediction_dataset(
    rover: Rover, terrain: Terrain, packed: PackedCommands, commands: Any, first: Array, which: NDArray[np.int64], out: Array,
    done: NDArray[np.int64], ends: NDArray[np.uint8], shape: tuple[int, ...], every: int, details: bool, inputs: dict[str, Any],
) -> xr.Dataset:  # fmt: skip
    """Return the Dataset of predicted drives.

    Args:
        rover, terrain: of the drives.
        packed, commands: packed commands, and as given.
        first: (n, 3) starts.
        which: (n,) row of the commands of each drive.
        out: (n, records, R_SIZE) records.
        done: (n,) steps done.
        ends: (n,) `DriveEnd`.
        shape: batch shape; its product is n.
        every: steps between records.
        details: True to add contacts, gaps and clearance.
        inputs: friction (...), gravity, speed, and names of soils (n,), empty on rigid terrain.

    Returns:
        The Dataset.
    """
    import xarray as xr

    n, records, _ = out.shape
    steps = np.minimum(np.arange(records) * every, packed.counts.max())
    if not shape:  # one drive: its records end with it
        records = int(np.isfinite(out[0, :, 0]).sum())
        out, steps = out[:, :records], steps[:records]
    counts = packed.counts[which]
    time = steps * packed.span
    station = np.minimum(steps, counts[:, None] - 1) if n else np.zeros((0, records), dtype=np.int64)
    steering = packed.rows[which[:, None], station, C_STEERING:]
    on_soil = bool(inputs["soils"].size) and bool(inputs["soils"].flat[0])
    values = _values(rover, out, steering, inputs["gravity"], on_soil) | _commanded(packed, commands, first, which, steps)
    reached = np.isfinite(out[..., 0])
    for name in ("x_command", "y_command", "yaw_command"):
        if name in values:
            values[name] = np.where(reached, values[name], np.nan)
    after = np.array([STATUS_AFTER.get(DriveEnd(code), Status.NOT_CONVERGED) for code in ends], dtype=np.uint8)
    lifted = values["wheel_lifted"].any(axis=-1)
    values["status"] = np.where(reached, np.where(lifted, Status.WHEEL_LIFTED, Status.CONVERGED), after[:, None]).astype(np.uint8)
    values["height_gain"] = rover.mass * inputs["gravity"] * (out[..., kernel.R_HEIGHT] - out[:, :1, kernel.R_HEIGHT])
    if details and records:
        q, status = np.ascontiguousarray(out[..., kernel.R_Q : kernel.R_Q + 6]), values["status"]
        x, y, yaw = (np.ascontiguousarray(out[..., k]) for k in range(3))
        pose = Pose(rover, terrain, x, y, yaw, steering, q, status)
        values |= {name: getattr(pose, name) for name in DETAILS}
        values["contact_angle_rate"] = (
            np.gradient(pose.contact_angle, time, axis=1) if records > 1 else np.full_like(pose.contact_angle, np.nan)
        )
    batch = () if not shape else ("run",) if len(shape) == 1 else tuple(f"run_{k}" for k in range(len(shape)))
    known = RUN_VARIABLES | EXTRA
    data: dict[str, Any] = {
        name: (
            (*batch, "time", *dims),
            _plain(values[name]).reshape(*shape, records, *values[name].shape[2:]),
            {"units": units, "long_name": text},
        )
        for name, (dims, units, text) in known.items()
        if name in values
    }
    data["status"][2].update(flag_values=np.array(list(Status), dtype=np.uint8), flag_meanings=" ".join(s.name for s in Status))
    travelled = np.hypot(
        np.diff(out[..., 0], axis=1, prepend=first[:, None, 0]), np.diff(out[..., 1], axis=1, prepend=first[:, None, 1])
    )
    coords: dict[str, Any] = {
        "time": ("time", time, {"units": "s", "long_name": "time since the start"}),
        "distance": (
            (*batch, "time"),
            np.cumsum(travelled, axis=1).reshape(*shape, records),
            {"units": "m", "long_name": DISTANCE},
        ),
        "wheel": list(rover.wheel_names),
        "side": AXES["side"],
        "axis": AXES["axis"],
    }
    attrs: dict[str, Any] = {
        "rover": rover.name, "terrain": terrain.name, "path": packed.description, "speed": inputs["speed"],
        "gravity": inputs["gravity"], "step": float(packed.fastest.max() * packed.span), "mode": "contact",
        "source": f"rockerbogie {__version__} predict",
        "law": _law(inputs, shape),
    }  # fmt: skip
    reasons = np.array([TEXT[DriveEnd(code)] for code in ends])
    if shape:
        data["end"] = (batch, ends.reshape(shape), _end_attrs())
        data["ends_because"] = (batch, reasons.reshape(shape), {"long_name": "reason for which the drive ends"})
        if inputs["soils"][0]:
            data["soil"] = (batch, inputs["soils"].reshape(shape), {"long_name": "name of the soil"})
        else:
            data["friction"] = (batch, inputs["friction"], {"units": "1", "long_name": "friction coefficient"})
    else:
        attrs |= {
            "end": DriveEnd(ends[0]).name,
            "ends_because": str(reasons[0]),
            "reached_end": int(ends[0] == DriveEnd.REACHED_END),
        }
    run = xr.Dataset(data, coords, attrs)
    run.encoding[SCENE] = (rover, terrain)
    return run


def _law(inputs: dict[str, Any], shape: tuple[int, ...]) -> str:
    """Return the force law in words."""
    soils = sorted(set(map(str, inputs["soils"])))
    if soils[0]:
        return f"soil {', '.join(soils)}"
    return "friction" if shape else f"friction {float(inputs['friction']):g}"


def _end_attrs() -> dict[str, Any]:
    """Return the attributes of the codes of ends."""
    return {
        "units": "1",
        "long_name": "reason code of the end, see rockerbogie.DriveEnd",
        "flag_values": np.array(list(DriveEnd), dtype=np.uint8),
        "flag_meanings": " ".join(end.name for end in DriveEnd),
    }


def _plain(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return booleans as uint8, which netCDF files can hold; other arrays as they are."""
    return values.astype(np.uint8) if values.dtype == np.bool_ else values


def _values(rover: Rover, out: Array, steering: Array, gravity: float, soil: bool) -> dict[str, NDArray[Any]]:
    """Return the variables that records hold, each (n, records, ...)."""
    x, y, yaw = (out[..., k] for k in range(3))
    z, roll, pitch, rocker = (out[..., kernel.R_Q + k] for k in range(4))
    names = ("x", "y", "yaw", "z", "roll", "pitch", "rocker")
    values: dict[str, NDArray[Any]] = {"x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw, "rocker": rocker}
    values |= {f"{name}_rate": out[..., kernel.R_RATE + k] for k, name in enumerate(names)}
    values["bogie"], values["bogie_rate"] = (
        out[..., kernel.R_Q + 4 : kernel.R_Q + 6],
        out[..., kernel.R_RATE + 7 : kernel.R_RATE + 9],
    )
    values["steering"] = np.where(np.isfinite(x)[..., None], steering, np.nan)
    values |= {name: out[..., at : at + 6] for name, at in BLOCKS.items()}
    radius, turn = rover.wheel_radius, out[..., kernel.R_TURN : kernel.R_TURN + 6]
    rim = radius * (values["wheel_rate"] + turn)
    travel = rim + values["roll_slip"]
    values["slip_ratio"] = slip_ratio(rim, travel)
    values["slip_angle"] = np.arctan2(values["side_slip"], np.abs(travel))
    values["wheel_lifted"] = values["normal_force"] < LIFTED_SHARE * rover.mass * gravity
    if soil:
        against = rim * travel < -STANDING * rim**2
        values["law_exceeded"] = against | (values["normal_force"] > LOADS[1] * rover.mass * gravity)
    values["motor_work"], values["dissipation"] = out[..., kernel.R_WORK], out[..., kernel.R_LOSS]
    R = body_transform(x, y, z, roll, pitch, yaw)[..., :3, :3]
    rates = np.stack([values["x_rate"], values["y_rate"], values["z_rate"]], axis=-1)
    for k, velocity in enumerate(np.moveaxis(np.einsum("...ji,...j->...i", R, rates), -1, 0)):
        values["v" + "xyz"[k]] = velocity
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    values["wx"] = values["roll_rate"] - sp * values["yaw_rate"]
    values["wy"] = cr * values["pitch_rate"] + sr * cp * values["yaw_rate"]
    values["wz"] = -sr * values["pitch_rate"] + cr * cp * values["yaw_rate"]
    return values


def _commanded(
    packed: PackedCommands, commands: Any, first: Array, which: NDArray[np.int64], steps: NDArray[np.int64]
) -> dict[str, Array]:
    """Return positions (n, records) to which paths would lead without slip."""
    paths = list(commands) if isinstance(commands, Sequence) else [commands]
    if not all(isinstance(path, Path) for path in paths):
        return {}
    step = packed.fastest[0] * packed.span
    found = []
    for path in paths:
        at = path.sample(np.minimum(steps * step, path.length))
        c, s = np.cos(path.yaw[0]), np.sin(path.yaw[0])
        dx, dy = at.x - path.x[0], at.y - path.y[0]
        found.append(np.stack([c * dx + s * dy, c * dy - s * dx, at.yaw - path.yaw[0]]))
    ahead, left, turned = np.moveaxis(np.array(found)[which], 1, 0)
    c, s = np.cos(first[:, 2:]), np.sin(first[:, 2:])
    return {
        "x_command": first[:, :1] + c * ahead - s * left,
        "y_command": first[:, 1:2] + s * ahead + c * left,
        "yaw_command": first[:, 2:] + turned,
    }
