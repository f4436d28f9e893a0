"""Comparisons with tolerances, and rovers that several tests use."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

import rockerbogie as rb


def assert_close(actual: ArrayLike, expected: ArrayLike, tol: float, unit: str, reason: str) -> None:
    """Assert that `actual` is within `tol` of `expected`, and NaN exactly where `expected` is.

    Args:
        actual: values (...).
        expected: values of a shape that broadcasts with `actual`.
        tol: largest difference allowed, in `unit`.
        unit: unit of all values, for the message.
        reason: reason why the two should agree, and why to that tolerance.
    """
    a, e = np.broadcast_arrays(np.asarray(actual, dtype=float), np.asarray(expected, dtype=float))
    assert a.size, f"nothing to compare: {reason}"
    lost = np.isnan(a) != np.isnan(e)
    assert not lost.any(), f"NaN at {np.argwhere(lost)[0].tolist()} in one and not the other ({lost.sum()} of {a.size}): {reason}"
    with np.errstate(invalid="ignore"):  # infinite on both sides is equal
        apart = np.where((a == e) | np.isnan(a), 0.0, np.abs(a - e))
    worst = np.unravel_index(apart.argmax(), apart.shape)
    assert apart[worst] <= tol, (
        f"off by {apart[worst]:.3g} {unit} at {[int(i) for i in worst]} (got {a[worst]:.12g}, expected {e[worst]:.12g}), "
        f"allowed {tol:g} {unit}: {reason}"
    )


def paper_rover() -> rb.Rover:
    """Return the paper's rover from the constants of its Table I; its rear wheels steer."""
    return rb.Rover.from_dh(
        K3=0.27, K4=0.29, K5=0.29, K6=0.2846, K7=0.245, K8=0.145, K9=np.radians(30.7), K10=0.10, K11=0.125,
        name="elhami-dashti", steers=(True, False, False),
    )  # fmt: skip


def random_rover(rng: np.random.Generator, *, bogie_ahead: bool | None = None) -> rb.Rover:
    """Return a random rover: size, tracks, steering offsets, wheels, and bogie ahead or behind."""
    ahead = bool(rng.integers(2)) if bogie_ahead is None else bogie_ahead
    size = np.exp(rng.uniform(np.log(0.2), np.log(2.0)))
    forward = 1.0 if ahead else -1.0
    drop = -rng.uniform(0.25, 0.6) + rng.uniform(-0.01, 0.01, 3)
    reach = np.array([-rng.uniform(0.7, 1.0), rng.uniform(-0.1, 0.1), rng.uniform(0.7, 1.0)]) * forward
    track = rng.uniform(0.45, 0.8, 3)
    hubs = np.stack([reach, track, drop], axis=1)
    rocker = (rng.uniform(-0.2, 0.2) + 0.0, rng.uniform(0.2, 0.8), rng.uniform(0.0, 0.3))
    bogie = (reach[1:].mean() + rng.uniform(-0.1, 0.1), rng.uniform(0.2, 0.8), rng.uniform(-0.2, 0.1))
    return rb.Rover.from_pivots(
        name="random",
        wheel_radius=size * rng.uniform(0.15, 0.28, 3),
        wheel_width=size * rng.uniform(0.0, 0.3) * rng.integers(2),
        rocker_pivot=np.multiply(rocker, size),
        bogie_pivot=np.multiply(bogie, size),
        hubs=hubs * size,
        steering_offset=size * rng.uniform(-0.1, 0.1, (3, 2)) * rng.integers(2, size=(3, 1)),
    )
