"""The page's tabs in headless Chromium: sizes, maps, routes, simulation, keys, phones."""

from __future__ import annotations

import math
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[lab]'")

import rockerbogie as rb
from support.browser import PATIENCE, choose, close_notes, open_page, pixel_of, press, text_of, wait_for
from support.lab_page import at_rest, check_numbers, visible

ROVER = rb.load_rover("osr")
TERRAIN = rb.surfaces.rocks(k=0.1, seed=3, size=4.0, spacing=0.04)


def tab(page: Any, name: str) -> None:
    page.get_by_role("tab", name=name).click()


def step(page: Any, label: str, key: str, times: int) -> None:
    """Move a slider by its keys."""
    slider = page.get_by_label(label, exact=True).first
    slider = slider if slider.get_attribute("role") == "slider" else slider.get_by_role("slider")
    slider.focus()
    for _ in range(times):
        slider.press(key)


def test_equilibrium_mode_shows_the_equilibrium_of_settle(page: Any, session: Any) -> None:
    tab(page, "Pose")
    choose(page, "mode", "equilibrium")
    wait_for(lambda: session.state.mode == "equilibrium", "the mode")
    session.later(lambda: session.state.move(0.35, -0.2, 0.4))
    session.later(session.redraw)
    check_numbers(page, session)

    def total() -> float:
        return sum(float(value) for value in re.findall(r"(\d+) %", page.inner_text('[data-key="wheels"]')))

    wait_for(lambda: total() == pytest.approx(100.0, abs=4.0), "normal forces that carry the weight")
    choose(page, "mode", "contact")
    check_numbers(page, session)


def test_arrows_appear_and_disappear(page: Any, session: Any) -> None:
    tab(page, "Pose")
    for kind, on in (("points", True), ("normals", False), ("forces", True)):
        wait_for(lambda kind=kind, on=on: visible(page, f"/contacts/{kind}") is on, f"{kind} at first")
        page.get_by_label(f"show {kind}").click()
        wait_for(lambda kind=kind, on=on: visible(page, f"/contacts/{kind}") is not on, f"{kind} changed")
        page.get_by_label(f"show {kind}").click()
        wait_for(lambda kind=kind, on=on: visible(page, f"/contacts/{kind}") is on, f"{kind} as before")


def test_constants_of_the_paper_are_sliders(page: Any, session: Any) -> None:
    tab(page, "Rover")
    choose(page, "rover", "elhami-dashti")
    wait_for(lambda: session.state.rover.name == "elhami-dashti" and at_rest(session), "the rover of the paper")
    choose(page, "sizes by", "K1 to K11 of the paper")
    wait_for(lambda: "K11" in session.rover_panel.sliders and at_rest(session), "sliders of K1 to K11")
    before = session.state.rover.to_dh()
    slider = session.rover_panel.sliders["K6"]
    page.wait_for_selector("text=K11")
    page.locator(f'[id="{slider._impl.uuid}"]').get_by_role("slider").focus()
    for presses in (1, 2):
        page.keyboard.press("ArrowRight")
        longer = round(before["K6"], 3) + presses * slider.step
        wait_for(lambda k6=longer: session.state.rover.to_dh()["K6"] == pytest.approx(k6, abs=1e-9), "a longer K6")
    assert float(slider.value) == pytest.approx(longer, abs=1e-9), "the number shown is the number used"
    check_numbers(page, session)
    after = session.state.rover.to_dh()
    assert all(after[key] == pytest.approx(before[key], abs=1e-12) for key in before if key != "K6")
    choose(page, "rover", "osr")
    wait_for(lambda: session.state.rover.name == ROVER.name and at_rest(session), "the first rover")


def test_a_surface_is_generated_from_its_parameters_and_seed(page: Any, session: Any) -> None:
    tab(page, "Terrain")
    choose(page, "surface", "rocks")
    wait_for(lambda: set(session.terrain_panel.fields) >= {"k", "seed", "size"}, "fields of the parameters")
    for label, value in (("k", "0.05"), ("seed", "7"), ("size", "4"), ("spacing", "0.04")):
        field = page.get_by_label(label, exact=True)
        field.fill(value)
        field.press("Enter")
    wait_for(lambda: session.terrain_panel.fields["spacing"].value == 0.04, "the typed spacing")
    press(page, "Generate")
    wait_for(lambda: "seed 7" in session.state.terrain.name, "the new terrain")
    made = rb.surfaces.rocks(k=0.05, seed=7, size=4.0, spacing=0.04)
    assert np.array_equal(session.state.terrain.z, made.z)
    check_numbers(page, session)
    field = page.get_by_label("spacing", exact=True)
    field.fill("-1")
    field.press("Enter")
    wait_for(lambda: session.terrain_panel.fields["spacing"].value == -1, "the typed spacing")
    press(page, "Generate")
    page.wait_for_selector("text=That did not work")
    assert session.state.terrain.z.shape == made.z.shape
    session.later(lambda: session.terrain_panel.use(TERRAIN))


def test_colours_have_a_legend_and_a_map_gives_routes(page: Any, session: Any) -> None:
    tab(page, "Terrain")
    wait_for(lambda: session.state.terrain is TERRAIN and at_rest(session), "the first terrain")
    choose(page, "colour by", "slope")
    page.wait_for_selector("text=slope [°]")
    drawn = session.terrain_view.legend
    assert drawn.low < drawn.high <= math.pi / 2
    press(page, "Map where the rover can go")
    page.wait_for_selector("text=headings passable")
    assert session.maps["passable"].dims == ("y", "x")
    for layer in ("clearance", "roll", "required_friction"):
        if layer in session.maps and session.maps[layer].dims == ("y", "x"):
            choose(page, "colour by", layer)
            wait_for(lambda layer=layer: session.colour == layer, f"the layer {layer}")
    choose(page, "colour by", "hillshade")
    tab(page, "Drive")
    choose(page, "a click", "sets start, then goal")
    wait_for(lambda: "Click the start" in text_of(page, "path"), "the next step")
    state = session.state
    for x, y in ((state.x - 0.35, state.y - 0.45), (state.x + 0.5, state.y - 0.4)):
        page.mouse.click(*pixel_of(page, session, (x, y, float(TERRAIN.height(x, y)))))
        wait_for(lambda: session.drive_panel.start is not None or session.drive_panel.path is not None, "a point of the route")
    wait_for(lambda: session.drive_panel.path is not None, "the route")
    wait_for(lambda: visible(page, "/path/line") and visible(page, "/path/goal"), "the route in the picture")
    ends = session.drive_panel.path.sample(np.array([0.0, session.drive_panel.path.length]))
    assert (float(ends.x[-1]), float(ends.y[-1])) == pytest.approx((x, y), abs=0.15)
    press(page, "Drive the path")
    wait_for(lambda: session.drive_panel.run is not None, "the run")


def test_a_simulation_is_a_ghost_with_its_difference_plotted(page: Any, session: Any) -> None:
    tab(page, "Drive")
    session.later(session.drive_panel.clear)
    choose(page, "a click", "adds to the path")
    panel, state = session.drive_panel, session.state
    wait_for(lambda: panel.run is None and at_rest(session), "no run")
    assert not visible(page, "/ghost/body")
    for count, (x, y) in enumerate(((0.0, -0.5), (0.4, -0.5)), 1):
        page.mouse.click(*pixel_of(page, session, (x, y, float(state.terrain.height(x, y)))))
        wait_for(lambda count=count: len(panel.points) == count, "a point of the path")
    press(page, "Drive the path")
    wait_for(lambda: panel.run is not None, "the run")
    press(page, "Simulate it in MuJoCo too")
    wait_for(lambda: panel.simulated is not None, "the simulation")
    session.later(lambda: panel.play(False))
    wait_for(lambda: visible(page, "/ghost/body"), "the ghost")
    text = wait_for(lambda: (t := page.inner_text('[data-key="charts"]')) and "MuJoCo" in t and t, "the chart of the difference")
    rms = {name: float(value) for name, value in re.findall(r"(\w+) \(RMS ([\d.]+)°\)", text)}
    assert {"roll", "pitch", "rocker"} <= set(rms)
    table = rb.compare(rb.settle_along(state.rover, state.terrain, panel.simulated.run), panel.simulated.run)
    for name in ("roll", "pitch"):
        assert rms[name] == pytest.approx(math.degrees(table[name].rms), abs=2e-3)
    session.later(panel.clear)
    wait_for(lambda: not visible(page, "/ghost/body"), "no ghost")


def test_every_key_does_what_the_list_of_keys_names(page: Any, session: Any) -> None:
    tab(page, "Pose")
    session.later(lambda: session.state.move(0.0, 0.0, 0.0))
    session.later(session.redraw)
    wait_for(lambda: at_rest(session) and session.state.x == 0.0, "the rover at the origin")
    page.locator("body").press("i")
    wait_for(lambda: session.state.x == pytest.approx(0.05 * session.state.size, abs=1e-9), "one press forward")
    page.locator("body").press("k")
    wait_for(lambda: session.state.x == pytest.approx(0.0, abs=1e-9) and at_rest(session), "one press back")
    page.locator("body").press("l")
    wait_for(lambda: session.state.yaw == pytest.approx(-0.05, abs=1e-9), "one press right")
    page.locator("body").press("j")
    wait_for(lambda: session.state.yaw == pytest.approx(0.0, abs=1e-9) and at_rest(session), "one press left")
    before = np.array(session.client.camera.position)
    session.later(lambda: session.state.move(0.5, 0.4, 0.0))
    page.locator("body").press("c")
    wait_for(lambda: np.linalg.norm(np.array(session.client.camera.position) - before) > 0.3, "the camera at the rover")
    check_numbers(page, session)


def test_a_phone_shows_the_rover_above_a_sheet_of_full_width(browser: Any, lab: Any, page: Any) -> None:
    known = set(lab.sessions)
    phone = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True).new_page()
    phone.set_default_timeout(1000 * PATIENCE)
    phone.goto(lab.url)
    phone.wait_for_selector('[data-key="roll"]', state="attached")
    session = lab.sessions[next(iter(set(lab.sessions) - known))]
    wait_for(lambda: at_rest(session), "the rover at rest")
    close_notes(phone)
    assert phone.evaluate("document.documentElement.scrollWidth") <= 390
    sheet = phone.evaluate(
        "() => { let e = document.querySelector('[data-key=\"hint\"]'), b; while (e) { const r = e.getBoundingClientRect();"
        " if (getComputedStyle(e).position === 'fixed') b = r; e = e.parentElement; } return [b.left, b.right, b.top] }"
    )
    assert sheet[:2] == [0, 390]
    state = session.state
    body = pixel_of(phone, session, (state.x, state.y, float(state.pose.z)))
    assert 0 < body[0] < 390
    assert 0 < body[1] < sheet[2]
    for name in ("Drive", "Rover", "Terrain", "Pose"):
        phone.get_by_role("tab", name=name).tap()
        phone.wait_for_selector(f'[role="tab"][aria-selected="true"]:has-text("{name}")')
    x, y = state.x + 0.3, state.y + 0.35
    goal = pixel_of(phone, session, (x, y, float(state.terrain.height(x, y))))
    phone.touchscreen.tap(*goal)
    wait_for(lambda: at_rest(session) and abs(state.x - x) < 0.1, "the rover at the tapped point")
    check_numbers(phone, session)
    camera, place = np.array(session.client.camera.position), np.array([state.x, state.y])
    grabbed = np.array(pixel_of(phone, session, (state.x, state.y, float(state.pose.z) + 0.2)))
    finger = phone.context.new_cdp_session(phone)
    for kind, share in (("touchStart", 0.0), ("touchMove", 0.3), ("touchMove", 0.6), ("touchMove", 1.0), ("touchEnd", None)):
        at = [] if share is None else [dict(zip("xy", map(float, grabbed + share * np.array([-40.0, 10.0])), strict=True))]
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
    wait_for(lambda: at_rest(session) and np.hypot(*(np.array([state.x, state.y]) - place)) > 0.1, "the rover under the finger")
    assert np.array_equal(session.client.camera.position, camera), "a finger on the rover does not turn the view"
    check_numbers(phone, session)
    phone.context.close()
    wait_for(lambda: session.closed, "the session of the phone closed")


def test_the_command_shows_a_map_and_a_run_from_files(browser: Any, tmp_path: Path) -> None:
    run = rb.drive(ROVER, TERRAIN, rb.Path.straight((-0.4, 0.3), 0.2, 0.8), 0.05, step=0.04)
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    rb.write_map(rb.traversability(ROVER, TERRAIN, 4, 0.4), tmp_path / "map.nc")
    command = [sys.executable, "-m", "rockerbogie", "lab", "--no-browser", "--light", "--rover", "osr"]
    command += ["--terrain", "surface:rocks?k=0.1&seed=3&size=4&spacing=0.04"]
    command += ["--map", str(tmp_path / "map.nc"), "--run", str(tmp_path / "run.nc")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            url = re.search(r"http://127\.0\.0\.1:\d+", line)
            assert url, line
            page = open_page(browser, url[0])
            first = f"{round(math.degrees(float(run['roll'][0])), 2) + 0.0:.2f}°"
            wait_for(lambda: text_of(page, "roll") == first, "roll of the run's first record")
            tab(page, "Terrain")
            page.wait_for_selector("text=headings passable")
            wait_for(lambda: page.get_by_label("colour by").first.input_value() == "passable", "the map's colours")
            tab(page, "Drive")
            wait_for(lambda: page.get_by_role("button", name="▶ Play").is_enabled(), "the button")
            wait_for(lambda: page.locator('[data-key="charts"] svg').count() == 3, "three charts")
            assert str(tmp_path) not in page.content()
            page.close()
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(PATIENCE)
