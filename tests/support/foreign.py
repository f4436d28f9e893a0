"""Robot files in the styles of other projects, generated from a known rover.

Each style is a function that takes a rover and returns the text of a URDF with the conventions and faults of such files. The
result of an import is compared with the known rover.
"""

from __future__ import annotations

from collections.abc import Callable
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

import rockerbogie as rb
from rockerbogie.rover.rotations import rotation_x, rotation_y, rotation_z

Array = NDArray[np.float64]
Made = tuple[str, dict[str, str]]

EYE = np.eye(3)


class Robot:
    """A URDF under construction.

    Points are given in the rover's frame and written in the file's frame, which is rotated by `turn`.
    """

    def __init__(self, name: str, turn: Array = EYE, digits: int = 12) -> None:
        self.name, self.turn, self.digits = name, turn, digits
        self.lines: list[str] = []
        self.origin: dict[str, Array] = {}  # origin of each link in the rover's frame, m
        self.frame: dict[str, Array] = {}  # rotation of each link in the file's root frame

    def words(self, values: Array) -> str:
        return " ".join(f"{float(v) + 0.0:.{self.digits}g}" for v in np.round(values, 14))

    def link(self, name: str, *, mass: float = 0.0, shapes: str = "", inertia: tuple[float, ...] = (0.1, 0.1, 0.1)) -> None:
        body = ""
        if mass:
            ixx, iyy, izz = inertia
            body = (
                f'<inertial><mass value="{mass}"/>'
                f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
            )
        self.lines.append(f"<link name={quoteattr(name)}>{body}{shapes}</link>")

    def root(self, name: str, **link: object) -> None:
        self.origin[name], self.frame[name] = np.zeros(3), EYE
        self.link(name, **link)  # type: ignore[arg-type]

    def joint(
        self, name: str, kind: str, parent: str, child: str, at: Array, axis: Array | None = None, *,
        rpy: tuple[float, float, float] = (0, 0, 0), limit: str = "", **link: object,
    ) -> None:  # fmt: skip
        """Add a joint at a point and about an axis, both in the rover's frame, and its child link."""
        if child not in self.origin:
            self.link(child, **link)  # type: ignore[arg-type]
        x, y, z = (rotation_x(rpy[0]), rotation_y(rpy[1]), rotation_z(rpy[2]))
        xyz = self.frame[parent].T @ self.turn @ (at - self.origin[parent])
        self.origin[child], self.frame[child] = np.asarray(at, dtype=float), self.frame[parent] @ z @ y @ x
        lies = "" if axis is None else f'<axis xyz="{self.words(self.frame[child].T @ self.turn @ axis)}"/>'
        self.lines.append(
            f'<joint name={quoteattr(name)} type="{kind}"><origin xyz="{self.words(xyz)}" rpy="{self.words(np.array(rpy))}"/>'
            f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>{lies}{limit}</joint>"
        )

    def text(self, extra: str = "") -> str:
        return f"<?xml version='1.0'?>\n<robot name={quoteattr(self.name)}>\n" + "\n".join(self.lines) + extra + "\n</robot>\n"


LEFT = np.array([0.0, 1.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])
SIDES = ("left", "right")
MESH = '<visual><geometry><mesh filename="package://not_here/meshes/part.stl"/></geometry></visual>'


def stop(limits: Array, sign: float = 1.0) -> str:
    low, high = sorted(float(v) * sign for v in limits)
    return f'<limit lower="{low!r}" upper="{high!r}" effort="100" velocity="1"/>'


def cylinder(rover: rb.Rover, i: int, rpy: str, use: str = "collision") -> str:
    size = f'<cylinder radius="{float(rover.wheel_radius[i])!r}" length="{float(rover.wheel_width[i])!r}"/>'
    return f'<{use}><origin rpy="{rpy}" xyz="0 0 0"/><geometry>{size}</geometry></{use}>'


def add_mast_and_arm(robot: Robot, base: str, at: Array) -> None:
    """Add a mast that pans and tilts, and an arm of five hinges.

    Three hinges of the arm are parallel to the axles.
    """
    robot.joint("mast_pan", "revolute", base, "mast", at, UP, limit=stop(np.array([-3.0, 3.0])), mass=5.0)
    robot.joint("mast_tilt", "revolute", "mast", "head", at + 0.3 * UP, LEFT, limit=stop(np.array([-1.0, 1.0])), mass=2.0)
    robot.joint("head_to_camera", "fixed", "head", "camera", at + 0.35 * UP)
    last = base
    for k, axis in enumerate((UP, LEFT, LEFT, np.array([1.0, 0, 0]), LEFT)):
        reach = at + np.array([0.1 + 0.1 * k, -0.1, -0.1])
        robot.joint(f"arm_{k}_joint", "revolute", last, f"arm_{k}", reach, axis, limit=stop(np.array([-2.0, 2.0])), mass=1.0)
        last = f"arm_{k}"


def rockers_fixed(rover: rb.Rover) -> str:
    """Return a student rover for ROS.

    A footprint link, rockers on chains of fixed brackets, wheels that are meshes only.
    """
    robot = Robot("student_rover", digits=6)
    robot.root("base_footprint")
    robot.joint("base_joint", "fixed", "base_footprint", "base_link", 0.27 * UP, mass=10.0, shapes=MESH)
    for s, side in enumerate(SIDES):
        d = "LR"[s]
        pivot, bogie_pivot = rover.rocker_pivot[s], rover.bogie_pivot[s]
        robot.joint(f"bracket_{d}", "fixed", "base_link", f"bracket_link_{d}", pivot + (-0.05, 0, 0.05), mass=0.1)
        robot.joint(f"turnbuckle_{d}", "fixed", f"bracket_link_{d}", f"turn_{d}", pivot + (0, 0, 0.02), LEFT, mass=1.0)
        robot.joint(
            f"side_{d}_1",
            "fixed",
            f"turn_{d}",
            f"side_link_{d}_1",
            pivot,
            LEFT,
            limit=stop(np.array([-0.5, 0.5])),
            mass=7.0,
            shapes=MESH,
        )
        robot.joint(
            f"side_{d}_2",
            "revolute",
            f"side_link_{d}_1",
            f"side_link_{d}_2",
            bogie_pivot,
            LEFT,
            limit=stop(rover.bogie_limits),
            mass=3.0,
        )
        for i in (s, 2 + s, 4 + s):
            arm = f"side_link_{d}_1" if i < 2 else f"side_link_{d}_2"
            post = f"post_{i}_{d}"
            top = rover.hubs[i] + 0.1 * UP
            if rover.steers[i]:
                robot.joint(f"corner_{i}_{side}", "revolute", arm, post, top, UP, limit=stop(np.array([-0.5, 0.5])), mass=0.8)
            else:
                robot.joint(f"mount_{i}_{side}", "fixed", arm, post, top, LEFT, mass=0.3)
            robot.joint(f"wheel_{i}_{side}", "continuous", post, f"w_{i}_{side}", rover.hubs[i], LEFT, mass=0.8, shapes=MESH)
    robot.joint("imu_joint", "fixed", "base_link", "imu_link", 0.27 * UP)
    return robot.text('<transmission name="t"><joint name="wheel_0_left"/></transmission><gazebo reference="imu_link"/>')


def rockers_in_two_arms(rover: rb.Rover) -> str:
    """Return a Mars rover for Gazebo.

    Forward is −y; each rocker is two arms on a tilted axis; it has a mast and an arm.
    """
    quarter = rotation_z(-np.pi / 2)  # the rover's forward is the file's -y, its left the file's +x
    robot = Robot("two_armed", quarter)
    robot.root("base_footprint")
    robot.joint("base_joint", "fixed", "base_footprint", "chassis", np.zeros(3), mass=700.0, shapes=MESH)
    tilt = 0.19
    for s in (0, 1):
        d = "LR"[s]
        pivot, bogie_pivot = rover.rocker_pivot[s], rover.bogie_pivot[s]
        turn = tilt if s else -tilt
        robot.joint(f"axis_{d}", "fixed", "chassis", f"axis_link_{d}", pivot, rpy=(0, turn, 0), mass=7.3, shapes=MESH)
        axis = quarter.T @ robot.frame[f"axis_link_{d}"] @ np.array([1.0, 0, 0])
        for end in "FB":
            robot.joint(
                f"arm_{end}_{d}_joint",
                "revolute",
                f"axis_link_{d}",
                f"susp_{end}_{d}",
                pivot,
                axis,
                limit=stop(np.array([-0.4, 0.4])),
                mass=7.3,
            )
            robot.joint(f"back_{end}_{d}", "fixed", f"susp_{end}_{d}", f"level_{end}_{d}", pivot, rpy=(0, -turn, 0), mass=0.02)
        robot.joint(
            f"bogie_{d}",
            "revolute",
            f"level_B_{d}",
            f"susp_B2_{d}",
            bogie_pivot,
            LEFT,
            limit=stop(np.array([-1.2, 1.2])),
            mass=7.3,
        )
        for i in (s, 2 + s, 4 + s):
            arm = f"level_F_{d}" if i < 2 else f"susp_B2_{d}"
            where = ("back", "middle", "front")[int((rover.hubs[s::2, 0] < rover.hubs[i, 0]).sum())]
            if rover.steers[i]:
                robot.joint(
                    f"steer_{where}_{d}",
                    "revolute",
                    arm,
                    f"steer_link_{where}_{d}",
                    rover.hubs[i] + 0.4 * UP,
                    UP,
                    limit=stop(np.array([-1.6, 1.6])),
                    mass=5.0,
                )
                arm = f"steer_link_{where}_{d}"
            small = '<collision><geometry><cylinder radius="0.02" length="0.02"/></geometry></collision>'
            robot.joint(f"hub_{where}_{d}", "fixed", arm, f"hub_link_{where}_{d}", rover.hubs[i], mass=0.02, shapes=small)
            tyre, tread = f"{where}_wheel_{d}", cylinder(rover, i, "0 1.57 0")
            robot.joint(f"{tyre}_joint", "continuous", f"hub_link_{where}_{d}", tyre, rover.hubs[i], LEFT, mass=8.0, shapes=tread)
    add_mast_and_arm(robot, "chassis", np.array([0.6, 0.3, 1.1]))
    return robot.text('<gazebo><plugin filename="x" name="y"/></gazebo><ros2_control name="c" type="system"/>')


def upside_down_and_weightless(rover: rb.Rover) -> str:
    """Return an operations model.

    x forward, y right, z down; no masses, no joint limits, rockers not coupled.
    """
    robot = Robot("flight_model", np.diag([1.0, -1.0, -1.0]))
    robot.root("RNAV")
    endless = '<limit lower="-inf" upper="inf" effort="0" velocity="0"/>'
    robot.joint("RNAV_to_BODY", "fixed", "RNAV", "BODY", 0.9 * UP, shapes=MESH)
    for s in (0, 1):
        d = "LR"[s]
        robot.joint(f"{d}_DIFF", "revolute", "BODY", f"{d}_ROCKER", rover.rocker_pivot[s], LEFT, limit=endless, shapes=MESH)
        robot.joint(
            f"{d}_KNEE",
            "revolute",
            f"{d}_ROCKER",
            f"{d}_BOGIE",
            rover.bogie_pivot[s],
            -LEFT if s else LEFT,
            limit=endless,
            shapes=MESH,
        )
        for i in (s, 2 + s, 4 + s):
            arm = f"{d}_ROCKER" if i < 2 else f"{d}_BOGIE"
            if rover.steers[i]:
                robot.joint(
                    f"{d}{i}_STEER", "revolute", arm, f"{d}{i}_FORK", rover.hubs[i] + 0.5 * UP, -UP, limit=endless, shapes=MESH
                )
                arm = f"{d}{i}_FORK"
            robot.joint(f"{d}{i}_DRIVE", "revolute", arm, f"{d}{i}_TYRE", rover.hubs[i], -LEFT, limit=endless, shapes=MESH)
    add_mast_and_arm(robot, "BODY", np.array([0.8, 0.5, 1.1]))
    text = robot.text()
    for mass in ("5.0", "2.0", "1.0"):
        text = text.replace(f'<mass value="{mass}"/>', '<mass value="0"/>')
    return text


def bars_closed_elsewhere(rover: rb.Rover) -> str:
    """Return a hobby rover.

    Continuous rockers with void limits, a brace, and turnbuckles whose loops are closed in <gazebo>.
    """
    robot = Robot("maker_rover")
    box = '<collision><geometry><box size="0.425 0.285 0.093"/></geometry></collision>'
    robot.root("base_link", mass=0.01, shapes='<collision><geometry><box size="0.01 0.01 0.01"/></geometry></collision>')
    robot.joint("box_joint", "fixed", "base_link", "box_link", np.zeros(3), mass=1.0, shapes=box)
    robot.joint("brace_joint", "revolute", "base_link", "brace", 0.068 * UP, UP, limit=stop(np.array([-0.8, 0.8])), mass=0.1,
                shapes='<collision><geometry><box size="0.2 0.015 0.015"/></geometry></collision>')  # fmt: skip
    for s, side in enumerate(SIDES):
        robot.joint(
            f"{side}_rocker_joint",
            "continuous",
            "base_link",
            f"{side}_rocker",
            rover.rocker_pivot[s],
            LEFT,
            limit=stop(np.array([-0.8, 0.8])),
            mass=0.25,
        )
        robot.joint(
            f"{side}_bogie_joint",
            "revolute",
            f"{side}_rocker",
            f"{side}_bogie",
            rover.bogie_pivot[s],
            LEFT,
            limit=stop(rover.bogie_limits),
            mass=0.25,
        )
        for i in (s, 2 + s, 4 + s):
            arm = f"{side}_rocker" if i < 2 else f"{side}_bogie"
            if rover.steers[i]:
                robot.joint(f"corner_{i}_joint", "continuous", arm, f"corner_{i}", rover.hubs[i] + 0.132 * UP, UP, mass=0.25)
                arm = f"corner_{i}"
            turned = f"{(1 - 2 * s) * np.pi / 2!r} 0 0"
            robot.joint(
                f"drive_{i}_joint",
                "continuous",
                arm,
                f"drive_{i}",
                rover.hubs[i],
                LEFT,
                mass=0.25,
                shapes=cylinder(rover, i, turned),
            )
    loops = "".join(
        f'<gazebo><link name="{s}_bar"/><joint name="{s}_ball" type="ball"><parent>brace</parent><child>{s}_bar</child></joint>'
        "</gazebo>"
        for s in SIDES
    )
    return robot.text(loops)


def drawn_in_cad(rover: rb.Rover) -> str:
    """Return a CAD export.

    Forward is +y, joint frames are rotated, axes point either way, wheels have no sizes.

    It has one-sided joint limits, and inertias that no body can have.
    """
    quarter = rotation_z(np.pi / 2)  # the rover's forward is the file's +y
    robot = Robot("cad_rover", quarter)
    half = np.pi / 2
    flat = (1e-10, 2e-10, 9e-10)
    robot.root("base_link", mass=64.8, shapes=MESH, inertia=(1.6, 1.3, 2.57))
    for s, side in enumerate(SIDES):
        limits = np.array([0.0, 1.0]) if s == 0 else np.array([-0.1, 0.1])
        heavy, light = {"mass": 35.9, "inertia": flat}, {"mass": 21.3, "inertia": flat}
        first, second = f"{side}_1", f"{side}_2"
        ends = stop(limits, 1.0 if s else -1.0)
        robot.joint(
            f"{first}_joint",
            "revolute",
            "base_link",
            first,
            rover.rocker_pivot[s],
            LEFT,
            rpy=(half, 0, half),
            limit=ends,
            **heavy,
        )
        ends = stop(np.array([-0.4, 0.3]))
        robot.joint(f"{second}_joint", "revolute", first, second, rover.bogie_pivot[s], -LEFT, limit=ends, **heavy)
        for i in (s, 2 + s, 4 + s):
            arm, tyre = first if i < 2 else second, f"{side}_{i}_wheel"
            robot.joint(f"{tyre}_joint", "continuous", arm, tyre, rover.hubs[i], LEFT, rpy=(np.pi, 0, np.pi), **light)
    add_mast_and_arm(robot, "base_link", np.array([0.2, 0.0, 0.5]))
    return robot.text()


def legs_bolted_on(rover: rb.Rover) -> str:
    """Return a student's CAD rover.

    Its rockers are fixed to the body by joints with an axis of length 0.

    It has a fixed motor before each wheel, wheels that turn about x, a leg without mass, and no wheel sizes.
    """
    robot = Robot("bolted_rover")
    half = np.pi / 2
    robot.root("base_link", mass=0.49, shapes=MESH)
    for s, side in enumerate(SIDES):
        leg, sub = f"{side}_leg", f"{side}_sub_leg"
        robot.joint(f"{leg}_joint", "fixed", "base_link", leg, rover.rocker_pivot[s], np.zeros(3), rpy=(half, 0, 0),
                    mass=0.04 * (1 - s), shapes=MESH)  # fmt: skip
        robot.joint(f"{sub}_joint", "revolute", leg, sub, rover.bogie_pivot[s], -LEFT, limit=stop(rover.bogie_limits), mass=0.02)
        for i in (s, 2 + s, 4 + s):
            motor = f"motor_{i}"
            inboard = rover.hubs[i] - (0.2 - 0.4 * s) * rover.wheel_radius[i] * LEFT
            robot.joint(
                f"{motor}_joint", "fixed", leg if i < 2 else sub, motor, inboard, rpy=(half, half - np.pi * s, 0), mass=0.01
            )
            robot.joint(f"wheel_{i}_joint", "continuous", motor, f"wheel_{i}", rover.hubs[i], LEFT * (1 - 2 * s), mass=0.03)
    return robot.text()


STYLES: dict[str, Callable[[rb.Rover], str]] = {
    style.__name__: style
    for style in (
        rockers_fixed,
        rockers_in_two_arms,
        upside_down_and_weightless,
        bars_closed_elsewhere,
        drawn_in_cad,
        legs_bolted_on,
    )
}
