"""The page in headless Chromium: numbers, dragging, sizes, runs, uploads, visitors."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[lab]'")

import rockerbogie as rb
from support.browser import PATIENCE, close_notes, drag, open_page, pixel_of, press, text_of, wait_for
from support.lab_page import at_rest, check_numbers

ROVER = rb.load_rover("osr")
TERRAIN = rb.surfaces.rocks(k=0.1, seed=3, size=4.0, spacing=0.04)


def test_the_page_shows_the_settled_rover(page: Any, session: Any) -> None:
    assert "Drag the rover" in page.inner_text('[data-key="hint"]')
    check_numbers(page, session)
    state = session.state
    body = session.rover_view.frames[0]
    assert np.allclose(
        np.asarray(body.position) + session.terrain_view.offset, (state.x, state.y, float(state.pose.z)), atol=1e-6
    )
    assert page.outside == []


def test_a_drag_moves_the_rover_and_the_numbers_are_those_of_settle(page: Any, session: Any) -> None:
    body = (session.state.x, session.state.y, float(session.state.pose.z) + 0.2)
    start = pixel_of(page, session, body)
    goal = pixel_of(page, session, np.array(body) + (0.3, 0.25, 0.0))
    drag(page, start, goal)
    state, end = session.state, pytest.approx((0.3, 0.25), abs=0.12)
    wait_for(lambda: at_rest(session) and (state.x, state.y) == end, "the rover at the end of the drag")
    check_numbers(page, session)
    assert (state.x, state.y) == end
    assert state.yaw == 0.0


def test_a_drag_of_the_ring_turns_the_rover(page: Any, session: Any) -> None:
    from rockerbogie.lab.rover_view import ring_mesh

    state = session.state
    before = (state.x, state.y)
    ring = ring_mesh(state.rover)[0]
    side = ring[18:20].mean(axis=0) * (1.04, 1.04, 1.0)  # the left of the ring
    T = state.pose.T_world_body
    start = T[:3, :3] @ side + T[:3, 3]
    turn = rb.body_transform(0, 0, 0, 0, 0, 0.5)[:3, :3]
    goal = turn @ (start - T[:3, 3]) + T[:3, 3]
    drag(page, pixel_of(page, session, start), pixel_of(page, session, goal))
    end = pytest.approx(0.5, abs=0.15)
    wait_for(lambda: at_rest(session) and state.yaw == end, "the rover at the end of the drag")
    check_numbers(page, session)
    assert state.yaw == end
    assert (state.x, state.y) == pytest.approx(before, abs=1e-9)


def test_typed_positions_and_keys_move_the_rover(page: Any, session: Any) -> None:
    field = page.get_by_label("x [m]", exact=True)
    field.fill("-0.2")
    field.press("Enter")
    wait_for(lambda: session.state.x == pytest.approx(-0.2, abs=1e-9), "the typed x")
    field.blur()
    yaw = session.state.yaw
    page.keyboard.press("j")
    wait_for(lambda: session.state.yaw == pytest.approx(yaw + 0.05, abs=1e-6), "one press turns by 0.05 rad")
    check_numbers(page, session)


def test_a_slider_changes_the_rover(page: Any, session: Any) -> None:
    page.get_by_role("tab", name="Rover").click()
    own = float(session.state.rover.wheel_radius[0])
    radius = next(slider for slider in session.rover_panel.sliders.values() if slider.value == pytest.approx(own))
    slider = page.get_by_role("slider").first
    slider.focus()
    for presses in range(1, 5):
        slider.press("ArrowRight")
        larger = pytest.approx(own + presses * radius.step)
        wait_for(lambda larger=larger: session.state.rover.wheel_radius[0] == larger, "larger wheels")
    check_numbers(page, session)
    with page.expect_download() as download:
        press(page, "Save as TOML")
    saved = rb.load_rover(download.value.path().rename(Path(download.value.path()).with_suffix(".toml")))
    assert saved.name == "osr-changed"
    assert saved.source.endswith("changed in the lab")
    assert np.allclose(saved.wheel_radius, session.state.rover.wheel_radius)
    press(page, "Back to the original sizes")
    wait_for(lambda: session.state.rover.wheel_radius[0] == own, "the original wheels")


def test_an_uploaded_rover_and_a_broken_file(page: Any, session: Any, tmp_path: Path) -> None:
    page.get_by_role("tab", name="Rover").click()
    good, bad = tmp_path / "mine.urdf", tmp_path / "bad.toml"
    good.write_text(rb.to_urdf(rb.load_rover("sawppy")))
    bad.write_text("[wheel]\nradius = -1\n")
    own = session.state.rover
    with page.expect_file_chooser() as chooser:
        press(page, "Upload TOML")
    chooser.value.set_files(bad)
    page.wait_for_selector("text=That did not work")
    assert session.state.rover is own
    assert str(tmp_path) not in page.content()
    close_notes(page)
    with page.expect_file_chooser() as chooser:
        press(page, "Upload TOML")
    chooser.value.set_files(good)
    wait_for(lambda: session.state.rover is not own, "the uploaded rover")
    assert np.allclose(session.state.rover.hubs, rb.load_rover("sawppy").hubs, atol=1e-6)
    check_numbers(page, session)


def test_an_uploaded_geotiff_becomes_the_terrain(page: Any, session: Any, tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    from rasterio.transform import from_origin

    file, broken = tmp_path / "yard.tif", tmp_path / "broken.tif"
    z = np.add.outer(np.linspace(1.5, 0, 60), np.linspace(0, 0.7, 70)).astype("float32")
    profile = {"driver": "GTiff", "height": 60, "width": 70, "count": 1, "dtype": "float32", "crs": "EPSG:32633"}
    with rasterio.open(file, "w", transform=from_origin(500000, 4000000, 0.1, 0.1), **profile) as raster:
        raster.write(z, 1)
    broken.write_bytes(file.read_bytes()[:300])
    page.get_by_role("tab", name="Terrain").click()
    own = session.state.terrain
    for name in (broken, file):
        with page.expect_file_chooser() as chooser:
            press(page, "Upload a GeoTIFF")
        chooser.value.set_files(name)
        if name is broken:
            page.wait_for_selector("text=That did not work")
            assert session.state.terrain is own
            close_notes(page)
    wait_for(lambda: session.state.terrain.name == "yard", "the uploaded terrain")
    assert session.state.terrain.crs is not None
    wait_for(lambda: session.state.x == pytest.approx(500003.5, abs=0.2), "the rover at the centre of the map")
    check_numbers(page, session)


def test_a_run_plays_and_scrubs(page: Any, session: Any) -> None:
    page.get_by_role("tab", name="Drive").click()
    session.later(lambda: session.terrain_panel.use(TERRAIN))
    session.later(lambda: session.rover_panel.use(ROVER))
    wait_for(lambda: session.state.rover is ROVER and at_rest(session), "the first rover")
    panel = session.drive_panel
    panel.click.value = "adds to the path"
    for count, pixel in enumerate(((120, 240), (240, 260)), 1):
        page.mouse.click(*pixel)
        wait_for(lambda count=count: len(panel.points) == count, "a point of the path")
    xmin, ymin, xmax, ymax = TERRAIN.bounds
    assert all(xmin <= x <= xmax and ymin <= y <= ymax for x, y in panel.points)
    press(page, "Drive the path")
    wait_for(lambda: panel.run is not None and panel.time > 0.2, "the run plays")
    session.later(lambda: panel.play(False))  # a browser that draws on the processor is slow while the run plays
    page.wait_for_selector('[data-key="charts"] svg')
    run = panel.run.run
    slider = page.get_by_role("slider").nth(1)
    slider.focus()
    for key, index in (("End", -1), ("Home", 0)):
        slider.press(key)
        angle = math.degrees(float(run["roll"][index]))
        roll = f"{round(angle, 2) + 0.0:.2f}°"
        wait_for(lambda key=key: panel.time == pytest.approx(panel.run.duration if key == "End" else 0.0, abs=0.02), key)
        wait_for(lambda roll=roll: text_of(page, "roll") == roll, f"roll {roll} of the run")
    assert not panel.playing


def test_a_frame_does_not_undo_what_the_visitor_chose(page: Any, session: Any) -> None:
    panel, fields = session.drive_panel, session.pose_panel
    if panel.run is None:
        pytest.skip("no run: the test before failed")
    for choose_value, key, control in (
        (lambda: page.get_by_role("slider").nth(1).press("End"), "scrub", panel.scrub),
        (lambda: page.get_by_label("x [m]").fill("0.25"), ("typed", 0), fields.x),
    ):
        if control is fields.x:
            page.get_by_role("tab", name="Pose").click()
        began, busy = threading.Event(), threading.Event()
        before = control.value
        session.later(lambda began=began, busy=busy: (began.set(), busy.wait()))  # a long frame
        try:
            assert began.wait(PATIENCE), "the session takes no job"  # else it may take the choice together with this one
            choose_value()
            wait_for(lambda key=key: key in session._jobs, "the visitor's choice")
            control.value = before  # as the frame writes it, which began earlier
        finally:
            busy.set()
        if control is panel.scrub:
            wait_for(lambda: panel.time == pytest.approx(panel.run.duration, abs=0.02), "the chosen time")
        else:
            wait_for(lambda: session.state.x == pytest.approx(0.25, abs=1e-9), "the chosen x")


def test_visitors_do_not_disturb_each_other_and_leave_nothing(browser: Any, page: Any, session: Any, lab: Any) -> None:
    session.later(session.drive_panel.clear)
    wait_for(lambda: session.drive_panel.run is None and at_rest(session), "no run")
    place = (session.state.x, session.state.y)
    second = open_page(browser, lab.url)
    wait_for(lambda: len(lab.sessions) == 2, "a second session")
    other = next(s for s in lab.sessions.values() if s is not session)
    other.later(lambda: other.state.move(0.5, 0.5, 1.0))
    other.later(lambda: setattr(other.state, "mode", "equilibrium"))
    wait_for(lambda: other.state.mode == "equilibrium", "the other's mode")
    assert (session.state.x, session.state.y) == place
    assert session.state.mode == "contact"
    second.close()
    wait_for(lambda: len(lab.sessions) == 1, "the closed tab is forgotten")
    other.join(PATIENCE)
    assert not other._thread.is_alive()
