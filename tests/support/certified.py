"""Faults of settled poses, found with certified brackets of every gap and of the clearance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import rockerbogie as rb
from rockerbogie.terrain.spline import _bridged
from support import oracle, sampled
from support.sharp_grounds import Case

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Largest depth of a tread point below the terrain, and largest gap of a wheel in contact, m.
TOLERANCE = 1e-6
#: Largest distance of `pose.gap` and `pose.clearance` from their brackets, m.
AGREES = 1e-8
LENGTHS = ("deep", "far", "gap", "clearance")  # faults that are lengths: `errors_of`
FAULTS = ("deep", "far", "gap", "clearance", "belly", "lifted", "no data", "count")


@dataclass
class Bracket:
    """Certified brackets of poses (n,)."""

    gap_low: Array  # (n, 6) m
    gap_high: Array
    clearance_low: Array  # (n,) m
    clearance_high: Array
    known: Mask  # (n, 6) the tread lies over known terrain
    complete: Mask  # (n,) the brackets are closed, or narrower than NARROW


#: A bracket narrower than this decides every fault but the last digits of `pose.gap`, m, even if its search ended early.
NARROW = 1e-7
SLACK = 1e-8  # width of the oracle's brackets, m


def certify(pose: rb.Pose, truth: str = "") -> Bracket:
    """Bracket gaps and clearance of poses (n,) by `rb.verify`; by the oracle if `truth` says so."""
    if truth == "oracle" or not hasattr(rb, "verify"):
        return certify_by_oracle(pose)
    v = rb.verify(pose)
    width = np.fmax((v.gap_high - v.gap_low).max(axis=-1), v.clearance_high - v.clearance_low)
    decided = v.complete | (width < NARROW)
    return Bracket(v.gap_low, v.gap_high, v.clearance_low, v.clearance_high, v.known, decided)


def certify_by_oracle(pose: rb.Pose) -> Bracket:
    """Bracket gaps and clearance of poses (n,) by the oracle, with missing nodes bridged.

    Bridging does not change known cells. A value is NaN if a sampled point of its tread or face lies over missing data or
    off the map.
    """
    n = pose.status.size
    ground = oracle.Ground.of(filled(pose.terrain) if np.isnan(pose.terrain.z).any() else pose.terrain)
    wheels = oracle.stand(pose.rover, pose.x, pose.y, pose.yaw, pose.q, pose.steering)
    faces = oracle.box(pose.rover, pose.x, pose.y, pose.yaw, pose.q)
    gap, box = least(ground, wheels).reshape(n, 6), least(ground, faces).reshape(n, 3)
    complete = np.isfinite(gap).all(axis=1) & np.isfinite(box).all(axis=1)
    known = tread_known(pose)
    clearance = np.where(box_known(pose, faces), box.min(axis=1), np.nan)
    high = np.where(known, gap, np.nan)
    return Bracket(high - SLACK, high, clearance - SLACK, clearance, known, complete)


def least(ground: oracle.Ground, wheels: oracle.Wheels) -> Array:
    """Return the gap (m,) of treads or faces by the oracle, m; −inf where it is not bracketed."""
    m, run = len(wheels.radius), 1200
    out = np.full(m, -np.inf)
    for start in range(0, m, run):
        at = np.arange(start, min(start + run, m))
        try:
            out[at] = oracle.least_gap(ground, wheels.take(at), SLACK).gap
        except AssertionError:
            for k in at:
                try:
                    out[k] = oracle.least_gap(ground, wheels.take([k]), SLACK).gap[0]
                except AssertionError:
                    continue
    return out


def tread_known(pose: rb.Pose, grow: float = -1e-9) -> Mask:
    """Return True (n, 6) where all sampled points of a tread lie over known terrain.

    Treads are larger by `grow`, m, so that the test is decided for treads that end at the border of missing data.
    """
    n = pose.status.size
    if np.isfinite(pose.terrain.z).all() and np.isfinite(pose.gap).all():
        return np.ones((n, 6), dtype=bool)
    w = oracle.stand(pose.rover, pose.x, pose.y, pose.yaw, pose.q, pose.steering)
    w = replace(w, radius=w.radius + grow, half=np.maximum(w.half + grow, 0.0))
    phi, side = np.meshgrid(np.linspace(-np.pi, np.pi, 361), np.linspace(-1, 1, 33), indexing="ij")
    over = sampled.over(pose.terrain.height, w, np.broadcast_to(phi, (6 * n, *phi.shape)), side * w.half[:, None, None])
    return np.isfinite(over).all(axis=(1, 2)).reshape(n, 6)


def box_known(pose: rb.Pose, faces: oracle.Faces) -> Mask:
    """Return True (n,) where all sampled points of the box's lower faces lie over known terrain.

    If this holds for the faces but not for faces 1e-6 m larger, both are right: then True if `pose.clearance` is not NaN.
    """
    n = pose.status.size
    reported = np.isfinite(pose.clearance)
    if np.isfinite(pose.terrain.z).all() and reported.all():
        return reported
    u, v = np.meshgrid(np.linspace(-1, 1, 201), np.linspace(-1, 1, 201))

    def known(grow: float) -> Mask:
        a, b = faces.reach[:, None, None] + grow, faces.half[:, None, None] + grow
        return np.isfinite(sampled.over(pose.terrain.height, faces, a * u, b * v)).all(axis=(1, 2)).reshape(n, 3).all(axis=1)

    inner, outer = known(-1e-9), known(1e-6)
    return np.where(inner == outer, inner, reported)


def some(pose: rb.Pose, at: NDArray[np.int64] | Mask) -> rb.Pose:
    """Return the poses `at` of a batch (n,)."""
    report = None if pose.report is None else pose.report[at]
    fields = {name: getattr(pose, name)[at] for name in ("x", "y", "yaw", "steering", "q", "status")}
    return replace(pose, report=report, **fields)


@dataclass
class Verdict:
    """Outcome of one case: its poses with a result, and their faults."""

    given: Mask  # (n,) the pose has a result
    bad: dict[str, Array]  # by fault, its size for each pose (n,): 0 if right, m where it is a length
    unproved: int  # brackets that did not close
    worst: dict[str, float]  # by length, its largest value over all given poses, m: `errors_of`


def judge(case: Case, mode: str, counted: int = 0, truth: str = "") -> tuple[rb.Pose, Verdict]:
    """Settle a case and search its poses for every fault.

    Args:
        case: terrain, rover and positions (n,).
        mode: "contact" or "equilibrium".
        counted: number of given poses, the first ones, whose contacts are counted.
        truth: see `certify`.

    Returns:
        The poses (n,) and their verdict.
    """
    pose = case.settle(mode)
    given = np.isfinite(pose.z)
    if mode == "contact":
        given &= np.isin(pose.status, (rb.Status.CONVERGED, rb.Status.JOINT_STOP))
    n = pose.status.size
    bad = {name: np.zeros(n) for name in FAULTS}
    unproved, worst = 0, dict.fromkeys(LENGTHS, 0.0)
    at = np.flatnonzero(given)
    if at.size:
        settled = some(pose, at)
        bracket = certify(settled, truth)
        unproved = int((~bracket.complete).sum())
        errors = errors_of(settled, bracket)
        worst = {name: float(errors[name].max()) for name in LENGTHS}
        for name, values in faults_of(settled, bracket).items():
            bad[name][at] = values
        if counted:
            bad["count"][at[:counted]] = wrong_counts(some(settled, np.arange(min(counted, at.size))))
    if np.isnan(case.terrain.z).any():
        bad["no data"] = false_no_data(case, pose, mode, truth)
    return pose, Verdict(given, bad, unproved, worst)


def errors_of(pose: rb.Pose, b: Bracket) -> dict[str, Array]:
    """Return, by name in LENGTHS, a lower bound of each pose's error (n,), m.

    It is 0 if a bracket contains 0 error, and inf if exactly one of value and bracket is NaN. deep: depth of the deepest tread
    below the terrain. far: largest gap of a wheel in contact. gap, clearance: distance of `pose.gap` and
    `pose.clearance` from their brackets.
    """
    return {
        "deep": np.fmax(np.where(np.isfinite(b.gap_high), -b.gap_high, 0.0), 0.0).max(axis=1),
        "far": np.where(pose.wheel_lifted, 0.0, np.fmax(b.gap_low, 0.0)).max(axis=1),
        "gap": outside(pose.gap, b.gap_low, b.gap_high).max(axis=1),
        "clearance": outside(pose.clearance, b.clearance_low, b.clearance_high),
    }


def faults_of(pose: rb.Pose, b: Bracket) -> dict[str, Array]:
    """Return, by fault, its size for each given pose (n,), m; 0 where the pose is right.

    A value is wrong only if its whole bracket lies beyond the tolerance.
    """
    errors, lifted = errors_of(pose, b), pose.wheel_lifted
    limits = {"deep": TOLERANCE, "far": TOLERANCE, "gap": AGREES, "clearance": AGREES}
    out = {name: beyond(value, limits[name]) for name, value in errors.items()}
    # A tread over missing data has no gap: such a pose must not have a result.
    out["gap"] = np.where(b.known.all(axis=1), out["gap"], np.inf)
    if pose.report is not None:
        on_belly = pose.status == rb.Status.BELLY_CONTACT
        out["belly"] = beyond(-b.clearance_high, TOLERANCE) + np.where(on_belly, beyond(b.clearance_low, TOLERANCE), 0.0)
        out["lifted"] = np.where(lifted, beyond(0.9 * TOLERANCE - b.gap_high, 0.0), 0.0).max(axis=1)
    return out


def beyond(value: Array, limit: float) -> Array:
    """Return `value` where it exceeds the limit, else 0; NaN counts as 0."""
    return np.where(value > limit, value, 0.0)


def outside(value: Array, low: Array, high: Array) -> Array:
    """Return the distance of `value` from [low, high]; 0 if both are NaN, inf if only one is."""
    with np.errstate(invalid="ignore"):
        off = np.fmax(np.fmax(low - value, value - high), 0.0)
    off = np.where(np.isnan(value) & np.isnan(high), 0.0, off)
    return np.where(np.isnan(value) != np.isnan(high), np.inf, off)


def wrong_counts(pose: rb.Pose) -> Array:
    """Return the largest error (n,) of a contact count per pose, without ambiguous wheels.

    `sampled.contact_count` states the rule. If `pose.contact_count` is higher, denser sampling has to confirm it.
    """
    reported, seen = pose.contact_count, sampled.contact_count(pose)
    again = np.flatnonzero(((seen >= 0) & (reported > seen)).any(axis=1))
    if again.size:
        seen[again] = sampled.contact_count(some(pose, again), per_cell=3 * sampled.PER_CELL)
    return np.where(seen >= 0, abs(reported - seen), 0).max(axis=1).astype(float)


def filled(terrain: rb.Terrain) -> rb.Terrain:
    """Return the terrain with missing nodes bridged as the spline does.

    Known cells do not change.
    """
    z = _bridged(terrain.z, np.isfinite(terrain.z))
    return rb.Terrain.from_array(z, terrain.spacing, terrain.origin, terrain.interpolation, name=terrain.name)


def false_no_data(case: Case, pose: rb.Pose, mode: str, truth: str = "") -> Array:
    """Return 1 where a pose (n,) is NO_DATA although the filled map's pose is valid, else 0.

    It is valid if all six treads, in equilibrium also the body's box, lie over known terrain, and the gaps are 0 here.
    """
    out = np.zeros(pose.status.size)
    lost = np.flatnonzero(pose.status == rb.Status.NO_DATA)
    if not lost.size:
        return out
    whole = some(case.settle(mode, filled(case.terrain)), lost)
    good = np.isfinite(whole.z) & np.isin(whole.status, (rb.Status.CONVERGED, rb.Status.JOINT_STOP))
    if not good.any():
        return out
    lost, there = lost[good], replace(some(whole, good), terrain=case.terrain)
    b = certify(there, truth)
    known = b.known & (b.gap_high <= TOLERANCE) & (b.gap_high >= -TOLERANCE)
    fine = known.all(axis=1) & tread_known(there, 1e-6).all(axis=1)
    if mode == "equilibrium":
        fine &= np.isfinite(b.clearance_high)
    out[lost[fine]] = 1.0
    return out
