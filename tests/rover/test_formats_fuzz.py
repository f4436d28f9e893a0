"""Mutated robot files, and changes that must not change the rover.

A mutated file gives a possible rover, in agreement with MuJoCo, or one sentence.
"""

from __future__ import annotations

import random
import re
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pytest

import rockerbogie as rb
from fuzz.mutate import run
from rockerbogie.rover.formats import build_rover, read_trees, to_sdf, to_urdf
from support import probe
from support.helpers import assert_close


@pytest.mark.parametrize("seed", [101, 102])
def test_mutated_files(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log into the working folder
    tally = run(400, seed)
    assert tally["refused"] + tally["taken"] == 400
    assert min(tally["refused"], tally["taken"]) > 30, "both ways are met"
    assert tally["compared"] > 5, "some are read by MuJoCo too"


def rename(text: str, rng: random.Random) -> str:
    """Give every link, joint and frame a name without meaning."""
    root = ElementTree.fromstring(text)
    names = sorted({e.get("name", "") for e in root.iter() if e.tag in ("link", "joint", "frame")})
    new = {name: f"n{k}" for name, k in zip(names, rng.sample(range(1000), len(names)), strict=True)}
    for element in root.iter():
        for key in ("name", "link", "joint", "relative_to", "attached_to"):
            if element.get(key) in new and element is not root:
                element.set(key, new[element.get(key, "")])
        if element.tag in ("parent", "child") and (element.text or "").strip() in new:
            element.text = new[(element.text or "").strip()]
    return ElementTree.tostring(root, encoding="unicode")


def shuffle(text: str, rng: random.Random) -> str:
    """Write links and joints in another order. The first link, SDF's canonical one, stays first."""
    root = ElementTree.fromstring(text)
    holder = _holder(root)
    children = list(holder)
    first = next(e for e in children if e.tag == "link")
    for child in children:
        holder.remove(child)
    children.remove(first)
    rng.shuffle(children)
    holder.extend([first, *children])
    return ElementTree.tostring(root, encoding="unicode")


def add_sensors(text: str, rng: random.Random) -> str:
    """Fix links without mass and shape to random links, as sensor frames are."""
    root = ElementTree.fromstring(text)
    holder = _holder(root)
    links = [e.get("name", "") for e in holder.findall("link")]
    for k in range(3):
        name, parent = f"sensor_{k}_{rng.randrange(10**9)}", rng.choice(links)
        SubElement(holder, "link", name=name)
        joint = SubElement(holder, "joint", name=f"{name}_joint", type="fixed")
        if root.tag == "robot":
            SubElement(joint, "parent", link=parent)
            SubElement(joint, "child", link=name)
        else:
            SubElement(joint, "parent").text = parent
            SubElement(joint, "child").text = name
    return ElementTree.tostring(root, encoding="unicode")


def add_rocks(text: str, rng: random.Random) -> str:
    """Put loose links, or other models, beside the rover."""
    root = ElementTree.fromstring(text)
    if root.tag == "robot":
        SubElement(root, "link", name=f"rock_{rng.randrange(10**9)}")
        return ElementTree.tostring(root, encoding="unicode")
    rocks = Element("model", name=f"rocks_{rng.randrange(10**9)}")
    for k in range(40):
        SubElement(rocks, "link", name=f"rock_{k}")
    root.insert(0, rocks)
    return ElementTree.tostring(root, encoding="unicode")


def reverse_joints(text: str, rng: random.Random) -> str:
    """Exchange parent and child of some of an SDF's joints; the joint's pose stays where it was."""
    root = ElementTree.fromstring(text)
    if root.tag == "robot":
        return text
    holder = _holder(root)
    for joint in holder.findall("joint"):
        pose, axis = joint.find("pose"), joint.find("axis")
        parent, child = joint.find("parent"), joint.find("child")
        assert parent is not None
        assert child is not None
        if axis is None or axis.find("mimic") is not None or pose is not None or rng.random() < 0.5:
            continue
        placed = SubElement(joint, "pose")
        placed.set("relative_to", child.text or "")
        placed.text = "0 0 0 0 0 0"
        parent.text, child.text = child.text, parent.text
        xyz = axis.find("xyz")
        assert xyz is not None
        xyz.text = " ".join(repr(-float(v)) for v in (xyz.text or "").split())  # the same sense of the angle
    return ElementTree.tostring(root, encoding="unicode")


def write_no_limits(text: str, rng: random.Random) -> str:
    """Write missing limits as libsdformat before 1.10 does, or as the largest double."""
    root = ElementTree.fromstring(text)
    for axis in root.iter("axis"):
        if root.tag == "sdf" and axis.find("limit") is None:
            far = rng.choice(("1e16", "1.7976931348623157e+308"))
            limit = SubElement(axis, "limit")
            SubElement(limit, "lower").text, SubElement(limit, "upper").text = f"-{far}", far
    return ElementTree.tostring(root, encoding="unicode")


def reformat(text: str, rng: random.Random) -> str:
    """Add comments and white space."""
    spaces = rng.choice((" ", "\n\t", "\r\n"))
    return re.sub(r">(\s*)<", f"><!-- {rng.random()} -->{spaces}<", text.partition("?>")[2] or text)


def _holder(root: Element) -> Element:
    """Return the element that holds the rover's links."""
    return root if root.tag == "robot" else max(root.iter("model"), key=lambda m: len(m.findall("joint")))


HARMLESS = (rename, shuffle, add_sensors, add_rocks, reverse_joints, write_no_limits, reformat)
SOURCES = {
    "probe.urdf": probe.urdf(),
    "probe.sdf": probe.sdf(),
    "sawppy.urdf": to_urdf(rb.load_rover("sawppy")),
    "curiosity.sdf": to_sdf(rb.load_rover("curiosity")),
}


@pytest.mark.parametrize("name", SOURCES)
def test_harmless_changes_change_nothing(name: str) -> None:
    """Names, order, roots, reversed joints, sensors and loose links change nothing."""
    truth = build_rover(read_trees(SOURCES[name], name), name).rover
    rng = random.Random(name)
    for _ in range(40):
        text, done = SOURCES[name], []
        for change in rng.sample(HARMLESS, rng.randint(1, 4)):
            text = change(text, rng)
            done.append(change.__name__)
        got = build_rover(read_trees(text, name), name).rover
        why = f"{name} after {', '.join(done)}"
        for field in ("rocker_pivot", "bogie_pivot", "hubs", "wheel_radius", "wheel_width", "steering_offset", "body_box"):
            assert_close(getattr(got, field), getattr(truth, field), 1e-9, "m", f"{field}: {why}")
        for field in ("rocker_limits", "bogie_limits", "differential"):
            assert_close(getattr(got, field), getattr(truth, field), 1e-9, "rad", f"{field}: {why}")
        for own, other in zip(got.links, truth.links, strict=True):
            assert_close(own.mass, other.mass, 1e-9, "kg", why)
            assert_close(own.com, other.com, 1e-9, "m", why)
            assert_close(own.inertia, other.inertia, 1e-9 * np.abs(other.inertia).max(), "kg m²", why)
