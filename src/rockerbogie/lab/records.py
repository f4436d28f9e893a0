"""Runs as arrays that are played back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..rover.model import Rover
from ..rover.rotations import wrap_angle
from ..settling.pose import Pose
from ..simulation.compare import settle_along
from ..terrain.heightfield import Terrain
from .charts import Line, chart
from .state import standing

if TYPE_CHECKING:
    import xarray as xr


class Frame(NamedTuple):
    """Moment of a run, interpolated between two records."""

    position: tuple[float, float, float]  # x, y (m) and yaw (rad)
    q: Array  # (6,) z, roll, pitch, rocker, bogies; NaN where the run has no pose
    steering: Array  # (6,) rad
    wheel_turn: Array  # (6,) rad
    nearest: int  # of the nearest record


@dataclass(frozen=True, eq=False)
class Record:
    """Run of one rover on one terrain, in memory."""

    run: xr.Dataset
    poses: Pose  # (n,)
    time: Array  # (n,) s, from 0
    distance: Array  # (n,) m
    wheel_turn: Array  # (n, 6) rad

    @classmethod
    def of(cls, rover: Rover, terrain: Terrain, run: xr.Dataset) -> Record:
        """Return a run as arrays.

        Args:
            rover: its rover.
            terrain: its terrain.
            run: from `drive`, `simulate` or a file of theirs.

        Returns:
            The record.

        Raises:
            RockerbogieError: a Dataset that is not a run.
        """
        needed = ("x", "y", "yaw", "z", "roll", "pitch", "rocker", "bogie", "steering", "status")
        missing = [name for name in needed if name not in run]
        if missing or run.sizes.get("time", 0) < 2:
            raise RockerbogieError(
                f"it is not a run of `drive` or `simulate`: {', '.join(missing) if missing else 'two records'} missing"
            )
        value = {name: np.asarray(run[name].values, dtype=float) for name in needed}
        q = np.stack([value["z"], value["roll"], value["pitch"], value["rocker"], *value["bogie"].T], axis=1)
        status = value["status"].astype(np.uint8)
        poses = Pose(rover, terrain, value["x"], value["y"], np.unwrap(value["yaw"]), value["steering"], q, status)
        time = np.asarray(run["time"].values, dtype=float)
        rates = np.nan_to_num(np.asarray(run["wheel_rate"].values, dtype=float)) if "wheel_rate" in run else np.zeros((len(q), 6))
        turned = np.concatenate([np.zeros((1, 6)), np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(time)[:, None], axis=0)])
        distance = np.asarray(run["distance"].values, dtype=float)
        return cls(run, poses, time - time[0], distance, turned)

    @property
    def duration(self) -> float:
        """Time from the first to the last record, s."""
        return float(self.time[-1])

    def at(self, time: float) -> Frame:
        """Return the moment of a time.

        Args:
            time: s, clipped to the run.

        Returns:
            The frame, linear between two records; yaw continuous.
        """
        time = min(max(time, 0.0), self.duration)
        k = int(np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2))
        share = (time - self.time[k]) / max(self.time[k + 1] - self.time[k], 1e-12)

        def mix(values: Array) -> Array:
            return np.asarray((1 - share) * values[k] + share * values[k + 1])

        p = self.poses
        position = (float(mix(p.x)), float(mix(p.y)), float(mix(p.yaw)))
        return Frame(position, mix(p.q), mix(p.steering), mix(self.wheel_turn), k + round(share))

    def pose(self, index: int) -> Pose:
        """Return the pose of one record.

        Args:
            index: of the record.

        Returns:
            The pose, shape ().
        """
        p = self.poses
        status = np.asarray(p.status[index])
        return Pose(p.rover, p.terrain, p.x[index], p.y[index], p.yaw[index], p.steering[index], p.q[index], status)

    def drawn(self, frame: Frame) -> Array:
        """Return the joint values with which a frame is drawn.

        Args:
            frame: from `at`.

        Returns:
            (6,) those of the frame, or a level rover on the terrain where it has no pose.
        """
        if np.isfinite(frame.q).all():
            return frame.q
        return standing(self.poses.rover, self.poses.terrain, frame.position[0], frame.position[1])

    def charts(self, time: float) -> list[str]:
        """Draw attitude, joint and contact angles over the distance, with a cursor.

        Args:
            time: of the cursor, s.

        Returns:
            SVG texts.
        """
        degrees = 180 / np.pi
        p = self.poses
        cursor = float(np.interp(time, self.time, self.distance))
        names = p.rover.wheel_names
        contact = np.asarray(self.run["contact_angle"].values, dtype=float) if "contact_angle" in self.run else None
        groups = [
            ("attitude", [Line("roll", p.roll), Line("pitch", p.pitch)]),
            ("joints", [Line("rocker", p.rocker), Line("bogie left", p.bogie[:, 0]), Line("bogie right", p.bogie[:, 1])]),
        ]
        if contact is not None:
            groups.append(("contact angles", [Line(name, contact[:, i]) for i, name in enumerate(names)]))
        return [
            chart(title, "°", self.distance, "distance [m]", [Line(line.name, degrees * line.values) for line in lines], cursor)
            for title, lines in groups
        ]


class Difference(NamedTuple):
    """Differences between the kinematic model and a simulation at equal x, y and yaw."""

    time: Array  # (n,) s
    angles: dict[str, Array]  # name -> (n,) rad

    def chart(self, time: float) -> str:
        """Draw the differences over time, with a cursor.

        Args:
            time: of the cursor, s.

        Returns:
            SVG text with the RMS of each angle.
        """
        lines = []
        for name, value in self.angles.items():
            degrees = np.degrees(value)
            known = degrees[np.isfinite(degrees)]
            rms = float(np.sqrt((known**2).mean())) if known.size else float("nan")
            lines.append(Line(f"{name} (RMS {rms:.3f}°)", degrees))
        return chart("model − MuJoCo at equal x, y, yaw", "°", self.time, "time [s]", lines, time)


def difference(rover: Rover, terrain: Terrain, simulated: xr.Dataset) -> Difference:
    """Return the differences between the kinematic model and a simulation, record by record.

    Args:
        rover: of both.
        terrain: of both.
        simulated: from `simulate`.

    Returns:
        Roll, pitch, rocker and bogies of the model at the simulation's x, y and yaw, minus the simulation's.
    """
    model = settle_along(rover, terrain, simulated)
    angles = {name: wrap_angle(model[name].values - simulated[name].values) for name in ("roll", "pitch", "rocker")}
    bogie = wrap_angle(model["bogie"].values - simulated["bogie"].values)
    angles |= {"bogie left": bogie[:, 0], "bogie right": bogie[:, 1]}
    time = np.asarray(simulated["time"].values, dtype=float)
    return Difference(time - time[0], angles)
