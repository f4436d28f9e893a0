"""Comparison of the page's numbers with `settle`, and the state of its scene."""

from __future__ import annotations

import math
from typing import Any

import rockerbogie as rb
from support.browser import text_of, wait_for


def at_rest(session: Any) -> bool:
    """Return True if the session has finished all its jobs and frames."""
    idle = bool(session._wake._waiters)
    return idle and session.state.target is None and not session._jobs and not session._moving()


def shown(pose: rb.Pose) -> dict[str, str]:
    """Return the texts that the page must show for a pose."""
    angles = {
        "roll": pose.roll,
        "pitch": pose.pitch,
        "rocker": pose.rocker,
        "bogie_left": pose.bogie[0],
        "bogie_right": pose.bogie[1],
    }
    texts = {key: f"{round(math.degrees(float(value)), 2) + 0.0:.2f}°" for key, value in angles.items()}
    return texts | {"clearance": f"{float(pose.clearance):.3f} m", "status": rb.Status(int(pose.status)).name}


def check_numbers(page: Any, session: Any) -> None:
    """Compare the numbers in the page with `settle` at the position of the state."""
    state, differences = session.state, {}

    def equal() -> bool:
        expected = shown(rb.settle(state.rover, state.terrain, state.x, state.y, state.yaw, mode=state.mode))
        found = {key: (text_of(page, key), text) for key, text in expected.items()}
        differences.clear()
        differences.update({key: texts for key, texts in found.items() if texts[0] != texts[1]})
        return not differences and at_rest(session)

    wait_for(equal, "the numbers of settle in the page", differences)


def visible(page: Any, node: str) -> bool:
    """Return True if the browser draws a node of the scene."""
    script = "name => { const o = window.__viserMutable.nodeRefFromName[name]; return Boolean(o && o.visible) }"
    return bool(page.evaluate(script, node))
