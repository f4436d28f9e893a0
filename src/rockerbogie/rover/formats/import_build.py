"""From a tree and its roles to a `Rover`: the numbers, what was guessed for want of them, and what was mended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RoverError
from ..checks import possible_inertia
from ..differential import check_ratio
from ..model import IDEAL_DIFFERENTIAL, Link, Rover
from .import_roles import Hinge, Roles, find_roles
from .limits import check_size, check_wheelbase
from .tree import DISC, Shape, Tree

Array = NDArray[np.float64]

#: Wheel radius over wheelbase where a file says neither: the presets' lie between 0.111 and 0.136.
RADIUS_SHARE = 0.12


@dataclass(frozen=True)
class ImportResult:
    """A rover read from a robot file, and what became of the file on the way."""

    rover: Rover
    found: tuple[str, ...]  # read from the file
    guessed: tuple[str, ...]  # not in the file: look at each, and overrule what is wrong
    repaired: tuple[str, ...]  # in the file, and not as a rover has it

    def __str__(self) -> str:
        lines = [f"rover {self.rover.name!r}"]
        for label in ("found", "guessed", "repaired"):
            lines += [f"  {label}: {line}" for line in getattr(self, label)]
        return "\n".join(lines)

    @property
    def mended(self) -> tuple[str, ...]:
        """Return `repaired`, by its old name."""
        return self.repaired


#: Old name of `ImportResult`.
Import = ImportResult


def build_rover(
    tree: Tree,
    what: str,
    *,
    scale: float = 1.0,
    forward: str | None = None,
    up: str | None = None,
    joints: dict[str, Sequence[str]] | None = None,
    **overrule: Any,
) -> ImportResult:
    """A rover from a tree; see `import_rover` for the arguments."""
    roles = find_roles(tree, what, joints or {}, forward, up)
    reader = _Reader(tree, what, roles, scale)
    hubs = reader.hubs()
    check_wheelbase(float(np.ptp(hubs[:, 0])), what)
    given: dict[str, Any] = {"name": tree.name, "source": f"imported from {what}"}
    given |= {"hubs": hubs, "bogie_pivot": reader.points(roles.bogies)}
    given["rocker_pivot"] = reader.rocker_pivot(overrule.get("rocker_pivot"))
    given["steers"] = [steer is not None for steer in roles.steers]
    given["steering_offset"] = reader.steering_offset(hubs)
    given["wheel_radius"], given["wheel_width"] = reader.treads(hubs, overrule)
    given["differential"] = reader.differential()
    given["rocker_limits"] = reader.rocker_limits(given["differential"])
    given["bogie_limits"] = reader.limits(roles.bogies, "bogies")
    given["body_box"] = reader.body_box()
    given["wheel_names"] = reader.wheel_names()
    shape = {
        key: value for key, value in (given | overrule).items() if key not in ("mass", "body", "rockers", "bogies", "wheels")
    }
    links = reader.links(shape, overrule.get("mass"))
    rover = Rover.from_pivots(
        **shape, **links, **{k: overrule[k] for k in ("body", "rockers", "bogies", "wheels") if k in overrule}
    )
    check_size(rover, what)
    if overrule:
        roles.found.append(f"overruled by you: {', '.join(overrule)}")
    return ImportResult(rover, tuple(roles.found), tuple(roles.guessed), tuple(roles.repaired))


class _Reader:
    """Takes the numbers off a tree whose roles are known, turned into the rover's frame and scaled to metres."""

    def __init__(self, tree: Tree, what: str, roles: Roles, scale: float) -> None:
        self.tree, self.what, self.roles, self.scale = tree, what, roles, scale
        self.turn = roles.axes.T
        self.T = tree.rest()
        if tree.notes:
            roles.repaired.extend(tree.notes)
        names = [w.joint.name for w in roles.wheels]
        roles.found.append(f"wheels {', '.join(names)}")
        roles.found.append(f"bogies {', '.join(b.joint.name for b in roles.bogies)}")
        if any(roles.rockers):
            roles.found.append(f"rockers {', '.join(r.joint.name for r in roles.rockers if r)}")
        steering = [s.joint.name for s in roles.steers if s]
        roles.found.append(f"steering {', '.join(steering) if steering else 'none'}")
        self.part_of = self._assign()

    def at(self, point: Array) -> Array:
        """A point (3,) of the file's root frame in the rover's, m."""
        return self.turn @ point * self.scale

    def points(self, hinges: Sequence[Hinge]) -> Array:
        """Where hinges stand (n, 3), m."""
        return np.array([self.at(h.point) for h in hinges])

    def hubs(self) -> Array:
        """Wheel centres (6, 3): on the axle, abreast of the tread's middle where the file shows a tread."""
        hubs = self.points(self.roles.wheels)
        for i, wheel in enumerate(self.roles.wheels):
            tread = self._tread(wheel)
            if tread is not None:
                hubs[i, 1] = self.at((self.T[wheel.child] @ tread.T)[:3, 3])[1]
        return hubs

    def rocker_pivot(self, given: Any) -> Array:
        """Pivots (2, 3) of the rockers."""
        rockers = [r for r in self.roles.rockers if r is not None]
        if not rockers:
            if given is None:
                raise RoverError(
                    f"{self.what}: its rockers are one piece with the body and no joint marks where they turn: "
                    "give rocker_pivot=(x, y, z) of the left one (--set linkage.rocker_pivot_m=[x,y,z])"
                )
            self.roles.repaired.append("the rockers are one piece with the body: cut loose at the pivot given")
            return np.zeros((2, 3))  # overruled
        pivots = self.points(rockers)
        arms = [a for a in self.roles.arms if a is not None]
        if arms:
            astray = float(np.abs((self.points(arms) - pivots)[:, [0, 2]]).max())
            line = "each rocker comes in two arms with a joint of its own; joined into one"
            self.roles.repaired.append(line + (f" at the bogie's arm, {astray:.3g} m from the wheel's" if astray > 1e-6 else ""))
        return pivots

    def steering_offset(self, hubs: Array) -> Array:
        """Steering axis minus hub (6, 2), taken where the axis passes the hub's height."""
        offset = np.zeros((6, 2))
        for i, steer in enumerate(self.roles.steers):
            if steer is None:
                continue
            point, axis = self.at(steer.point), self.turn @ steer.axis
            if abs(axis[2]) < 0.5:
                raise RoverError(
                    f"{self.what}: steering joint {steer.joint.name!r} does not stand upright; "
                    "leave it out of joints={'steering': [...]}"
                )
            offset[i] = (point + axis * (hubs[i, 2] - point[2]) / axis[2] - hubs[i])[:2]
            if (lean := np.degrees(np.arccos(min(1.0, abs(axis[2]))))) > 1e-4:
                self.roles.repaired.append(f"steering axis {steer.joint.name!r} leans {lean:.2g} deg; stood upright")
        return offset

    def treads(self, hubs: Array, overrule: dict[str, Any]) -> tuple[Array, Array]:
        """Radius and width (6,) of the wheels, from cylinders, spheres or ellipsoids along their axles, or guessed."""
        shapes = [self._tread(w) for w in self.roles.wheels]
        radius, width = np.zeros(6), np.zeros(6)
        missing = [w.child for w, s in zip(self.roles.wheels, shapes, strict=True) if s is None]
        for i, shape in enumerate(shapes):
            if shape is not None:
                radius[i] = shape.size[0] * self.scale
                width[i] = shape.size[1] * self.scale if shape.kind == "cylinder" and DISC not in shape.name.split("_") else 0.0
        if not missing:
            return radius, width
        if len(missing) < 6:
            known = [i for i, shape in enumerate(shapes) if shape is not None]
            radius[radius == 0], width[width == 0] = radius[known].mean(), width[known].mean()
            self.roles.guessed.append(f"wheels {', '.join(missing)} have no size; taken as the mean of the others")
        elif "wheel_radius" not in overrule:
            height, length = float(np.median(hubs[:, 2])), float(np.ptp(hubs[:, 0]))
            if height > 0 and np.ptp(hubs[:, 2]) <= 0.4 * height and 2 * height <= length:
                radius[:], why = height, "the hubs' height over the file's origin"
            else:
                radius[:], why = RADIUS_SHARE * length, f"{RADIUS_SHARE:g} of its wheelbase, the rule of thumb"
            self.roles.guessed.append(
                f"wheel_radius {radius[0]:.6g} m: {why}; the wheels have no size in the file (meshes are not read): "
                "give wheel_radius= in metres"
            )
        if len(missing) == 6 and "wheel_width" not in overrule:
            self.roles.guessed.append("wheel_width 0 (thin discs), as the wheels have no size")
        return radius, width

    def _tread(self, wheel: Hinge) -> Shape | None:
        """The largest round shape about the wheel's axle: what collides before what is only seen."""
        best: Shape | None = None
        for link in (name for name, group in self.roles.groups.items() if group == wheel.child):
            for shape in self.tree.parts[link].shapes:
                if shape.kind not in ("cylinder", "sphere", "ellipsoid") or shape.size[0] <= 0:
                    continue
                along = shape.kind != "cylinder" or abs((self.T[link] @ shape.T)[:3, 2] @ wheel.axis) > 0.9
                rank = (shape.collides, shape.size[0])
                if along and (best is None or rank > (best.collides, best.size[0])):
                    placed = np.linalg.inv(self.T[wheel.child]) @ self.T[link] @ shape.T
                    best = Shape(shape.kind, shape.size, placed, shape.name, shape.collides)
        return best

    def differential(self) -> Array:
        """The polynomial, or the ratio of the joints' `mimic`, or the ideal one where nothing ties them."""
        rockers = self.roles.rockers
        if rockers[0] is None or rockers[1] is None:
            return np.array(IDEAL_DIFFERENTIAL)
        names = [rocker.joint.name for rocker in rockers if rocker]
        signs = [self._sign(rocker) for rocker in rockers if rocker]
        ties = [self._tie(name) for name in names]
        if self.tree.differential is not None:
            polynomial = self.tree.differential * signs[1] * np.array(signs[0]) ** np.arange(len(self.tree.differential))
            if ties[1][0] != names[0] or len(polynomial) < 2:
                raise RoverError(
                    f"{self.what}: its differential is a polynomial by which {names[1]!r} does not follow {names[0]!r}"
                )
            check_ratio(float(polynomial[1]), self.what)
            return polynomial
        if ties[0][0] == ties[1][0] and abs(ties[0][1]) > 1e-6:
            ratio = ties[1][1] * signs[1] / (ties[0][1] * signs[0])
            if ratio < 0:
                check_ratio(ratio, self.what)
                self.roles.found.append(f"differential: right = {ratio:g} left")
                return np.array([0.0, ratio])
            self.roles.repaired.append(
                f"the rockers were tied to turn alike (ratio {ratio:g}); closed with the ideal differential, -1"
            )
        elif not self.roles.freed:
            self.roles.repaired.append("nothing ties the two rockers: closed with the ideal differential, right = -left")
        return np.array(IDEAL_DIFFERENTIAL)

    def _tie(self, name: str) -> tuple[str, float]:
        """The joint that this one follows in the end, and by what factor; itself by 1 where it follows none."""
        factor, seen = 1.0, {name}
        while (mimic := self.tree.joints[name].mimic) is not None:
            name, factor = mimic[0], factor * mimic[1]
            if name not in self.tree.joints or name in seen:
                raise RoverError(
                    f"{self.what}: a joint mimics {name!r}, which is {'itself' if name in seen else 'not in the file'}"
                )
            seen.add(name)
        return name, factor

    def _sign(self, hinge: Hinge) -> float:
        return 1.0 if hinge.axis @ self.roles.axes[:, 1] > 0 else -1.0

    def limits(self, hinges: Sequence[Hinge | None], label: str) -> Array:
        """The narrowest stops (2,) of some hinges, nose down positive, rad."""
        low, high = -np.inf, np.inf
        for hinge in hinges:
            if hinge is None or hinge.joint.limits is None:
                continue
            a, b = (v * self._sign(hinge) for v in hinge.joint.limits)
            if abs(a) >= np.pi and abs(b) >= np.pi:
                continue  # beyond a half turn: no stop
            a, b = sorted((a, b))
            if not a <= 0 <= b or a == b:
                self.roles.repaired.append(f"the stops of {hinge.joint.name!r} ({a:g}, {b:g} rad) leave out its rest; left out")
                continue
            low, high = max(low, a if a > -np.pi else -np.inf), min(high, b if b < np.pi else np.inf)
        if not low < high:
            self.roles.repaired.append(f"the stops given for the {label} leave no room between them; left out")
            return np.array([-np.inf, np.inf])
        if np.isinf(low) and np.isinf(high):
            self.roles.found.append(f"no stops for the {label}")
        return np.array([low, high])

    def rocker_limits(self, differential: Array) -> Array:
        """Stops (2,) of the left rocker: its own, and the right one's through the differential's slope at rest."""
        rockers = self.roles.rockers
        own = self.limits([rockers[0], self.roles.arms[0]], "left rocker")
        other = self.limits([rockers[1], self.roles.arms[1]], "right rocker")
        across = np.sort(np.polynomial.polynomial.polyval(own, differential)) if np.isfinite(own).all() else own
        if np.allclose(other, across, rtol=0, atol=1e-9):
            return own
        theirs = np.sort(other / differential[1])
        return np.array([max(own[0], theirs[0]), min(own[1], theirs[1])])

    def body_box(self) -> Array | None:
        """The box (2, 3) about the body's own colliding boxes; None where it has none."""
        corners = []
        for link, part in self.part_of.items():
            if part != "body" or self.roles.groups[link] in self.frozen:
                continue
            for shape in self.tree.parts[link].shapes:
                if shape.kind == "box" and shape.collides and min(shape.size) > 0:
                    T = self.T[link] @ shape.T
                    half = np.abs(self.turn @ T[:3, :3]) @ np.array(shape.size) / 2 * self.scale
                    middle = self.at(T[:3, 3])
                    corners += [middle - half, middle + half]
        if not corners:
            self.roles.guessed.append("body_box: the body has no colliding box; one is put between the wheels")
            return None
        return np.array([np.min(corners, axis=0), np.max(corners, axis=0)])

    def wheel_names(self) -> list[str] | None:
        """Names from links called wheel_NAME, as we write them; else none, and they are named by where they stand."""
        names = [w.child.removeprefix("wheel_") for w in self.roles.wheels]
        short = all(w.child.startswith("wheel_") and n and len(n) <= 12 for w, n in zip(self.roles.wheels, names, strict=True))
        return names if short and len(set(names)) == 6 else None

    def _assign(self) -> dict[str, str]:
        """Which part of the rover each link belongs to; what has no role of its own goes with what carries it."""
        roles, owner = self.roles, {}
        for s, side in enumerate(("left", "right")):
            for hinge in (roles.rockers[s], roles.arms[s]):
                if hinge is not None:
                    owner[hinge.child] = f"rocker_{side}"
            owner[roles.bogies[s].child] = f"bogie_{side}"
        for i, wheel in enumerate(roles.wheels):
            owner[wheel.child] = f"wheel_{i + 1}"
            knuckle = roles.steers[i]
            if knuckle is not None and self._rides_with(knuckle.child, wheel.child):
                owner[knuckle.child] = f"wheel_{i + 1}"
        part_of = {}
        extra: list[str] = []
        knuckles = {k.child for k in roles.steers if k is not None}
        for link in self.tree.order:
            group = roles.groups[link]
            carried = group
            while carried not in owner and carried in roles.parents:
                carried = roles.parents[carried]
            part_of[link] = owner.get(carried, "body")
            if group not in owner and group not in knuckles and group in roles.parents:
                extra.append(link)
        self.frozen = {roles.groups[link] for link in extra}
        if extra:
            roles.found.append(f"held at rest, with what carries them: {', '.join(extra[:6])}{', ...' * (len(extra) > 6)}")
        return part_of

    def _rides_with(self, knuckle: str, wheel: str) -> bool:
        """True for a knuckle whose mass is centred on its wheel's, as we write them: the two are one part again."""
        own, other = self._sum([knuckle]), self._sum([wheel])
        return own.mass > 0 and other.mass > 0 and bool(np.abs(own.com - other.com).max() < 1e-9)

    def _sum(self, groups: Sequence[str]) -> Link:
        return self._gather([link for link, group in self.roles.groups.items() if group in groups])

    def _gather(self, links: Sequence[str]) -> Link:
        """Several links of the tree as one rigid part at rest, in the rover's frame."""
        parts = [self.tree.parts[link] for link in links]
        mass = sum(p.mass for p in parts)
        if mass == 0:
            return Link(0.0, np.zeros(3), np.zeros((3, 3)))
        placed = [
            (p.mass, self.at((self.T[p.name] @ [*p.com, 1.0])[:3]), self.turn @ self.T[p.name][:3, :3], p.inertia)
            for p in parts
            if p.mass
        ]
        com = placed[0][1] if len(placed) == 1 else sum((m * c for m, c, _, _ in placed), np.zeros(3)) / mass
        inertia = np.zeros((3, 3))
        for m, c, R, own in placed:
            d = c - com
            inertia += R @ own @ R.T * self.scale**2 + m * (np.eye(3) * (d @ d) - np.outer(d, d))
        return Link(float(mass), com, inertia)

    def links(self, shape: dict[str, Any], mass: float | None) -> dict[str, Any]:
        """The rover's own links, or its mass alone where the file has no masses."""
        names = ("body", "rocker_left", "rocker_right", "bogie_left", "bogie_right", *(f"wheel_{i + 1}" for i in range(6)))
        parts = [self._gather([link for link, part in self.part_of.items() if part == name]) for name in names]
        total = sum(p.mass for p in parts)
        if total == 0:
            if mass is None:
                self.roles.guessed.append("mass: the file has none; the rule of thumb for its wheelbase is taken")
            else:
                self.roles.repaired.append("the file has no masses: yours is shared by rule of thumb")
            return {} if mass is None else {"mass": mass}
        if mass is not None:
            parts = [Link(p.mass * mass / total, p.com, p.inertia * mass / total) for p in parts]
        typical = Rover.from_pivots(**shape, mass=total if mass is None else mass).links
        weightless, impossible = [], []
        for k, (name, part) in enumerate(zip(names, parts, strict=True)):
            if part.mass == 0:
                weightless.append(name)
                parts[k] = Link(0.0, typical[k].com, np.zeros((3, 3)))
            elif not possible_inertia(part.inertia):
                impossible.append(name)
                parts[k] = Link(part.mass, part.com, typical[k].inertia * (part.mass / typical[k].mass))
        if weightless:
            self.roles.repaired.append(f"no mass in the file, left so: {', '.join(weightless)}")
        if impossible:
            self.roles.repaired.append(
                f"an inertia no body can have, taken from its shape in place of it: {', '.join(impossible)}"
            )
        return {"body": parts[0], "rockers": parts[1:3], "bogies": parts[3:5], "wheels": parts[5:]}
