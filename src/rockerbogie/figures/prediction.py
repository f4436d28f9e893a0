"""Chart of a predicted drive: its track beside the commanded one, slip, torque and energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .style import COLOURS, INK, LEFT, RIGHT, figure, look

if TYPE_CHECKING:
    import xarray as xr

LINES = ("-", "--", ":")
ENERGIES = (
    ("motor_work", "work of the motors", INK),
    ("height_gain", "gain of height", LEFT),
    ("dissipation", "dissipation", RIGHT),
)


def prediction_chart(run: xr.Dataset) -> Figure:
    """Draw predicted and commanded track, slip, slip angle, torque and energy.

    Args:
        run: one drive of `predict`.

    Returns:
        Figure of five charts.
    """
    s = run["distance"].to_numpy()
    with look():
        fig = figure(9.0, 11.0)
        track, slip, side, torque, energy = fig.subplots(5, 1, gridspec_kw={"height_ratios": [3, 2, 2, 2, 2]})
        fig.suptitle(f"{run.attrs['rover']} on {run.attrs['terrain']}: predicted drive, {run.attrs['law']}")
        _track(track, run)
        for ax, name, label, scale in (
            (slip, "slip_ratio", "slip ratio (%)", 100.0),
            (side, "slip_angle", "slip angle (°)", 180.0 / np.pi),
            (torque, "wheel_torque", "motor torque (N·m)", 1.0),
        ):
            for i, wheel in enumerate(run["wheel"].to_numpy()):
                values = scale * run[name].isel(wheel=i).to_numpy()
                ax.plot(s, values, LINES[i // 2], color=(LEFT, RIGHT)[i % 2], lw=1.2, label=str(wheel))
            ax.set_ylabel(label)
        slip.legend(loc="lower left", bbox_to_anchor=(0, 0.98), ncols=6, fontsize=8.5, borderaxespad=0.1)
        for name, label in (
            ("motor_work", "work of the motors"),
            ("height_gain", "gain of height"),
            ("dissipation", "dissipation"),
        ):
            energy.plot(s, run[name], color={"motor_work": INK, "height_gain": LEFT, "dissipation": RIGHT}[name], label=label)
        energy.set_ylabel("energy (J)")
        energy.legend(loc="lower left", bbox_to_anchor=(0, 0.98), ncols=3, fontsize=8.5, borderaxespad=0.1)
        energy.set_xlabel("distance (m)")
        for ax in (slip, side, torque, energy):
            ax.set_xlim(s[0], max(s[-1], s[0] + 1e-9))
        fig.align_ylabels((slip, side, torque, energy))
    return fig


def _track(ax: Axes, run: xr.Dataset) -> None:
    """Draw the predicted and the commanded track from above."""
    if "x_command" in run:
        ax.plot(run["x_command"], run["y_command"], color="#999999", lw=3.0, label="commanded")
    ax.plot(run["x"], run["y"], color=COLOURS["tilt"], label="predicted")
    x, y, yaw = (run[name].to_numpy() for name in ("x", "y", "yaw"))
    some = np.unique(np.linspace(0, len(x) - 1, 12).astype(int))
    ax.quiver(x[some], y[some], np.cos(yaw[some]), np.sin(yaw[some]), color=RIGHT, width=0.004, scale=25, label="heading")
    ax.plot(x[-1], y[-1], "s", mfc="white", mec=INK, ms=7, label=f"end: {run.attrs['ends_because']}")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("x (m)")
    ax.set_ylabel("y (m)")
    ax.legend(loc="lower left", bbox_to_anchor=(0, 0.98), ncols=4, fontsize=8.5, borderaxespad=0.1)
