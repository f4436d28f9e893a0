"""Numbers of a rover, read from a tree whose roles are found.

They are in the rover's frame, in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval

from ...arrays import Array
from ...errors import RoverError
from ..differential import check_ratio
from ..model import IDEAL_DIFFERENTIAL
from .import_body import body_box
from .import_parts import Parts
from .import_roles import Hinge, Roles
from .import_ties import compose, tie
from .import_treads import Tread, find_tread
from .tree import Tree

#: Wheel radius over wheelbase where a file gives neither: the presets' lie between 0.111 and 0.136.
RADIUS_SHARE = 0.12


class Numbers(Parts):
    """Reader of the rover's numbers; adds lines to the report in `roles`."""

    def __init__(self, tree: Tree, what: str, roles: Roles, scale: float) -> None:
        super().__init__(tree, what, roles, scale)
        self.angles = tree.rest_angles()
        roles.repaired.extend(tree.notes)
        report = [f"wheels {', '.join(w.joint.name for w in roles.wheels)}"]
        report.append(f"bogies {', '.join(b.joint.name for b in roles.bogies)}")
        if any(roles.rockers):
            report.append(f"rockers {', '.join(r.joint.name for r in roles.rockers if r)}")
        steering = [s.joint.name for s in roles.steers if s]
        report.append(f"steering {', '.join(steering) if steering else 'none'}")
        roles.found[:0] = report
        self.tread = [find_tread(tree, self.T, [k for k, g in roles.groups.items() if g == w.child], w) for w in roles.wheels]

    def points(self, hinges: Sequence[Hinge]) -> Array:
        """Return the points of hinges (n, 3), m.

        Args:
            hinges: n hinges.

        Returns:
            (n, 3) in the rover's frame, m.
        """
        return np.array([self.at(h.point) for h in hinges])

    def hubs(self) -> Array:
        """Return wheel centres (6, 3), m.

        They lie on the axle, beside the tread's middle if the file has a tread.

        Returns:
            (6, 3) in the rover's frame, m.
        """
        hubs = self.points(self.roles.wheels)
        for i, tread in enumerate(self.tread):
            if tread is not None:
                hubs[i, 1] = self.at(tread.centre)[1]
        return hubs

    def rocker_pivot(self, given: Any) -> Array:
        """Return the rockers' pivots (2, 3), m; zeros if they are given by the caller.

        Args:
            given: the caller's pivots, or None.

        Returns:
            (2, 3) m.

        Raises:
            RoverError: no joint marks them and none are given.
        """
        rockers = [r for r in self.roles.rockers if r is not None]
        if not rockers:
            if given is None:
                raise RoverError(
                    f"{self.what}: its rockers are one piece with the body and no joint marks where they turn: "
                    "give rocker_pivot=(x, y, z) of the left one (--set linkage.rocker_pivot_m=[x,y,z])"
                )
            self.roles.repaired.append("the rockers are one piece with the body: separated at the pivot given")
            return np.zeros((2, 3))  # overridden
        pivots = self.points(rockers)
        arms = [a for a in self.roles.arms if a is not None]
        if arms:
            astray = float(np.abs((self.points(arms) - pivots)[:, [0, 2]]).max())
            line = "each rocker comes in two arms with a joint of its own; joined into one"
            self.roles.repaired.append(line + (f" at the bogie's arm, {astray:.3g} m from the wheel's" if astray > 1e-6 else ""))
        return pivots

    def steering_offset(self, hubs: Array) -> Array:
        """Return steering axis minus hub (6, 2), m, where the axis passes the hub's height.

        Args:
            hubs: (6, 3), m.

        Returns:
            (6, 2) m.

        Raises:
            RoverError: a steering axis that is not upright.
        """
        offset = np.zeros((6, 2))
        for i, steer in enumerate(self.roles.steers):
            if steer is None:
                continue
            point, axis = self.at(steer.point), self.turn @ steer.axis
            if abs(axis[2]) < 0.5:
                raise RoverError(
                    f"{self.what}: steering joint {steer.joint.name!r} is not upright; "
                    "leave it out of joints={'steering': [...]}"
                )
            offset[i] = (point + axis * (hubs[i, 2] - point[2]) / axis[2] - hubs[i])[:2]
            if (tilt := np.degrees(np.arccos(min(1.0, abs(axis[2]))))) > 1e-4:
                self.roles.repaired.append(f"steering axis {steer.joint.name!r} is {tilt:.2g} deg off upright; set upright")
        return offset

    def treads(self, hubs: Array, override: dict[str, Any]) -> tuple[Array, Array]:
        """Return radius and width (6,) of the wheels, m, from their shapes, or guessed.

        Args:
            hubs: (6, 3), m.
            override: the caller's numbers; what they give is not guessed.

        Returns:
            Radius (6,) and width (6,), m.
        """
        radius, width = np.zeros(6), np.zeros(6)
        report = self.roles.guessed
        missing = [w.child for w, t in zip(self.roles.wheels, self.tread, strict=True) if t is None]
        for i, tread in enumerate(self.tread):
            if tread is not None:
                radius[i], width[i] = tread.radius * self.scale, tread.width * self.scale
        known = [t for t in self.tread if t is not None]
        if known and "wheel_radius" not in override:
            self._report_treads(known)
        if not missing:
            return radius, width
        if known:
            radius[radius == 0] = np.mean([t.radius for t in known]) * self.scale
            width[[t is None for t in self.tread]] = np.mean([t.width for t in known]) * self.scale
            report.append(f"wheels {', '.join(missing)} have no size; taken as the mean of the others")
        elif "wheel_radius" not in override:
            height, length = float(np.median(hubs[:, 2])), float(np.ptp(hubs[:, 0]))
            if height > 0 and np.ptp(hubs[:, 2]) <= 0.4 * height and 2 * height <= length:
                radius[:], why = height, "the hubs' height over the file's origin"
            else:
                radius[:], why = RADIUS_SHARE * length, f"{RADIUS_SHARE:g} of its wheelbase, the rule of thumb"
            report.append(
                f"wheel_radius {radius[0]:.6g} m: {why}; no shape in the file gives their size: give wheel_radius= in metres"
            )
        if not known and "wheel_width" not in override:
            report.append("wheel_width 0 (thin discs), as the wheels have no size")
        return radius, width

    def _report_treads(self, known: list[Tread]) -> None:
        """Add the report's lines on the shapes that the wheels' sizes come from."""
        shapes = sorted({f"{'colliding' if t.collides else 'visible'} {t.shape}" for t in known})
        self.roles.found.append(f"wheel sizes from {' and '.join(shapes)} shapes")
        if any(t.across for t in known):
            self.roles.warnings.append(
                'wheel cylinders lie across their axles (a common slip: a cylinder\'s axis is z; rpy="1.5708 0 0" is missing): '
                "their radius and length are taken as if they lay along"
            )
        for small, large in sorted({(t.other * self.scale, t.radius * self.scale) for t in known if t.other}):
            self.roles.warnings.append(
                f"wheels collide with a radius of {small:.4g} m and are seen with {large:.4g} m: the larger is taken as the tread"
            )

    def differential(self) -> Array:
        """Return the differential's polynomial.

        It is that of the joints' `mimic` or equality, or the ideal one if nothing ties them.

        Returns:
            (n,) coefficients, lowest power first.
        """
        rockers = self.roles.rockers
        if rockers[0] is None or rockers[1] is None:
            return np.array(IDEAL_DIFFERENTIAL)
        names = [rocker.joint.name for rocker in rockers if rocker]
        signs = [self.sign(rocker) for rocker in rockers if rocker]
        (left, p), (right, q) = (tie(self.tree, name, self.angles, self.what) for name in names)
        if self.tree.differential is not None:
            if left != right or len(p) > 2 or len(self.tree.differential) < 2:
                raise RoverError(
                    f"{self.what}: its differential is a polynomial by which {names[1]!r} does not mimic {names[0]!r}"
                )
            p, q = np.array([0.0, 1.0]), np.asarray(self.tree.differential)
        if left == right:
            polynomial = compose(p, q, self.what)
            polynomial = polynomial * signs[1] * np.array(signs[0]) ** np.arange(len(polynomial))
            if polynomial[1] < 0:
                check_ratio(float(polynomial[1]), self.what)
                if len(polynomial) > 2:
                    self.roles.found.append(f"differential: a polynomial, right = {polynomial[1]:g} left + ...")
                else:
                    self.roles.found.append(f"differential: right = {polynomial[1]:g} left")
                return polynomial
            self.roles.repaired.append(
                f"the rockers were tied to turn alike (ratio {polynomial[1]:g}); closed with the ideal differential, -1"
            )
        elif not self.roles.freed:
            self.roles.repaired.append("nothing ties the two rockers: closed with the ideal differential, right = -left")
        return np.array(IDEAL_DIFFERENTIAL)

    def sign(self, hinge: Hinge) -> float:
        """Return 1 if the hinge's positive sense is the rover's (nose down), else -1.

        Args:
            hinge: a hinge along the axles.

        Returns:
            1 or -1.
        """
        return 1.0 if hinge.axis @ self.roles.axes[:, 1] > 0 else -1.0

    def own_limits(self, hinge: Hinge) -> tuple[float, float] | None:
        """Return a hinge's limits from its rest, nose down positive, rad.

        They are infinite beyond a half turn.

        Args:
            hinge: a hinge along the axles.

        Returns:
            (low, high), or None if it has no limits.
        """
        if hinge.joint.limits is None:
            return None
        a, b = sorted((v - self.angles[hinge.joint.name]) * self.sign(hinge) for v in hinge.joint.limits)
        if a <= -np.pi and b >= np.pi:
            return None
        if not a <= 0 <= b or a == b:
            name = hinge.joint.name
            self.roles.repaired.append(f"the limits of {name!r} ({a:.4g}, {b:.4g} rad) leave out its rest; left out")
            return None
        return (a if a > -np.pi else -np.inf), (b if b < np.pi else np.inf)

    def limits(self, hinges: Sequence[Hinge | None], label: str) -> Array:
        """Return the narrowest limits (2,) of some hinges, nose down positive, rad.

        Args:
            hinges: the hinges; None is skipped.
            label: their name in the report.

        Returns:
            (2,) rad.
        """
        limits = [self.own_limits(hinge) for hinge in hinges if hinge is not None]
        known = [pair for pair in limits if pair is not None]
        low, high = max((a for a, _ in known), default=-np.inf), min((b for _, b in known), default=np.inf)
        both = [pair or (-np.inf, np.inf) for pair in limits]
        if any(not np.allclose(pair, both[0], rtol=0, atol=1e-6) for pair in both[1:]):
            sides = ", ".join(f"({a:.4g}, {b:.4g})" for a, b in both)
            self.roles.warnings.append(f"limits of the {label} differ: {sides} rad; their common range is used")
        if not low < high:
            self.roles.repaired.append(f"the limits given for the {label} leave no room between them; left out")
            return np.array([-np.inf, np.inf])
        if np.isinf(low) and np.isinf(high):
            self.roles.found.append(f"no limits for the {label}")
        return np.array([low, high])

    def rocker_limits(self, differential: Array) -> Array:
        """Return limits (2,) of the left rocker, rad.

        They are its own, and the right one's through the differential's slope at rest.

        Args:
            differential: coefficients of the right rocker's angle in the left one's.

        Returns:
            (2,) rad.
        """
        rockers = self.roles.rockers
        own = self.limits([rockers[0], self.roles.arms[0]], "left rocker")
        other = self.limits([rockers[1], self.roles.arms[1]], "right rocker")
        across = np.sort(polyval(own, differential)) if np.isfinite(own).all() else np.sort(own * differential[1])
        if np.allclose(other, across, rtol=0, atol=1e-9):
            return own
        theirs = np.sort(other / differential[1])
        both = np.array([max(own[0], theirs[0]), min(own[1], theirs[1])])
        if not both[0] < both[1]:
            pairs = [f"({a:.4g}, {b:.4g})" for a, b in (own, other)]
            text = f"left {pairs[0]}, right {pairs[1]} rad"
            self.roles.warnings.append(f"limits of the rockers leave no room: {text}; the left one's are used")
            return own
        if np.isfinite(own).any() and np.isfinite(other).any():
            pairs = [f"({a:.4g}, {b:.4g})" for a, b in (own, other)]
            self.roles.warnings.append(f"limits of the rockers differ: left {pairs[0]}, right {pairs[1]} rad; both are kept to")
        return both

    def body_box(self, hubs: Array) -> Array | None:
        """Return the box (2, 3) about the body's own shapes, m; None if it has none of a known size.

        Args:
            hubs: (6, 3) m.

        Returns:
            (2, 3) lowest and highest corner, or None.
        """
        links = [k for k, part in self.part_of.items() if part == "body" and self.roles.groups[k] not in self.frozen]
        return body_box(self.tree, self.roles, links, self.T, self.scale, hubs)

    def wheel_names(self) -> list[str] | None:
        """Return the wheels' names from links called wheel_NAME, or None.

        Returns:
            Six names, or None.
        """
        names = [w.child.removeprefix("wheel_") for w in self.roles.wheels]
        short = all(w.child.startswith("wheel_") and n and len(n) <= 12 for w, n in zip(self.roles.wheels, names, strict=True))
        return names if short and len(set(names)) == 6 else None

    def dropped(self) -> list[str]:
        """Return the report's lines on properties of the file that a rover does not have.

        Returns:
            Lines of text.
        """
        lines = [f"{kind}: {_names(names)}" for kind, names in self.tree.dropped.items()]
        roles = self.roles
        limited = [h.joint.name for h in (*roles.steers, *roles.wheels) if h is not None and self._bounded(h)]
        if limited:
            lines.append(f"limits of wheels and steering: {_names(limited)}")
        up = roles.axes[:, 2]
        pitching = [h for h in (*roles.rockers, *roles.arms, *roles.bogies, *roles.wheels) if h is not None]
        steering = [h for h in roles.steers if h is not None]
        turned = [h for h in pitching if self.sign(h) < 0] + [h for h in steering if h.axis @ up < 0]
        if turned:
            names = _names([h.joint.name for h in turned])
            lines.append(f"senses of joints that count the other way in the file (change the signs of its logs): {names}")
        angles = {h.joint.name: self.angles[h.joint.name] for h in (*pitching, *steering)}
        if offset := [f"{name} {angle:.4g} rad" for name, angle in angles.items() if angle]:
            lines.append(f"zero angles of joints that are not the rover's rest: {', '.join(offset)}")
        rockers = {h.joint.name for h in (*roles.rockers, *roles.arms) if h is not None}
        if tied := [name for name, joint in self.tree.joints.items() if joint.mimic is not None and name not in rockers]:
            lines.append(f"mimic of joints other than the rockers: {_names(tied)}")
        return lines

    def _bounded(self, hinge: Hinge) -> bool:
        """Return True if a hinge has a limit within a half turn."""
        limits = hinge.joint.limits
        return limits is not None and not hinge.joint.locked and bool(np.abs(limits).min() < np.pi)


def _names(names: Sequence[str]) -> str:
    """Return up to six names as text, and the number of all if there are more."""
    return ", ".join(names[:6]) + (f", ... ({len(names)} in all)" if len(names) > 6 else "")
