"""Cases of the golden outputs: rovers, terrains and results, by public names only.

Each group is a function that yields pairs (name, array or text). Inputs depend on the group's name only, so that one group
can be computed without the others. Lengths scale with the wheel radius, so that each rover has terrain of its own size.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import tomllib
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import rockerbogie as rb

Item = tuple[str, Any]
Group = Callable[[], Iterator[Item]]

PRESETS = ("curiosity", "elhami-dashti", "osr", "perseverance", "rocky7", "sawppy")
ROVERS = (*PRESETS, "custom")
SURFACES = (
    "ditch",
    "fractal",
    "mars",
    "paper",
    "plane",
    "ramp",
    "rocks",
    "rough",
    "sine",
    "step",
    "noise",
    "holes",
    "steep",
    "boulders",
)
#: Surfaces on which wheels lift, joints reach their limits and bodies touch.
HARD = ("rocks", "step", "rough", "noise", "holes", "steep", "boulders")
INTERPOLATIONS = ("cubic", "linear")
#: Node distances in wheel radii; the cases take turns.
CELLS = (0.15, 0.3, 0.6, 1.0)
SIDE = 60.0  # of a map, in wheel radii
CONTACT_POSES, MOTION_POSES = 101, 40
#: In equilibrium mode a pose takes 1 to 2 ms, so there are fewer.
EQUILIBRIUM_POSES, EQUILIBRIUM_POSES_HARD = 1, 3
STABILITY_POSES = 12  # on each surface


def generator(name: str) -> np.random.Generator:
    """Return a random generator seeded by a name.

    Only its method `random` is used, because it gives the same numbers in every NumPy version.
    """
    return np.random.default_rng(zlib.crc32(name.encode()))


def uniform(rng: np.random.Generator, low: float, high: float, *shape: int) -> np.ndarray:
    """Return random numbers of the shape, uniform in [low, high)."""
    return low + (high - low) * rng.random(shape)


@functools.cache
def rover_of(name: str) -> rb.Rover:
    """Return a preset, or the rover "custom" with unequal wheels and a nonlinear differential."""
    if name != "custom":
        return rb.load_rover(name)
    return rb.Rover.from_pivots(
        name="custom",
        wheel_radius=(0.1, 0.1, 0.11),
        wheel_width=(0.06, 0.0, 0.08),
        rocker_pivot=(0.05, 0.3, 0.15),
        bogie_pivot=(-0.2, 0.3, 0.08),
        hubs=[(0.42, 0.32, -0.1), (-0.02, 0.36, -0.1), (-0.4, 0.32, -0.11)],
        steers=(True, False, True),
        steering_offset=(0.01, 0.02),
        rocker_limits=(-0.5, 0.6),
        bogie_limits=(-0.7, 0.7),
        differential=(0.0, -0.9, 0.1, -0.05),
    )


@functools.cache
def terrain_of(rover: str, surface: str, interpolation: Any) -> rb.Terrain:
    """Return the terrain of a case, scaled by the rover's wheel radius."""
    unit = float(rover_of(rover).wheel_radius[0])
    turn = ROVERS.index(rover) + SURFACES.index(surface) + INTERPOLATIONS.index(interpolation)
    cell = CELLS[turn % len(CELLS)] * unit
    grid: dict[str, Any] = {"size": SIDE * unit, "spacing": cell, "interpolation": interpolation}
    make, seed = rb.surfaces, 7 + turn
    match surface:
        case "plane":
            return make.plane(0.15, 0.6, **grid)
        case "steep":
            return make.plane(0.85, 1.1, **grid)
        case "boulders":
            return boulders(f"{rover}/{surface}/{interpolation}", unit, cell, interpolation)
        case "ramp":
            return make.ramp(0.3, 2.0 * unit, start=2.0 * unit, direction=0.4, corner=0.4 * unit, **grid)
        case "step":
            return make.step(0.8 * unit, start=0.0, direction=0.3, **grid)
        case "ditch":
            return make.ditch(1.0 * unit, 2.5 * unit, start=0.0, direction=-0.5, **grid)
        case "sine":
            return make.sine(0.8 * unit, 16.0 * unit, direction=0.7, **grid)
        case "rough":
            grid["spacing"] = min(cell, 0.3 * unit)
            return make.rough(seed, max_slope=0.35, min_radius=3.0 * unit, **grid)
        case "fractal":
            return make.fractal(seed, rms_slope=0.14, **grid)
        case "rocks":
            return make.rocks(0.15, seed, smallest=max(unit, 2.01 * cell), largest=6.0 * unit, **grid)
        case "mars":
            rocks = {"smallest_rock": max(1.5 * unit, 2.01 * cell), "largest_rock": 8.0 * unit}
            return make.mars(seed, crater_density=0.3, smallest_crater=10.0 * unit, **rocks, **grid)
        case "paper":
            length = {"run_in": 10, "length": 20, "hill_amplitude": 1.5, "ramp_height": 2, "corner": 10 / 75, "seam": 2}
            length |= {"run_out": 20, "behind": 10, "width": 20, "spacing": 10 / 75}
            return make.paper(**{key: value * unit for key, value in length.items()}, interpolation=interpolation)
    return random_terrain(f"{rover}/{surface}/{interpolation}", unit, cell, surface == "holes", interpolation)


def random_terrain(name: str, unit: float, cell: float, missing: bool, interpolation: Any) -> rb.Terrain:
    """Return white noise, or smoother terrain with missing data and a far origin if `missing`.

    The latter has unequal spacing along x and y, and heights near −4450 m.
    """
    rng = generator(name)
    count = int(SIDE * unit / cell)
    z = uniform(rng, -0.4, 0.4, count, count) * unit
    if not missing:
        return rb.Terrain.from_array(z, cell, (-SIDE * unit / 2, -SIDE * unit / 2), interpolation)
    z = (z + np.roll(z, 1, 0) + np.roll(z, 1, 1) + np.roll(z, (1, 1), (0, 1))) / 3
    z[rng.random(z.shape) < 0.2 * (cell / (SIDE * unit)) ** 2 * 100] = np.nan  # some 20 nodes
    z[: count // 5, : count // 4] = np.nan
    return rb.Terrain.from_array(z - 4450.0, (cell, 1.25 * cell), (12345.5, -987.25), interpolation)


def boulders(name: str, unit: float, cell: float, interpolation: Any) -> rb.Terrain:
    """Return level terrain with cones high enough to reach the body of a rover."""
    rng = generator(name)
    axis = -SIDE * unit / 2 + cell * np.arange(int(SIDE * unit / cell))
    z = np.zeros((len(axis), len(axis)))
    for x, y in uniform(rng, -26, 26, 60, 2) * unit:
        z = np.maximum(z, 3.5 * unit - 2.0 * np.hypot(axis - x, axis[:, None] - y))
    return rb.Terrain.from_array(z, cell, (axis[0], axis[0]), interpolation)


def positions(name: str, terrain: rb.Terrain, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return random x, y (m) and yaw (rad), each (count,); some are across the map's edge."""
    rng = generator(name)
    xmin, ymin, xmax, ymax = terrain.bounds
    x, y = (0.5 * (a + b) + 0.5 * (b - a) * uniform(rng, -0.88, 0.88, count) for a, b in ((xmin, xmax), (ymin, ymax)))
    return x, y, uniform(rng, -np.pi, np.pi, count)


def steering_of(name: str, rover: rb.Rover, count: int) -> np.ndarray:
    """Return steering (count, 6), rad: 0 in the first half of the poses, random in the second."""
    angle = uniform(generator(name + "/steering"), -0.6, 0.6, count, 6) * rover.steers
    angle[: count // 2] = 0.0
    return angle


def pose_items(pose: rb.Pose) -> Iterator[Item]:
    """Yield the results of a settled pose that both modes have."""
    yield "q", np.stack([pose.z, pose.roll, pose.pitch, pose.rocker, pose.bogie[..., 0], pose.bogie[..., 1]], axis=-1)
    for name in ("status", "contact_count", "clearance", "gap", "contact_angle", "contact_point", "contact_normal", "joint_stop"):
        yield name, getattr(pose, name)


def contact(name: str, rover: str, surface: str, interpolation: str) -> Iterator[Item]:
    """Yield heights and normals of the terrain, and poses settled in contact mode."""
    terrain, machine = terrain_of(rover, surface, interpolation), rover_of(rover)
    x, y, yaw = positions(name, terrain, CONTACT_POSES)
    yield "terrain.z", terrain.z
    yield "terrain.height", terrain.height(x, y)
    yield "terrain.normal", terrain.normal(x, y)
    yield from pose_items(rb.settle(machine, terrain, x, y, yaw, steering=steering_of(name, machine, len(x))))


def equilibrium(name: str, rover: str, surface: str, interpolation: str) -> Iterator[Item]:
    """Yield poses settled in equilibrium mode, with the support of the wheels and of the body."""
    terrain = terrain_of(rover, surface, interpolation)
    count = EQUILIBRIUM_POSES_HARD if surface in HARD else EQUILIBRIUM_POSES
    pose = rb.settle(rover_of(rover), terrain, *positions(name, terrain, count), mode="equilibrium")
    yield from pose_items(pose)
    for channel in ("support", "belly_support", "wheel_lifted"):
        yield channel, getattr(pose, channel)


def stability(name: str, rover: str) -> Iterator[Item]:
    """Yield tip margins of poses in contact mode on every surface."""
    machine = rover_of(rover)
    for surface in SURFACES:
        for interpolation in INTERPOLATIONS:
            label = f"{surface}.{interpolation}"
            terrain = terrain_of(rover, surface, interpolation)
            where = positions(f"{name}/{label}", terrain, STABILITY_POSES)
            found = rb.stability(rb.settle(machine, terrain, *where))
            for key in ("tip_margin", "tip_bound", "tip_angle", "stays", "force_angle", "energy"):
                yield f"{label}.{key}", getattr(found, key)


def motion(name: str, rover: str) -> Iterator[Item]:
    """Yield frames, Jacobians, twists, commands and slip of poses on smooth terrain."""
    machine, terrain, rng = rover_of(rover), terrain_of(rover, "rough", "cubic"), generator(name)
    x, y, yaw = positions(name, terrain, MOTION_POSES)
    turn = steering_of(name, machine, MOTION_POSES)
    settled = np.isfinite(rb.settle(machine, terrain, x, y, yaw, steering=turn).z)  # `wheel_commands` refuses NaN
    turn = turn[settled]
    pose = rb.settle(machine, terrain, x[settled], y[settled], yaw[settled], steering=turn)
    count = len(turn)
    rates = {"wheel_rates": uniform(rng, -1, 1, count, 6), "rocker_rate": uniform(rng, -0.1, 0.1, count)}
    rates["bogie_rates"] = uniform(rng, -0.1, 0.1, count, 2)
    twist = uniform(rng, -0.1, 0.1, count, 6)
    yield "wheel_frames", rb.wheel_frames(machine, pose.rocker, pose.bogie, turn)
    yield "wheel_jacobians", rb.wheel_jacobians(machine, pose)
    found = rb.body_twist(machine, pose, **rates, gyro=uniform(rng, -0.1, 0.1, count, 3))
    for key in ("twist", "covariance", "rocker_rate", "bogie_rates", "residual"):
        yield f"body_twist.{key}", getattr(found, key)
    for label, options in (
        ("free", {}),
        ("limited", {"wheel_rate_limit": 0.2, "steering_limit": 0.4}),
        ("set", {"steering": turn}),
    ):
        sent = rb.wheel_commands(machine, pose, twist, **options)
        for key in ("wheel_rates", "steering", "twist", "rocker_rate", "bogie_rates", "speed_scale", "side_slip", "turn_slip"):
            yield f"wheel_commands.{label}.{key}", getattr(sent, key)
    for label, given in (("all", rates), ("wheels", {"wheel_rates": rates["wheel_rates"]})):
        slip = rb.wheel_slip(machine, pose, twist, **given)
        for key in ("roll", "side", "turn", "lift", "ratio", "angle"):
            yield f"wheel_slip.{label}.{key}", getattr(slip, key)


def dataset_items(label: str, data: Any) -> Iterator[Item]:
    """Yield the numbers of a Dataset, variable by variable."""
    stored = {"distance_3d": "distance", "distance": "distance_horizontal"} if "distance_3d" in data.coords else {}
    for key in (*data.coords, *data.data_vars):
        if data[key].dtype.kind in "fiub":
            yield f"{label}.{stored.get(str(key), key)}", data[key].values


def drive(name: str, rover: str) -> Iterator[Item]:
    """Yield a run along rounded waypoints, and odometry of its log with random errors."""
    machine, terrain = rover_of(rover), terrain_of(rover, "sine", "cubic")
    unit = float(machine.wheel_radius[0])
    path = rb.Path.waypoints(np.array([(-16, -12), (-4, 6), (10, 8), (18, -6)]) * unit, radius=6 * unit)
    run = rb.drive(machine, terrain, path, speed=0.5 * unit, step=0.5 * unit)
    yield from dataset_items("run", run)
    rng = generator(name)
    log = run[["wheel_rate", "steering", "rocker", "bogie", "roll", "pitch", "yaw"]].copy(deep=True)
    log["wheel_rate"] = log["wheel_rate"] * uniform(rng, 0.9, 1.1, *log["wheel_rate"].shape)
    log["pitch"] = log["pitch"] + uniform(rng, -0.01, 0.01, *log["pitch"].shape)
    start = tuple(float(run[key][0]) for key in "xyz")
    yield from dataset_items("odometry", rb.odometry(machine, log, start=start))
    yield from dataset_items("odometry.map", rb.odometry(machine, log, terrain, start=start))
    yield from dataset_items("odometry.soil", rb.odometry(machine, log, start=start, soil=rb.SlopeSlip(0.5, 0.3)))
    yield from dataset_items("odometry.flat", rb.flat_odometry(machine, log, start=start))


def paper_run(name: str) -> Iterator[Item]:
    """Yield the run of the paper's rover over the paper's terrain, at the default sizes."""
    path = rb.Path.straight((0.0, 0.0), 0.0, 4.0)
    yield from dataset_items("run", rb.drive(rb.load_rover("elhami-dashti"), rb.surfaces.paper(), path, step=0.02))


def traversability(name: str) -> Iterator[Item]:
    """Yield all layers of a traversability map, and a route across it."""
    rover = rb.load_rover("curiosity")
    terrain = rb.surfaces.rocks(0.02, 3, smallest=0.3, base=rb.surfaces.fractal(5, rms_slope=0.09, size=24.0, spacing=0.1))
    maps = rb.traversability(rover, terrain, headings=8, resolution=0.75)
    yield from dataset_items("map", maps)
    way = rb.plan(maps, (-7.0, -7.0), (7.0, 6.0), rover=rover)
    for key, label in (("x", "x"), ("y", "y"), ("yaw", "heading"), ("distance", "distance"), ("cost", "cost"), ("tilt", "tilt")):
        yield f"plan.{label}", getattr(way, key)


def exports(name: str, rover: str) -> Iterator[Item]:
    """Yield the Denavit-Hartenberg table and the exports, without their comments."""
    machine = rover_of(rover)
    rows = rb.dh_table(machine)
    yield "dh.numbers", np.array([(row.theta, row.d, row.a, row.alpha) for row in rows])
    yield "dh.names", "\n".join(f"{row.frame} {row.parent} {row.joint}" for row in rows)
    unit = float(machine.wheel_radius[0])
    part = {"region": (-2 * unit, -2 * unit, 2 * unit, 2 * unit), "cell": 0.5 * unit}
    for label, text in (
        ("mjcf", rb.to_mjcf(machine)),
        ("mjcf.terrain", rb.to_mjcf(machine, terrain_of(rover, "sine", "cubic"), **part)),
        ("urdf", rb.to_urdf(machine)),
        ("urdf.ros2_control", rb.to_urdf(machine, ros2_control=True)),
        ("sdf", rb.to_sdf(machine)),
    ):
        yield label, ElementTree.canonicalize(text, strip_text=True).replace("><", ">\n<")
    yield "toml", json.dumps(tomllib.loads(rb.to_toml(machine)), indent=0)


#: Keys of `settle --json` that were added after the golden outputs were stored.
ADDED_KEYS = ("joint_stop", "support", "belly_support", "wheel_lifted", "support_share", "joints")


def command_line(name: str) -> Iterator[Item]:
    """Yield the record that `rockerbogie settle --json` prints, without the status's meaning."""
    from rockerbogie.cli import main

    place = ["--terrain", "surface:rocks", "--rover", "sawppy", "--at=0.5,-0.75", "--yaw=30", "--json"]
    for mode in ("contact", "equilibrium"):
        text = io.StringIO()
        with contextlib.redirect_stdout(text):
            code = main(["settle", "--mode", mode, *place])
        record = json.loads(text.getvalue())
        for key in ("meaning", *ADDED_KEYS):
            record.pop(key, None)
        yield mode, json.dumps({"exit code": code} | record, indent=0)


def groups() -> dict[str, Group]:
    """Return every group by its name, in the order in which they are computed."""
    found: dict[str, Callable[..., Iterator[Item]]] = {"cli": command_line, "paper-run": paper_run, "map": traversability}
    arguments: dict[str, tuple[str, ...]] = {}
    for rover in ROVERS:
        for label, function in (("exports", exports), ("motion", motion), ("drive", drive)):
            found[f"{label}/{rover}"], arguments[f"{label}/{rover}"] = function, (rover,)
        if rover in PRESETS:  # "custom" has no masses
            found[f"stability/{rover}"], arguments[f"stability/{rover}"] = stability, (rover,)
        for label, settled in (("contact", contact), ("equilibrium", equilibrium)):
            for surface in SURFACES:
                for interpolation in INTERPOLATIONS:
                    name = f"{label}/{rover}/{surface}/{interpolation}"
                    found[name], arguments[name] = settled, (rover, surface, interpolation)
    return {name: functools.partial(function, name, *arguments.get(name, ())) for name, function in found.items()}
