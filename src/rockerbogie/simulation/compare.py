"""Comparison of two runs at equal x, y and yaw, channel by channel."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..files.version import __version__
from ..motion.drive import summary
from ..rover.model import Rover
from ..rover.rotations import wrap_angle
from ..settling.dataset import SCENE, VARIABLES, run_dataset
from ..settling.pose import Pose
from ..settling.settle import settle
from ..settling.status import Status
from ..terrain.heightfield import Terrain
from .measurement import LIFTED_GAP

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Two records are at the same position if no coordinate differs by more than this, m and rad.
SAME_POSITION = 1e-6
#: Compared variables, with the dim of those that hold several channels.
COMPARED = {"z": None, "roll": None, "pitch": None, "rocker": None, "bogie": "side", "contact_angle": "wheel"}
#: For print: SI unit -> unit, factor.
PRINTED = {"m": ("mm", 1e3), "rad": ("deg", 180 / np.pi)}
#: States in which a rover is in equilibrium without six wheels in contact and all joints free.
CONSTRAINED = (Status.JOINT_STOP, Status.WHEEL_LIFTED, Status.BELLY_CONTACT)


@dataclass(frozen=True)
class Channel:
    """Differences of one quantity in SI units: root mean square, largest, its position, count."""

    name: str
    unit: str
    rms: float
    worst: float
    worst_at: float  # m along the path
    count: int


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`; printed as a table in degrees and millimetres."""

    channels: tuple[Channel, ...]
    resettled: bool = False  # the first run's rover was settled at the positions of the second run
    unlike: int = 0  # records left out: other wheels off the ground, other joints at their limits, or no pose

    def __getitem__(self, name: str) -> Channel:
        """Return the channel of that name."""
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise KeyError(name)

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return the channels as numbers.

        Returns:
            Channel name -> unit, rms, worst, worst_at and count, SI units.
        """
        return {c.name: {k: v for k, v in asdict(c).items() if k != "name"} for c in self.channels}

    def __str__(self) -> str:
        """Return the table."""
        lines = [f"{'difference':<18} {'rms':>9} {'worst':>9}       at m  records"]
        for c in self.channels:
            unit, factor = PRINTED[c.unit]
            lines.append(f"{c.name:<18} {factor * c.rms:9.4f} {factor * c.worst:9.4f} {unit:<4} {c.worst_at:6.2f} {c.count:8d}")
        if self.resettled:
            lines.append("the first run's rover, settled at the positions of the second")
        if self.unlike:
            lines.append(f"{self.unlike} records left out: other wheels are off the ground or other joints at their limits there")
        return "\n".join(lines)


def settle_along(rover: Rover, terrain: Terrain, run: xr.Dataset) -> xr.Dataset:
    """Settle the rover at each position of a run, with the contacts that the run has there.

    The run gives x, y, yaw and steering. Six wheels in contact are the rule. Where the run has a wheel off the ground, a
    joint at its limit or the body on the terrain, and where six contacts would need a joint beyond its limit, the pose is
    that of equilibrium mode.

    Args:
        rover: the rover.
        terrain: the map.
        run: run of `drive` or `simulate`.

    Returns:
        Dataset over the same `time` with the variables of `Pose.to_xarray`.
    """
    places = [run[name].to_numpy() for name in ("x", "y", "yaw")]
    steering = run["steering"].to_numpy()
    pose = settle(rover, terrain, *places, steering=steering)
    constrained = np.isin(run["status"].to_numpy(), CONSTRAINED) | (pose.status == Status.JOINT_STOP)
    if constrained.any():
        there = settle(rover, terrain, *(a[constrained] for a in places), steering=steering[constrained], mode="equilibrium")
        q, status = pose.q.copy(), pose.status.copy()
        q[constrained], status[constrained] = there.q, there.status
        pose = Pose(rover, terrain, pose.x, pose.y, pose.yaw, pose.steering, q, status)
    time, distance = run["time"].to_numpy(), run["distance"].to_numpy()
    attrs = {
        "source": f"rockerbogie {__version__} settle, along: {run.attrs.get('source', 'a run')}",
        "status_summary": summary(pose.status, distance),
    }
    return run_dataset(rover, terrain, time, distance, {name: getattr(pose, name) for name in VARIABLES}, attrs)


def compare(run: xr.Dataset, sim: xr.Dataset) -> Comparison:
    """Compare height, attitude, joint and contact angles of two runs, record by record.

    They are compared at equal x, y and yaw, as a simulated rover slides off its path and the terrain differs over a few
    centimetres. If the two are at different positions, the rover of `run` is settled at those of `sim`
    (`settle_along`). Records in which other wheels are off the ground or other joints at their limits are left out and counted.

    Args:
        run: run of `drive`.
        sim: run of `simulate`, or another run of `drive`.

    Returns:
        RMS and largest difference of each channel.

    Raises:
        RockerbogieError: runs of two rovers or terrains; a run without records; runs at different positions that were read from
            files, so that rover and terrain are not known.
    """
    if sim.sizes["time"] == 0:
        raise RockerbogieError("the second run has no records: there is nothing to compare")
    names = [data.attrs.get("rover") for data in (run, sim)]
    if names[0] != names[1]:
        raise RockerbogieError(f"the runs are of two rovers, {names[0]!r} and {names[1]!r}: compare runs of one")
    elsewhere = _elsewhere(run, sim)
    if elsewhere and "simulate" in run.attrs.get("source", "") and "simulate" not in sim.attrs.get("source", ""):
        raise RockerbogieError(
            "give the kinematic run first and the simulation second: the first is settled at the positions of the second"
        )
    if elsewhere:
        scene: tuple[Rover, Terrain] | None = run.encoding.get(SCENE, sim.encoding.get(SCENE))
        if scene is None:
            raise RockerbogieError(f"the runs {elsewhere}: compare settle_along(rover, terrain, sim) with sim")
        if scene[1].name != sim.attrs.get("terrain"):
            raise RockerbogieError(
                f"the runs are on two terrains, {scene[1].name!r} and {sim.attrs.get('terrain')!r}: compare on one"
            )
        run = settle_along(*scene, sim)
    distance, alike = sim["distance"].to_numpy(), _alike(run, sim)
    channels = []
    for name, dim in COMPARED.items():
        difference = run[name].to_numpy() - sim[name].to_numpy()
        unit = sim[name].attrs["units"]
        if unit == "rad":
            difference = wrap_angle(difference)
        difference[~alike] = np.nan
        labels = [name] if dim is None else [f"{name} {label}".replace("_", " ") for label in sim[dim].to_numpy()]
        channels += [
            _channel(label, unit, column, distance) for label, column in zip(labels, np.atleast_2d(difference.T), strict=True)
        ]
    return Comparison(tuple(channels), resettled=bool(elsewhere), unlike=int((~alike).sum()))


def _alike(run: xr.Dataset, sim: xr.Dataset) -> NDArray[np.bool_]:
    """Return the records with equal status and the same wheels off the ground in both runs.

    Args:
        run, sim: runs with equal records.

    Returns:
        (n,) True where the records can be compared.
    """
    status = [data["status"].to_numpy() for data in (run, sim)]
    lifted = [data["gap"].to_numpy() > LIFTED_GAP for data in (run, sim)]
    either = (status[0] == Status.WHEEL_LIFTED) | (status[1] == Status.WHEEL_LIFTED)
    return np.asarray((status[0] == status[1]) & ~(either & (lifted[0] != lifted[1]).any(axis=1)))


def _elsewhere(run: xr.Dataset, sim: xr.Dataset) -> str:
    """Return how the positions of two runs differ.

    Args:
        run, sim: the runs.

    Returns:
        End of a sentence about the runs; empty if they are at the same positions.
    """
    if run.sizes["time"] != sim.sizes["time"]:
        return f"have {run.sizes['time']} and {sim.sizes['time']} records"
    apart = max(float(np.abs(run[name].to_numpy() - sim[name].to_numpy()).max()) for name in ("x", "y"))
    turned = float(np.abs(wrap_angle(run["yaw"].to_numpy() - sim["yaw"].to_numpy())).max())
    if max(apart, turned) <= SAME_POSITION:
        return ""
    return f"are up to {apart:.3g} m and {np.degrees(turned):.3g} deg apart, where angles differ anyway"


def _channel(name: str, unit: str, difference: Array, distance: Array) -> Channel:
    """Return the statistics of one channel.

    Args:
        name: name of the channel.
        unit: its unit.
        difference: (n,) NaN where it is not known.
        distance: (n,) m.

    Returns:
        The channel; NaN and count 0 if no difference is known.
    """
    known = np.isfinite(difference)
    if not known.any():
        return Channel(name, unit, np.nan, np.nan, np.nan, 0)
    size = np.where(known, np.abs(difference), -1.0)
    k = int(np.argmax(size))
    return Channel(
        name, unit, float(np.sqrt(np.mean(difference[known] ** 2))), float(size[k]), float(distance[k]), int(known.sum())
    )
