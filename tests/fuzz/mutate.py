"""Mutate robot files, byte by byte and in ways that keep them readable.

`python tools/fuzz_files.py --kind robot` mutates 10,000.

Every mutated file must give a possible rover or one `RoverError`, within `LONGEST`. URDF files that MuJoCo reads too must agree
with it: the pivots' and hubs' positions, and the sum of the masses.
"""

from __future__ import annotations

import random
import re
import time
import warnings
from collections import Counter
from xml.etree import ElementTree

import numpy as np

import rockerbogie as rb
from rockerbogie.rover.formats import ImportResult, build_rover, read_trees, to_sdf, to_toml, to_urdf
from rockerbogie.rover.formats.toml_read import read_toml

#: Numbers that have broken readers before.
NASTY = (
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "-inf",
    "",
    "abc",
    "1_0",
    "0x10",
    "1,5",
    "9" * 400,
    "1e400",
    "1000",
    "0.001",
    "--1",
    "1 2",
)
#: No file may take more processor time, s.
LONGEST = 5.0


def sources() -> dict[str, str]:
    """Return the files to mutate: our own exports, and files in the styles of others."""
    from support import foreign, probe

    files = {}
    for name in ("curiosity", "elhami-dashti", "sawppy"):
        rover = rb.load_rover(name)
        files |= {f"{name}.urdf": to_urdf(rover), f"{name}.sdf": to_sdf(rover), f"{name}.toml": to_toml(rover, options=True)}
    bar = rb.load_rover("perseverance").replace(differential=np.array([0.0, -1.0, 0.01, 0.002]))
    files |= {"bar.urdf": to_urdf(bar, ros2_control=True), "bar.toml": to_toml(bar)}
    for name, style in foreign.STYLES.items():
        files[f"{name}.urdf"] = style(rb.load_rover("curiosity"))
    files |= {"probe.urdf": probe.urdf(), "probe.sdf": probe.sdf(), "probe14.sdf": probe.sdf("1.4", 1.5707963267948966)}
    inner = probe.sdf().partition('<model name="probe">')[2].partition("</model>")[0]
    nested = f'<model name="probe"><pose>5 4 0.3 0 0 1</pose>{inner}</model><frame name="f" attached_to="probe"/>'
    files["nested.sdf"] = (
        f'<sdf version="1.9"><world name="w"><model name="yard"><link name="slab"/>{nested}</model></world></sdf>'
    )
    hull = '<mesh name="hull" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"/>'
    body = '<geom type="box" size="0.3 0.18 0.1" mass="5"/><geom type="mesh" mesh="hull" mass="15"/>'
    tie = '<joint joint1="steer_Rr" joint2="steer_Rl" polycoef="0 -0.8 0 0.3 0"/>'
    files |= {"probe.xml": probe.mjcf(), "mesh.xml": probe.mjcf(body, hull, tie), "osr.xml": rb.to_mjcf(rb.load_rover("osr"))}
    return files


def spoil(name: str, text: str, rng: random.Random) -> str:
    """Return one mutated copy."""
    ways = [_bytes, _numbers, _lines]
    if not name.endswith(".toml"):
        ways += [_elements, _elements, _attributes]
    for _ in range(rng.choice((1, 1, 2, 5))):
        text = rng.choice(ways)(text, rng)
    return text


def _bytes(text: str, rng: random.Random) -> str:
    at = rng.randrange(max(len(text), 1))
    length = rng.choice((1, 1, 3, 40, 400))
    filler = "".join(chr(rng.choice((0, 9, 34, 38, 39, 60, 62, 65, 91, 255, 8232, 65534))) for _ in range(rng.choice((0, 1, 3))))
    return rng.choice((text[:at] + filler + text[at + length :], text[:at] + text[at : at + length] * 2 + text[at:], text[:at]))


def _numbers(text: str, rng: random.Random) -> str:
    spots = list(re.finditer(r"-?\d+\.?\d*(?:e[-+]?\d+)?", text))
    if not spots:
        return text
    spot = rng.choice(spots)
    value = spot.group()
    try:
        scaled = repr(float(value) * rng.choice((1000.0, 0.001, -1.0, 57.3)))
    except (ValueError, OverflowError):
        scaled = "1"
    return text[: spot.start()] + rng.choice((*NASTY, scaled, scaled, scaled)) + text[spot.end() :]


def _lines(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    way = rng.randrange(3)
    if way == 0:
        del lines[i]
    elif way == 1:
        lines.insert(j, lines[i])
    else:
        lines[i], lines[j] = lines[j], lines[i]
    return "\n".join(lines)


def _parse(text: str) -> ElementTree.Element | None:
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError):
        return None


def _elements(text: str, rng: random.Random) -> str:
    """Remove, double, move or nest an element."""
    root = _parse(text)
    if root is None:
        return text
    parents = {child: parent for parent in root.iter() for child in parent}
    if not parents:
        return text
    child = rng.choice(list(parents))
    way = rng.randrange(5)
    if way == 0:
        parents[child].remove(child)
    elif way == 1:
        parents[child].append(child)
    elif way == 2:
        other = rng.choice([e for e in root.iter() if e not in set(child.iter())])
        parents[child].remove(child)
        other.append(child)
    elif way == 3:
        child.tag = rng.choice(("link", "joint", "inertial", "axis", "limit", "mimic", "robot", "sdf", "x:y", "rockerbogie"))
    else:
        child.text = rng.choice(NASTY)
    return ElementTree.tostring(root, encoding="unicode")


def _attributes(text: str, rng: random.Random) -> str:
    """Drop, change or swap an attribute."""
    root = _parse(text)
    if root is None:
        return text
    elements = [e for e in root.iter() if e.attrib]
    if not elements:
        return text
    element = rng.choice(elements)
    key = rng.choice(list(element.attrib))
    way = rng.randrange(4)
    if way == 0:
        del element.attrib[key]
    elif way == 1:
        element.set(
            key, rng.choice((*NASTY, "fixed", "continuous", "floating", "base_link", "0 0 0", "0 0 1", "1 0 0", "nan nan nan"))
        )
    else:
        other = rng.choice([e for e in elements if key in e.attrib])
        element.attrib[key], other.attrib[key] = other.attrib[key], element.attrib[key]
    return ElementTree.tostring(root, encoding="unicode")


def read(name: str, text: str) -> tuple[rb.Rover, ImportResult | None]:
    """Return the rover of a file's text, and the import's report if it is a robot file."""
    if name.endswith(".toml"):
        return read_toml(text, name), None
    result = build_rover(read_trees(text.encode("utf-8", "surrogatepass"), name), name)
    return result.rover, result


def agrees_with_mujoco(text: str, result: ImportResult) -> bool:
    """Check an imported URDF against MuJoCo; return False if MuJoCo refuses the file.

    Joints are found by the names in the report. Distances between pivots and hubs do not depend on the frame; hubs are compared
    in the side view, as they are moved along their axles to the tread. Files with joints that are not at 0 at rest, with laid or
    freed hinges, or with a scale are left out.
    """
    import mujoco

    report = " ".join((*result.repaired, *result.guessed, *result.dropped))
    if any(
        word in report for word in ("zero angles", "lie up to", "fixed to the body", "fixed joints", "two arms", "more than one")
    ):
        return False
    root = _parse(text)  # None for a prefix that is not declared, which the package's parser lets pass
    if root is None:
        return False
    if any(joint.find("limit") is not None and _locked(joint.find("limit")) for joint in root.findall("joint")):
        return False
    masses = [link.find("inertial") for link in root.findall("link")]
    values = [None if inertial is None else inertial.find("mass") for inertial in masses]
    total = sum(float(mass.get("value") or 0) for mass in values if mass is not None)
    guessed = any(word in report for word in ("mass", "no joint joins"))
    assert guessed or abs(result.rover.mass - total) <= 1e-6 * total, f"mass {result.rover.mass}, the file's sum is {total}"
    for element in root.iter("link"):
        for part in [e for e in element if e.tag in ("visual", "collision", "inertial")]:
            element.remove(part)
        element.append(ElementTree.fromstring(SOLID))
    for parent in list(root):
        if parent.tag not in ("link", "joint"):
            root.remove(parent)
    for joint in root.findall("joint"):
        for tag in ("mimic", "limit"):
            for child in joint.findall(tag):
                joint.remove(child)
        if joint.get("type") == "revolute":
            joint.set("type", "continuous")
    try:
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    except ValueError:
        return False
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    names = {line.split(" ")[0]: line.partition(" ")[2].split(", ") for line in result.found[:3]}
    rover = result.rover
    pairs = [(names["bogies"], rover.bogie_pivot)] + ([(names["rockers"], rover.rocker_pivot)] if "rockers" in names else [])
    theirs = np.concatenate([[data.joint(n).xanchor for n in joints] for joints, _ in pairs])
    ours = np.concatenate([points for _, points in pairs])
    size = rover.wheelbase
    gap = np.linalg.norm(theirs[:, None] - theirs[None], axis=-1) - np.linalg.norm(ours[:, None] - ours[None], axis=-1)
    assert np.abs(gap).max() < 1e-6 * size, "pivots are apart as in MuJoCo"
    axle = data.joint(names["bogies"][0]).xaxis
    hubs = np.array([data.joint(n).xanchor for n in names["wheels"]]) - theirs[0]
    side = np.linalg.norm(hubs - np.outer(hubs @ axle, axle), axis=1)
    own = np.linalg.norm((rover.hubs - ours[0])[:, [0, 2]], axis=1)
    assert np.abs(side - own).max() < 1e-6 * size, "hubs are as far from the left bogie's pivot as in MuJoCo, in the side view"
    return True


SOLID = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def _locked(limit: ElementTree.Element | None) -> bool:
    """Return True for limits that hold a joint at one angle.

    A missing limit is read as 0.
    """
    return limit is not None and float(limit.get("lower") or 0) == float(limit.get("upper") or 0)


def check(rover: rb.Rover) -> None:
    """Check that a rover is possible, independently of the package's own checks."""
    lengths = [
        rover.rocker_pivot,
        rover.bogie_pivot,
        rover.hubs,
        rover.wheel_radius,
        rover.wheel_width,
        rover.steering_offset,
        rover.body_box,
    ]
    assert all(np.isfinite(a).all() for a in lengths), "a length is not finite"
    assert (rover.wheel_radius > 0).all(), "a wheel has no size"
    assert (rover.wheel_width >= 0).all(), "a wheel has a negative width"
    assert (rover.hubs[::2, 1] > rover.hubs[1::2, 1]).all(), "left is right"
    assert 0.01 < rover.wheelbase < 30, "no rover has this size"
    for low, high in (rover.rocker_limits, rover.bogie_limits):
        assert low <= 0 <= high, "its rest is beyond a joint limit"
        assert low < high, "it cannot move"
    slope = np.polynomial.polynomial.polyder(rover.differential)
    reach = np.linspace(*np.where(np.isfinite(rover.rocker_limits), rover.rocker_limits, 0.0), 50)
    assert (np.polynomial.polynomial.polyval(reach, slope) < 0).all(), "its differential turns back"
    assert rover.mass > 0, "it has no mass"
    for link in rover.links:
        assert np.isfinite(link.mass), "a mass is not finite"
        assert link.mass >= 0, "a mass is negative"
        assert np.isfinite(link.com).all(), "a centre of mass is not finite"
        moments = np.linalg.eigvalsh(link.inertia)
        assert moments[0] >= -1e-9 * max(moments[2], 1e-300), "an inertia is negative"
        assert moments[2] <= moments[:2].sum() + 1e-5 * moments[2] + 1e-12, "an inertia breaks the triangle"
    frames = rb.wheel_frames(rover, 0.1, [0.1, -0.1])
    assert np.isfinite(frames).all(), "wheel frames are not finite"
    assert np.isfinite(rover.packed[np.isfinite(rover.packed)]).all()


def run(count: int, seed: int = 0) -> Counter[str]:
    """Mutate and read `count` files; return the numbers refused, taken and compared."""
    rng = random.Random(seed)
    files = sources()
    names = sorted(files)
    tally: Counter[str] = Counter()
    slowest = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning from numpy is a number out of hand
        for k in range(count):
            name = names[k % len(names)]
            text = spoil(name, files[name], rng)
            start = time.process_time()
            try:
                rover, result = read(name, text)
            except rb.RoverError as error:
                tally["refused"] += 1
                tally["longest_message"] = max(tally["longest_message"], len(str(error)))
            except BaseException as error:
                raise AssertionError(f"seed {seed}, file {k} ({name}): {type(error).__name__}: {error}\n{text[:3000]}") from error
            else:
                tally["taken"] += 1
                try:
                    check(rover)
                    if result is not None and name.endswith(".urdf"):
                        tally["compared"] += agrees_with_mujoco(text, result)
                except (AssertionError, KeyError) as error:
                    raise AssertionError(f"seed {seed}, file {k} ({name}): {error}\n{text[:6000]}") from error
            taken = time.process_time() - start
            slowest = max(slowest, taken)
            assert taken < LONGEST, f"seed {seed}, file {k} ({name}) took {taken:.1f} s"
    tally["slowest_ms"] = round(1e3 * slowest)
    return tally
