"""Rovers written in each format read back the same, and load in other programs."""

from __future__ import annotations

import io
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.rover.formats import build_rover, presets, read_trees, schema, to_sdf, to_toml, to_urdf
from rockerbogie.rover.formats.toml_read import read_toml
from support.helpers import assert_close, random_rover
from support.mjcf import load_mjcf

NAMES = sorted(presets())
WRITERS: dict[str, Callable[[rb.Rover], str]] = {
    "urdf": to_urdf,
    "urdf with ros2_control": lambda rover: to_urdf(rover, ros2_control=True),
    "sdf": to_sdf,
    "mjcf": rb.to_mjcf,
    "toml": to_toml,
    "toml with options": lambda rover: to_toml(rover, options=True),
}
LENGTHS = ("rocker_pivot", "bogie_pivot", "hubs", "wheel_radius", "wheel_width", "steering_offset", "body_box")
ANGLES = ("rocker_limits", "bogie_limits", "differential")


def read(text: str) -> rb.Rover:
    return build_rover(read_trees(text, "test"), "test").rover if text.lstrip().startswith("<") else read_toml(text)


def assert_same(a: rb.Rover, b: rb.Rover, why: str) -> None:
    for name in LENGTHS:
        assert_close(getattr(a, name), getattr(b, name), 1e-12, "m", f"{name}, {why}")
    for name in ANGLES:
        assert_close(getattr(a, name), getattr(b, name), 1e-12, "rad", f"{name}, {why}")
    assert (a.steers == b.steers).all()
    assert a.wheel_names == b.wheel_names
    scale = max(np.abs(link.inertia).max() for link in b.links)
    for k, (own, other) in enumerate(zip(a.links, b.links, strict=True)):
        assert_close(own.mass, other.mass, 1e-12 * b.mass, "kg", f"mass of link {k}, {why}")
        assert_close(own.com, other.com, 1e-12, "m", f"centre of link {k}, {why}")
        assert_close(own.inertia, other.inertia, 1e-12 * scale, "kg m2", f"inertia of link {k}, {why}")


def strange_rover(seed: int) -> rb.Rover:
    """A rover nobody built, sides unlike, with parts of its own and a ratio for a differential."""
    rng = np.random.default_rng(seed)
    rover = random_rover(rng)
    askew = rng.uniform(-0.01, 0.01, (6, 3)) * rover.wheelbase * (0, 1, 1)
    links = []
    for link in rover.links:
        spin = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        moments = rng.uniform(0.5, 1.0, 3) * link.mass * rover.wheel_radius.min() ** 2
        links.append(rb.Link(link.mass * rng.uniform(0.5, 2), link.com + rng.uniform(-0.02, 0.02, 3), spin * moments @ spin.T))
    steers = np.array([True, True, False, False, True, True]) & bool(seed % 3)
    return rover.replace(
        hubs=rover.hubs + askew,
        steers=steers,
        steering_offset=rover.steering_offset * steers[:, None],  # of a wheel that does not steer, no file says where its axis is
        rocker_limits=np.array([-rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.9)]),
        bogie_limits=np.array([-rng.uniform(0.3, 0.9), np.inf if seed % 2 else 0.5]),
        differential=np.array([0.0, -rng.uniform(0.6, 1.4)]),
        body=links[0], rockers=tuple(links[1:3]), bogies=tuple(links[3:5]), wheels=tuple(links[5:]),
    )  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("form", WRITERS)
def test_presets_come_back(name: str, form: str) -> None:
    rover = rb.load_rover(name)
    assert_same(read(WRITERS[form](rover)), rover, f"{name} through {form}")


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("form", ["urdf", "sdf", "mjcf", "toml"])
def test_strange_rovers_come_back(seed: int, form: str) -> None:
    rover = strange_rover(seed)
    assert_same(read(WRITERS[form](rover)), rover, f"strange rover {seed} through {form}")


def test_a_chain_of_formats() -> None:
    """URDF -> SDF -> TOML -> MJCF -> URDF, reading each."""
    rover = strange_rover(1)
    now = rover
    for form in ("urdf", "sdf", "toml", "mjcf", "urdf"):
        now = read(WRITERS[form](now))
    assert_same(now, rover, "through five files")


@pytest.mark.parametrize("form", ["urdf", "sdf", "toml"])
def test_a_bar_comes_back_whole(form: str) -> None:
    """A differential that is no ratio: formats that know only ratios carry it besides."""
    from test_differential import BAR

    base = rb.load_rover("perseverance")
    rover = base.replace(differential=BAR.polynomial(base.rocker_pivot[0], base.rocker_limits))
    assert_same(read(WRITERS[form](rover)), rover, f"a bar through {form}")


def joint_angles(rover: rb.Rover, rng: np.random.Generator) -> tuple[float, np.ndarray, np.ndarray, dict[str, float]]:
    """Random joint angles, and the same by the joints' names in our URDF."""
    q, b, s = float(rng.uniform(-0.5, 0.5)), rng.uniform(-0.7, 0.7, 2), rng.uniform(-1.5, 1.5, 6) * rover.steers
    by_name = {"rocker_left": q, "rocker_right": float(rover.right_rocker(q)), "bogie_left": b[0], "bogie_right": b[1]}
    for i, wheel in enumerate(rover.wheel_names):
        by_name |= {f"steer_{wheel}": float(s[i])} if rover.steers[i] else {}
        by_name[f"wheel_{wheel}"] = float(rng.uniform(-9, 9))
    return q, b, s, by_name


def assert_wheels(rover: rb.Rover, places: list[np.ndarray], q: float, b: np.ndarray, s: np.ndarray, program: str) -> None:
    expected = rb.wheel_frames(rover, q, b, s)[:, :3, 3]
    assert_close(places, expected, 1e-9, "m", f"{rover.name}: wheels in {program} and in rb.wheel_frames")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("form", ["urdf", "mjcf"])
def test_loads_in_mujoco(name: str, form: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    rover, rng = rb.load_rover(name), np.random.default_rng(1)
    model = mujoco.MjModel.from_xml_string(WRITERS[form](rover))
    assert model.neq == 1, "the differential ties the rockers"
    suffix = "_joint" if form == "urdf" else ""
    data = mujoco.MjData(model)
    for _ in range(10):
        q, b, s, by_name = joint_angles(rover, rng)
        for joint, angle in by_name.items():
            data.joint(joint + suffix).qpos[0] = angle
        mujoco.mj_kinematics(model, data)
        assert_wheels(rover, [data.body(f"wheel_{w}").xpos for w in rover.wheel_names], q, b, s, f"MuJoCo's {form}")


@pytest.mark.parametrize("name", NAMES)
def test_loads_in_pinocchio(name: str) -> None:
    pin = pytest.importorskip("pinocchio")
    rover, rng = rb.load_rover(name), np.random.default_rng(2)
    model = pin.buildModelFromXML(to_urdf(rover))
    data = model.createData()
    assert_close(
        pin.computeTotalMass(model), rover.mass - rover.body.mass, 1e-9 * rover.mass, "kg", "all that moves, the base being fixed"
    )
    for _ in range(10):
        q, b, s, by_name = joint_angles(rover, rng)
        config = pin.neutral(model)
        for joint, angle in by_name.items():
            j = model.joints[model.getJointId(f"{joint}_joint")]
            config[j.idx_q : j.idx_q + j.nq] = [angle] if j.nq == 1 else [np.cos(angle), np.sin(angle)]
        pin.framesForwardKinematics(model, data, config)
        places = [data.oMf[model.getFrameId(f"wheel_{w}")].translation for w in rover.wheel_names]
        assert_wheels(rover, places, q, b, s, "Pinocchio")


@pytest.mark.parametrize("name", NAMES)
def test_loads_in_yourdfpy(name: str) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    rover, rng = rb.load_rover(name), np.random.default_rng(3)
    robot = yourdfpy.URDF.load(io.BytesIO(to_urdf(rover).encode()), load_meshes=False)
    for _ in range(3):
        q, b, s, by_name = joint_angles(rover, rng)
        follows = {name: by_name[name.removesuffix("_joint")] for name in robot.actuated_joint_names}
        assert "rocker_right_joint" not in follows, "it mimics the left one"
        robot.update_cfg(follows)
        assert_wheels(rover, [robot.get_transform(f"wheel_{w}")[:3, 3] for w in rover.wheel_names], q, b, s, "yourdfpy")


@pytest.mark.parametrize("name", NAMES)
def test_the_differential_holds_in_mujoco(name: str) -> None:
    """Dropped onto rocks, the exported rover keeps right = -left to 2e-4 rad."""
    mujoco = pytest.importorskip("mujoco")
    rover = rb.load_rover(name)
    size = rover.wheelbase
    rng = np.random.default_rng(5)
    z = np.zeros((81, 81))
    yy, xx = np.mgrid[-1.5:1.5:81j, -1.5:1.5:81j]
    for _ in range(60):
        cx, cy, r = *rng.uniform(-1.3, 1.3, 2), rng.uniform(0.05, 0.2)
        z = np.maximum(z, np.sqrt(np.maximum(r**2 - (xx - cx) ** 2 - (yy - cy) ** 2, 0)) * 0.6)
    ground = rb.Terrain.from_array(z * size, spacing=3.0 * size / 80, origin=(-1.5 * size, -1.5 * size), interpolation="linear")
    model = load_mjcf(rb.to_mjcf(rover, ground, cell=3.0 * size / 80))
    data = mujoco.MjData(model)
    data.joint("free").qpos[:3] = (0.0, 0.0, 0.35 * size - float((rover.hubs[:, 2] - rover.wheel_radius).min()))
    worst = moved = 0.0
    for _ in range(int(1.5 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        left, right = data.joint("rocker_left").qpos[0], data.joint("rocker_right").qpos[0]
        worst, moved = max(worst, abs(left + right)), max(moved, abs(left))
    assert moved > 0.01, "the rocks turn the rockers"
    assert data.ncon > 3, "it has come down"
    # the equality is a soft constraint: it gives way under impact, for sawppy by 1.05e-4 rad
    assert_close(worst, 0.0, 2e-4, "rad", f"{name}: the equality holds while it drops")


@pytest.mark.parametrize("name", NAMES)
def test_schema_holds(name: str) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    rule = jsonschema.Draft202012Validator(schema())
    for text in ((presets()[name] / "rover.toml").read_text(), to_toml(rb.load_rover(name), options=True)):
        rule.validate(tomllib.loads(text))
    broken = tomllib.loads(to_toml(rb.load_rover(name)))
    broken["wheels"]["radius"] = 0.1
    assert not rule.is_valid(broken)


def test_the_schema_file_is_up_to_date() -> None:
    import json

    file = Path(presets()["curiosity"]).parent / "rover.schema.json"
    stored = json.loads(file.read_text())
    stored.pop("$comment", None)  # the command's mark, with the version
    assert stored == schema(), "write it anew: rockerbogie rovers schema src/rockerbogie/rover/presets/rover.schema.json"
