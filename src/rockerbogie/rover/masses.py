"""Links of a rover, and the rule of thumb for masses that are not given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from ..arrays import Array, frozen

#: Mass of a rover whose mass is not given: this many kg times the cube of its wheelbase (Curiosity 78, Rocky 7 128).
DEFAULT_DENSITY = 90.0
#: Shares of a total mass if the links' own are not given: body, each rocker, each bogie, each wheel.
MASS_SHARES = (0.60, 0.06, 0.04, 0.20 / 6)
#: Fields that the rule of thumb for masses uses.
GEOMETRY = ("rocker_pivot", "bogie_pivot", "hubs", "wheel_radius", "wheel_width", "body_box")
#: The rover's links by the field that holds them.
GROUPS = ("body", "rockers", "bogies", "wheels")
#: A link is derived if it agrees with the rule of thumb to this relative error.
DERIVED = 1e-9


@dataclass(frozen=True)
class Link:
    """A rigid part of a rover, at rest in the body frame.

    Mass (kg), centre of mass (3,) (m) and inertia (3, 3) about it (kg m²).

    The arrays are read-only.
    """

    mass: float
    com: Array
    inertia: Array

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    def __post_init__(self) -> None:
        for name in ("com", "inertia"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


class Shape(Protocol):
    """The fields of a rover that this module reads."""

    @property
    def rocker_pivot(self) -> Array: ...
    @property
    def bogie_pivot(self) -> Array: ...
    @property
    def hubs(self) -> Array: ...
    @property
    def wheel_radius(self) -> Array: ...
    @property
    def wheel_width(self) -> Array: ...
    @property
    def body_box(self) -> Array: ...


def links_like(links: Sequence[Link], shape: Shape, share: float) -> list[Link]:
    """Return links of the same masses by the rule of thumb for a rover's shape.

    Args:
        links: one group of the rover's links (body, rockers, bogies or wheels).
        shape: the rover's lengths.
        share: each link's share of the rover's mass by the rule of thumb.

    Returns:
        As many links, their centres and inertias by the rule of thumb.
    """
    group = MASS_SHARES.index(share)
    total = links[0].mass / share
    made = share_masses(
        total, shape.rocker_pivot, shape.bogie_pivot, shape.hubs, shape.wheel_radius, shape.wheel_width, shape.body_box
    )
    typical = [made[0]] if group == 0 else list(made[group])  # type: ignore[arg-type]
    return [replace(link, com=t.com, inertia=t.inertia) for link, t in zip(links, typical, strict=True)]


def links_for(old: Any, new: Any, groups: Sequence[str], derive: bool) -> tuple[dict[str, Any], list[str]]:
    """Return the links of a rover whose lengths have changed.

    Args:
        old: the rover with the lengths that its links were made for.
        new: the same rover with new lengths.
        groups: the groups of links to adapt ("body", "rockers", "bogies", "wheels").
        derive: share the total mass anew by the rule of thumb, whether or not the links follow it.

    Returns:
        The fields that change, and the groups whose links do not follow the rule of thumb and stay.
    """
    links: dict[str, Any] = {}
    kept: list[str] = []
    for group, share in zip(GROUPS, MASS_SHARES, strict=True):
        own = [old.body] if group == "body" else list(getattr(old, group))
        if group not in groups:
            continue
        if derive:
            own = [replace(link, mass=share * old.mass) for link in own]
        elif not any(link.mass for link in own):
            continue
        before, after = (links_like(own, rover, share) for rover in (old, new))
        if not derive and all(_same(a, b) for a, b in zip(before, after, strict=True)):
            continue
        if derive or _ruled(own, before, float(np.ptp(old.hubs[:, 0]))):
            links[group] = after[0] if group == "body" else tuple(after)
        else:
            kept.append(group)
    return links, kept


def _same(a: Link, b: Link) -> bool:
    """Return True if two links have the same centre and inertia."""
    return np.array_equal(a.com, b.com) and np.array_equal(a.inertia, b.inertia)


def _ruled(own: Sequence[Link], typical: Sequence[Link], length: float) -> bool:
    """Return True if links follow the rule of thumb: equal masses, its centres and inertias."""
    if len({link.mass for link in own}) > 1 or own[0].mass == 0:
        return False
    a, b = (np.array([[*k.com / length, *k.inertia.ravel() / (k.mass * length**2)] for k in some]) for some in (own, typical))
    return bool(np.allclose(a, b, rtol=DERIVED, atol=DERIVED))


def default_box(hubs: Array, pivots: Array, bogies: Array, radius: Array) -> Array:
    """Return the box (2, 3) of a body whose own is not given, m.

    It fills 60 % of the wheelbase, lies inside the linkage, and clears the axles by 1.3 radii.

    Args:
        hubs: (6, 3) m.
        pivots, bogies: (2, 3) pivots of rockers and bogies, m.
        radius: (6,) of the wheels, m.

    Returns:
        (2, 3) lowest and highest corner, m.
    """
    centre = (hubs[:, 0].max() + hubs[:, 0].min()) / 2
    half = 0.3 * np.ptp(hubs[:, 0])
    inner = 0.8 * np.abs(np.concatenate([hubs[:, 1], pivots[:, 1], bogies[:, 1]])).min()
    bottom = hubs[:, 2].max() + 1.3 * radius.max()
    top = max(pivots[:, 2].max(), bottom) + radius.max()
    return np.array([[centre - half, -inner, bottom], [centre + half, inner, top]])


def default_mass(hubs: Array) -> float:
    """Return the mass of a rover whose own is not given, kg.

    It is `DEFAULT_DENSITY` times the wheelbase cubed.

    Args:
        hubs: (6, 3) m.

    Returns:
        kg.
    """
    return float(DEFAULT_DENSITY * np.ptp(hubs[:, 0]) ** 3)


def share_masses(
    total: float, pivots: Array, bogies: Array, hubs: Array, radius: Array, width: Array, box: Array
) -> tuple[Link, list[Link], list[Link], list[Link]]:
    """Return the links of a rover of which only the total mass is known.

    The body is a solid box, rockers and bogies are thin-rod triangles, wheels are solid cylinders.

    Args:
        total: mass of the whole rover, kg.
        pivots, bogies: (2, 3) pivots of rockers and bogies, m.
        hubs: (6, 3) m.
        radius, width: (6,) of the wheels, m.
        box: (2, 3) of the body, m.

    Returns:
        Body, rockers (2), bogies (2), wheels (6).
    """
    m_body, m_rocker, m_bogie, m_wheel = (share * total for share in MASS_SHARES)
    size = box[1] - box[0]
    body = Link(m_body, box.mean(axis=0), np.diag(m_body / 12 * (size @ size - size**2)))
    rockers = [_points_link(m_rocker, pivots[s], bogies[s], hubs[s]) for s in (0, 1)]
    arms = [_points_link(m_bogie, bogies[s], hubs[2 + s], hubs[4 + s]) for s in (0, 1)]
    wheels = []
    for i in range(6):
        breadth = max(width[i], 0.2 * radius[i])  # a disc of width 0 gets the inertia of a thin cylinder
        across = m_wheel * (3 * radius[i] ** 2 + breadth**2) / 12
        wheels.append(Link(m_wheel, hubs[i].copy(), np.diag([across, m_wheel * radius[i] ** 2 / 2, across])))
    return body, rockers, arms, wheels


def _points_link(mass: float, *points: Array) -> Link:
    """Return a link whose mass is shared by its joints.

    A small isotropic part keeps its inertia from being singular.
    """
    p = np.array(points)
    r = p - p.mean(axis=0)
    inertia = mass / len(p) * sum(np.eye(3) * (v @ v) - np.outer(v, v) for v in r)
    return Link(mass, p.mean(axis=0), inertia + np.eye(3) * 1e-3 * np.trace(inertia))
