"""Import of robot files in the styles of others: reports, overrides, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.rover.formats import Import, build_rover, import_rover, load_rover, read_trees, to_sdf, to_urdf
from support import foreign
from support.helpers import assert_close


def take(text: str, **override: object) -> Import:
    return build_rover(read_trees(text, "test.urdf"), "test.urdf", **override)  # type: ignore[arg-type]


def said(lines: tuple[str, ...], *words: str) -> bool:
    """True where one of the lines holds all the words."""
    return any(all(word in line for word in words) for line in lines)


def assert_geometry(got: rb.Rover, truth: rb.Rover, tol: float, *, but: tuple[str, ...] = ()) -> None:
    for name in ("rocker_pivot", "bogie_pivot", "hubs", "wheel_radius", "wheel_width", "steering_offset"):
        if name not in but:
            assert_close(getattr(got, name), getattr(truth, name), tol, "m", f"{name} from the file and as it was made")


def assert_sits_level(rover: rb.Rover, tol: float) -> None:
    """Assert that on a plane every wheel is down and the body horizontal.

    The tolerance is what the hubs' heights leave over its length.
    """
    size = 4 * rover.wheelbase
    ground = rb.Terrain.from_array(np.zeros((41, 41)), spacing=size / 40, origin=(-size / 2, -size / 2))
    pose = rb.settle(rover, ground, 0.0, 0.0, 0.3)
    assert pose.status == rb.Status.CONVERGED
    assert_close(pose.gap, np.zeros(6), 1e-6, "m", "every wheel is down")
    level = np.degrees([float(pose.roll), float(pose.pitch)])
    assert_close(level, [0.0, 0.0], tol, "deg", "the body is level")


def test_rockers_fixed() -> None:
    truth = rb.load_rover("osr")
    got = take(foreign.rockers_fixed(truth))
    assert_geometry(got.rover, truth, 1e-6, but=("wheel_radius",))  # six digits in the file
    assert (got.rover.steers == truth.steers).all()
    assert_close(got.rover.rocker_limits, (-0.5, 0.5), 0, "rad", "the fixed joint keeps its limits")
    assert said(got.guessed, "rockers are fixed", "side_L_1", "side_R_1")
    assert said(got.guessed, "wheel_radius 0.0839", "hubs' height")
    assert said(got.guessed, "wheel_width 0")
    assert_close(got.rover.mass, 10 + 2 * (0.1 + 1 + 7 + 3 + 2 * 0.8 + 0.3 + 3 * 0.8), 1e-9, "kg", "every link is counted once")
    heights = np.ptp(truth.hubs[:, 2])
    assert_sits_level(got.rover, np.degrees(2 * heights / truth.wheelbase))


def test_rockers_in_two_arms() -> None:
    truth = rb.load_rover("curiosity")
    got = take(foreign.rockers_in_two_arms(truth))
    assert_geometry(got.rover, truth, 1e-9)
    assert_close(got.rover.rocker_limits, (-0.4, 0.4), 0, "rad", "as the arms'")
    assert said(got.repaired, "two arms")
    assert said(got.repaired, "2 hinges lie up to 11 deg off")
    assert said(got.repaired, "nothing ties the two rockers")
    assert said(got.guessed, "forward is -y", "from its names")
    assert said(got.found, "held at rest", "mast")
    assert got.rover.wheel_names == truth.wheel_names
    assert_sits_level(got.rover, 1e-6)


def test_upside_down_and_weightless() -> None:
    truth = rb.load_rover("perseverance")
    got = take(foreign.upside_down_and_weightless(truth))
    assert_geometry(got.rover, truth, 1e-9, but=("wheel_width",))
    assert np.isinf(got.rover.rocker_limits).all()
    assert np.isinf(got.rover.bogie_limits).all()
    assert said(got.repaired, "up is -z")
    assert said(got.guessed, "mass: the file has none")
    assert_sits_level(got.rover, 1e-6)
    heavy = take(foreign.upside_down_and_weightless(truth), mass=1025.0, wheel_width=0.331)
    assert_close(heavy.rover.mass, 1025.0, 1e-9, "kg", "overridden")
    assert_geometry(heavy.rover, truth, 1e-9)


def test_bars_closed_elsewhere() -> None:
    truth = rb.load_rover("sawppy")
    got = take(foreign.bars_closed_elsewhere(truth))
    assert_geometry(got.rover, truth, 1e-9)
    assert_close(got.rover.body_box, truth.body_box, 1e-12, "m", "the body's colliding box; the brace's is not the body's")
    assert_close(got.rover.bogie_limits, truth.bogie_limits, 1e-12, "rad", "from the file")
    assert said(got.repaired, "continuous", "limits it also gives do not count")
    assert said(got.repaired, "<gazebo>")
    assert_close(got.rover.mass, 4.61, 1e-9, "kg", "every link once")
    assert_close(
        got.rover.wheels[0].com, truth.hubs[0], 1e-12, "m", "a knuckle of its own weight rides with its arm, not its wheel"
    )
    assert_sits_level(got.rover, np.degrees(2 * np.ptp(truth.hubs[:, 2]) / truth.wheelbase))


def test_drawn_in_cad() -> None:
    truth = rb.load_rover("rocky7")
    bare = take(foreign.drawn_in_cad(truth))
    assert said(bare.guessed, "0.12 of its wheelbase", "no shape in the file gives", "give wheel_radius=")
    assert_close(bare.rover.wheel_radius, 0.12 * truth.wheelbase, 1e-9, "m", "nothing in the file says more")
    assert_geometry(bare.rover, truth, 1e-9, but=("wheel_radius", "wheel_width"))
    assert_sits_level(bare.rover, 1e-6)
    got = take(foreign.drawn_in_cad(truth), wheel_radius=0.065, wheel_width=0.08)
    assert_geometry(got.rover, truth, 1e-9)
    assert_close(got.rover.rocker_limits, (-0.1, 0.0), 1e-12, "rad", "left -1 to 0, right -0.1 to 0.1: what both allow")
    assert_close(got.rover.bogie_limits, (-0.3, 0.4), 1e-12, "rad", "about -y in the file, so turned over")
    assert said(got.guessed, "forward is y", "forward='-y' turns it round")
    assert said(got.repaired, "an inertia that no body can have", "wheel_6")
    turned = take(foreign.drawn_in_cad(truth), wheel_radius=0.065, forward="-y")
    assert_close(
        turned.rover.hubs[0], truth.hubs[1] * (-1, -1, 1), 1e-9, "m", "turned round, the right front wheel is the left rear one"
    )
    assert_sits_level(got.rover, 1e-6)


def test_legs_bolted_on() -> None:
    """The rockers' joints are fixed and say nothing of an axis, whichever way their frames lie."""
    truth = rb.load_rover("rocky7")
    got = take(foreign.legs_bolted_on(truth))
    assert_geometry(got.rover, truth, 1e-9, but=("wheel_radius", "wheel_width", "steering_offset"))
    assert not got.rover.steers.any()
    assert said(got.guessed, "taken as turning at joints 'left_leg_joint' and 'right_leg_joint'")
    assert_close(
        [link.mass for link in got.rover.rockers], (0.05, 0.01), 1e-12, "kg", "with the motor bolted on; one leg weighs none"
    )
    assert_sits_level(got.rover, 1e-6)


@pytest.mark.parametrize("preset", ["curiosity", "rocky7", "elhami-dashti", "osr"])
@pytest.mark.parametrize("style", sorted(foreign.STYLES))
def test_every_style_of_every_rover(style: str, preset: str) -> None:
    """Linkages with the bogie ahead and behind, in everyone's manner."""
    truth = rb.load_rover(preset)
    got = take(foreign.STYLES[style](truth), wheel_radius=truth.wheel_radius, wheel_width=truth.wheel_width)
    if style == "drawn_in_cad" and preset in ("osr", "elhami-dashti"):  # it steers nothing and says nothing of forward but +y
        assert not got.rover.steers.any()
    assert_geometry(got.rover, truth, 1e-6, but=("steering_offset",))


def test_names_mean_nothing() -> None:
    """The same rover with every name replaced by a number is the same rover."""
    import re

    truth = rb.load_rover("perseverance")
    text = to_urdf(truth)
    names = sorted(set(re.findall(r'(?:name|link|joint)="([^"]+)"', text)) - {"perseverance"}, key=len, reverse=True)
    numbered = {name: f"n{k:03d}" for k, name in enumerate(np.random.default_rng(0).permutation(names))}
    text = re.sub(r'"([^"]+)"', lambda m: f'"{numbered.get(m[1], m[1])}"', text)
    got = take(text)
    assert_geometry(got.rover, truth, 1e-12)
    assert not got.guessed
    assert not got.repaired


@pytest.mark.parametrize(
    ("given", "expected"),
    [(("rocker_left_joint", 1.0, "rocker_right_joint", -1.25), -1.25), (("brace", 0.5, "brace", -0.5), -1.0)],
)
def test_ratios_are_followed_back(given: tuple[str, float, str, float], expected: float) -> None:
    """`mimic` straight from the left rocker, or of both from a brace between them."""
    truth = rb.load_rover("curiosity")
    text = to_urdf(truth)
    left, a, _, b = given
    if left == "brace":
        text = text.replace(
            "</robot>",
            '<link name="bar"/><joint name="brace" type="continuous"><parent link="base_link"/><child link="bar"/>'
            '<axis xyz="0 0 1"/></joint></robot>',
        )  # fmt: skip
        old = '<child link="rocker_left" />'
        assert old in text
        text = text.replace(old, old + f'<mimic joint="brace" multiplier="{a}"/>')
        text = text.replace(
            '<mimic joint="rocker_left_joint" multiplier="-1.0" offset="0.0" />', f'<mimic joint="brace" multiplier="{b}"/>'
        )
    else:
        text = text.replace('multiplier="-1.0"', f'multiplier="{b}"')
    got = take(text)
    assert_close(got.rover.differential, (0.0, expected), 1e-15, "", "the ratio between the rockers")


def test_a_locked_joint_stands_where_it_is_locked() -> None:
    """A mast folded for driving, locked at a quarter turn: its weight is where it lies."""
    truth = rb.load_rover("curiosity")
    quarter = f'<limit lower="{-np.pi / 2}" upper="{-np.pi / 2}" effort="1" velocity="1"/>'
    mast = (
        '<link name="mast"><inertial><origin xyz="0 0 1"/><mass value="10"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="fold" type="revolute"><origin xyz="0.5 0 1"/><parent link="base_link"/><child link="mast"/>'
        f'<axis xyz="0 1 0"/>{quarter}</joint></robot>'
    )
    body = take(to_urdf(truth).replace("</robot>", mast)).rover.body
    expected = (truth.body.mass * truth.body.com + 10 * np.array([-0.5, 0.0, 1.0])) / (truth.body.mass + 10)
    assert_close(body.com, expected, 1e-12, "m", "the mast lies backwards")


def test_roles_can_be_overridden() -> None:
    """A file whose search would go elsewhere: the wheels' joints named outright, in any order."""
    truth = rb.load_rover("curiosity")
    text = to_urdf(truth)
    wheels = [f"wheel_{w}_joint" for w in reversed(truth.wheel_names)]
    got = take(text, joints={"wheels": wheels, "steering": ["steer_LF_joint", "steer_RF_joint"]})
    assert_geometry(got.rover, truth, 1e-12)
    assert got.rover.steers.tolist() == [True, True, False, False, False, False]
    with pytest.raises(rb.RoverError, match="joint 'steer_LF_joint' is no rocker"):
        take(text, joints={"rockers": ["steer_LF_joint", "steer_RF_joint"]})
    with pytest.raises(rb.RoverError, match="no joint named 'wheel_LX_joint'; did you mean 'wheel_"):
        take(text, joints={"wheels": ["wheel_LX_joint"]})
    with pytest.raises(rb.RoverError, match="no role of joints named 'wheel'; did you mean 'wheels'"):
        take(text, joints={"wheel": wheels})


def test_one_piece_rockers_need_a_pivot() -> None:
    """Bogies and wheels straight on the body: where the rockers turn is nowhere in the file."""
    truth = rb.load_rover("curiosity")
    robot = foreign.Robot("one_piece")
    robot.root("base", mass=100.0)
    for s, side in enumerate(foreign.SIDES):
        robot.joint(
            f"{side}_bogie",
            "revolute",
            "base",
            f"bogie_{s}",
            truth.bogie_pivot[s],
            foreign.LEFT,
            limit=foreign.stop(np.array([-1.0, 1.0])),
            mass=9.0,
        )
        for i in (s, 2 + s, 4 + s):
            arm = "base" if i < 2 else f"bogie_{s}"
            robot.joint(
                f"drive_{i}",
                "continuous",
                arm,
                f"tyre_{i}",
                truth.hubs[i],
                foreign.LEFT,
                mass=5.0,
                shapes=foreign.cylinder(truth, i, "1.5707963267949 0 0"),
            )
    with pytest.raises(rb.RoverError, match=r"one piece with the body .* give rocker_pivot="):
        take(robot.text())
    got = take(robot.text(), rocker_pivot=truth.rocker_pivot[0])
    assert_geometry(got.rover, truth, 1e-9)
    assert got.rover.rockers[0].mass == 0


def test_millimetres_are_caught() -> None:
    import re

    truth = rb.load_rover("sawppy")

    def thousandfold(match: re.Match[str]) -> str:
        return f'{match[1]}="{" ".join(repr(1000 * float(w)) for w in match[2].split())}"'

    text = re.sub(r'\b(xyz|radius|length|size)="([^"]*)"', thousandfold, to_urdf(truth))
    text = re.sub(r'<axis xyz="[^"]*"', lambda m: re.sub(r"1000\.0", "1", m[0]), text)
    with pytest.raises(rb.RoverError, match=r"wheelbase would be 541\.6 m.*millimetres"):
        take(text)
    text = re.sub(r'\b(i..)="([^"]*)"', lambda m: f'{m[1]}="{1e6 * float(m[2])!r}"', text)
    got = take(text, scale=0.001)
    assert_geometry(got.rover, truth, 1e-12)
    assert_close(got.rover.bogies[0].inertia, truth.bogies[0].inertia, 1e-12, "kg m2", "kg mm2 scaled too")


def test_one_number_in_millimetres_is_caught() -> None:
    text = to_urdf(rb.load_rover("sawppy"))
    assert text.count('xyz="-0.181 ') == 2
    with pytest.raises(rb.RoverError, match=r"6 of its hinges could be wheels, 181\.\d m apart"):
        take(text.replace('xyz="-0.181 ', 'xyz="-181.0 '))


def test_load_rover_warns_of_guesses(tmp_path: Path) -> None:
    file = tmp_path / "maker.urdf"
    file.write_text(foreign.bars_closed_elsewhere(rb.load_rover("sawppy")))
    with pytest.warns(UserWarning, match=r"maker\.urdf: \d+ repaired(.|\n)*repaired: nothing ties the two rockers"):
        assert load_rover(file).name == "maker_rover"
    report = str(import_rover(file))
    assert "found: wheels drive_0_joint" in report
    assert "repaired: nothing ties the two rockers" in report


REFUSED = {
    "an entity bomb": (
        '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x "ha"><!ENTITY y "&x;&x;&x;&x;">]><robot name="&y;"/>',
        "declares a document type or entities",
    ),
    "a file from elsewhere": (
        '<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="&x;"/>',
        "declares a document type or entities",
    ),
    "depth": ("<robot>" + "<a>" * 500 + "</a>" * 500 + "</robot>", "nested deeper than 200"),
    "breadth": ("<robot>" + "<link/>" * 200_001 + "</robot>", "more than 200000 elements"),
    "no XML": ("<robot><link></robot>", "not well-formed XML"),
    "another language": ("<svg/>", "its root element is <svg>; URDF begins with <robot>"),
    "xacro": ('<robot xmlns:xacro="x" name="a"><xacro:macro name="b"/></robot>', "expand it first"),
    "nothing": ("<robot name='a'/>", "holds no link"),
    "one link": ("<robot name='a'><link name='b'/></robot>", "at most 0 of its outermost hinges lie parallel"),
    "a ring": (
        "<robot name='a'><link name='b'/><link name='c'/><joint name='j' type='fixed'><parent link='b'/><child link='c'/></joint>"
        "<joint name='k' type='fixed'><parent link='c'/><child link='b'/></joint></robot>",
        "form a ring",
    ),
    "two parents": (
        "<robot name='a'><link name='b'/><link name='c'/><link name='d'/>"
        "<joint name='j' type='fixed'><parent link='b'/><child link='c'/></joint>"
        "<joint name='k' type='fixed'><parent link='d'/><child link='c'/></joint></robot>",
        "at most 0 of its outermost hinges lie parallel",
    ),
    "a link that is not there": (
        "<robot name='a'><link name='b'/><joint name='j' type='fixed'><parent link='b'/><child link='c'/></joint></robot>",
        "joins link 'c', which the file does not hold",
    ),
}


@pytest.mark.parametrize("kind", sorted(REFUSED))
def test_refused(kind: str) -> None:
    text, sentence = REFUSED[kind]
    with pytest.raises(rb.RoverError, match=sentence):
        take(text)


def test_huge_files_are_not_read(tmp_path: Path) -> None:
    file = tmp_path / "huge.urdf"
    with file.open("wb") as handle:
        handle.truncate(30_000_000)
    with pytest.raises(rb.RoverError, match=r"30 MB; .* the limit is 20 MB"):
        import_rover(file)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('type="continuous"', 'type="wheel"', "is of type 'wheel'; URDF has fixed, revolute"),
        ('<axis xyz="0.0 1.0 0.0" />', '<axis xyz="0 0 0" />', "has an axis of no length"),
        ('<mass value="539.4"', '<mass value="-1"', "has a mass of -1 kg; give 0 or more"),
        ('<mass value="539.4"', '<mass value="heavy"', "mass is 'heavy'; it takes 1 finite number"),
        ('<parent link="base_link" />', "", "names no parent link"),
        ('radius="0.25"', 'radius="nan"', "cylinder radius is 'nan'"),
        ('multiplier="-1.0"', 'multiplier="nan"', "mimic multiplier is 'nan'"),
        ('joint="rocker_left_joint"', 'joint="ghost"', "a joint mimics 'ghost', which is not in the file"),
    ],
)
def test_faults_are_named(old: str, new: str, sentence: str) -> None:
    text = to_urdf(rb.load_rover("curiosity"))
    assert old in text
    with pytest.raises(rb.RoverError, match=sentence):
        take(text.replace(old, new, 1))


def test_four_wheels_are_not_a_rocker_bogie() -> None:
    robot = foreign.Robot("four_wheels")
    robot.root("base", mass=10.0)
    for k, (x, y) in enumerate(((0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2))):
        robot.joint(f"w{k}", "continuous", "base", f"wheel{k}", np.array([x, y, 0.0]), foreign.LEFT, mass=1.0)
    with pytest.raises(
        rb.RoverError, match="at most 4 of its outermost hinges lie parallel.*, and a rocker-bogie rover has six wheels$"
    ):
        take(robot.text())


def test_wheels_that_stand_across() -> None:
    """Six wheels of which two stand across at rest: the sentence says where to look."""
    text = foreign.bars_closed_elsewhere(rb.load_rover("sawppy"))
    for name in ("drive_4", "drive_5"):
        head, tail = text.split(f'<joint name="{name}_joint"')
        text = head + f'<joint name="{name}_joint"' + tail.replace('<axis xyz="0 1 0"/>', '<axis xyz="1 0 0"/>', 1)
    with pytest.raises(rb.RoverError, match="at most 4 .* must some be steered straight ahead first"):
        take(text)


def test_three_bogies_are_not_a_rocker_bogie() -> None:
    """Six wheels on three bogies, one of them across the tail."""
    robot = foreign.Robot("triple")
    robot.root("base", mass=10.0)
    for name, at, axis, wheels in (
        ("left", (0.1, 0.2, 0.1), foreign.LEFT, ((0.3, 0.25, 0.0), (-0.1, 0.25, 0.0))),
        ("right", (0.1, -0.2, 0.1), foreign.LEFT, ((0.3, -0.25, 0.0), (-0.1, -0.25, 0.0))),
        ("rear", (-0.3, 0.0, 0.1), np.array([1.0, 0, 0]), ((-0.3, 0.25, 0.0), (-0.3, -0.25, 0.0))),
    ):
        robot.joint(name, "continuous", "base", f"{name}_bogie", np.array(at), axis, mass=1.0)
        for k, place in enumerate(wheels):
            robot.joint(
                f"{name}_{k}", "continuous", f"{name}_bogie", f"{name}_wheel_{k}", np.array(place), foreign.LEFT, mass=1.0
            )
    with pytest.raises(rb.RoverError, match="no left and right pair of bogies with a rocker wheel to each"):
        take(robot.text())


def test_sdf_with_loops_and_frames() -> None:
    """SDF with relative poses in degrees, a closed loop, and other models is read."""
    truth = rb.load_rover("sawppy")
    text = to_sdf(truth)
    at = '<link name="bogie_left">\n      <pose>-0.11 0.18 -0.0502 0.0 0.0 0.0</pose>'
    assert at in text
    text = text.replace(at, '<frame name="p"><pose degrees="true">-0.11 0.18 -0.0502 0 90 0</pose></frame>'
                              '<link name="bogie_left"><pose relative_to="p" degrees="true">0 0 0 0 -90 0</pose>')  # fmt: skip
    text = text.replace(
        "</model>",
        '<link name="bar"><pose>0 0 0.07 0 0 0</pose></link><link name="rod"><pose>0.03 0.1 0.07 0 0 0</pose></link>'
        '<joint name="brace" type="revolute"><parent>base_link</parent><child>bar</child>'
        '<axis><xyz expressed_in="__model__">0 0 1</xyz></axis></joint>'
        '<joint name="ball_1" type="ball"><parent>bar</parent><child>rod</child></joint>'
        '<joint name="ball_2" type="ball"><parent>rocker_left</parent><child>rod</child></joint></model>',
    )
    text = text.replace("<model ", '<world name="w"><model name="rock"><link name="stone"/></model><model ').replace(
        "</model>\n</sdf>", "</model></world></sdf>"
    )
    got = take(text)
    assert_geometry(got.rover, truth, 1e-12)
    assert said(got.repaired, "ball_2", "closes a loop")


def test_mjcf_with_classes_and_degrees() -> None:
    """MuJoCo's own compiler reads it: defaults, degrees, meshes that are missing."""
    truth = rb.load_rover("rocky7")
    text = rb.to_mjcf(truth).replace(
        "<worldbody>", '<asset><mesh name="m" file="not_here.stl"/></asset><worldbody><geom type="mesh" mesh="m"/>', 1
    )
    got = take(text)
    assert_geometry(got.rover, truth, 1e-12)
    with pytest.raises(rb.RoverError, match="includes other files"):
        take(text.replace("<worldbody>", '<include file="/etc/hostname"/><worldbody>', 1))
    with pytest.raises(rb.RoverError, match="MuJoCo refuses it"):
        take(text.replace('type="free"', 'type="loose"', 1))
