"""Headless Chromium for the tests of the page."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .patience import PATIENCE

CHROMIUM = "/usr/bin/chromium"
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader",
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1 , EXCLUDE localhost",
]  # fmt: skip


@contextmanager
def chromium() -> Iterator[Any]:
    """Start a browser, or skip the test with the reason."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install '.[dev]'")
    if not Path(CHROMIUM).exists():
        pytest.skip(f"no {CHROMIUM}: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, headless=True, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


def open_page(browser: Any, url: str, size: tuple[int, int] = (760, 400)) -> Any:
    """Open the page and wait for its numbers."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(1000 * PATIENCE)
    page.outside = []  # requests to other addresses
    page.on(
        "request", lambda request: None if request.url.startswith((url, "data:", "blob:")) else page.outside.append(request.url)
    )
    page.goto(url)
    page.wait_for_selector('[data-key="roll"]', state="attached")
    return page


def close_notes(page: Any) -> None:
    """Close all messages in the page."""
    page.eval_on_selector_all(".mantine-Notification-closeButton", "buttons => buttons.forEach(b => b.click())")


def wait_for(condition: Callable[[], Any], what: str, state: object = "") -> Any:
    """Wait until a condition is true; return its value. A failure shows `state`."""
    end = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert time.monotonic() < end, f"not within {PATIENCE:.0f} s: {what} {state}"
        time.sleep(0.05)
    return value


def text_of(page: Any, key: str) -> str:
    """Return the text of a number in the page."""
    return str(page.inner_text(f'[data-key="{key}"]')).rstrip(" ▲✕")


def pixel_of(page: Any, session: Any, point: Any) -> tuple[float, float]:
    """Return the position in the page at which a point of the world is drawn."""
    from scipy.spatial.transform import Rotation

    camera = session.client.camera
    turn = Rotation.from_quat(np.roll(camera.wxyz, -1))  # of the camera: z forward, y down
    away = turn.inv().apply(np.asarray(point) - session.terrain_view.offset - np.asarray(camera.position))
    width, height = page.evaluate("() => { const c = document.querySelector('canvas'); return [c.clientWidth, c.clientHeight]; }")
    unit = height / 2 / np.tan(camera.fov / 2)
    return width / 2 + unit * away[0] / away[2], height / 2 + unit * away[1] / away[2]


def press(page: Any, name: str) -> None:
    """Press a button as soon as it is enabled, without the pointer.

    The pointer of playwright would wait for the browser to draw.
    """
    button = page.get_by_role("button", name=name)
    wait_for(button.is_enabled, f"the button {name!r} enabled")
    button.dispatch_event("click")


def drag(page: Any, start: tuple[float, float], end: tuple[float, float], steps: int = 6) -> None:
    """Press at a pixel, move to another one, and release."""
    page.mouse.move(*start)
    page.mouse.down()
    for share in np.linspace(0, 1, steps + 1)[1:]:
        page.mouse.move(*(np.array(start) + share * (np.array(end) - start)))
    page.mouse.up()


def choose(page: Any, label: str, option: str) -> None:
    """Choose an option of a drop-down list."""
    page.get_by_label(label, exact=True).first.click()
    page.get_by_role("option", name=option, exact=True).first.click()
