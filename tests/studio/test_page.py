# SPDX-License-Identifier: MIT
"""A person at the page: a simulated robot is driven, tuned and stopped in a real browser."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Literal

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, Position

from tests.studio.parts import NIGHTLY, Opener, Program, let_live, studio, until
from tests.waiting import wait_until

GAIN = "ISMC_LAM_XY"


@pytest.fixture
def page(simulated: Program, open_page: Opener) -> Page:
    found = open_page(simulated.url)
    until(found, "robot?.pose")
    if found.evaluate("studio.state.commands") != "this page":
        found.click("#take-over")
    if found.evaluate("studio.state.robot.state") == "estop":
        found.click("#release")
    elif found.evaluate("studio.state.robot.state") != "disarmed":  # a page before was closed while it was armed
        found.click("#disarm")
    until(found, "robot.state === 'disarmed' && state.commands === 'this page'")
    return found


def arm(page: Page) -> None:
    """Press Arm, again if the robot refuses: one that has just started may still wait for its first pose."""
    for _ in range(10):
        page.click("#arm")
        until(page, "robot.armed || document.getElementById('notice').textContent !== ''")
        if page.evaluate("studio.state.robot.armed"):
            return
        let_live(page, 500)
    until(page, "robot.armed")


def drive(page: Page, begin: Callable[[], None], reached: str) -> None:
    """Arm if need be, begin to drive and wait until an expression is true.

    On a computer that is too busy for a robot in real time, the robot stops itself: then begin again.
    """
    for _ in range(4):
        if not page.evaluate("studio.state.robot.armed"):
            arm(page)
        begin()
        until(page, f"({reached}) || robot.state === 'failsafe'")
        if page.evaluate("studio.state.robot.state") != "failsafe":
            return
        page.click("#disarm")
        until(page, "robot.state === 'disarmed'")
    raise AssertionError(page.text_content("#texts"))


def follow_a_circle(page: Page) -> None:
    page.select_option("#path", "circle")
    drive(page, lambda: page.click("#start-path"), "robot.phase === 'path' && robot.path_time_s > 1")


def set_gain(page: Page, name: str, value: str) -> None:
    page.fill("#search", name)
    page.fill(f"#field-{name}", value)
    page.press(f"#field-{name}", "Enter")


def test_a_newcomer_starts_a_simulation_drives_and_comes_back(open_page: Opener) -> None:
    with studio() as program:
        page = open_page(program.url)
        page.click("#choose")
        page.select_option("#scenario", "fast")
        page.click("#simulate-form button")
        until(page, "robot?.pose?.[0] > 0.9")  # the first fix: before, the robot does not know that it starts at 1 m
        assert page.text_content("#fact-state") == "disarmed"
        follow_a_circle(page)
        frames = page.evaluate("studio.plots.drawn.frames")
        until(page, f"studio.plots.drawn.frames > {frames} + 5")
        page.click("#disarm")
        until(page, "!robot.armed")
        page.click("#choose")
        page.click("#disconnect")
        until(page, "state.link.phase === 'none'")
        until(page, "document.querySelectorAll('.parameter, #texts li').length === 0")  # of the robot before
        page.reload()
        until(page, "state?.link.phase === 'none'")


def test_a_gain_is_changed_marked_undone_and_redone(page: Page) -> None:
    before, steps = float(page.input_value(f"#field-{GAIN}")), page.evaluate("studio.state.undo")
    wanted = round(before) + 1  # exact as a float32, whatever the slider has left
    set_gain(page, GAIN, str(wanted))
    until(page, f"state.undo === {steps} + 1")
    until(page, f"studio.plots.marked.some((mark) => mark.changes.{GAIN}?.[1] === {wanted})")
    page.keyboard.press("Tab")
    page.click("#undo")
    until(page, f"Number(document.getElementById('field-{GAIN}').value) === {before}")
    page.click("#redo")
    until(page, f"Number(document.getElementById('field-{GAIN}').value) === {wanted}")
    start = page.locator(f"[data-name={GAIN}] .tag.start").text_content() or ""
    assert float(start.removeprefix("was ")) == pytest.approx(before, rel=1e-4), "as many digits as the tag shows"


def test_a_dragged_slider_changes_the_robot_and_is_one_step(page: Page) -> None:
    steps = page.evaluate("studio.state.undo")
    page.fill("#search", GAIN)
    slider = page.locator(f"[data-name={GAIN}] input[type=range]")
    box = slider.bounding_box()
    assert box is not None
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] * 0.5, middle)
    page.mouse.down()
    for part in (0.55, 0.6, 0.65, 0.7):
        page.mouse.move(box["x"] + box["width"] * part, middle)
        let_live(page, 100)
    page.mouse.up()
    until(page, f"state.undo === {steps} + 1")


def test_a_refused_value_is_said_beside_its_field_and_the_robot_keeps_the_old_one(page: Page) -> None:
    before = page.input_value(f"#field-{GAIN}")
    set_gain(page, GAIN, "100000")
    refusal = page.locator(f"[data-name={GAIN}] .refusal")
    until(page, f"document.querySelector('[data-name={GAIN}] .refusal').textContent !== ''")
    assert "from 0 to 200" in (refusal.text_content() or "")
    page.keyboard.press("Tab")
    until(page, f"document.getElementById('field-{GAIN}').value === '{before}'")


def test_what_is_said_does_not_move_the_map(page: Page) -> None:
    """Who draws a path with the mouse would draw a step in it."""
    page.wait_for_function("document.getElementById('notice').textContent === ''")
    top = "document.getElementById('map').getBoundingClientRect().top"
    before = page.evaluate(top)
    page.click("#go")
    page.wait_for_function("document.getElementById('notice').textContent !== ''")
    assert page.evaluate(top) == before, "while it is disarmed, the robot refuses to drive"
    page.evaluate("document.getElementById('faults').textContent = 'Faults: encoder, fix refused, pose stale'")
    assert page.evaluate(top) == before


@pytest.mark.parametrize(
    "focus",
    ["#path", "#keys", "body", *(pytest.param(one, marks=NIGHTLY) for one in ("#arm", "#laps", "#pause", "#target-x"))],
)
def test_the_space_bar_stops_wherever_the_focus_is(page: Page, focus: str) -> None:
    arm(page)
    page.select_option("#path", "circle")
    page.click("#start-path")
    until(page, "robot.mode === 'trajectory'")
    page.locator(focus).focus()
    page.keyboard.press("Space")
    until(page, "robot.state === 'estop'")


def test_the_stop_button_stops_when_the_finger_comes_down(page: Page) -> None:
    arm(page)
    box = page.locator("#stop").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 5, box["y"] + 5)
    page.mouse.down()
    until(page, "robot.state === 'estop'")
    page.mouse.up()
    until(page, "!document.getElementById('release').disabled")


def test_a_click_on_the_map_drives_there(page: Page) -> None:
    x, y, _ = page.evaluate("studio.state.robot.pose")
    page.fill("#target-x", f"{x + 0.1:.3f}")
    page.fill("#target-y", f"{y:.3f}")
    page.fill("#target-theta", "0")
    drive(page, lambda: page.click("#go"), f"Math.abs(robot.pose[0] - {x + 0.1}) < 0.01")
    box = page.locator("#map").bounding_box()
    assert box is not None
    place = Position(x=box["width"] / 2, y=box["height"] * 0.4)  # a fifth of a metre to the left
    drive(page, lambda: page.locator("#map").click(position=place), f"robot.pose[1] > {y} + 0.15")


def test_a_path_drawn_with_the_mouse_is_shown_and_followed(page: Page) -> None:
    arm(page)
    page.uncheck("#follow")
    page.click("#draw")
    box = page.locator("#map").bounding_box()
    assert box is not None
    metre = box["width"] / 2  # the map is 2 m wide
    begin = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(*begin)
    page.mouse.down()
    for step in range(1, 41):
        angle = math.pi * step / 40
        page.mouse.move(begin[0] + 0.3 * metre * math.sin(angle), begin[1] - 0.15 * metre * (1 - math.cos(angle)))
    page.mouse.up()
    until(page, "!document.getElementById('follow-line').disabled")
    assert re.match(r"0\.\d+ m, \d+\.\d s", page.text_content("#draw-text") or "")
    end = page.evaluate("studio.map.line[studio.map.line.length - 1]")
    page.click("#follow-line")
    until(page, "robot.phase === 'path'")
    until(page, "robot.phase === 'done'")
    until(page, f"Math.hypot(robot.pose[0] - {end[0]}, robot.pose[1] - {end[1]}) < 0.02")
    page.click("#forget-line")
    assert page.is_disabled("#follow-line")
    page.check("#follow")


def test_a_path_that_is_too_short_is_refused_in_words(page: Page) -> None:
    page.click("#draw")
    box = page.locator("#map").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 50, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 53, box["y"] + 50)
    page.mouse.up()
    until(page, "document.getElementById('notice').textContent.includes('must be 0.05 m or more')")
    assert page.is_disabled("#follow-line")


def test_a_path_is_not_begun_behind_a_persons_back(page: Page) -> None:
    """A robot that is not armed would begin it at the next Arm."""
    page.select_option("#path", "circle")
    page.click("#start-path")
    until(page, "document.getElementById('notice').textContent.includes('press Arm first')")


def test_keys_drive_as_long_as_they_are_held(page: Page) -> None:
    arm(page)
    page.check("#keys")
    x = page.evaluate("studio.state.robot.pose[0]")

    def hold_key() -> None:
        page.keyboard.up("w")
        page.locator("#keys").focus()
        page.keyboard.down("w")

    drive(page, hold_key, f"robot.pose[0] > {x} + 0.02")
    page.keyboard.up("w")
    until(page, "document.getElementById('key-text').textContent === ''")
    until(page, "robot.mode === 'hold' && robot.armed")  # test_drives.py shows that no failsafe follows


PAD = """(pad) => {
    window.pad = pad && { connected: true, mapping: "standard", id: "Test pad", axes: pad.axes,
        buttons: [0, 1, 2, 3].map((n) => ({ pressed: n === pad.button })) };
    navigator.getGamepads = () => [null, window.pad];
}"""
"""Stands for a gamepad: there is none at the computer that runs the tests."""


def test_a_gamepad_drives_turns_and_stops(page: Page) -> None:
    arm(page)
    page.check("#gamepad")
    until(page, "document.getElementById('gamepad-text').textContent.includes('press a button')")
    x, _, theta = page.evaluate("studio.state.robot.pose")

    def move_sticks(*axes: float) -> None:
        page.evaluate(PAD, {"axes": [0, 0, 0, 0]})
        until(page, "document.getElementById('gamepad-text').textContent === 'Test pad'")
        page.evaluate(PAD, {"axes": axes})

    drive(page, lambda: move_sticks(0, -1, 0, 0), f"robot.pose[0] > {x} + 0.02")
    drive(page, lambda: move_sticks(0.05, 0.1, -1, 0), f"robot.pose[2] > {theta} + 0.05")  # the left stick rests
    page.evaluate(PAD, None)  # unplugged
    until(page, "document.getElementById('key-text').textContent === ''")
    page.evaluate(PAD, {"axes": [0, -1, 0, 0], "button": 1})
    until(page, "robot.state === 'estop'")
    page.evaluate(PAD, {"axes": [0, -1, 0, 0]})  # still held
    page.click("#release")
    until(page, "robot.state === 'disarmed'")
    arm(page)
    until(page, "document.getElementById('gamepad-text').textContent === 'release the sticks first'")
    x = page.evaluate("studio.state.robot.pose[0]")
    newest = page.evaluate("studio.plots.newest")
    until(page, f"studio.plots.newest > {newest} + 1")
    assert abs(page.evaluate("studio.state.robot.pose[0]") - x) < 0.02
    page.evaluate(PAD, {"axes": [0, 0, 0, 0]})
    until(page, "document.getElementById('gamepad-text').textContent === 'Test pad'")
    page.uncheck("#gamepad")


def test_pausing_loses_nothing(page: Page) -> None:
    page.click("#pause")
    assert page.text_content("#pause") == "Go on"
    at = page.evaluate("studio.plots.drawn.newest")
    until(page, f"studio.plots.newest > {at} + 1")
    page.click("#pause")
    gap = page.evaluate("""() => { const { time } = studio.plots.samples_of('tracking.pose.x');
        return Math.max(...time.slice(1).map((t, i) => t - time[i])); }""")
    assert gap < 0.5


def test_a_stretch_is_measured_and_has_a_spectrum(page: Page) -> None:
    follow_a_circle(page)
    plot = page.locator("#panels .u-over").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 20)
    page.mouse.up()
    until(page, "document.querySelectorAll('#measured li').length > 0")
    assert page.locator("#measured li").count() == len(page.evaluate("studio.plots.keys")), "every signal that is shown"
    first = page.locator("#measured li").first.text_content() or ""
    assert re.match(r".*: -?[\d.e-]+ to -?[\d.e-]+( \S+)?, mean -?[\d.e-]+ ± [\d.e-]+, change -?[\d.e-]+", first)
    page.get_by_label("Spectrum of plot 2").click()
    until(page, "document.querySelectorAll('#spectrum-list li').length > 0")
    listed = page.text_content("#spectrum-list") or ""
    assert re.search(r"largest at [\d.]+ Hz, [\d.e-]+( \S+)?; resolution [\d.]+ Hz", listed)
    assert page.locator("#spectrum-plot canvas").count() == 1
    page.locator("#spectrum-dialog .stop").click()  # a window that covers the button has one of its own
    until(page, "robot.state === 'estop'")
    page.click("#close-spectrum")
    page.click("#pause")
    until(page, "document.querySelectorAll('#measured li').length === 0")


def test_the_robots_limits_are_drawn(page: Page) -> None:
    assert page.evaluate("studio.plots.limit('LIM_DUTY')") == 1.0
    assert page.evaluate("studio.plots.limit_of('wheels.duty.1')") == "LIM_DUTY"


def test_signals_are_found_and_shown(page: Page) -> None:
    page.click("#add-plot")
    number = page.locator(".panel").count()
    page.get_by_label(f"Signals of plot {number}").click()
    page.fill("#signal-search", "wheel speed")
    page.check("input[value='wheels.speed.3']")
    page.click("#close-signals")
    until(page, "studio.plots.samples_of('wheels.speed.3').time.length > 10")
    page.get_by_label(f"Remove plot {number}").click()


SEND_THE_FIRST_LOAD_LATE = """() => {
  const send = WebSocket.prototype.send;
  let held = 0;
  WebSocket.prototype.send = function (text) {
    if (text.includes('"load"') && held++ === 0) setTimeout(() => send.call(this, text), 500);
    else send.call(this, text);
  };
}"""


def test_parameters_are_saved_and_loaded(page: Page, simulated: Program) -> None:
    page.click("#store")
    until(page, "document.getElementById('notice').textContent.startsWith('Stored')")
    with page.expect_download() as download:
        page.click("#save")
    path = download.value.path()
    text = path.read_text()
    assert f"{GAIN} = " in text
    set_gain(page, GAIN, "33")
    until(page, f"document.getElementById('field-{GAIN}').value === '33'")
    page.evaluate(SEND_THE_FIRST_LOAD_LATE)
    page.set_input_files("#load", {"name": "x.toml", "mimeType": "text/plain", "buffer": text.encode()})
    page.keyboard.press("Tab")
    page.set_input_files("#load", {"name": "x.toml", "mimeType": "text/plain", "buffer": b"[parameters]\nNO = 1\n"})
    until(page, "document.getElementById('notice').textContent.includes('NO')")
    until(page, f"document.getElementById('field-{GAIN}').value !== '33'")
    let_live(page, 500)  # the answer to the first, which is no refusal
    until(page, "document.getElementById('notice').textContent.includes('NO')", wait_s=0.0)


def test_a_phone_shows_state_and_stop(simulated: Program, open_page: Opener) -> None:
    page = open_page(simulated.url, width=390, height=844)
    until(page, "robot?.pose")
    box = page.locator("#stop").bounding_box()
    assert box is not None
    assert box["width"] > 300
    assert box["y"] + box["height"] < 400
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.parametrize(
    ("colours", "width"),
    [
        ("light", 1500),
        ("dark", 390),
        pytest.param("dark", 1500, marks=NIGHTLY),
        pytest.param("light", 390, marks=NIGHTLY),
    ],
)
def test_it_can_be_used_by_keyboard_and_screen_reader(
    simulated: Program, browser: Browser, colours: Literal["light", "dark"], width: int
) -> None:
    """By axe's rules, all of them: names, contrasts, order, roles."""
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=colours)
    page.goto(simulated.url)
    until(page, "robot?.pose")
    page.fill("#search", "ISMC")
    found = Axe().run(page).response["violations"]
    page.close()
    assert [(one["id"], one["help"], [node["html"] for node in one["nodes"]]) for one in found] == []


def test_a_second_page_watches_until_it_takes_over(page: Page, simulated: Program, open_page: Opener) -> None:
    other = open_page(simulated.url)
    until(other, "robot?.pose")
    assert other.text_content("#fact-commands") not in ("this page", "no page")
    assert other.is_disabled("#arm")
    assert "Take over" in (other.text_content("#watching") or "")
    arm(page)
    other.keyboard.press("Space")
    until(page, "robot.state === 'estop'")
    other.click("#take-over")
    until(page, "state.commands !== 'this page'")
    other.click("#release")
    until(other, "robot.state === 'disarmed'")


def test_a_closed_page_is_a_lost_link(page: Page, simulated: Program) -> None:
    arm(page)
    page.select_option("#path", "circle")
    page.click("#start-path")
    until(page, "robot.mode === 'trajectory'")
    page.close()
    wait_until(lambda: not simulated.state()["robot"]["armed"], "it stays armed")
    assert simulated.state()["robot"]["state"] in ("failsafe", "disarmed")
