"""The wheel loads of one pose: force arrows on the rover, and their numbers."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..settling.pose import Pose
from ..statics.force_vectors import force_vectors
from ..statics.loads import LoadStatus, WheelLoads
from ..statics.stability import Stability
from .closeup import draw_pose, numbers_beside
from .style import ALARM, FORCE, INK, LEFT, RIGHT, figure, look

#: Length of the arrow of a force of a sixth of the weight, in wheelbases.
_ARROW = 0.22
_LINE = 0.039  # height of a line of numbers
#: Heads of the columns, and where they begin (the first) or end.
_COLUMNS = (
    ("wheel", 0.0), ("normal\nN", 0.29), ("traction\nN", 0.49), ("side\nN", 0.66), ("friction\nused", 0.84), ("torque\nN·m", 1.03)
)  # fmt: skip


def loads_figure(pose: Pose, loads: WheelLoads, tip: Stability, gravity: float) -> Figure:
    """Draw the contact forces of one pose as arrows on the rover, with their numbers.

    Args:
        pose: one pose, shape ().
        loads: its contact forces.
        tip: its tip margin.
        gravity: m/s².

    Returns:
        The figure. An arrow begins at its contact; a sixth of the weight is 0.22 wheelbases long.
    """
    rover, sixth = pose.rover, pose.rover.mass * gravity / 6.0
    scale = _ARROW * rover.wheelbase / sixth
    with look():
        fig = figure(11.4, 6.6)
        title = f"{rover.name} on {pose.terrain.name}: loads at {gravity:.3g} m/s²"
        note = f" · arrows: forces on the wheels, {sixth:.4g} N is {_ARROW * rover.wheelbase:.2g} m long"
        ax, camera = draw_pose(fig, rover, pose.terrain, pose.to_xarray(), title, note=note)
        for point, force in zip(pose.contact_point, force_vectors(pose, loads), strict=True):
            if np.linalg.norm(force) > 1e-3 * sixth:
                begin, end = camera.project(np.array([point, point + scale * force]))[:, :2]
                ax.annotate(
                    "", end, begin, zorder=8,
                    arrowprops={"arrowstyle": "-|>", "color": FORCE, "lw": 2.0, "shrinkA": 0, "shrinkB": 0},
                )  # fmt: skip
        _write_numbers(numbers_beside(fig), pose, loads, tip)
    return fig


def _write_numbers(ax: Axes, pose: Pose, loads: WheelLoads, tip: Stability) -> None:
    """Write friction, tip margin and forces beside the picture."""
    status, margin = LoadStatus(int(loads.status)), float(tip.tip_margin)
    held = status == LoadStatus.BALANCED
    rows = [
        ("law", loads.law.replace("_", " ")),
        ("tilt", f"{np.degrees(float(pose.tilt)):.2f}°"),
        ("required friction", f"{float(loads.required_friction):.3f}" if held else "–"),
        ("largest torque", f"{np.abs(loads.torque).max():.3g} N·m" if held else "–"),
        ("tip margin", "–" if np.isnan(margin) else f"{np.degrees(margin):.1f}°"),
        ("tips over", ("sliding" if tip.slides else str(tip.edge)) or "–"),
    ]
    if held and float(loads.belly) > 0.0:
        rows.append(("under the body", f"{float(loads.belly):.4g} N"))
    y = 0.985
    for name, value in rows:
        ax.text(0.0, y, name, color="#555555")
        ax.text(0.5, y, value, fontweight="bold" if name == "required friction" else "normal")
        y -= _LINE
    y -= 1.1 * _LINE
    for head, x in _COLUMNS:
        ax.text(x, y, head, ha="left" if x == 0.0 else "right", color="#555555", fontsize=8, va="baseline")
    ax.plot([0, 1.03], [y - 0.35 * _LINE] * 2, color="#bbbbbb", lw=0.8, clip_on=False)
    for i, name in enumerate(pose.rover.wheel_names):
        y -= _LINE
        cells = [name] + ["–"] * 5
        if held:
            used, forces = float(loads.friction_used[i]), (loads.normal[i], loads.traction[i], loads.side[i])
            parts = [f"{force:.0f}" if abs(force) >= 100 else f"{force:.1f}" for force in forces]
            cells = [name, *parts, "–" if np.isnan(used) else f"{used:.3f}", f"{loads.torque[i]:.2f}"]
        for cell, (_, x) in zip(cells, _COLUMNS, strict=True):
            ax.text(x, y, cell, ha="left" if x == 0.0 else "right", color=INK if x else (LEFT, RIGHT)[i % 2])
    y -= 1.6 * _LINE
    ax.text(0.0, y, status.name, fontweight="bold", color="#00704f" if held else ALARM)
