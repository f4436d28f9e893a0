"""Import of a rover from the trees of a robot file, with a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import RoverError
from ..model import Rover
from .import_check import check_import
from .import_numbers import Numbers
from .import_roles import Roles
from .import_search import find_roles
from .limits import check_size, check_wheelbase
from .tree import Tree

LABELS = ("found", "guessed", "repaired", "dropped", "warnings")
LINKS = ("body", "rockers", "bogies", "wheels")


@dataclass(frozen=True)
class ImportResult:
    """A rover read from a robot file, and the report of the import, line by line.

    `found`: read from the file. `guessed`: not in the file; check each. `repaired`: in the file, but not as a rover has it.
    `dropped`: in the file, but not part of a `Rover`. `warnings`: results that look wrong; check each.
    """

    rover: Rover
    found: tuple[str, ...]
    guessed: tuple[str, ...]
    repaired: tuple[str, ...]
    dropped: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        lines = [f"rover {self.rover.name!r}"]
        for label in LABELS:
            lines += [f"  {label.removesuffix('s')}: {line}" for line in getattr(self, label)]
        return "\n".join(lines)

    @property
    def mended(self) -> tuple[str, ...]:
        """Return `repaired`, by its old name."""
        return self.repaired


#: Old name of `ImportResult`.
Import = ImportResult


def build_rover(
    trees: Tree | Sequence[Tree],
    what: str,
    *,
    scale: float = 1.0,
    forward: str | None = None,
    up: str | None = None,
    joints: dict[str, Sequence[str]] | None = None,
    **override: Any,
) -> ImportResult:
    """Return the rover in the trees of a file.

    It is the first tree, largest first, that holds a rocker-bogie.

    Args:
        trees: the trees of the file.
        what: the file's name, for messages.
        scale, forward, up, joints, override: see `import_rover`.

    Returns:
        The rover and the report.

    Raises:
        RoverError: no rocker-bogie in any tree, or one whose numbers are impossible.
    """
    trees = [trees] if isinstance(trees, Tree) else list(trees)
    tree, roles, others = _choose(trees, what, joints or {}, forward, up)
    tree = roles.tree
    reader = Numbers(tree, what, roles, scale)
    hubs = reader.hubs()
    check_wheelbase(float(np.ptp(hubs[:, 0])), what)
    given: dict[str, Any] = {"name": tree.name, "source": f"imported from {what}"}
    given |= {"hubs": hubs, "bogie_pivot": reader.points(roles.bogies)}
    given["rocker_pivot"] = reader.rocker_pivot(override.get("rocker_pivot"))
    given["steers"] = [steer is not None for steer in roles.steers]
    given["steering_offset"] = reader.steering_offset(hubs)
    given["wheel_radius"], given["wheel_width"] = reader.treads(hubs, override)
    given["differential"] = reader.differential()
    given["rocker_limits"] = reader.rocker_limits(given["differential"])
    given["bogie_limits"] = reader.limits(roles.bogies, "bogies")
    given["body_box"] = reader.body_box(hubs)
    given["wheel_names"] = reader.wheel_names()
    shape = {key: value for key, value in (given | override).items() if key not in ("mass", *LINKS)}
    links = reader.links(shape, override.get("mass"))
    rover = Rover.from_pivots(**shape, **links, **{k: override[k] for k in LINKS if k in override})
    check_size(rover, what)
    if override:
        roles.found.append(f"overridden by you: {', '.join(override)}")
    dropped = [*reader.dropped(), *others]
    check_import(rover, tree, roles, override)
    return ImportResult(
        rover, tuple(roles.found), tuple(roles.guessed), tuple(roles.repaired), tuple(dropped), tuple(roles.warnings)
    )


def _choose(
    trees: list[Tree], what: str, joints: dict[str, Sequence[str]], forward: str | None, up: str | None
) -> tuple[Tree, Roles, list[str]]:
    """Return the first tree with a rocker-bogie, its roles, and the lines on the others."""
    complaint: RoverError | None = None
    rovers: list[tuple[Tree, Roles]] = []
    named = {name for names in joints.values() for name in names}
    ready = [tree for tree in trees if named <= tree.joints.keys()] or trees[:1]
    for tree in ready:
        try:
            rovers.append((tree, find_roles(tree, what, joints, forward, up)))
        except RoverError as error:
            complaint = complaint or error
    if not rovers:
        assert complaint is not None
        raise complaint
    tree, roles = rovers[0]
    if len(rovers) > 1:
        names = ", ".join(repr(other.name) for other, _ in rovers)
        roles.warnings.append(
            f"the file holds {len(rovers)} rovers ({names}): the first is read; name another's wheels to read it"
        )
    left = [other for other in trees if other is not tree]
    if not left:
        return tree, roles, []
    count, mass = sum(len(other.parts) for other in left), sum(p.mass for other in left for p in other.parts.values())
    first = [name for other in left for name in other.parts][:4]
    text = f"{count} links that no joint joins to the rover ({', '.join(first)}{', ...' * (count > 4)})"
    return tree, roles, [f"{text}, {mass:.4g} kg" if mass else text]
