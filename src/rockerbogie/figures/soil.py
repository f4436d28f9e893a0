"""Chart of a wheel in soil: drawbar, torque and sinkage against slip."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..terrain.soil.forces import wheel_soil_forces
from ..terrain.soil.laws import Grousers, WheelLaw
from .style import figure, look

#: Slips of the curves.
SLIPS = np.linspace(-1.0, 1.0, 201)
#: Line colours of the slip angles.
_COLOURS = ("#222222", "#0072B2", "#D55E00", "#009E73")


def soil_chart(
    soil: WheelLaw,
    radius: float,
    width: float,
    load: float,
    *,
    gravity: float,
    grousers: Grousers | float | None = None,
    slip_angles: tuple[float, ...] = (0.0, np.radians(15.0), np.radians(30.0)),
    title: str = "",
) -> Figure:
    """Draw drawbar, side force, torque and sinkage of a wheel against slip.

    Args:
        soil: a law.
        radius: m.
        width: m.
        load: N.
        gravity: m/s².
        grousers: their height, m, or their measures.
        slip_angles: one curve each, rad; at most 4 are drawn.
        title: text above.

    Returns:
        Figure of four charts: drawbar and side force as shares of the load, torque in N·m, sinkage in mm. Curves have gaps where
        the soil cannot carry the load.
    """
    with look():
        fig = figure(9.0, 7.0)
        axes = fig.subplots(2, 2, sharex=True)
        panels = (("drawbar", "drawbar / load", load), ("side", "side force / load", load), ("torque", "torque (N·m)", 1.0),
                  ("sinkage", "sinkage (mm)", 1e-3))  # fmt: skip
        for angle, colour in zip(slip_angles, _COLOURS, strict=False):
            forces = wheel_soil_forces(soil, radius, width, load, SLIPS, angle, gravity=gravity, grousers=grousers)
            for axis, (name, label, scale) in zip(axes.flat, panels, strict=True):
                axis.plot(SLIPS, getattr(forces, name) / scale, color=colour, label=f"slip angle {np.degrees(angle):.0f}°")
                axis.set_ylabel(label)
        axes[1, 1].invert_yaxis()
        axes[0, 0].legend(fontsize=8.5)
        for axis in axes[1]:
            axis.set_xlabel("slip")
            axis.set_xlim(-1.0, 1.0)
        if title:
            fig.suptitle(title)
    return fig
