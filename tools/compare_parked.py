"""Compare required friction, normal forces and tips with MuJoCo, wheels locked.

    python tools/compare_parked.py --poses 200 --seed 0
    python tools/compare_parked.py --loads --poses 200 --write
    PYTHONPATH=tests python tools/compare_parked.py --tips --poses 16 --write

Each rover has thin wheels, fixed to their links; rockers, bogies and the differential move. Under each wheel lies the plane
that is tangent to the terrain at its contact, so that both models have the same contact normals. The rover is parked at high
friction, which then falls slowly until the rover slides. With `--tips`, gravity turns slowly in evenly spaced azimuths until the
rover, on a level plane, moves by 10°; then wheels have their width. `--write` writes the table between its markers in the docs.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
from pathlib import Path
from typing import Any

import numpy as np

import rockerbogie as rb
from rockerbogie.simulation.mjcf import add_mechanism, empty_spec

ROVERS = ("curiosity", "osr", "sawppy")
#: Ranges of the slope of planes, and of required friction, that are compared.
SLOPES, FRICTIONS = (np.radians(5.0), np.radians(35.0)), (0.05, 1.2)
#: Time step; time in which gravity sets in, and in which the rover comes to rest, s.
STEP, SETTLING, PARKING = 0.002, 0.4, 1.6
#: Times (s) after that, and friction coefficients relative to the required one, between which friction falls linearly. Near 1 it
#: falls slowly: a rover that begins to slide needs a second or two to move by `SLID`.
TIMES, FACTORS = (0.0, 3.0, 35.0), (1.6, 1.25, 0.85)
#: Share of the wheelbase that the body moves, or angle (rad) by which a joint turns, if the rover is lost while it is parked; and
#: if it slides after that.
FAR, SLID = 0.04, 0.02

#: Tips: friction coefficient, rate of gravity's turn (rad/s) and change of attitude or of a joint (rad) that counts as a tip.
GRIP, RATE, MOVED = 1.3, np.radians(0.1), np.radians(10.0)
#: A rover whose limit is this close to the friction angle slides rather than tips, rad.
SLIDES = np.radians(0.05)
#: Page and name of the markers of each table.
TABLES = {"loads": ("forces.md", "parked loads"), "tips": ("stability.md", "parked tips")}
DOCS = Path(__file__).parents[1] / "docs"


class Parked:
    """A rover with locked wheels in MuJoCo, each on its own plane."""

    def __init__(self, rover: rb.Rover, pose: rb.Pose) -> None:
        import mujoco

        self.mujoco, self.wheelbase = mujoco, rover.wheelbase
        spec = empty_spec("parked")
        spec.option.timestep = STEP
        points, normals = pose.contact_point.reshape(6, 3), pose.contact_normal.reshape(6, 3)
        for i, (point, normal) in enumerate(zip(points, normals, strict=True)):
            place: dict[str, Any] = {"pos": point - [float(pose.x), float(pose.y), 0.0], "quat": _turn_up_to(normal)}
            bits = {"contype": 2 << i, "conaffinity": 0, "priority": -1}
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1], **place, **bits)
        base = spec.worldbody.add_body(name="body")
        base.add_freejoint(name="free")
        add_mechanism(spec, rover, base, friction=1.0, wheel_joints=False)
        names = [f"wheel_{name}" for name in rover.wheel_names]
        for geom in spec.geoms:
            if geom.name in names or geom.name == "body":
                geom.contype, geom.conaffinity = 0, (2 << names.index(geom.name) if geom.name in names else 0)
        self.model = spec.compile()
        self.start = mujoco.MjData(self.model)
        w, x, y, z = _quaternion(float(pose.roll), float(pose.pitch), float(pose.yaw))
        self.start.qpos[:7] = [0.0, 0.0, float(pose.z), w, x, y, z]
        right = float(rover.right_rocker(float(pose.rocker)))
        angles = {"rocker_left": float(pose.rocker), "rocker_right": right}
        angles |= {f"bogie_{side}": float(pose.bogie[k]) for k, side in enumerate(("left", "right"))}
        for name, angle in angles.items():
            self.start.qpos[self.model.joint(name).qposadr[0]] = angle
        mujoco.mj_forward(self.model, self.start)
        self.wheels = [self.model.geom(name).id for name in names]

    def slides_at(self, required: float) -> float:
        """Return the friction at which the parked rover slides, relative to the required one.

        Args:
            required: friction coefficient.

        Returns:
            The relative coefficient; NaN if the rover is lost before friction falls, or holds at the lowest one.
        """
        mujoco, model = self.mujoco, self.model
        data = mujoco.MjData(model)
        data.qpos[:] = self.start.qpos
        parking = int(PARKING / STEP)
        parked = self.start.qpos
        for n in range(parking + int(TIMES[-1] / STEP)):
            factor = float(np.interp(n * STEP - PARKING, TIMES, FACTORS))
            model.geom_friction[self.wheels, 0] = factor * required
            model.opt.gravity[2] = -9.81 * min(1.0, n * STEP / SETTLING)
            mujoco.mj_step(model, data)
            if n == parking:
                parked = data.qpos.copy()
                if self._moved(self.start.qpos, parked) > FAR:
                    return np.nan
            if n > parking and self._moved(parked, data.qpos) > SLID:
                return factor
        return np.nan

    def normal_forces(self, friction: float) -> np.ndarray:
        """Return the normal forces (6,) of the rover at a friction coefficient, of the weight."""
        mujoco, model = self.mujoco, self.model
        data, force = mujoco.MjData(model), np.empty(6)
        data.qpos[:] = self.start.qpos
        model.geom_friction[self.wheels, 0] = friction
        for n in range(int(PARKING / STEP)):
            model.opt.gravity[2] = -9.81 * min(1.0, n * STEP / SETTLING)
            mujoco.mj_step(model, data)
        found = np.zeros(6)
        for k in range(data.ncon):
            mujoco.mj_contactForce(model, data, k, force)
            wheel = next(i for i, geom in enumerate(self.wheels) if geom in data.contact[k].geom)
            found[wheel] += force[0]
        return found / (9.81 * float(model.body_mass.sum()))

    def _moved(self, before: np.ndarray, now: np.ndarray) -> float:
        """Return the greatest change of position (over the wheelbase) or of a joint (rad)."""
        change = now - before
        return max(float(np.linalg.norm(change[:3])) / self.wheelbase, float(np.abs(change[7:]).max()))


def _turn_up_to(normal: np.ndarray) -> np.ndarray:
    """Return the quaternion (w, x, y, z) that turns the vertical to a normal."""
    q = np.array([1.0 + normal[2], -normal[1], normal[0], 0.0])
    return q / np.linalg.norm(q)


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z) of Rz(yaw) Ry(pitch) Rx(roll)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    return w, x, y, z


def draw_pose(rng: np.random.Generator, rover: rb.Rover, ground: str) -> rb.Pose | None:
    """Return a random pose on a plane or on rocks, or None if it is not one to compare."""
    size = 2.5 * rover.wheelbase
    yaw = rng.uniform(0, 2 * np.pi)
    if ground == "planes":
        slope, way = np.tan(rng.uniform(*SLOPES)), rng.uniform(0, 2 * np.pi)
        at = np.arange(-size, size + 0.05, size / 10)
        z = slope * (np.cos(way) * at[None, :] + np.sin(way) * at[:, None])
        terrain = rb.Terrain.from_array(z, size / 10, (-size, -size), "linear")
        pose = rb.settle(rover, terrain, 0.0, 0.0, yaw)
    else:
        terrain = rb.surfaces.rocks(seed=int(rng.integers(1000)))
        xmin, ymin, xmax, ymax = terrain.bounds
        room = 1.2 * rover.wheelbase
        pose = rb.settle(rover, terrain, rng.uniform(xmin + room, xmax - room), rng.uniform(ymin + room, ymax - room), yaw)
    if pose.status != rb.Status.CONVERGED or np.any(pose.joint_stop):
        return None
    loads = rb.wheel_loads(pose)
    return pose if FRICTIONS[0] < float(loads.required_friction) < FRICTIONS[1] else None


def compare(case: tuple[str, str, int, int]) -> list[float]:
    """Return the relative thresholds of some random poses of a rover."""
    name, ground, poses, seed = case
    rng = np.random.default_rng([seed, ROVERS.index(name), ground == "rocks"])
    rover = rb.load_rover(name).replace(wheel_width=0.0, masses="keep")
    found = []
    while len(found) < poses:
        pose = draw_pose(rng, rover, ground)
        if pose is not None:
            found.append(Parked(rover, pose).slides_at(float(rb.wheel_loads(pose).required_friction)))
    return found


def compare_loads(name: str, poses: int, seed: int) -> tuple[float, float]:
    """Return the largest differences of normal forces that statics determines, of the weight.

    On a level plane, statics determines all six. On a slope, tractions in the plane have no moment about lines in it, so that
    statics determines their sum and their centre.

    Args:
        name: rover.
        poses: number of headings on the level plane, and of random slopes.
        seed: of the slopes.

    Returns:
        Largest difference of a wheel's force on the level plane; of the sum, or of the moment over the farthest contact's
        distance, on slopes.
    """
    rover = rb.load_rover(name).replace(wheel_width=0.0, masses="keep")
    level = rb.surfaces.plane(interpolation="linear")
    worst, worst_sum, rng = 0.0, 0.0, np.random.default_rng([seed, ROVERS.index(name)])
    for yaw in np.linspace(0.0, 2.0 * np.pi, poses, endpoint=False):
        pose = rb.settle(rover, level, 0.0, 0.0, yaw)
        expected = rb.wheel_loads(pose, law="vertical").normal / (rover.mass * rb.GRAVITY["earth"])
        worst = max(worst, float(np.abs(Parked(rover, pose).normal_forces(0.8) - expected).max()))
    for _ in range(poses):
        pose = None
        while pose is None:
            pose = draw_pose(rng, rover, "planes")
        loads = rb.wheel_loads(pose)
        expected = loads.normal / (rover.mass * rb.GRAVITY["earth"])
        found = Parked(rover, pose).normal_forces(1.5 * float(loads.required_friction))
        points = pose.contact_point[:, :] - pose.contact_point.mean(axis=0)
        moment = (found - expected) @ points / np.abs(points).max()
        worst_sum = max(worst_sum, abs(float((found - expected).sum())), float(np.abs(moment).max()))
    return worst, worst_sum


def limit_in_azimuth(pose: rb.Pose, azimuth: float) -> float:
    """Return the tilt of gravity in one azimuth at which GRIP no longer holds a pose, rad."""
    g, low, high = rb.GRAVITY["earth"], 0.0, 1.4
    while high - low > 1e-5:
        tilt = 0.5 * (low + high)
        turned = g * np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), -np.cos(tilt)])
        held = float(rb.wheel_loads(pose, acceleration=np.array([0.0, 0.0, -g]) - turned).required_friction) <= GRIP
        low, high = (tilt, high) if held else (low, tilt)
    return low


def compare_tips(case: tuple[str, int]) -> list[tuple[float, float, float]]:
    """Return azimuth, predicted tilt and MuJoCo's tilt at which a rover is lost, rad.

    Args:
        case: rover, and number of azimuths.
    """
    import mujoco

    from support.braked import tilt_of_loss

    name, count = case
    rover = rb.load_rover(name)
    pose = rb.settle(rover, rb.surfaces.plane(interpolation="linear"), 0.0, 0.0)
    found = []
    for azimuth in np.linspace(0.0, 2.0 * np.pi, count, endpoint=False):
        expected = limit_in_azimuth(pose, azimuth)
        found.append((azimuth, expected, tilt_of_loss(mujoco, rover, azimuth, GRIP, expected, RATE, MOVED)))
    return found


def tips_table(count: int) -> str:
    """Return the table of tips.

    Args:
        count: number of azimuths.
    """
    table = "| rover | azimuths | it tips in | of these within 0.5° | largest difference | it slides in | largest difference |\n"
    table += "|---" * 7 + "|\n"
    with multiprocessing.Pool() as pool:
        results = pool.map(compare_tips, [(name, count) for name in ROVERS], chunksize=1)
    for name, found in zip(ROVERS, results, strict=True):
        _, expected, seen = np.array(found).T
        error, slides = np.degrees(np.abs(seen - expected)), expected > np.arctan(GRIP) - SLIDES
        worst = [f"{error[some].max():.2f}°" if some.any() else "–" for some in (~slides, slides)]
        close = int((error[~slides] <= 0.5).sum())
        table += f"| {name} | {count} | {(~slides).sum()} | {close} | {worst[0]} | {slides.sum()} | {worst[1]} |\n"
    return table


def loads_table(poses: int, seed: int) -> str:
    """Return the table of normal forces.

    Args:
        poses, seed: as for `compare_loads`.
    """
    table = "| rover | level plane: a wheel | slopes: sum or centre |\n|---|---|---|\n"
    for name in ROVERS:
        worst, worst_sum = compare_loads(name, poses, seed)
        table += f"| {name} | {100 * worst:.2f} % | {100 * worst_sum:.2f} % |\n"
    return table


def write_table(kind: str, table: str) -> None:
    """Write a table between its markers.

    Args:
        kind: key of TABLES.
        table: Markdown.
    """
    page, name = DOCS / TABLES[kind][0], TABLES[kind][1]
    first, last = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    before, _, rest = page.read_text().partition(first)
    page.write_text(f"{before}{first}\n{table}\n{last}{rest.partition(last)[2]}")


def main() -> None:
    """Run the comparison and print its table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--poses", type=int, default=200, help="poses of each rover on each kind of terrain")
    parser.add_argument("--ground", choices=("planes", "rocks"), action="append", help="default: both")
    parser.add_argument("--loads", action="store_true", help="compare normal forces on planes instead of friction")
    parser.add_argument("--tips", action="store_true", help="compare the tilts at which rovers tip, in --poses azimuths")
    parser.add_argument("--write", action="store_true", help="write the table of --loads or --tips into the docs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="write the thresholds as JSON")
    options = parser.parse_args()
    if options.loads or options.tips:
        table = loads_table(options.poses, options.seed) if options.loads else tips_table(options.poses)
        print(table)
        if options.write:
            write_table("loads" if options.loads else "tips", table)
        return
    cases = [(name, ground, options.poses, options.seed) for ground in options.ground or ("planes", "rocks") for name in ROVERS]
    with multiprocessing.Pool() as pool:
        results = pool.map(compare, cases, chunksize=1)
    columns = ("terrain", "rover", "poses", "median", "90 % within", "worst", "not found", "within 5 %", "within 10 %")
    print("| " + " | ".join(columns) + " |\n" + "|---" * len(columns) + "|")
    for (name, ground, poses, _), found in zip(cases, results, strict=True):
        error = np.abs(np.array(found) - 1.0)
        lost = int(np.isnan(error).sum())
        shares = [f"{100 * np.mean(error <= bound):.1f} %" for bound in (0.05, 0.10)]
        spread = [f"{100 * value:.1f} %" for value in (np.nanquantile(error, 0.9), np.nanmax(error))]
        cells = (ground, name, poses, f"{np.nanmedian(found):.3f}", *spread, lost, *shares)
        print("| " + " | ".join(map(str, cells)) + " |")
    if options.output:
        if options.output.exists():
            raise SystemExit(f"{options.output} exists: give another name")
        options.output.write_text(json.dumps([[*case, found] for case, found in zip(cases, results, strict=True)]))


if __name__ == "__main__":
    main()
