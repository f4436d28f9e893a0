"""Numbers that the page shows for one pose, with their limits."""

from __future__ import annotations

import math
from html import escape
from typing import NamedTuple

import numpy as np

from ..maps.limits import Limits
from ..settling.pose import Pose
from ..settling.status import MEANING, Status
from ..statics.loads import LoadStatus, WheelLoads, wheel_loads
from ..statics.stability import Stability, stability

#: A value beyond this share of its limit counts as near it.
NEAR = 0.8
#: Level -> colour of the text. The page adds a word or a sign, so that colour is not the only difference.
COLOURS = {"": "inherit", "good": "#0a7d55", "near": "#b35900", "over": "#c0242b"}
SIGNS = {"": "", "good": "", "near": " ▲", "over": " ✕"}


class Reading(NamedTuple):
    """One number of the page: name, text with unit, and its level against its limit."""

    key: str
    label: str
    text: str
    level: str  # "", "good", "near" or "over"
    hint: str = ""


def readings(pose: Pose, limits: Limits, loads: WheelLoads, tip: Stability) -> list[Reading]:
    """Return the numbers of a pose.

    Args:
        pose: one pose, shape ().
        limits: limits of attitude, joints and clearance; joint limits of the rover count too.
        loads: contact forces of the pose.
        tip: tip margin of the pose.

    Returns:
        The readings in the order in which the page shows them.
    """
    rover = pose.rover
    angles = [("roll", pose.roll, limits.roll), ("pitch", pose.pitch, limits.pitch), ("tilt", pose.tilt, limits.tilt)]
    found = [_angle(key, key, float(value), limit) for key, value, limit in angles]
    joints = [
        ("rocker", "rocker", float(pose.rocker), limits.rocker, rover.rocker_limits),
        ("bogie_left", "bogie left", float(pose.bogie[0]), limits.bogie, rover.bogie_limits),
        ("bogie_right", "bogie right", float(pose.bogie[1]), limits.bogie, rover.bogie_limits),
    ]
    for key, label, value, limit, (low, high) in joints:
        bound = float(high if value >= 0.0 else -low)
        found.append(_angle(key, label, value, min(bound, math.inf if limit is None else limit)))
    found.append(_clearance(float(pose.clearance), limits.clearance))
    friction = float(loads.required_friction)
    text = "—" if math.isnan(friction) else "none holds it" if math.isinf(friction) else f"{friction:.3f}"
    found.append(Reading("required_friction", "friction needed", text, "over" if math.isinf(friction) else ""))
    margin = float(tip.tip_margin)
    level = "" if math.isnan(margin) else "over" if margin < math.radians(5) else "near" if margin < math.radians(15) else "good"
    found.append(Reading("tip_margin", "tip margin", _degrees(margin), level))
    return found


def measure(pose: Pose) -> tuple[WheelLoads, Stability]:
    """Compute contact forces and tip margin of a pose.

    Args:
        pose: one pose.

    Returns:
        Loads of least friction, and the tip margin.
    """
    return wheel_loads(pose), stability(pose)


def _angle(key: str, label: str, value: float, limit: float | None) -> Reading:
    """Return the reading of an angle, rad, with a symmetric limit."""
    if limit is None or not math.isfinite(limit) or math.isnan(value):
        return Reading(key, label, _degrees(value, 2), "")
    share = abs(value) / limit if limit > 0 else math.inf
    level = "over" if share >= 1.0 - 1e-9 else "near" if share >= NEAR else "good"
    return Reading(key, label, _degrees(value, 2), level, f"limit ±{math.degrees(limit):.1f}°")


def _clearance(value: float, limit: float | None) -> Reading:
    """Return the reading of the body's clearance, m."""
    text = "—" if math.isnan(value) else f"{value:.3f} m"
    least = 0.0 if limit is None else limit
    level = "" if math.isnan(value) else "over" if value <= least else "good"
    return Reading("clearance", "clearance", text, level, f"least {least:.2f} m")


def _degrees(value: float, digits: int = 1) -> str:
    """Return an angle in degrees as text."""
    return "—" if math.isnan(value) else f"{round(math.degrees(value), digits) + 0.0:.{digits}f}°"


def status_line(pose: Pose) -> tuple[str, str, str]:
    """Return status, meaning and level of a pose.

    Args:
        pose: one pose.

    Returns:
        Name of the status, its meaning, and the level of its colour.
    """
    status = Status(int(pose.status))
    level = "good" if status == Status.CONVERGED else "over" if np.isnan(float(pose.z)) else "near"
    return status.name, MEANING[status][0], level


def readings_html(pose: Pose, numbers: list[Reading]) -> str:
    """Return the numbers as HTML.

    Args:
        pose: one pose.
        numbers: from `readings`.

    Returns:
        A status line and a grid of numbers; each number has the attribute `data-key`.
    """
    name, meaning, level = status_line(pose)
    cells = "".join(
        f'<div title="{escape(r.hint)}" style="display:flex;justify-content:space-between;gap:6px">'
        f'<span style="opacity:.65">{escape(r.label)}</span>'
        f'<b data-key="{r.key}" style="color:{COLOURS[r.level]};font-variant-numeric:tabular-nums;white-space:nowrap">'
        f"{escape(r.text)}{SIGNS[r.level]}</b></div>"
        for r in numbers
    )
    return (
        f'<div style="padding:0 1.2em .5em .8em;font-size:13px;line-height:1.45">'
        f'<div style="margin-bottom:4px"><b data-key="status" style="color:{COLOURS[level]}">{name}</b>'
        f'<span style="opacity:.65"> {escape(meaning)}</span></div>'
        f'<div style="display:grid;grid-template-columns:1fr 1fr;column-gap:14px">{cells}</div></div>'
    )


def wheels_html(pose: Pose, loads: WheelLoads) -> str:
    """Return the table of wheels as HTML.

    Args:
        pose: one pose.
        loads: its contact forces.

    Returns:
        A table: wheel, contact angle, gap, normal force, its share of the weight, friction used, axle torque.
    """
    held = int(loads.status) == LoadStatus.BALANCED
    weight = pose.rover.mass * pose.gravity
    rows = []
    for i, name in enumerate(pose.rover.wheel_names):
        lifted = bool(pose.contact_count[i] == 0) or np.isnan(float(pose.z))
        cells = [name, "off" if lifted else _degrees(float(pose.contact_angle[i]))]
        if held and not lifted:
            normal = float(loads.normal[i])
            used = float(loads.friction_used[i])
            cells += [
                f"{normal:.0f} N", f"{100 * normal / weight:.0f} %", "—" if math.isnan(used) else f"{used:.2f}",
                f"{round(float(loads.torque[i]), 1) + 0.0:+.1f}",
            ]  # fmt: skip
        else:
            cells += ["—"] * 4
        rows.append("<tr>" + "".join(f'<td style="text-align:right;padding:1px 4px">{escape(c)}</td>' for c in cells) + "</tr>")
    heads = ("wheel", "contact", "normal", "share", "friction", "N·m")
    head = "".join(f'<th style="text-align:right;padding:1px 4px;font-weight:500;opacity:.65">{h}</th>' for h in heads)
    return (
        '<div style="padding:0 .4em;overflow-x:auto"><table data-key="wheels" style="font-size:12px;width:100%;'
        f'border-collapse:collapse;font-variant-numeric:tabular-nums"><tr>{head}</tr>{"".join(rows)}</table></div>'
    )
