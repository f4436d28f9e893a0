"""Paths: geometry against circles and finite differences, and errors for impossible ones."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from support.helpers import assert_close

U_TURN = rb.Path.waypoints([(0, 0), (3, 0), (3, 4), (0, 4)], radius=0.8)
WINDING = rb.Path.waypoints([(5, -2), (1, -3), (-2, 1), (-3, -4), (2, -7)], radius=0.5)
LOG = rb.Path.from_arrays([0, 1, 1.5, 1.2, 0], [0, 0.5, 2, 4, 5], np.radians([170, 179, -175, -160, -200]))
PATHS = {
    "straight": rb.Path.straight((1, -2), 0.7, 3.0),
    "left": rb.Path.arc((1, -2), 0.7, 2.0, 4.0),
    "right": rb.Path.arc((1, -2), 0.7, 0.5, -7.0),
    "u-turn": U_TURN,
    "winding": WINDING,
    "log": LOG,
}


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
def test_course_and_curvature_are_derivatives(path: rb.Path) -> None:
    h = 1e-6
    s = np.random.default_rng(0).uniform(h, path.length - h, 2000)
    s = s[np.abs(s[:, None] - path.distance).min(axis=1) > 2 * h]  # a joint has two curvatures
    before, at, after = path.sample(s - h), path.sample(s), path.sample(s + h)
    assert_close((after.x - before.x) / (2 * h), np.cos(at.course), 1e-7, "-", "dx/ds is the cosine of the course")
    assert_close((after.y - before.y) / (2 * h), np.sin(at.course), 1e-7, "-", "dy/ds is its sine")
    assert_close((after.yaw - before.yaw) / (2 * h), at.curvature, 1e-7, "rad/m", "curvature is the rate of yaw")


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
def test_position_and_yaw_are_continuous(path: rb.Path) -> None:
    s = np.linspace(0, path.length, 20001)
    at = path.sample(s)
    step = s[1]
    assert_close(np.hypot(np.diff(at.x), np.diff(at.y)), step, step * 0.3, "m", "no jump: chords fall short at corners only")
    assert np.abs(np.diff(at.yaw)).max() < 3.5 * step  # the tightest curve here is of 0.5 m, and the log turns by 1.2 rad/m


def test_arc_lies_on_its_circle() -> None:
    path = rb.Path.arc((1, -2), np.pi / 2, 2.0, np.pi / 2)
    at = path.sample(np.linspace(0, path.length, 50))
    assert_close(np.hypot(at.x + 1, at.y + 2), 2.0, 1e-12, "m", "the centre is a radius to the left")
    assert_close([at.x[-1], at.y[-1], at.yaw[-1]], [-1, 0, np.pi], 1e-12, "m, rad", "a quarter turn left")
    assert path.length == pytest.approx(np.pi)
    right = rb.Path.arc((1, -2), np.pi / 2, 2.0, -np.pi / 2).sample(path.length)
    assert_close([right.x, right.y, right.yaw], [3, 0, 0], 1e-12, "m, rad", "and a quarter turn right")


def test_yaw_counts_whole_turns() -> None:
    path = rb.Path.arc((0, 0), 0.0, 1.0, 4 * np.pi)
    assert_close(path.sample(path.length).yaw, 4 * np.pi, 1e-12, "rad", "yaw is not wrapped")


def test_waypoints_start_and_end_at_their_points_and_round_the_corners() -> None:
    start, end = U_TURN.sample(0.0), U_TURN.sample(U_TURN.length)
    assert_close([start.x, start.y, start.yaw], [0, 0, 0], 1e-12, "m, rad", "the first point, facing the second")
    assert_close([end.x, end.y, end.yaw], [0, 4, np.pi], 1e-12, "m, rad", "the last, with the course of arrival")
    assert U_TURN.length == pytest.approx(3 + 4 + 3 - 4 * 0.8 + np.pi * 0.8)
    at = U_TURN.sample(np.linspace(0, U_TURN.length, 5001))
    assert np.hypot(at.x - 3, at.y).min() == pytest.approx(0.8 * (np.sqrt(2) - 1), abs=1e-3)  # what a right angle is cut by
    assert_close(at.course, at.yaw, 1e-12, "rad", "yaw is the direction of travel")
    assert set(np.round(np.abs(at.curvature), 9)) == {0.0, 1.25}


def test_arcs_may_use_a_whole_leg() -> None:
    path = rb.Path.waypoints([(0, 0), (1, 0), (1, 2), (0, 2)], radius=1.0)
    assert path.length == pytest.approx(np.pi)


def test_log_passes_through_its_poses_with_yaw_unwrapped() -> None:
    at = LOG.sample(LOG.distance)
    assert_close(at.x, [0, 1, 1.5, 1.2, 0], 1e-12, "m", "the poses given")
    assert_close(np.degrees(at.yaw), [170, 179, 185, 200, 160], 1e-9, "deg", "the poses given, without jumps of a whole turn")
    assert not np.allclose(LOG.sample(0.5).course, LOG.sample(0.5).yaw)


@pytest.mark.parametrize("shape", [(), (1,), (3, 1, 2), (0,)])
def test_sample_keeps_the_shape(shape: tuple[int, ...]) -> None:
    at = WINDING.sample(np.full(shape, 1.0))
    assert all(np.shape(value) == shape for value in at)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: rb.Path.straight((0, 0), 0, 0), "no length: give one above 0"),
        (lambda: rb.Path.straight((0, 0), 0, -2), "no length: give one above 0"),
        (lambda: rb.Path.straight((0, 0), 0, np.nan), "not finite"),
        (lambda: rb.Path.straight((0, np.inf), 0, 1), "not finite"),
        (lambda: rb.Path.straight((0, 0), np.nan, 1), "not finite"),
        (lambda: rb.Path.arc((0, 0), 0, 0, 1), "radius is 0 m; give one above 0"),
        (lambda: rb.Path.arc((0, 0), 0, np.nan, 1), "radius is nan m; give one above 0"),
        (lambda: rb.Path.arc((0, 0), 0, np.inf, 1), "not finite"),
        (lambda: rb.Path.arc((0, 0), 0, 1, 0), "no length"),
        (lambda: rb.Path.waypoints([(0, 0)]), "at least two points"),
        (lambda: rb.Path.waypoints([]), "at least two points"),
        (lambda: rb.Path.waypoints([(0, 0, 0), (1, 1, 1)]), "at least two points \\(x, y\\)"),
        (lambda: rb.Path.waypoints([(0, 0), (1, np.nan)]), "point 2 of the path is \\(1, nan\\): give finite numbers"),
        (lambda: rb.Path.waypoints([(0, 0), (2, 2), (2, 2)]), "points 2 and 3 of the path are both at \\(2, 2\\) m"),
        (lambda: rb.Path.waypoints([(0, 0), (2, 0), (0, 0)]), "turns back on itself at waypoint 2"),
        (lambda: rb.Path.waypoints([(0, 0), (2, 0), (2, 1)], radius=1.5), "between waypoints 2 and 3, 1 m apart: .* at most 1 m"),
        (lambda: rb.Path.waypoints([(0, 0), (2, 0), (2, 2)], radius=-1), "radius is -1 m"),
        (lambda: rb.Path.waypoints([(0, 0), (1, 0), (1, 1)], radius=np.inf), "radius is inf m; give a finite"),
        (lambda: rb.Path.waypoints("one, two"), "made of numbers"),
        (lambda: rb.Path.from_arrays([0], [0], [0]), "at least 2"),
        (lambda: rb.Path.from_arrays([0, 1], [0, 1], [0]), "three \\(n,\\)"),
        (lambda: rb.Path.from_arrays([0, 1], [0, 1], [0, np.nan]), "yaw holds a value that is not finite"),
        (lambda: rb.Path.from_arrays([0, 0], [1, 1], [0, 1]), "both at"),
        (lambda: rb.Path.straight((0, 0), 0, 1).sample(1.1), "runs from 0 to 1 m; distances asked for run from 1.1 to 1.1 m"),
        (lambda: rb.Path.straight((0, 0), 0, 1).sample([0.5, np.nan]), "runs from 0 to 1 m"),
    ],
)  # fmt: skip
def test_bad_paths_are_refused(call, sentence: str) -> None:
    with pytest.raises(rb.PathError, match=sentence):
        call()


def test_a_path_prints_as_a_line() -> None:
    assert repr(U_TURN) == f"<Path of {U_TURN.length:.6g} m: {U_TURN.description}>"
    assert "\n" not in repr(U_TURN)


def test_heading_of_a_route_is_deprecated() -> None:
    numbers = [np.arange(3.0) for _ in range(6)]
    route = rb.Route(*numbers, crs=None, rover="osr", clearance=numbers[0], time=numbers[0], goal=np.ones(3, dtype=np.int64))
    with pytest.warns(DeprecationWarning, match=r"use Route\.yaw"):
        assert route.heading is route.yaw
    assert "\n" not in repr(route)
