"""Chart of a drive's loads: required friction, motor torques and tip margin along the path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .style import COLOURS, LEFT, RIGHT, figure, look

if TYPE_CHECKING:
    import xarray as xr


def loads_chart(run: xr.Dataset) -> Figure:
    """Draw required friction, motor torques and tip margin along the path.

    Args:
        run: from `drive` with `loads=True`.

    Returns:
        Figure of three charts.
    """
    s = run["distance"].to_numpy()
    with look():
        fig = figure(9.0, 8.0)
        friction, torque, tip = fig.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [2, 3, 2]})
        fig.suptitle(f"{run.attrs['rover']} on {run.attrs['terrain']}: loads at {run.attrs['gravity']:.3g} m/s²")
        friction.plot(s, run["required_friction"], color=COLOURS["tilt"])
        friction.set_ylabel("required friction (1)")
        friction.set_ylim(bottom=0.0)
        for i, name in enumerate(run["wheel"].to_numpy()):
            line = ("-", "--", ":")[i // 2]
            torque.plot(s, run["axle_torque"].isel(wheel=i), line, color=(LEFT, RIGHT)[i % 2], lw=1.2, label=str(name))
        torque.set_ylabel("motor torque (N·m)")
        torque.legend(loc="lower left", bbox_to_anchor=(0, 0.98), ncols=6, fontsize=8.5, borderaxespad=0.1)
        tip.plot(s, np.degrees(run["tip_margin"]), color=COLOURS["roll"])
        tip.set_ylabel("tip margin (°)")
        tip.set_ylim(bottom=0.0)
        tip.set_xlabel("distance along the path (m)")
        tip.set_xlim(s[0], s[-1])
        fig.align_ylabels((friction, torque, tip))
    return fig
