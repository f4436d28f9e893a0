"""Box about the body's own shapes, and the rule for bodies whose meshes are not read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import Array
from .import_roles import Roles
from .tree import Shape, Tree

#: A box shorter than this share of the wheelbase is a part of the body, not the body.
SHORT = 0.25


def body_box(tree: Tree, roles: Roles, links: Sequence[str], rest: dict[str, Array], scale: float, hubs: Array) -> Array | None:
    """Return the box about the body's shapes.

    Of each link it takes the colliding shapes, or the visible ones if none collide.

    Args:
        tree: the tree.
        roles: its roles; gets the lines of the report.
        links: the body's links.
        rest: T_root_link of every link.
        scale: metres in the file's unit.
        hubs: (6, 3) wheel centres, m.

    Returns:
        (2, 3) lowest and highest corner in the rover's frame, m; None if no shape has a known size, if a colliding mesh of the
        body is not read, or if a visible one is not and the box of the others is too short to be the body.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    blind: list[str] = []  # colliding meshes that are not read
    unseen: list[str] = []  # visible ones, on links where nothing collides
    kinds = set()
    for link in links:
        shapes = _counted(tree.parts[link].shapes)
        for shape in shapes:
            if shape.unread:
                (blind if shape.collides else unseen).append(link)
                continue
            ends = np.array([shape.extent(axis, rest[link]) for axis in roles.axes.T]) * scale
            low, high = np.minimum(low, ends[:, 0]), np.maximum(high, ends[:, 1])
            kinds.add(f"{'colliding' if shape.collides else 'visible'} {shape.kind}")
    known = bool((low < high).all())
    short = known and high[0] - low[0] < SHORT * float(np.ptp(hubs[:, 0]))
    if blind or (unseen and (short or not known)):
        names = ", ".join(dict.fromkeys([*blind, *unseen]))
        why = "; ".join(tree.unread[:3]) or "meshes are read from files beside the robot file"
        roles.warnings.append(
            f"body_box: meshes of {names} are not read ({why}); a box is put between the wheels: "
            "clearance is a guess, give body_box= in metres"
        )
        roles.guessed.append("body_box: a box between the wheels, as meshes of the body are not read")
        return None
    if not known:
        roles.guessed.append("body_box: the body has no shape of a known size; one is put between the wheels")
        return None
    if unseen:
        roles.warnings.append(f"body_box leaves out visible meshes that are not read: {', '.join(dict.fromkeys(unseen))}")
    if short:
        roles.warnings.append(f"body_box is only {high[0] - low[0]:.3g} m long: does the file leave out the body's own shape?")
    roles.found.append(f"body_box from {', '.join(sorted(kinds))} shapes")
    return np.array([low, high])


def _counted(shapes: Sequence[Shape]) -> list[Shape]:
    """Return a link's shapes that bound it: those that collide, or else the visible ones."""
    colliding = [shape for shape in shapes if shape.collides]
    return [shape for shape in colliding or shapes if shape.kind == "mesh" or min(shape.size) > 0]
