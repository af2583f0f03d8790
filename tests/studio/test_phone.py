# SPDX-License-Identifier: MIT
"""The page on a phone: fingers that scroll move no robot, and everything fits."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.studio.parts import WAIT_MS, Program, take_over, until

PHONE = {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def phone(shared_studio: Program, browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True, device_scale_factor=2)
    page = context.new_page()
    page.set_default_timeout(WAIT_MS)
    page.goto(shared_studio.url)
    until(page, "robot?.pose")
    take_over(page)
    page.tap("#arm")
    until(page, "robot.armed")
    yield page
    page.tap("#disarm")
    until(page, "!robot.armed")
    context.close()


def bring_into_sight(page: Page, what: str) -> tuple[float, float]:
    """Return the middle of an element, in the middle of the screen."""
    page.locator(what).evaluate("(element) => element.scrollIntoView({ block: 'center' })")
    box = page.locator(what).bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def swipe(page: Page, place: tuple[float, float], dx: float, dy: float) -> None:
    """A finger that goes down, moves and goes up, as the operating system reports it."""
    session = page.context.new_cdp_session(page)
    x, y = place
    session.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for step in range(1, 11):
        point = {"x": x + dx * step / 10, "y": y + dy * step / 10}
        session.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [point]})
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


@pytest.mark.parametrize(("dx", "dy"), [(0, -150), (0, 150), (120, 0), (60, -120)])
def test_a_swipe_over_the_map_moves_no_robot(phone: Page, dx: float, dy: float) -> None:
    place = bring_into_sight(phone, "#map")
    before = phone.evaluate("window.scrollY")
    swipe(phone, place, dx, dy)
    if dx == 0:
        until(phone, f"Math.abs(window.scrollY - {before}) > 50")
    phone.evaluate("new Promise(requestAnimationFrame)")
    assert not phone.evaluate("studio.map.going")
    assert phone.input_value("#target-x") == "0"


def test_a_swipe_over_a_slider_changes_no_gain(phone: Page) -> None:
    phone.fill("#search", "ISMC_LAM_XY")
    steps = phone.evaluate("studio.state.undo")
    place = bring_into_sight(phone, "[data-name=ISMC_LAM_XY] input[type=range]")
    before = phone.evaluate("window.scrollY")
    swipe(phone, place, 10, 150)
    until(phone, f"Math.abs(window.scrollY - {before}) > 50")
    assert phone.evaluate("studio.state.undo") == steps


def test_a_tap_on_the_map_sets_a_target(phone: Page) -> None:
    x, y = bring_into_sight(phone, "#map")
    phone.touchscreen.tap(x + 10, y)
    until(phone, "studio.map.going")
    phone.tap("#cancel")
    until(phone, "!studio.map.going")


def test_a_finger_draws_a_path_once_it_was_asked_for(phone: Page) -> None:
    phone.tap("#draw")
    place = bring_into_sight(phone, "#map")
    before = phone.evaluate("window.scrollY")
    swipe(phone, place, 80, -80)
    until(phone, "studio.map.line.length > 5 && !document.getElementById('follow-line').disabled")
    assert phone.evaluate("window.scrollY") == before
    assert not phone.evaluate("studio.map.going")
    phone.tap("#forget-line")


def test_stop_stays_in_sight_and_leaves_room(phone: Page) -> None:
    phone.evaluate("window.scrollTo(0, 2000)")
    phone.evaluate("new Promise(requestAnimationFrame)")
    box = phone.locator("#stop").bounding_box()
    assert box is not None
    assert 0 <= box["y"] < 60
    header = phone.locator("header").bounding_box()
    assert header is not None
    assert header["y"] + header["height"] < 200, "of 844"


def test_nothing_is_wider_than_the_screen(phone: Page) -> None:
    phone.evaluate("document.querySelectorAll('details').forEach((group) => { group.open = true; })")
    phone.fill("#search", "")
    phone.tap("#add-xy")
    wide = phone.evaluate(
        """[...document.querySelectorAll("body *")].filter((element) => element.offsetParent !== null
            && !element.closest("#run-list, #run-compared, canvas, svg, .u-wrap")
            && element.getBoundingClientRect().right > innerWidth + 1)
            .map((element) => element.outerHTML.slice(0, 80))"""
    )
    assert wide == []
    assert phone.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
    phone.get_by_label("Remove plot").last.tap()
