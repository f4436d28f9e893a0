"""Find the rocker-bogie in a tree of links and joints: by what hangs on what and which way its hinges lie, not by names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from ...errors import RoverError, unknown_name
from .tree import Joint, Tree

Array = NDArray[np.float64]

#: Hinges this close to the common direction of the wheels' axles are taken as lying along it (cosine of 20 degrees).
PARALLEL = float(np.cos(np.radians(20)))
#: A hinge on a wheel's arm this far from that direction can steer (cosine of 60 degrees).
ACROSS = 0.5
#: Left and right must mirror each other this well in the side view, as a share of the rover's length.
MIRROR = 0.08
#: Wheels are searched among this many hinges.
MOST_LEAVES = 40
#: Axes of the file's own frame this close to the rover's are taken as the rover's (rad).
SNAP = 0.2


@dataclass(frozen=True)
class Hinge:
    """A hinge at rest, in the file's root frame: where it is and which way it lies; the rigid groups it joins."""

    joint: Joint
    parent: str
    child: str
    point: Array
    axis: Array


@dataclass
class Roles:
    """Who is who: left, right; wheels in the paper's order. `axes` (3, 3) has forward, left, up as columns."""

    wheels: list[Hinge]
    steers: list[Hinge | None]
    bogies: list[Hinge]
    rockers: list[Hinge | None]  # None: rigid with the body, and nothing marks the pivot
    arms: list[Hinge | None]  # the rocker wheel's own arm, where the rocker comes in two
    axes: Array
    groups: dict[str, str]  # link: the rigid group it belongs to
    parents: dict[str, str]  # group: the group that carries it
    freed: bool = False  # the rockers were fixed
    found: list[str] = field(default_factory=list)
    guessed: list[str] = field(default_factory=list)
    repaired: list[str] = field(default_factory=list)


def find_roles(tree: Tree, what: str, joints: dict[str, Sequence[str]], forward: str | None, up: str | None) -> Roles:
    """Who is who in the tree.

    Args:
        what: the file's name, for messages.
        joints: overrules the search: names of the joints that are "wheels" (6), "bogies" (2), "rockers" (2), or all that
            may be "steering".
        forward, up: overrule the rover's directions, as an axis of the file's root frame: "x", "-y", ...

    Raises:
        RoverError: no rocker-bogie in it; the sentence says how far the search came.
    """
    for role, names in joints.items():
        if role not in ("wheels", "bogies", "rockers", "steering"):
            raise RoverError(unknown_name("role of joints", role, ("wheels", "bogies", "rockers", "steering")))
        for name in names:
            if name not in tree.joints:
                raise RoverError(f"{what}: {unknown_name('joint', name, tree.joints)}")
    search = _Search(tree, what, joints, freed=list(joints.get("rockers", ())))
    roles = search.run(forward, up)
    turning = [r.joint.name for r in (*roles.rockers, *roles.arms) if r is not None]
    if wrong := [name for name in joints.get("rockers", ()) if name not in turning]:
        raise RoverError(f"{what}: joint {wrong[0]!r} is no rocker: none of the bogies hangs on what it carries")
    if roles.rockers[0] is None and (pivots := search.fixed_pivots(roles)):
        roles = _Search(tree, what, joints, freed=pivots).run(forward, up)
        roles.freed = True
        roles.guessed.append(f"the rockers are fixed to the body; taken as turning at joints {pivots[0]!r} and {pivots[1]!r}")
    return roles


class _Search:
    """One look at the tree with some of its fixed joints taken as hinges."""

    def __init__(self, tree: Tree, what: str, joints: dict[str, Sequence[str]], freed: Sequence[str]) -> None:
        self.tree, self.what, self.joints = tree, what, joints
        self.T = tree.rest()
        self.groups = {tree.root: tree.root}
        self.inbound: dict[str, Hinge] = {}
        for link in tree.order[1:]:
            joint = tree.inbound[link]
            if joint.name in freed or (joint.kind == "hinge" and not joint.locked):
                axis = joint.axis if joint.axis is not None else np.array([0.0, 1.0, 0.0])
                T = self.T[link]
                self.groups[link] = link
                self.inbound[link] = Hinge(joint, self.groups[joint.parent], link, T[:3, 3], T[:3, :3] @ axis)
            else:
                self.groups[link] = self.groups[joint.parent]
        self.freed = set(freed)

    def run(self, forward: str | None, up: str | None) -> Roles:
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
            astray = "; must some be steered straight ahead first?" if len(leaves) >= 6 else ""
            raise RoverError(
                f"{self.what}: at most {most} of its outermost hinges lie parallel, as the axles of wheels do, "
                f"and a rocker-bogie rover has six wheels{astray}"
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

    def _match(self, cluster: list[Hinge], forward: str | None, up: str | None) -> Roles:
        lateral = _mean_direction([h.axis for h in cluster])
        if (snapped := _snap(lateral)) is not None:
            lateral = snapped
        self._lay_freed(lateral)
        span = max(float(np.linalg.norm(a.point - b.point)) for a, b in combinations(cluster, 2))
        if span < 1e-9:
            raise RoverError(f"{self.what}: all its wheels are in one place")

        def apart(a: Hinge, b: Hinge) -> float:
            """How far b is from being a's mirror image: the distance in the side view, over the rover's length."""
            across = a.point - b.point
            return float(np.linalg.norm(across - (across @ lateral) * lateral)) / span

        def crosswise(a: Hinge, b: Hinge) -> float:
            return float((a.point - b.point) @ lateral) / span

        arms = {h.child: self._arm(h, cluster, lateral) for h in cluster}
        by_arm: dict[str, list[Hinge]] = {}
        for h in cluster:
            by_arm.setdefault(arms[h.child][0], []).append(h)
        bogies = [
            self.inbound[g]
            for g, on in by_arm.items()
            if len(on) == 2 and g in self.inbound and abs(self.inbound[g].axis @ lateral) > PARALLEL
        ]
        if "bogies" in self.joints:
            bogies = [b for b in bogies if b.joint.name in self.joints["bogies"]]
        choices = []
        for b1, b2 in combinations(bogies, 2):
            if apart(b1, b2) > MIRROR or abs(crosswise(b1, b2)) < 0.02:
                continue
            rest = [h for h in cluster if arms[h.child][0] not in (b1.child, b2.child)]
            for w1, w2 in permutations(rest, 2):
                if apart(w1, w2) > MIRROR or crosswise(w1, w2) * crosswise(b1, b2) <= 0:
                    continue
                kind = self._rocker_kind(b1, b2, arms[w1.child][0], arms[w2.child][0], lateral)
                if kind is not None:
                    choices.append((kind, apart(w1, w2) + apart(b1, b2), b1, b2, w1, w2))
        if not choices:
            raise RoverError(
                f"{self.what}: {len(cluster)} of its hinges could be wheels, {span:.4g} m apart, and {len(bogies)} bogies, "
                "but no left and right pair of bogies with a rocker wheel to each was found among them: "
                "name them with joints={'wheels': [...], 'bogies': [...], 'rockers': [...]}"
            )
        kind, _, b1, b2, w1, w2 = min(choices, key=lambda c: c[:2])
        return self._roles(kind, [b1, b2], [w1, w2], by_arm, arms, lateral, forward, up)

    def _lay_freed(self, lateral: Array) -> None:
        """Fixed joints taken as hinges turn about the rover's left, unless they are given an axis that all but lies so."""
        for group, hinge in self.inbound.items():
            if hinge.joint.kind == "fixed" and abs(hinge.axis @ lateral) <= PARALLEL:
                self.inbound[group] = replace(hinge, axis=lateral)

    def _arm(self, wheel: Hinge, cluster: list[Hinge], lateral: Array) -> tuple[str, Hinge | None]:
        """The rigid group that carries the wheel, past its steering knuckle if it has one; and the steering hinge."""
        knuckle = self.inbound.get(wheel.parent)
        if knuckle is None or abs(knuckle.axis @ lateral) > ACROSS or sum(h.parent == wheel.parent for h in cluster) > 1:
            return wheel.parent, None
        if "steering" in self.joints and knuckle.joint.name not in self.joints["steering"]:
            return knuckle.parent, None
        return knuckle.parent, knuckle

    def _rocker_kind(self, b1: Hinge, b2: Hinge, a1: str, a2: str, lateral: Array) -> int | None:
        """0: two rockers; 1: two rockers in two arms each; 2: fixed to the body; None: no rockers. a1, a2: the wheels' arms."""

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
        self, kind: int, bogies: list[Hinge], outer: list[Hinge], by_arm: dict[str, list[Hinge]],
        arms: dict[str, tuple[str, Hinge | None]], lateral: Array, forward: str | None, up: str | None,
    ) -> Roles:  # fmt: skip
        rockers = [None if kind == 2 else self.inbound[b.parent] for b in bogies]
        wheels = [*outer, *by_arm[bogies[0].child], *by_arm[bogies[1].child]]
        pivots = [*bogies, *(r for r in rockers if r is not None)]
        roles = Roles(
            [], [], bogies, rockers, [None, None], np.eye(3), self.groups, {g: h.parent for g, h in self.inbound.items()}
        )
        roles.axes = self._frame(
            roles, lateral, np.array([w.point for w in wheels]), np.array([p.point for p in pivots]), wheels, forward, up
        )
        f, left, _ = roles.axes.T
        side = 0 if (bogies[0].point - bogies[1].point) @ left > 0 else 1
        roles.bogies = [bogies[side], bogies[1 - side]]
        roles.rockers = [rockers[side], rockers[1 - side]]
        ordered = [outer[side], outer[1 - side]]
        pairs = [
            sorted(by_arm[b.child], key=lambda h, w=w: abs((h.point - w.point) @ f))  # type: ignore[misc]
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
            roles.repaired.append(f"{len(tilted)} hinges lie up to {worst:.2g} deg off the rover's left; taken as lying along it")
        return roles

    def _frame(
        self, roles: Roles, lateral: Array, hubs: Array, pivots: Array, wheels: list[Hinge], forward: str | None, up: str | None
    ) -> Array:  # fmt: skip
        """Forward, left, up as columns: up from the wheels to the pivots, forward along x where that is lengthwise."""
        square = [axis for axis in np.eye(3) if abs(axis @ lateral) < 1e-12]
        if len(square) == 2:
            lengthwise, upright = sorted(square, key=lambda axis: -float(np.ptp(hubs @ axis)))
        else:
            flat = hubs - hubs.mean(axis=0)
            flat -= np.outer(flat @ lateral, lateral)
            lengthwise = np.linalg.svd(flat)[2][0]
            lengthwise = lengthwise * (np.sign(lengthwise[np.abs(lengthwise).argmax()]))
            upright = np.cross(lengthwise, lateral)
            roles.guessed.append(
                "its frame lies along none of the rover's directions; forward and up are taken from where the wheels stand"
            )
        if up is not None:
            upright = _axis("up", up)
        elif (pivots.mean(axis=0) - hubs.mean(axis=0)) @ upright < 0:
            upright = -upright
        if forward is not None:
            lengthwise = _axis("forward", forward)
        else:
            vote = _vote(wheels, lengthwise)
            if np.allclose(lengthwise, (1, 0, 0)):
                if vote < 0:
                    roles.guessed.append("forward is +x of its frame; its names say otherwise: forward='-x' turns it round")
            else:
                lengthwise = lengthwise * (-1 if vote < 0 else 1)
                why = "from its names" if vote else "for want of better"
                roles.guessed.append(
                    f"forward is {_say(lengthwise)} of its frame, {why}; forward='{_say(-lengthwise)}' turns it round"
                )
        left = np.cross(upright, lengthwise)
        if abs(left @ lateral) < PARALLEL:
            raise RoverError(
                f"{self.what}: forward {_say(lengthwise)} and up {_say(upright)} must both lie across the axles, "
                f"which lie along {_say(lateral)}"
            )
        left /= np.linalg.norm(left)
        if upright @ (0, 0, 1) < 0.5:
            roles.repaired.append(f"up is {_say(upright)} of its frame: turned")
        return np.stack([np.cross(left, upright), left, upright], axis=1)

    def fixed_pivots(self, roles: Roles) -> list[str] | None:
        """For rockers rigid with the body: the fixed joint on each side that looks most like the pivot."""
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
        path = [link]
        while path[-1] in self.tree.inbound:
            path.append(self.tree.inbound[path[-1]].parent)
        return path


def _mean_direction(axes: list[Array]) -> Array:
    total = sum((a if a @ axes[0] > 0 else -a for a in axes), np.zeros(3))
    return np.asarray(total / np.linalg.norm(total))


def _snap(direction: Array) -> Array | None:
    """The axis of the file's frame that the direction all but lies along, if there is one."""
    k = int(np.abs(direction).argmax())
    return np.eye(3)[k] if abs(direction[k]) > np.cos(SNAP) else None


def _vote(wheels: list[Hinge], lengthwise: Array) -> float:
    """Which way the names of wheels and knuckles say is the front: positive along `lengthwise`; 0 if they say nothing."""
    middle = np.mean([w.point for w in wheels], axis=0)
    total = 0.0
    for w in wheels:
        name = f"{w.joint.name} {w.child} {w.parent}".lower()
        says = ("front" in name) - ("rear" in name or "back" in name)
        total += says * np.sign((w.point - middle) @ lengthwise)
    return total


def _axis(label: str, text: str) -> Array:
    names = {sign + axis: (1 if sign != "-" else -1) * np.eye(3)[k] for k, axis in enumerate("xyz") for sign in ("", "+", "-")}
    if text not in names:
        raise RoverError(f"{label} is {text!r}; give an axis of the file's frame: x, -x, y, -y, z or -z")
    return np.asarray(names[text], dtype=float)


def _say(direction: Array) -> str:
    k = int(np.abs(direction).argmax())
    if abs(direction[k]) < 1 - 1e-9:
        return "(" + ", ".join(f"{v:.3g}" for v in direction) + ")"
    return ("-" if direction[k] < 0 else "") + "xyz"[k]
