"""Search for the rocker-bogie in a tree of links and joints.

It uses which link carries which and the directions of hinges, not names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from ...arrays import Array
from ...errors import RoverError, unknown_name
from .import_roles import PARALLEL, ROLES, Hinge, Roles, mean_direction, rover_axes, snap
from .import_treads import find_tread
from .tree import Joint, Tree

#: A hinge on a wheel's arm this far from the axles' direction can steer (cosine of 60 degrees).
ACROSS = 0.5
#: Left and right must mirror each other this well in the side view, as a share of the rover's length.
MIRROR = 0.08
#: Six wheels are likely if their hubs lie this close to a line in the side view (share of the length), and if their radii differ
#: by no more than this factor: other coaxial hinges (turnbuckles, struts) fail both.
OFF_LINE, UNEQUAL = 0.12, 1.6
#: Wheels are searched among this many hinges.
MOST_LEAVES = 40


def find_roles(tree: Tree, what: str, joints: dict[str, Sequence[str]], forward: str | None, up: str | None) -> Roles:
    """Return the roles of a tree's hinges.

    Every link is tried as the root, the file's own root first.

    Args:
        tree: a connected tree.
        what: the file's name, for messages.
        joints: overrides the search: names of the joints that are "wheels" (6), "bogies" (2), "rockers" (2), or all that
            may be "steering". Fixed joints that are named are taken as hinges.
        forward, up: override the rover's directions, as an axis of the root's frame: "x", "-y", ...

    Returns:
        The roles, with the first lines of the report.

    Raises:
        RoverError: no rocker-bogie in it; the sentence tells how far the search came.
    """
    for role, names in joints.items():
        if role not in ROLES:
            raise RoverError(unknown_name("role of joints", role, ROLES))
        for name in names:
            if name not in tree.joints:
                raise RoverError(f"{what}: {unknown_name('joint', name, tree.joints)}")
    freed = [name for role in ("rockers", "bogies", "wheels") for name in joints.get(role, ())]
    search, roles = _from_any_root(tree, what, joints, freed, forward, up)
    turning = [r.joint.name for r in (*roles.rockers, *roles.arms) if r is not None]
    if wrong := [name for name in joints.get("rockers", ()) if name not in turning]:
        raise RoverError(f"{what}: joint {wrong[0]!r} is no rocker: it carries none of the bogies")
    if roles.rockers[0] is None and (pivots := search.fixed_pivots(roles)):
        roles = _Search(roles.tree, what, joints, [*freed, *pivots]).run(forward, up)
        roles.freed = True
        roles.guessed.append(f"the rockers are fixed to the body; taken as turning at joints {pivots[0]!r} and {pivots[1]!r}")
    if named := [n for n in (*joints.get("wheels", ()), *joints.get("bogies", ())) if not _turns(tree.joints[n])]:
        roles.repaired.append(f"fixed joints taken as hinges, as you name them: {', '.join(named)}")
    return roles


def _from_any_root(
    tree: Tree, what: str, joints: dict[str, Sequence[str]], freed: list[str], forward: str | None, up: str | None
) -> tuple[_Search, Roles]:
    """Return the first search that succeeds, seen from the body's own link.

    A graph has no preferred root: if the file's root is not on the body, the tree is rooted at the body's link nearest to it.
    """
    first = _Search(tree, what, joints, freed)
    complaint: RoverError | None = None
    for search in (first, *(_Search(tree.rooted(root), what, joints, freed) for root in first.branching())):
        try:
            roles = search.run(forward, up)
        except RoverError as error:
            complaint = complaint or error
            continue
        if roles.body == roles.groups[tree.root]:
            if search is first:
                return search, roles
            root = tree.root
        else:
            root = next(link for link in tree.order if roles.groups[link] == roles.body)
            roles.found.append(f"the file's root {tree.root!r} is not on the body: {root!r} is")
        again = _Search(tree.rooted(root), what, joints, freed)
        found, roles = roles.found, again.run(forward, up)
        roles.found += found[-1:] if root != tree.root else []
        return again, roles
    assert complaint is not None
    raise complaint


def _turns(joint: Joint) -> bool:
    """Return True for a hinge that is not locked at one angle."""
    return joint.kind == "hinge" and not joint.locked


class _Search:
    """A search of a rooted tree, with some of its fixed joints taken as hinges."""

    def __init__(self, tree: Tree, what: str, joints: dict[str, Sequence[str]], freed: Sequence[str]) -> None:
        self.tree, self.what, self.joints = tree, what, joints
        self.T = tree.rest()
        self.groups = {tree.root: tree.root}
        self.inbound: dict[str, Hinge] = {}
        self.freed = {name for name in freed if not _turns(tree.joints[name])}
        for link in tree.order[1:]:
            joint = tree.inbound[link]
            if joint.name in freed or _turns(joint):
                T = self.T[link]
                axis = joint.axis if joint.axis is not None else self._axle(link)
                point = T[:3, :3] @ joint.anchor + T[:3, 3]
                self.groups[link] = link
                self.inbound[link] = Hinge(joint, self.groups[joint.parent], link, point, T[:3, :3] @ axis)
            else:
                self.groups[link] = self.groups[joint.parent]

    def _axle(self, link: str) -> Array:
        """Return the axis (3,) for a fixed joint without one: that of the link's cylinder, or y."""
        shape = next((s for s in self.tree.parts[link].shapes if s.kind == "cylinder"), None)
        return np.array([0.0, 1.0, 0.0]) if shape is None else shape.T[:3, 2]

    def branching(self) -> list[str]:
        """Return a link of each rigid group with two or more hinges, except the root's."""
        count = dict.fromkeys(self.groups.values(), 0)
        for group, hinge in self.inbound.items():
            count[group] += 1
            count[hinge.parent] += 1
        return [g for g in sorted(count, key=lambda g: -count[g]) if count[g] > 1 and g != self.tree.root][:MOST_LEAVES]

    def run(self, forward: str | None, up: str | None) -> Roles:
        """Return the roles in the best group of parallel hinges.

        Raises:
            RoverError: none fits.
        """
        carrying = {h.parent for h in self.inbound.values()}
        leaves = [h for h in self.inbound.values() if h.child not in carrying]
        if "wheels" in self.joints:
            leaves = [h for h in self.inbound.values() if h.joint.name in self.joints["wheels"]]
        if len(leaves) > MOST_LEAVES:
            raise RoverError(
                f"{self.what}: {len(leaves)} hinges carry nothing more, too many to search ({MOST_LEAVES}): "
                "name the wheels' with joints={'wheels': [...]}"
            )
        clusters: dict[frozenset[str], list[Hinge]] = {}
        for seed in leaves:
            cluster = [h for h in leaves if abs(h.axis @ seed.axis) > PARALLEL]
            clusters[frozenset(h.child for h in cluster)] = cluster
        ranked = sorted(clusters.values(), key=len, reverse=True)
        if not ranked or len(ranked[0]) < 6:
            most = len(ranked[0]) if ranked else 0
            if fixed := self._fixed_wheels():
                hint = f"; joints {', '.join(fixed)} are fixed: if they are wheels, name them with joints={{'wheels': [...]}}"
            else:
                hint = "; must some be steered straight ahead first?" if len(leaves) >= 6 else ""
            raise RoverError(
                f"{self.what}: at most {most} of its outermost hinges lie parallel, as the axles of wheels do, "
                f"and a rocker-bogie rover has six wheels{hint}"
            )
        complaint = ""
        for cluster in ranked:
            if len(cluster) < 6:
                break
            try:
                return self._match(cluster, forward, up)
            except RoverError as error:
                complaint = complaint or str(error)
        raise RoverError(complaint)

    def _fixed_wheels(self) -> list[str]:
        """Return the names of fixed joints that carry only a round shape, if there are six or more."""
        parents = {j.parent for j in self.tree.joints.values()}
        ends = [j for j in self.tree.inbound.values() if not _turns(j) and j.child not in parents]
        kinds = ("cylinder", "sphere", "mesh")
        names = [j.name for j in ends if any(s.kind in kinds and not s.unread for s in self.tree.parts[j.child].shapes)]
        return names if 6 <= len(names) <= MOST_LEAVES else []

    def _match(self, cluster: list[Hinge], forward: str | None, up: str | None) -> Roles:
        """Return the roles among parallel hinges; turn freed hinges to the axles' direction.

        In `self.inbound`, a fixed joint that was taken as a hinge gets that direction, unless its own is close to it; also if the
        method raises.

        Raises:
            RoverError: all wheels are at one point, or no two bogies with a rocker wheel to each.
        """
        lateral = mean_direction([h.axis for h in cluster])
        if (snapped := snap(lateral)) is not None:
            lateral = snapped
        self._lay_freed(lateral)
        span = max(float(np.linalg.norm(a.point - b.point)) for a, b in combinations(cluster, 2))
        if span < 1e-9:
            raise RoverError(f"{self.what}: all its wheels are at one point")

        def apart(a: Hinge, b: Hinge) -> float:
            """Return the distance in the side view of b from a's mirror image, over the length."""
            across = a.point - b.point
            return float(np.linalg.norm(across - (across @ lateral) * lateral)) / span

        def crosswise(a: Hinge, b: Hinge) -> float:
            """Return the distance between a and b along the axles, over the rover's length."""
            return float((a.point - b.point) @ lateral) / span

        arms = {h.child: self._arm(h, cluster, lateral) for h in cluster}
        by_arm: dict[str, list[Hinge]] = {}
        for h in cluster:
            by_arm.setdefault(arms[h.child][0], []).append(h)
        radii = {h.child: self._radius(h) for h in cluster}
        choices = []
        for b1, b2 in combinations(self._bogies(by_arm, lateral), 2):
            if apart(b1, b2) > MIRROR or abs(crosswise(b1, b2)) < 0.02:
                continue
            rest = [h for h in cluster if arms[h.child][0] not in (b1.child, b2.child)]
            for w1, w2 in permutations(rest, 2):
                if apart(w1, w2) > MIRROR or crosswise(w1, w2) * crosswise(b1, b2) <= 0:
                    continue
                kind = self._rocker_kind(b1, b2, arms[w1.child][0], arms[w2.child][0], lateral)
                if kind is None:
                    continue
                for p1, p2 in _pairs(by_arm[b1.child], by_arm[b2.child]):
                    six = [w1, w2, *p1, *p2]
                    off, unequal = _off_line(six, lateral, span), _unequal([radii[h.child] for h in six])
                    unlikely = (off > OFF_LINE) + (unequal > UNEQUAL)
                    cost = apart(w1, w2) + apart(b1, b2) + off + np.log(unequal)
                    choices.append(((unlikely, kind, cost), [b1, b2], [w1, w2], {b1.child: p1, b2.child: p2}))
        if not choices:
            raise RoverError(
                f"{self.what}: {len(cluster)} of its hinges could be wheels, {span:.4g} m apart, and "
                f"{len(self._bogies(by_arm, lateral))} bogies, "
                f"but no left and right pair of bogies with a rocker wheel to each was found among them{self._turned()}: "
                "name them with joints={'wheels': [...], 'bogies': [...], 'rockers': [...]}"
            )
        (_, kind, _), bogies, outer, pairs = min(choices, key=lambda c: c[0])
        roles = self._roles(kind, bogies, outer, pairs, arms, lateral, forward, up)
        others = [h for h in cluster if all(h.child != w.child for w in roles.wheels)]
        if others:
            roles.found.append(f"parallel hinges that are not wheels: {', '.join(h.joint.name for h in others)}")
        return roles

    def _turned(self) -> str:
        """Return a hint for messages if joints are not at 0 at rest, else ""."""
        turned = [f"{name!r} at {angle:.3g} rad" for name, angle in self.tree.rest_angles().items() if angle]
        return f" (at rest joint {', '.join(turned[:4])}: by a mimic offset or locked limits)" if turned else ""

    def _bogies(self, by_arm: dict[str, list[Hinge]], lateral: Array) -> list[Hinge]:
        """Return the hinges that may be bogies'.

        They are parallel to the axles, with two or more possible wheels on their arm.
        """
        most = 4 if sum(len(on) for on in by_arm.values()) <= 16 else 2
        bogies = [
            self.inbound[g]
            for g, on in by_arm.items()
            if 2 <= len(on) <= most and g in self.inbound and abs(self.inbound[g].axis @ lateral) > PARALLEL
        ]
        return [b for b in bogies if "bogies" not in self.joints or b.joint.name in self.joints["bogies"]]

    def _radius(self, wheel: Hinge) -> float:
        """Return the radius of a possible wheel's tread, NaN if its shapes give none."""
        tread = find_tread(self.tree, self.T, [k for k, g in self.groups.items() if g == wheel.child], wheel)
        return np.nan if tread is None else tread.radius

    def _lay_freed(self, lateral: Array) -> None:
        """Turn fixed joints that are taken as hinges into the axles' direction.

        A joint whose own axis is close to it keeps that axis.
        """
        for group, hinge in self.inbound.items():
            if hinge.joint.name in self.freed and abs(hinge.axis @ lateral) <= PARALLEL:
                self.inbound[group] = replace(hinge, axis=lateral)

    def _arm(self, wheel: Hinge, cluster: list[Hinge], lateral: Array) -> tuple[str, Hinge | None]:
        """Return the rigid group that carries the wheel, and the steering hinge.

        The group is that beyond the steering knuckle, if there is one.
        """
        knuckle = self.inbound.get(wheel.parent)
        if knuckle is None or abs(knuckle.axis @ lateral) > ACROSS or sum(h.parent == wheel.parent for h in cluster) > 1:
            return wheel.parent, None
        if "steering" in self.joints and knuckle.joint.name not in self.joints["steering"]:
            return knuckle.parent, None
        return knuckle.parent, knuckle

    def _rocker_kind(self, b1: Hinge, b2: Hinge, a1: str, a2: str, lateral: Array) -> int | None:
        """Return the kind of rockers.

        0: two rockers; 1: two rockers of two arms each; 2: rigid with the body; None: no rockers.

        Args:
            b1, b2: the bogies' hinges.
            a1, a2: the rocker wheels' arms.
            lateral: (3,) the axles' direction.
        """

        def turns(group: str) -> bool:
            return group in self.inbound and bool(abs(self.inbound[group].axis @ lateral) > PARALLEL)

        r1, r2 = b1.parent, b2.parent
        if r1 == r2:
            return 2 if a1 == a2 == r1 else None
        if not (turns(r1) and turns(r2)):
            return None
        base = self.inbound[r1].parent
        if self.inbound[r2].parent != base:
            return None
        if (a1, a2) == (r1, r2):
            return 0
        split = turns(a1) and turns(a2) and a1 != a2 and self.inbound[a1].parent == self.inbound[a2].parent == base
        return 1 if split else None

    def _roles(
        self, kind: int, bogies: list[Hinge], outer: list[Hinge], on_bogie: dict[str, list[Hinge]],
        arms: dict[str, tuple[str, Hinge | None]], lateral: Array, forward: str | None, up: str | None,
    ) -> Roles:  # fmt: skip
        """Return the roles, ordered left before right and in the paper's order of wheels."""
        rockers = [None if kind == 2 else self.inbound[b.parent] for b in bogies]
        wheels = [*outer, *on_bogie[bogies[0].child], *on_bogie[bogies[1].child]]
        pivots = [*bogies, *(r for r in rockers if r is not None)]
        parents = {g: h.parent for g, h in self.inbound.items()}
        roles = Roles(self.tree, [], [], bogies, rockers, [None, None], np.eye(3), self.groups, parents)
        hubs, points = (np.array([h.point for h in hinges]) for hinges in (wheels, pivots))
        roles.axes = rover_axes(roles, self.what, lateral, hubs, points, wheels, forward, up)
        f, left, _ = roles.axes.T
        side = 0 if (bogies[0].point - bogies[1].point) @ left > 0 else 1
        roles.bogies = [bogies[side], bogies[1 - side]]
        roles.rockers = [rockers[side], rockers[1 - side]]
        ordered = [outer[side], outer[1 - side]]
        pairs = [
            sorted(on_bogie[b.child], key=lambda h, w=w: abs((h.point - w.point) @ f))  # type: ignore[misc]
            for b, w in zip(roles.bogies, ordered, strict=True)
        ]
        roles.wheels = [*ordered, pairs[0][0], pairs[1][0], pairs[0][1], pairs[1][1]]
        roles.steers = [arms[w.child][1] for w in roles.wheels]
        if kind == 1:
            roles.arms = [self.inbound[arms[w.child][0]] for w in ordered]
        tilted = [
            h.joint.name for h in (*pivots, *wheels) if h.joint.name not in self.freed and abs(h.axis @ left) < np.cos(1e-6)
        ]
        if tilted:
            worst = max(np.degrees(np.arccos(min(1.0, abs(h.axis @ left)))) for h in (*pivots, *wheels) if h.joint.name in tilted)
            roles.repaired.append(f"{len(tilted)} hinges lie up to {worst:.2g} deg off the rover's left; taken as parallel to it")
        return roles

    def fixed_pivots(self, roles: Roles) -> list[str] | None:
        """Return the fixed joints that look most like the pivots of rigid rockers, or None."""
        chains = []
        for s in (0, 1):
            ends = [roles.bogies[s].joint.parent, (roles.steers[s] or roles.wheels[s]).joint.parent]
            first, second = (self._to_root(end) for end in ends)
            chains.append([link for link in first if link in second])
        if not (own := [[link for link in chains[s] if link not in chains[1 - s]] for s in (0, 1)])[0] or not own[1]:
            return None
        joints = [[self.tree.inbound[link] for link in own[s]] for s in (0, 1)]
        left = roles.axes[:, 1]

        def marked(joint: Joint) -> int:
            lies = joint.axis is not None and bool(abs((self.T[joint.child][:3, :3] @ joint.axis) @ left) > PARALLEL)
            return 2 * (lies and joint.limits is not None) + lies

        best = max(range(min(len(joints[0]), len(joints[1]))), key=lambda k: (marked(joints[0][k]) + marked(joints[1][k]), -k))
        return [joints[s][best].name for s in (0, 1)]

    def _to_root(self, link: str) -> list[str]:
        """Return the links from one to the root."""
        path = [link]
        while path[-1] in self.tree.inbound:
            path.append(self.tree.inbound[path[-1]].parent)
        return path


def _pairs(first: list[Hinge], second: list[Hinge]) -> list[tuple[list[Hinge], list[Hinge]]]:
    """Return every choice of two wheels on each of two bogies."""
    return [(list(p), list(q)) for p in combinations(first, 2) for q in combinations(second, 2)]


def _off_line(wheels: list[Hinge], lateral: Array, span: float) -> float:
    """Return the largest distance of hubs from their common line in the side view.

    It is divided by the rover's length.
    """
    points = np.array([w.point for w in wheels])
    flat = points - points.mean(axis=0)
    flat = flat - np.outer(flat @ lateral, lateral)
    along = np.linalg.svd(flat)[2][0]
    return float(np.linalg.norm(flat - np.outer(flat @ along, along), axis=1).max()) / span


def _unequal(radii: list[float]) -> float:
    """Return the ratio of the largest radius to the smallest; 1 if the shapes give none."""
    known = [r for r in radii if r > 0]
    return max(known) / min(known) if known else 1.0
