"""A page in headless Chromium, with its lab and its session."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import rockerbogie as rb
from support.browser import chromium, close_notes, open_page, wait_for


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as one:
        yield one


@pytest.fixture(scope="module")
def lab() -> Iterator[Any]:
    pytest.importorskip("viser", reason="viser is not installed: pip install '.[lab]'")
    from rockerbogie.lab.server import start_lab

    terrain = rb.surfaces.rocks(k=0.1, seed=3, size=4.0, spacing=0.04)
    lab = start_lab(rb.load_rover("osr"), terrain, light=True)
    yield lab
    lab.stop()


@pytest.fixture(scope="module")
def page(browser: Any, lab: Any) -> Any:
    page = open_page(browser, lab.url)
    wait_for(lambda: lab.sessions, "a session")
    return page


@pytest.fixture
def session(page: Any, lab: Any) -> Any:
    close_notes(page)
    return next(iter(lab.sessions.values()))
