"""Parts of a rover: the links of a tree that belong to each, and their mass properties."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ...arrays import Array
from ..checks import possible_inertia
from ..model import MASS_SHARES, Link, Rover
from .import_roles import Roles
from .tree import Tree


class Parts:
    """Assignment of a tree's links to the parts of a rover, in the rover's frame.

    It adds lines to the report in `roles`.
    """

    def __init__(self, tree: Tree, what: str, roles: Roles, scale: float) -> None:
        self.tree, self.what, self.roles, self.scale = tree, what, roles, scale
        self.turn = roles.axes.T
        self.T = tree.rest()
        self.part_of = self._assign()

    def at(self, point: Array) -> Array:
        """Return a point (3,) of the file's root frame in the rover's, m.

        Args:
            point: (3,) in the file's root frame and unit.

        Returns:
            (3,) in the rover's frame, m.
        """
        return self.turn @ point * self.scale

    def _assign(self) -> dict[str, str]:
        """Return the part of the rover that each link belongs to.

        A link without a role goes with the part that carries it.
        """
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
        """Return True for a knuckle whose mass is centred on its wheel's.

        The package writes them so: they are one part again.
        """
        own, other = self._sum([knuckle]), self._sum([wheel])
        return own.mass > 0 and other.mass > 0 and bool(np.abs(own.com - other.com).max() < 1e-9)

    def _sum(self, groups: Sequence[str]) -> Link:
        """Return the links of some rigid groups as one rigid part."""
        return self._gather([link for link, group in self.roles.groups.items() if group in groups])

    def _gather(self, links: Sequence[str]) -> Link:
        """Return several links of the tree as one rigid part at rest, in the rover's frame."""
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

    @cached_property
    def masses(self) -> dict[str, Link]:
        """The rover's links by name, as the file gives them."""
        names = ("body", "rocker_left", "rocker_right", "bogie_left", "bogie_right", *(f"wheel_{i + 1}" for i in range(6)))
        return {name: self._gather([link for link, part in self.part_of.items() if part == name]) for name in names}

    def links(self, shape: dict[str, Any], mass: float | None) -> dict[str, Any]:
        """Return the rover's links as arguments of `Rover.from_pivots`.

        If the file has no masses, it is the rover's mass alone.

        Args:
            shape: the other arguments.
            mass: the caller's total, kg, or None.

        Returns:
            Arguments by name.
        """
        report, parts = self.roles.repaired, list(self.masses.values())
        total = sum(p.mass for p in parts)
        if total == 0:
            if mass is None:
                self.roles.guessed.append("mass: the file has none; the rule of thumb for its wheelbase is taken")
            else:
                report.append("the file has no masses: yours is shared by rule of thumb")
            return {} if mass is None else {"mass": mass}
        shares = (parts[0].mass, *(sum(p.mass for p in parts[a:b]) for a, b in ((1, 3), (3, 5), (5, 11))))
        text = ", ".join(
            f"{label} {share:.4g}" for label, share in zip(("body", "rockers", "bogies", "wheels"), shares, strict=True)
        )
        self.roles.found.append(f"mass {total:.6g} kg in {sum(p.mass > 0 for p in self.tree.parts.values())} links: {text}")
        if parts[0].mass == 0:
            body = total * MASS_SHARES[0] / (1 - MASS_SHARES[0])
            self.roles.warnings.append(f"the file gives the body no mass: {body:.4g} kg is a guess, give mass= or body=")
            self.roles.guessed.append(f"mass of the body: {MASS_SHARES[0]:.0%} of the rover, the rule of thumb")
            total += body
            parts[0] = Link(body, np.zeros(3), np.full((3, 3), np.nan))
        if mass is not None:
            parts = [Link(p.mass * mass / total, p.com, p.inertia * mass / total) for p in parts]
        typical = Rover.from_pivots(**shape, mass=total if mass is None else mass).links
        weightless, impossible = [], []
        for k, (name, part) in enumerate(zip(self.masses, parts, strict=True)):
            if np.isnan(part.inertia).any():
                parts[k] = Link(part.mass, typical[k].com, typical[k].inertia * (part.mass / typical[k].mass))
            elif part.mass == 0:
                weightless.append(name)
                parts[k] = Link(0.0, typical[k].com, np.zeros((3, 3)))
            elif not possible_inertia(part.inertia):
                impossible.append(name)
                parts[k] = Link(part.mass, part.com, typical[k].inertia * (part.mass / typical[k].mass))
        if weightless:
            report.append(f"no mass in the file, left so: {', '.join(weightless)}")
        if impossible:
            report.append(f"an inertia that no body can have, replaced by that of its shape: {', '.join(impossible)}")
        return {"body": parts[0], "rockers": parts[1:3], "bogies": parts[3:5], "wheels": parts[5:]}
