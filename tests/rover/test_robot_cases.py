"""Robot files of the kinds that people report as misread.

Each has an independent expectation.

The base robot is written once, by plain formatting, in URDF, SDF and MJCF; each case changes a few words of it. Expected numbers
come from the base robot's drawing, from MuJoCo, from Pinocchio, or from libsdformat 12.3 (recorded in `SDFORMAT`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.rover.formats import ImportResult, build_rover, import_rover, presets, read_trees, to_urdf
from support import probe
from support.helpers import assert_close

HUBS = np.array([[0.42, 0.31, -0.3], [-0.02, 0.34, -0.3], [-0.4, 0.31, -0.3]])
ROCKER, BOGIE = np.array([0.08, 0.2, 0.0]), np.array([-0.21, 0.25, -0.12])
BOX = np.array([[-0.3, -0.18, -0.1], [0.3, 0.18, 0.1]])


def take(text: str, **options: object) -> ImportResult:
    return build_rover(read_trees(text, "probe"), "probe", **options)  # type: ignore[arg-type]


def said(lines: tuple[str, ...], *words: str) -> bool:
    """Return True if one of the lines holds all the words."""
    return any(all(word in line for word in words) for line in lines)


def assert_probe(result: ImportResult, *, box: bool = True, mass: float = 35.8) -> None:
    """Assert that the import is the base robot of the drawing."""
    rover, mirror = result.rover, (1, -1, 1)
    assert_close(rover.hubs, np.stack([HUBS, HUBS * mirror], axis=1).reshape(6, 3), 1e-9, "m", "hubs")
    assert_close(rover.rocker_pivot, [ROCKER, ROCKER * mirror], 1e-9, "m", "rocker pivots")
    assert_close(rover.bogie_pivot, [BOGIE, BOGIE * mirror], 1e-9, "m", "bogie pivots")
    assert_close(rover.wheel_radius, np.full(6, 0.11), 1e-9, "m", "wheel radius")
    assert_close(rover.wheel_width, np.full(6, 0.09), 1e-9, "m", "wheel width")
    assert rover.steers.tolist() == [True, True, False, False, True, True]
    assert_close(rover.rocker_limits, (-0.5, 0.5), 1e-9, "rad", "rocker limits")
    assert_close(rover.bogie_limits, (-0.6, 0.6), 1e-9, "rad", "bogie limits")
    assert_close(rover.differential, (0, -1), 1e-9, "", "differential")
    assert_close(rover.mass, mass, 1e-9, "kg", "mass")
    if box:
        assert_close(rover.body_box, BOX, 1e-9, "m", "body box")


@pytest.mark.parametrize("text", [probe.urdf(), probe.sdf(), probe.mjcf()], ids=["urdf", "sdf", "mjcf"])
def test_base_robot(text: str) -> None:
    result = take(text)
    assert_probe(result)
    assert not result.warnings
    assert not result.guessed
    assert said(result.found, "on a plane all six wheels are down", "level, joints at 0")
    assert said(result.found, "mass 35.8 kg")


# -- meshes -----------------------------------------------------------------------------------------------------------


def chassis(uri: str, scale: str = "1 1 1") -> str:
    """The base URDF with a mesh in place of the chassis' box, and a camera box on top."""
    mesh = f'<collision><geometry><mesh filename="{uri}" scale="{scale}"/></geometry></collision>'
    camera = probe.urdf_link("cam", 0.05, '<collision><geometry><box size="0.05 0.05 0.05"/></geometry></collision>')
    fixed = '<joint name="cam_j" type="fixed"><parent link="base"/><child link="cam"/><origin xyz="0.2 -0.05 0.2"/></joint>'
    return probe.urdf(body=mesh, extra=camera + fixed)


def test_missing_chassis_mesh_is_not_the_camera() -> None:
    result = take(chassis("package://x/y.stl"))
    assert_probe(result, box=False, mass=35.85)
    assert said(result.warnings, "body_box", "base", "not found")
    assert float(np.ptp(result.rover.body_box[:, 0])) > 0.3, "not the camera's 5 cm"


@pytest.mark.parametrize("uri", ["y.stl", "meshes/y.obj", "package://robot/meshes/y.stl", "package://other/y.dae"])
def test_chassis_mesh_gives_the_box(uri: str, tmp_path: Path) -> None:
    """A chassis mesh in millimetres (STL, OBJ or DAE), with a camera on top, gives the box."""
    trimesh = pytest.importorskip("trimesh")
    if uri.endswith(".dae"):
        pytest.importorskip("collada")
    folder = tmp_path / "robot" / "urdf"
    folder.mkdir(parents=True)
    place = {"package://robot/meshes/y.stl": tmp_path / "robot/meshes/y.stl", "package://other/y.dae": tmp_path / "other/y.dae"}
    file = place.get(uri, folder / uri)
    file.parent.mkdir(exist_ok=True)
    trimesh.creation.box((600, 360, 200)).export(file)
    robot = folder / "robot.urdf"
    robot.write_text(chassis(uri, "0.001 0.001 0.001"))
    result = import_rover(robot)
    assert_probe(result, box=False, mass=35.85)
    assert_close(result.rover.body_box, [[-0.3, -0.18, -0.1], [0.3, 0.18, 0.225]], 1e-6, "m", "chassis and camera")
    assert not result.warnings


def test_chassis_that_is_only_seen() -> None:
    """A camera that collides is not the body if the chassis is only seen."""
    text = chassis("package://x/y.stl").replace("<collision><geometry><mesh", "<visual><geometry><mesh", 1)
    result = take(text.replace("</geometry></collision></link>", "</geometry></visual></link>", 1))
    assert said(result.warnings, "body_box", "base")
    assert float(np.ptp(result.rover.body_box[:, 0])) > 0.3


def test_wheels_that_are_meshes(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.cylinder(0.11, 0.09, sections=64).export(tmp_path / "tyre.stl")
    wheel = '<visual><origin rpy="1.5707963267948966 0 0"/><geometry><mesh filename="tyre.stl"/></geometry></visual>'
    (tmp_path / "robot.urdf").write_text(probe.urdf(wheel=wheel))
    result = import_rover(tmp_path / "robot.urdf")
    assert_close(result.rover.wheel_radius, np.full(6, 0.11), 1e-6, "m", "from the mesh")
    assert_close(result.rover.wheel_width, np.full(6, 0.09), 1e-6, "m", "from the mesh")
    assert said(result.found, "wheel sizes from visible mesh")
    (tmp_path / "tyre.stl").write_bytes(b"solid nothing")
    assert said(import_rover(tmp_path / "robot.urdf").guessed, "wheel_radius")


MESH_HULL = '<mesh name="hull" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"/>'


def test_mjcf_mass_in_a_mesh(tmp_path: Path) -> None:
    """Half of the body's mass is in a mesh: MuJoCo's own sum."""
    mujoco = pytest.importorskip("mujoco")
    geom = '<geom type="box" size="0.3 0.18 0.1" mass="5"/><geom type="mesh" mesh="hull" {mass} contype="0" conaffinity="0"/>'
    text = probe.mjcf(body=geom.format(mass='mass="15"'), asset=MESH_HULL)
    assert_probe(take(text), mass=float(mujoco.MjModel.from_xml_string(text).body_mass.sum()))
    dense = probe.mjcf(body=geom.format(mass='density="9000"'), asset=MESH_HULL)
    assert_probe(take(dense), mass=float(mujoco.MjModel.from_xml_string(dense).body_mass.sum()))
    trimesh = pytest.importorskip("trimesh")
    (tmp_path / "parts").mkdir()
    trimesh.creation.box((0.2, 0.2, 0.1)).export(tmp_path / "parts" / "hull.stl")
    text = text.replace(MESH_HULL, '<mesh file="hull.stl"/>').replace('angle="radian"', 'angle="radian" meshdir="parts"')
    file = tmp_path / "robot.xml"
    file.write_text(text)
    assert_probe(import_rover(file), mass=35.8)
    heavy = text.replace('mass="15"', 'density="9000"')
    file.write_text(heavy)
    assert_close(import_rover(file).rover.mass, 20.8 + 9000 * 0.004, 1e-5, "kg", "STL holds single precision")
    (tmp_path / "parts" / "hull.stl").unlink()
    gone = import_rover(file)
    assert_close(gone.rover.mass, 20.8, 1e-9, "kg", "without the mesh")
    assert said(gone.dropped, "mass of a mesh that was not read", "base")
    file.write_text(text)
    assert_close(import_rover(file).rover.mass, 35.8, 1e-9, "kg", "a stated mass does not need the mesh")


# -- roles ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.12, 0.02, -0.1])
def test_turnbuckles_are_not_wheels(height: float) -> None:
    """Links of the differential on coaxial hinges above the hubs are not wheels."""
    shape = '<collision><origin rpy="1.5707963 0 0"/><geometry><cylinder radius="0.01" length="0.02"/></geometry></collision>'
    extra = "".join(
        probe.urdf_link(f"a_rod_{s}", 0.05, shape)
        + f'<joint name="a_rod_{s}_j" type="revolute"><parent link="rocker_{s}_link"/><child link="a_rod_{s}"/>'
        f'<origin xyz="0.15 {y} {height}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for s, y in (("l", 0.02), ("r", -0.02))
    )
    result = take(probe.urdf(extra=extra))
    assert_probe(result, mass=35.9)
    assert said(result.found, "not wheels", "a_rod_l_j")


def test_hub_motor_and_tyre() -> None:
    size = '<origin rpy="1.5707963267948966 0 0"/><geometry><cylinder radius="{}" length="{}"/></geometry>'
    wheel = f"<visual>{size.format(0.11, 0.09)}</visual><collision>{size.format(0.03, 0.05)}</collision>"
    result = take(probe.urdf(wheel=wheel))
    assert_probe(result)
    assert said(result.warnings, "0.03", "0.11")


def test_wheel_cylinder_across_its_axle() -> None:
    result = take(probe.urdf(wheel='<collision><geometry><cylinder radius="0.11" length="0.09"/></geometry></collision>'))
    assert_probe(result)
    assert said(result.warnings, "lie across their axles", "common slip")


def test_right_bogie_turned() -> None:
    """Hubs of a bogie turned by 0.25 rad move by 2 sin(0.125) times their distance."""
    text = probe.urdf().replace('<origin xyz="-0.29 -0.05 -0.12"/>', '<origin xyz="-0.29 -0.05 -0.12" rpy="0 0.25 0"/>')
    result = take(text)
    turned = np.array([[np.cos(0.25), 0, np.sin(0.25)], [0, 1, 0], [-np.sin(0.25), 0, np.cos(0.25)]])
    right = BOGIE * (1, -1, 1) + (HUBS[1:] - BOGIE) * (1, -1, 1) @ turned.T
    assert_close(result.rover.hubs[3::2], right, 1e-9, "m", "turned hubs")
    off = np.abs(right - HUBS[1:] * (1, -1, 1)).max(axis=1)
    assert said(result.warnings, "left and right differ", f"{off[0]:.4g} m", f"{off[1]:.4g} m")
    assert said(result.warnings, "on a plane", "right bogie -14.3 deg")


def test_fixed_wheels_can_be_named() -> None:
    text = probe.urdf().replace('type="continuous"', 'type="fixed"')
    with pytest.raises(rb.RoverError, match=r"drive_.. are fixed: .* name them with joints="):
        take(text)
    result = take(text, joints={"wheels": [f"drive_{a}{s}" for a in "FMR" for s in "lr"]})
    assert_probe(result)
    assert said(result.repaired, "fixed joints taken as hinges")


def test_limits_that_differ_by_side() -> None:
    text = probe.urdf().replace('lower="-0.6" upper="0.6"', 'lower="-0.4" upper="0.5"', 1)
    result = take(text)
    assert_close(result.rover.bogie_limits, (-0.4, 0.5), 0, "rad", "the common range")
    assert said(result.warnings, "limits of the bogies differ", "(-0.4, 0.5)", "(-0.6, 0.6)")


def test_rocker_limits_without_room() -> None:
    """Limits by which neither rocker may turn, through the differential, are a slip in the file."""
    result = take(probe.urdf().replace('lower="-0.5" upper="0.5"', 'lower="0" upper="0.5"'))
    assert_close(result.rover.rocker_limits, (0, 0.5), 0, "rad", "the left one's")
    assert said(result.warnings, "leave no room")


def test_a_mimic_offset_is_named() -> None:
    with pytest.raises(rb.RoverError, match=r"no left and right pair .* 'rocker_r' at 0\.2 rad: by a mimic offset"):
        take(probe.urdf().replace('multiplier="-1"/>', 'multiplier="-1" offset="0.2"/>'))


def test_dropped_properties_are_listed() -> None:
    text = probe.urdf().replace('<axis xyz="0 1 0"/><limit', '<axis xyz="0 -1 0"/><dynamics damping="2" friction="1"/><limit', 1)
    result = take(text)
    assert said(result.dropped, "damping: rocker_l")
    assert said(result.dropped, "friction: rocker_l")
    assert said(result.dropped, "senses", "rocker_l")
    assert said(result.dropped, "limits of wheels and steering", "steer_Fl")
    spring = probe.mjcf().replace('<joint name="bogie_l"', '<joint stiffness="5" name="bogie_l"')
    assert said(take(spring).dropped, "spring: bogie_l")
    strut = probe.urdf(extra=probe.urdf_link("strut", 0.5) + (
        '<joint name="strut_j" type="prismatic"><parent link="base"/><child link="strut"/><axis xyz="0 0 1"/>'
        '<limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>'))  # fmt: skip
    result = take(strut)
    assert_probe(result, mass=36.3)
    assert said(result.dropped, "prismatic", "strut_j")


# -- SDF --------------------------------------------------------------------------------------------------------------

#: Axis of a joint at yaw 45° to its child, the child at yaw 90°, as libsdformat 12.3 resolves it in the model's frame.
SDFORMAT = {
    ("1.4", ""): (1, 0, 0),
    ("1.4", "<use_parent_model_frame>0</use_parent_model_frame>"): (-np.sqrt(0.5), np.sqrt(0.5), 0),
    ("1.5", ""): (-np.sqrt(0.5), np.sqrt(0.5), 0),
    ("1.6", "<use_parent_model_frame>1</use_parent_model_frame>"): (1, 0, 0),
    ("1.9", ""): (-np.sqrt(0.5), np.sqrt(0.5), 0),
}


@pytest.mark.parametrize("version, flag", SDFORMAT)
def test_sdf_axes_by_version(version: str, flag: str) -> None:
    (tree,) = read_trees(
        f'<sdf version="{version}"><model name="m"><link name="a"/>'
        '<link name="b"><pose>1 0 0 0 0 1.5707963267948966</pose></link>'
        f'<joint name="j" type="revolute"><pose>0 0 1 0 0 0.7853981633974483</pose><parent>a</parent><child>b</child>'
        f"<axis><xyz>1 0 0</xyz>{flag}</axis></joint></model></sdf>",
        "m",
    )
    joint = tree.joints["j"]
    T = tree.rest()["b"]
    assert_close(T[:3, :3] @ joint.axis, SDFORMAT[version, flag], 1e-9, "", "axis in the model")
    assert_close(T[:3, :3] @ joint.anchor + T[:3, 3], (1, 0, 1), 1e-9, "m", "the joint's point")


def test_sdf14_rolled_wheels() -> None:
    turned = probe.sdf(version="1.4", wheel_roll=np.pi / 2)
    assert_probe(take(turned))
    with pytest.raises(rb.RoverError):  # there the axes are in the rolled frames: upright
        take(turned.replace('version="1.4"', 'version="1.5"'))


@pytest.mark.parametrize(
    "version, attribute", [("1.5", "frame"), ("1.6", "frame"), ("1.7", "relative_to"), ("1.9", "relative_to")]
)
def test_sdf_pose_relative_to(version: str, attribute: str) -> None:
    old = '<link name="bogie_l_link"><pose>-0.21 0.25 -0.12 0 0 0</pose>'
    text = probe.sdf(version=version)
    assert old in text
    new = f'<link name="bogie_l_link"><pose {attribute}="rocker_l_link">-0.29 0.05 -0.12 0 0 0</pose>'
    assert_probe(take(text.replace(old, new)))


@pytest.mark.parametrize("far", ["1e16", "1e+16", "1.7976931348623157e+308", "1e400", "inf", "1000"])
def test_huge_limits_are_none(far: str) -> None:
    limit = f"<limit><lower>-{far}</lower><upper>{far}</upper></limit>"
    result = take(probe.sdf(wheel_axis=limit))
    assert_probe(result)
    assert not said(result.dropped, "drive_")
    one = take(probe.sdf().replace("<lower>-0.6</lower>", f"<lower>-{far}</lower>"))
    assert_close(one.rover.bogie_limits, (-np.inf, 0.6), 0, "rad", "open on one side")
    urdf = take(probe.urdf().replace('lower="-0.6" upper="0.6"', f'lower="-{far}" upper="{far}"'))
    assert np.isinf(urdf.rover.bogie_limits).all()


@pytest.mark.parametrize("form", ["sdf", "urdf"])
def test_joints_that_point_inwards(form: str) -> None:
    """The body is the rockers' child; the graph is the same."""
    if form == "sdf":
        text = probe.sdf()
        for s, y in (("l", 0.2), ("r", -0.2)):
            old = f'<joint name="rocker_{s}" type="revolute"><parent>base</parent><child>rocker_{s}_link</child>'
            assert old in text
            new = f'<joint name="rocker_{s}" type="revolute"><parent>rocker_{s}_link</parent><child>base</child>'
            text = text.replace(old, f"{new}<pose>0.08 {y} 0 0 0 0</pose>")
    else:
        text = probe.urdf()
        for s, y in (("l", 0.2), ("r", -0.2)):
            old = f'<parent link="base"/><child link="rocker_{s}_link"/><origin xyz="0.08 {y} 0"/>'
            assert old in text
            # with the joint's frame at the body's origin, the pivot would move: only the left side can be turned in URDF
            if s == "l":
                hinge = f'<parent link="pivot"/><child link="rocker_{s}_link"/><origin xyz="0 0 0"/>'
                fixed = probe.urdf_link("pivot", 0) + (
                    '<joint name="turned" type="fixed"><parent link="pivot"/><child link="base"/>'
                    '<origin xyz="-0.08 -0.2 0"/></joint>'
                )
                text = text.replace(old, hinge).replace("</robot>", fixed + "</robot>")
    result = take(text)
    if form == "urdf":
        shift = result.rover.rocker_pivot[0] - ROCKER
        assert_close(result.rover.hubs[::2] - shift, HUBS, 1e-9, "m", "hubs, from the file's root")
        return
    assert_probe(result)
    assert said(result.dropped, "senses", "rocker_l, rocker_r")


def test_any_link_may_be_the_root() -> None:
    """The base robot's tree, declared from each of its links, gives the same rover."""
    (tree,) = read_trees(probe.sdf(), "probe")
    for root in tree.order:
        assert_probe(build_rover(tree.rooted(root), "probe"))


def test_sdf_joint_to_a_frame() -> None:
    text = probe.sdf().replace("<child>rocker_l_link</child>", "<child>rocker_l_mount</child>")
    text = text.replace("</model>", '<frame name="rocker_l_mount" attached_to="rocker_l_link"/></model>')
    assert_probe(take(text))
    chain = text.replace('attached_to="rocker_l_link"/>', 'attached_to="g"/><frame name="g" attached_to="rocker_l"/>')
    with pytest.raises(rb.RoverError, match="attached to itself"):
        take(chain)


def test_sdf_nested_models() -> None:
    """Frames as libsdformat 12.3 resolves them, placement frames included."""
    (tree,) = read_trees(
        '<sdf version="1.9"><model name="m"><model name="n" placement_frame="x"><pose>0 0 2 0 0 1.5707963267948966</pose>'
        '<link name="y"/><link name="x"><pose>1 0 0 0 0 0</pose></link><joint name="k" type="fixed"><parent>x</parent>'
        '<child>y</child></joint></model><link name="a"><pose relative_to="n">0 0 1 0 0 0</pose></link>'
        '<joint name="j" type="fixed"><parent>a</parent><child>n</child></joint></model></sdf>',
        "m",
    )
    rest = tree.rest()
    in_a = {name: (np.linalg.inv(rest["a"]) @ T)[:3, 3] for name, T in rest.items()}
    assert tree.joints["j"].child == "n::y"
    assert_close(in_a["n::y"], (0, 0, -1), 1e-9, "m", "n::y lies 1 m under a (libsdformat: a at 0 -1 3, n at 0 -1 2)")
    assert_close(in_a["n::x"], (1, 0, -1), 1e-9, "m", "n::x")
    inner = probe.sdf().partition('<model name="probe">')[2].partition("</model>")[0]
    outer = (
        '<sdf version="1.9"><model name="yard"><link name="slab"/><model name="probe"><pose>5 4 0.3 0 0 1</pose>'
        f"{inner}</model></model></sdf>"
    )
    result = take(outer)
    assert_probe(result)
    assert said(result.dropped, "slab")


def test_sdf_world_with_other_models() -> None:
    inner = probe.sdf().partition("<model")[2].rpartition("</model>")[0]
    rocks = "".join(f'<link name="rock{k}"><pose>{k} 3 0 0 0 0</pose></link>' for k in range(30))
    world = f'<sdf version="1.9"><world name="w"><model name="rocks"><static>true</static>{rocks}</model><model{inner}</model>'
    assert_probe(take(f"{world}</world></sdf>"))
    two = take(f"{world}<model{inner.replace('probe', 'twin', 1)}</model></world></sdf>")
    assert said(two.warnings, "2 rovers", "'probe', 'twin'")


def test_sdf_automatic_inertia() -> None:
    """`<inertial auto="true">`: mass and inertia of the collision shapes at their density."""
    inertial = '<inertial auto="true"><density>500</density></inertial>'
    text = f'<sdf version="1.11"><model name="m"><link name="a">{inertial}{{}}</link></model></sdf>'
    shapes = {
        "<box><size>1 2 3</size></box>": (6.0, [13, 10, 5]),
        "<sphere><radius>2</radius></sphere>": (4 / 3 * np.pi * 8, [1.6 * 12] * 3),
        "<ellipsoid><radii>1 2 3</radii></ellipsoid>": (8 * np.pi, [2.6 * 12, 2 * 12, 1 * 12]),
        "<cylinder><radius>1</radius><length>2</length></cylinder>": (2 * np.pi, [7, 7, 6]),
    }
    for shape, (volume, moments) in shapes.items():
        (tree,) = read_trees(
            text.format(f'<collision name="c"><pose>1 0 0 0 0 0</pose><geometry>{shape}</geometry></collision>'), "m"
        )
        part = tree.parts["a"]
        assert_close(part.mass, 500 * volume, 1e-9, "kg", shape)
        assert_close(part.com, (1, 0, 0), 1e-12, "m", shape)
        assert_close(np.diag(part.inertia) * 12 / part.mass, moments, 1e-9, "m2", f"{shape}: its moments over m/12")


# -- MJCF -------------------------------------------------------------------------------------------------------------


def test_mjcf_other_equalities() -> None:
    """Equalities of other joints and inactive ones are not the differential."""
    extra = '<joint joint1="steer_Rr" joint2="steer_Rl" polycoef="0 -0.8 0 0.3 0"/>'
    result = take(probe.mjcf(equality=extra))
    assert_probe(result)
    assert said(result.dropped, "mimic", "steer_Rr")
    inactive = '<joint name="alike" joint1="rocker_r" joint2="rocker_l" polycoef="0 1 0 0 0" active="false"/>'
    result = take(probe.mjcf(equality=inactive))
    assert_probe(result)
    assert said(result.dropped, "inactive", "alike")


@pytest.mark.parametrize("follower", ["rocker_r", "rocker_l"])
def test_mjcf_polynomial_differential(follower: str) -> None:
    """A polynomial between the rockers is the rover's differential, whichever of them follows."""
    leader = {"rocker_r": "rocker_l", "rocker_l": "rocker_r"}[follower]
    text = probe.mjcf().replace(
        'joint1="rocker_r" joint2="rocker_l" polycoef="0 -1 0 0 0"',
        f'joint1="{follower}" joint2="{leader}" polycoef="0 -0.9 0.05 0.02 0"',
    )
    rover = take(text).rover
    q = np.linspace(-0.4, 0.4, 9)
    followed = np.polynomial.polynomial.polyval(q, (0, -0.9, 0.05, 0.02))
    if follower == "rocker_r":
        assert_close(rover.right_rocker(q), followed, 1e-9, "rad", "right by left")
    else:
        assert_close(rover.right_rocker(followed), q, 1e-8, "rad", "left by right, inverted")


def test_mjcf_ref() -> None:
    """Limits are MuJoCo's range less `ref`, its joint coordinate at the pose in the file."""
    mujoco = pytest.importorskip("mujoco")
    text = probe.mjcf().replace('range="-0.5 0.5"', 'ref="0.7" range="0.2 1.2"')
    assert_probe(take(text))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.joint("rocker_l").qpos[0] = 1.2  # at its upper limit
    data.joint("rocker_r").qpos[0] = 0.2
    mujoco.mj_kinematics(model, data)
    hub = data.body("tyre_Fl").xpos - data.body("base").xpos
    assert_close(hub, rb.wheel_frames(take(text).rover, 0.5, (0.0, 0.0))[0, :3, 3], 1e-9, "m", "the same hub at the limit")


def test_mjcf_fused_with_the_world() -> None:
    welded = probe.mjcf().replace('<body name="base" pos="0 0 1"><freejoint/>', "").replace("</body></worldbody>", "</worldbody>")
    result = take(welded)
    assert_probe(result)
    assert said(result.repaired, "turn on the world")


@pytest.mark.parametrize("name", sorted(presets()))
def test_our_urdf_saved_by_mujoco(name: str, tmp_path: Path) -> None:
    """URDF through MuJoCo's writer: six digits; the body's mass is lost, and guessed."""
    mujoco = pytest.importorskip("mujoco")
    rover = rb.load_rover(name)
    file = tmp_path / "saved.xml"
    mujoco.mj_saveLastXML(str(file), mujoco.MjModel.from_xml_string(to_urdf(rover)))
    result = import_rover(file)
    for field in ("hubs", "rocker_pivot", "bogie_pivot", "wheel_radius", "body_box", "rocker_limits", "bogie_limits"):
        assert_close(getattr(result.rover, field), getattr(rover, field), 1e-5 * rover.wheelbase, "m", field)
    assert_close(result.rover.differential, rover.differential, 1e-5, "", "differential")
    assert_close(
        result.rover.mass - result.rover.body.mass, rover.mass - rover.body.mass, 1e-5 * rover.mass, "kg", "the other links"
    )
    assert said(result.warnings, "no mass")
    assert said(result.guessed, "mass of the body")


# -- refusals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text, name, sentence",
    [
        ('<robot name="a"><property name="r" value="0.1"/><macro name="w" params="x"/></robot>', "a.urdf", "xacro macros"),
        ('<robot name="a"><link name="${prefix}_base"/></robot>', "a.urdf", r"xacro macros \(\$\{prefix\}"),
        ('<robot xmlns:x="http://ros.org/wiki/xacro" name="a"><x:include filename="b"/></robot>', "a.xacro", "xacro macros"),
        ("#usda 1.0\n", "a.usda", "it is USD, which is not read"),
        ("PXR-USDC\0\0", "a.usd", "it is USD"),
        ("PK\x03\x04", "a.usdz", "zip archive"),
        ('<sdf version="1.2"><model name="a"><link name="b"/></model></sdf>', "a.sdf", "version 1.2 is not read"),
        ('<sdf version="1.9"><include><uri>model://x</uri></include></sdf>', "a.sdf", "expand it with `gz sdf -p`"),
    ],
)
def test_refusals_name_the_remedy(text: str, name: str, sentence: str) -> None:
    with pytest.raises(rb.RoverError, match=sentence):
        read_trees(text.encode(), name)


# -- exports ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("limits", [(-0.3, np.inf), (-np.inf, 0.3), (-0.3, 0.3), (-np.inf, np.inf)])
def test_urdf_loads_in_pinocchio_with_mimic(limits: tuple[float, float]) -> None:
    pin = pytest.importorskip("pinocchio")
    rover = rb.load_rover("osr").replace(rocker_limits=np.array(limits))
    model = pin.buildModelFromXML(to_urdf(rover), mimic=True)
    assert model.existJointName("rocker_right_joint")
    back = build_rover(read_trees(to_urdf(rover), "osr"), "osr").rover
    assert_close(back.rocker_limits, limits, 1e-12, "rad", "limits come back")


def test_urdf_root_has_no_mass() -> None:
    """ROS's KDL parser warns of a root link with inertia."""
    yourdfpy = pytest.importorskip("yourdfpy")
    import io

    robot = yourdfpy.URDF.load(io.BytesIO(to_urdf(rb.load_rover("curiosity")).encode()), load_meshes=False)
    assert robot.base_link == "base_link"
    assert robot.link_map["base_link"].inertial is None
    assert robot.link_map["body"].inertial.mass == pytest.approx(539.4)
