"""Drawing in a browser without a graphics card."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from support.browser import close_notes, open_page, pixel_of, wait_for

WIDTH = "() => document.querySelector('canvas[data-engine]').width"


@pytest.fixture(scope="module")
def plain_lab() -> Iterator[Any]:
    pytest.importorskip("viser", reason="viser is not installed: pip install '.[lab]'")
    from rockerbogie.lab.server import start_lab

    lab = start_lab(rb.load_rover("osr"), rb.surfaces.rocks(k=0.1, seed=3, size=4.0, spacing=0.04))
    yield lab
    lab.stop()


def test_a_browser_without_a_graphics_card_gets_light_drawing_and_a_note(browser: Any, plain_lab: Any) -> None:
    page = open_page(browser, plain_lab.url)
    session = wait_for(lambda: next(iter(plain_lab.sessions.values()), None), "a session")
    assert session.light
    assert session.terrain_panel.light.value
    assert "without a graphics card" in page.inner_text('[data-key="software"]')
    wait_for(lambda: page.locator(".mantine-Notification-root").count() == 0, "viser's own warning closed")

    close_notes(page)
    wait_for(lambda: page.evaluate(WIDTH) == page.evaluate(WIDTH.replace("width", "clientWidth")), "a sharp picture at rest")
    state = session.state
    body = np.array([state.x, state.y, float(state.pose.z) + 0.1])
    start = np.array(pixel_of(page, session, body))
    page.mouse.move(*start)
    page.mouse.down()
    turn = iter(np.linspace(0, 1000, 20001))

    def coarse() -> bool:
        angle = next(turn)
        page.mouse.move(*(start + 40 * np.array([np.sin(20 * angle), np.sin(10 * angle)])))
        return bool(page.evaluate(WIDTH) <= page.evaluate(WIDTH.replace("width", "clientWidth")) / 2 + 1)

    wait_for(coarse, "a coarse picture during a drag")
    page.mouse.up()
    wait_for(lambda: page.evaluate(WIDTH) == page.evaluate(WIDTH.replace("width", "clientWidth")), "a sharp picture after it")
    page.close()


def test_a_browser_with_a_graphics_card_keeps_full_drawing(browser: Any, plain_lab: Any) -> None:
    page = browser.new_page(viewport={"width": 500, "height": 400})
    page.add_init_script(
        "const get = WebGL2RenderingContext.prototype.getParameter;"
        "WebGL2RenderingContext.prototype.getParameter = function (name) {"
        "  return name === 0x9246 ? 'ANGLE (a graphics card)' : get.call(this, name); };"
    )
    known = set(plain_lab.sessions)
    page.goto(plain_lab.url)
    wait_for(lambda: set(plain_lab.sessions) - known, "a session")
    (number,) = set(plain_lab.sessions) - known
    assert not plain_lab.sessions[number].light
    assert page.locator('[data-key="software"]').count() == 0
    page.close()
