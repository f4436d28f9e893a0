"""How far two runs are apart, channel by channel, where both stand at the same x, y and yaw."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..errors import RockerbogieError
from ..motion.drive import summary
from ..rotations import wrap_angle
from ..rover.model import Rover
from ..settling.dataset import SCENE, VARIABLES, run_dataset
from ..settling.settle import settle
from ..terrain.heightfield import Terrain

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Two runs stand at the same place when no coordinate differs by more than this, m and rad.
SAME_PLACE = 1e-6
#: Variables compared, with the dim along which each holds several channels.
COMPARED = {"z": None, "roll": None, "pitch": None, "rocker": None, "bogie": "side", "contact_angle": "wheel"}
#: For print: SI unit -> unit, factor.
PRINTED = {"m": ("mm", 1e3), "rad": ("deg", 180 / np.pi)}


@dataclass(frozen=True)
class Channel:
    """One quantity's differences, in SI units: root mean square, the worst, where, and of how many records."""

    name: str
    unit: str
    rms: float
    worst: float
    worst_at: float  # m along the way
    count: int


@dataclass(frozen=True)
class Comparison:
    """What `compare` found; print it for a table in degrees and millimetres."""

    channels: tuple[Channel, ...]
    resettled: bool = False  # the first run stood elsewhere: its rover was settled where the second stands, and that is compared

    def __getitem__(self, name: str) -> Channel:
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise KeyError(name)

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Channel name -> unit, rms, worst, worst_at and count, in SI units."""
        return {c.name: {k: v for k, v in asdict(c).items() if k != "name"} for c in self.channels}

    def __str__(self) -> str:
        lines = [f"{'difference':<18} {'rms':>9} {'worst':>9}       at m  records"]
        for c in self.channels:
            unit, factor = PRINTED[c.unit]
            lines.append(f"{c.name:<18} {factor * c.rms:9.4f} {factor * c.worst:9.4f} {unit:<4} {c.worst_at:6.2f} {c.count:8d}")
        if self.resettled:
            lines.append("the first run's rover, settled where the second stands")
        return "\n".join(lines)


def settle_along(rover: Rover, terrain: Terrain, run: xr.Dataset) -> xr.Dataset:
    """The rover settled at every x, y, yaw and steering of a run: what `compare` holds a simulation against.

    Returns:
        Dataset over the same `time` with the variables of `Pose.to_xarray`.
    """
    pose = settle(rover, terrain, *(run[name].to_numpy() for name in ("x", "y", "yaw")), steering=run["steering"].to_numpy())
    time, distance = run["time"].to_numpy(), run["distance"].to_numpy()
    attrs = {
        "source": f"rockerbogie {__version__} settle, along: {run.attrs.get('source', 'a run')}",
        "status_summary": summary(pose.status, distance),
    }
    return run_dataset(rover, terrain, time, distance, {name: getattr(pose, name) for name in VARIABLES}, attrs)


def compare(run: xr.Dataset, sim: xr.Dataset) -> Comparison:
    """RMS and worst difference of height, attitude, joint and contact angles between two runs, record by record.

    They are compared at equal x, y and yaw. A simulated rover sways and skids off its path, and some centimetres further on
    the ground is another: where the two stand at different places, the rover of `run` is settled at those of `sim`
    (`settle_along`) and that is compared.

    Raises:
        RockerbogieError: the runs stand at different places and were read from files, so that rover and terrain are not known.
    """
    if sim.sizes["time"] == 0:
        raise RockerbogieError("the second run has no records: there is nothing to compare")
    names = [data.attrs.get("rover") for data in (run, sim)]
    if names[0] != names[1]:
        raise RockerbogieError(f"the runs are of two rovers, {names[0]!r} and {names[1]!r}: compare runs of one")
    elsewhere = _elsewhere(run, sim)
    if elsewhere and "simulate" in run.attrs.get("source", "") and "simulate" not in sim.attrs.get("source", ""):
        raise RockerbogieError(
            "give the kinematic run first and the simulation second: the first is settled where the second stands"
        )
    if elsewhere:
        scene: tuple[Rover, Terrain] | None = run.encoding.get(SCENE, sim.encoding.get(SCENE))
        if scene is None:
            raise RockerbogieError(f"the runs {elsewhere}: compare settle_along(rover, terrain, sim) with sim")
        if scene[1].name != sim.attrs.get("terrain"):
            raise RockerbogieError(
                f"the runs are on two grounds, {scene[1].name!r} and {sim.attrs.get('terrain')!r}: compare on one"
            )
        run = settle_along(*scene, sim)
    distance = sim["distance"].to_numpy()
    channels = []
    for name, dim in COMPARED.items():
        difference = run[name].to_numpy() - sim[name].to_numpy()
        unit = sim[name].attrs["units"]
        if unit == "rad":
            difference = wrap_angle(difference)
        labels = [name] if dim is None else [f"{name} {label}".replace("_", " ") for label in sim[dim].to_numpy()]
        channels += [
            _channel(label, unit, column, distance) for label, column in zip(labels, np.atleast_2d(difference.T), strict=True)
        ]
    return Comparison(tuple(channels), resettled=bool(elsewhere))


def _elsewhere(run: xr.Dataset, sim: xr.Dataset) -> str:
    """In what way the runs do not stand at the same places record by record; nothing if they do."""
    if run.sizes["time"] != sim.sizes["time"]:
        return f"have {run.sizes['time']} and {sim.sizes['time']} records"
    apart = max(float(np.abs(run[name].to_numpy() - sim[name].to_numpy()).max()) for name in ("x", "y"))
    turned = float(np.abs(wrap_angle(run["yaw"].to_numpy() - sim["yaw"].to_numpy())).max())
    if max(apart, turned) <= SAME_PLACE:
        return ""
    return f"stand up to {apart:.3g} m and {np.degrees(turned):.3g} deg apart, where angles differ anyway"


def _channel(name: str, unit: str, difference: Array, distance: Array) -> Channel:
    known = np.isfinite(difference)
    if not known.any():
        return Channel(name, unit, np.nan, np.nan, np.nan, 0)
    size = np.where(known, np.abs(difference), -1.0)
    k = int(np.argmax(size))
    return Channel(
        name, unit, float(np.sqrt(np.mean(difference[known] ** 2))), float(size[k]), float(distance[k]), int(known.sum())
    )
