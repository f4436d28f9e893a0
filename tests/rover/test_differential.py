"""The differential bar against its definition: links that keep their length.

It is computed by bisection here, and closed in MuJoCo.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

import rockerbogie as rb
from rockerbogie.rover.differential import FIT_ERROR, DifferentialBar
from rockerbogie.rover.rotations import rotation_y, rotation_z
from support.helpers import assert_close

Array = NDArray[np.float64]

#: A bar that errs as Perseverance's does (its README, 6).
BAR = DifferentialBar((-0.1, 1.12), (-0.1, 0.8, 1.12), (0.30402, 0.79959, 1.12))
#: One with nothing square about it.
SKEW = DifferentialBar((0.05, 1.2), (-0.1, 0.62, 1.15), (0.38, 0.81, 1.09))
REACH = np.radians([-32.0, 32.0])


def rover() -> rb.Rover:
    return rb.load_rover("perseverance")


def by_bisection(bar: DifferentialBar, pivot: Array, left: float) -> float:
    """The right angle, from the links' lengths alone."""
    mirror = np.array([1.0, -1.0, 1.0])
    centre, end, horn = np.array([bar.pivot[0], 0.0, bar.pivot[1]]), np.array(bar.end), np.array(bar.horn)
    length = np.linalg.norm(horn - end)

    def turned(point: Array, about: Array, R: Array) -> Array:
        return about + R @ (point - about)

    def slack_left(turn: float) -> float:
        ends = turned(end, centre, rotation_z(turn)), turned(horn, pivot, rotation_y(left))
        return float(np.linalg.norm(ends[0] - ends[1]) - length)

    turn = brentq(slack_left, -0.5, 0.5, xtol=1e-15)

    def slack_right(right: float) -> float:
        ends = (
            turned(end * mirror, centre, rotation_z(turn)),
            turned(horn * mirror, pivot * mirror, rotation_y(right)),
        )
        return float(np.linalg.norm(ends[0] - ends[1]) - length)

    return float(brentq(slack_right, -0.9, 0.9, xtol=1e-15))


@pytest.mark.parametrize("bar", [BAR, SKEW])
def test_links_keep_their_length(bar: DifferentialBar) -> None:
    pivot = rover().rocker_pivot[0]
    left = np.radians(np.linspace(-30, 30, 41))
    expected = [by_bisection(bar, pivot, q) for q in left]
    assert_close(bar.right(pivot, left), expected, 1e-12, "rad", "both hold the links' lengths")


def test_errs_as_the_flown_one() -> None:
    """|left + right| at most 0.055 deg to 14.5 deg, and 1.0 deg at 32 deg."""
    left = np.radians(np.linspace(-32, 32, 2001))
    off = np.degrees(np.abs(left + BAR.right(rover().rocker_pivot[0], left)))
    assert off[np.abs(left) <= np.radians(14.5)].max() <= 0.055
    assert_close(off.max(), 1.0, 0.01, "deg", "the bar's error at 32 deg")


@pytest.mark.parametrize("bar", [BAR, SKEW])
def test_swapping_sides_is_the_inverse(bar: DifferentialBar) -> None:
    pivot = rover().rocker_pivot[0]
    left = np.radians(np.linspace(-25, 25, 101))
    assert_close(bar.right(pivot, bar.right(pivot, left)), left, 1e-13, "rad", "the linkage mirrors itself")


@pytest.mark.parametrize("bar", [BAR, SKEW])
def test_the_rover_follows_it(bar: DifferentialBar) -> None:
    """The rover's polynomial agrees with the linkage to 1e-12 rad between the limits.

    It is no longer than needed.
    """
    base = rover()
    machine = rb.Rover.from_pivots(
        wheel_radius=base.wheel_radius, rocker_pivot=base.rocker_pivot, bogie_pivot=base.bogie_pivot, hubs=base.hubs,
        rocker_limits=REACH, differential=bar,
    )  # fmt: skip
    left = np.linspace(*REACH, 5003)
    assert_close(machine.right_rocker(left), bar.right(base.rocker_pivot[0], left), FIT_ERROR, "rad", "the fit's own promise")
    shorter = bar.polynomial(base.rocker_pivot[0], REACH / 4)
    assert len(shorter) < len(machine.differential)


def test_mujoco_closes_the_same_loop() -> None:
    """The bar built in MuJoCo from bodies and ball joints gives the same angles."""
    mujoco = pytest.importorskip("mujoco")
    pivot, (x, z) = rover().rocker_pivot[0], BAR.pivot
    end, horn = np.array(BAR.end), np.array(BAR.horn)

    def words(v: Array) -> str:
        return " ".join(repr(float(a)) for a in v)

    def sides() -> str:
        text = ""
        for name, s in (("left", 1.0), ("right", -1.0)):
            m = np.array([1.0, s, 1.0])
            text += (
                f'<body name="{name}" pos="{words(pivot * m)}"><joint name="{name}" axis="0 1 0"/><geom size=".01" mass="1"/>'
                f'<site name="horn_{name}" pos="{words((horn - pivot) * m)}"/></body>'
            )
        return text

    lump = '<geom size=".01" mass="1"/>'
    links = "".join(
        f'<body name="link_{n}" pos="{words((end - [x, 0, z]) * [1, s, 1])}"><joint type="ball" name="ball_{n}"/>{lump}'
        f'<site name="tip_{n}" pos="{words((horn - end) * [1, s, 1])}"/></body>'
        for n, s in (("left", 1.0), ("right", -1.0))
    )
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><compiler angle="radian"/><option gravity="0 0 0" timestep="0.002"/>'
        '<default><equality solref="0.004 1" solimp="0.9999 0.9999 0.001"/></default>'
        f'<worldbody>{sides()}<body pos="{x} 0 {z}"><joint name="bar" axis="0 0 1"/>{lump}{links}</body></worldbody>'
        '<equality><connect site1="tip_left" site2="horn_left"/><connect site1="tip_right" site2="horn_right"/>'
        '<joint joint1="left" name="hold"/></equality></mujoco>'
    )
    data = mujoco.MjData(model)
    for degrees in (-24.0, -10.0, 15.0, 28.0):
        mujoco.mj_resetData(model, data)
        for step in range(6000):  # turn the left rocker there slowly, then let it come to rest
            data.eq_active[:] = 1
            model.eq_data[2, 0] = np.radians(degrees) * min(1.0, step / 3000)
            data.qvel *= 0.9
            mujoco.mj_step(model, data)
        left, right = (float(data.joint(n).qpos[0]) for n in ("left", "right"))
        assert_close(right, BAR.right(pivot, left), 1e-6, "rad", "MuJoCo's constraints give way by about this much")


def test_a_bar_that_locks_is_refused() -> None:
    short = DifferentialBar((0.1, 1.12), (0.1, 0.2, 1.12), (0.30402, 0.79959, 1.4))
    with pytest.raises(rb.RoverError, match=r"locks with the left rocker at .* narrow rocker_limits, or lengthen"):
        short.polynomial(rover().rocker_pivot[0], REACH)


def test_a_bar_needs_joint_limits() -> None:
    with pytest.raises(rb.RoverError, match="needs the rocker's joint limits"):
        BAR.polynomial(rover().rocker_pivot[0], (-np.inf, np.inf))


def test_a_dead_centre_is_refused() -> None:
    inline = DifferentialBar((0.0, 1.12), (0.0, 0.5, 1.12), (0.0, 0.9, 1.12))
    with pytest.raises(rb.RoverError, match="dead centre"):
        inline.right(rover().rocker_pivot[0], 0.1)


def test_settles_with_a_bar() -> None:
    """The real bar and the ideal one differ, and each keeps its own relation.

    The terrain turns the rockers far.
    """
    ideal = rover()
    real = ideal.replace(differential=BAR.polynomial(ideal.rocker_pivot[0], ideal.rocker_limits))
    across = np.linspace(-8, 8, 161)
    z = np.clip(across[:, None] * 0.3, -0.4, 0.4) * np.linspace(-1, 1, 161)[None, :]
    ground = rb.Terrain.from_array(z, spacing=0.1, origin=(-8.0, -8.0))
    a, b = (rb.settle(r, ground, 0.3, 0.0, 0.4) for r in (ideal, real))
    for pose, machine in ((a, ideal), (b, real)):
        assert pose.status == 0
        frames = rb.wheel_frames(machine, pose.rocker, pose.bogie)
        assert np.isfinite(frames).all()
        assert_close(pose.gap, np.zeros(6), 1e-6, "m", "all wheels touch")
    assert abs(float(a.rocker - b.rocker)) > 0


def test_a_quartic_stands_for_it_in_mujoco() -> None:
    """The bar's rover is exported to MuJoCo with the nearest quartic.

    It errs by 4e-4 rad at 32 deg.
    """
    mujoco = pytest.importorskip("mujoco")
    base = rover()
    real = base.replace(differential=BAR.polynomial(base.rocker_pivot[0], REACH))
    model = mujoco.MjModel.from_xml_string(rb.to_mjcf(real))
    held = np.polynomial.Polynomial(model.eq_data[0][:5])
    left = np.linspace(*REACH, 1001)
    assert_close(held(left), real.right_rocker(left), 4e-4, "rad", "the quartic over the whole reach")
    near = left[np.abs(left) < np.radians(14.5)]
    assert_close(held(near), real.right_rocker(near), 2.5e-4, "rad", "and where it works")
    with pytest.raises(rb.RoverError, match="needs the rocker's joint limits"):
        rb.to_mjcf(real.replace(rocker_limits=np.array([-np.inf, np.inf])))
