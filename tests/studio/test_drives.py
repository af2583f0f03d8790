# SPDX-License-Identifier: MIT
"""What begins, ends and replaces a drive from the page, and what the page says of a robot that stopped by itself."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.studio.parts import Opener, Program, take_over, until

COMMAND_TIMEOUT_S = 0.5
"""SAFE_CMD_TO: without setpoints for so long, the robot stops by a failsafe."""


@pytest.fixture
def page(shared_studio: Program, open_page: Opener) -> Iterator[Page]:
    found = open_page(shared_studio.url, 1280, 900)
    until(found, "robot?.pose")
    make_ready(found)
    yield found
    make_ready(found)


def make_ready(page: Page) -> None:
    """Disarmed, in command, nothing broken."""
    take_over(page)
    if page.is_enabled("#mend"):
        page.click("#mend")
    page.select_option("#world-speed", "1")
    until(page, "state.world.on.length === 0 && state.world.speed === 1")
    if page.evaluate("studio.state.robot.state") == "estop":
        page.click("#release")
    else:
        page.click("#disarm")
    until(page, "robot.state === 'disarmed' && robot.faults.length === 0")


def slow_down(page: Page) -> None:
    """A busy machine may hold setpoints up for half a second of the robot's time."""
    page.select_option("#world-speed", "0.5")
    until(page, "state.world.speed === 0.5")


def arm(page: Page) -> None:
    page.click("#arm")
    until(page, "robot.state === 'armed' && robot.armed")


def wait_on_the_robots_clock(page: Page, seconds: float) -> None:
    newest = page.evaluate("studio.plots.newest")
    until(page, f"studio.plots.newest > {newest} + {seconds}")


def assert_no_stop_follows(page: Page) -> None:
    """A failsafe would come within SAFE_CMD_TO, and stay."""
    wait_on_the_robots_clock(page, COMMAND_TIMEOUT_S + 0.3)
    assert page.evaluate("[studio.state.robot.state, studio.state.last_stop]") == ["armed", None]


def drive_to(page: Page, dx: float) -> None:
    x = page.evaluate("studio.state.robot.pose[0]")
    page.fill("#target-x", f"{x + dx:.3f}")
    page.click("#go")
    until(page, f"Math.abs(robot.pose[0] - {x}) > {abs(dx) / 3}")


def break_encoder(page: Page, wheel: int) -> None:
    page.click(f"[data-fault='encoder_invalid {wheel}']")
    until(page, "robot.state === 'failsafe'")


def test_letting_go_of_a_drive_key_trips_no_failsafe(page: Page) -> None:
    slow_down(page)
    arm(page)
    page.check("#keys")
    for key in ("w", "q"):
        pose = page.evaluate("studio.state.robot.pose")
        page.keyboard.down(key)
        until(page, f"robot.pose.some((value, axis) => Math.abs(value - {pose}[axis]) > 0.01)")
        page.keyboard.up(key)
        assert_no_stop_follows(page)
    page.uncheck("#keys")


def test_a_drive_key_takes_the_place_of_a_pose_that_is_held(page: Page) -> None:
    slow_down(page)
    arm(page)
    drive_to(page, 0.1)
    page.check("#keys")
    page.keyboard.down("s")
    until(page, "document.getElementById('key-text').textContent !== ''")
    assert not page.evaluate("studio.map.going"), "two streams of setpoints would take turns"
    page.keyboard.up("s")
    assert_no_stop_follows(page)


def test_a_path_that_is_refused_leaves_a_held_pose_at_rest(page: Page) -> None:
    slow_down(page)
    arm(page)
    drive_to(page, 0.1)
    page.fill("#laps", "100000")
    page.click("#start-path")
    until(page, "document.getElementById('notice').textContent !== ''")
    assert_no_stop_follows(page)


def test_taking_over_while_the_robot_drives_to_a_pose_trips_no_failsafe(
    page: Page, shared_studio: Program, open_page: Opener
) -> None:
    other = open_page(shared_studio.url)
    until(other, "robot?.pose")
    slow_down(page)
    arm(page)
    drive_to(page, -0.6)
    other.click("#take-over")
    until(other, "state.commands === 'this page'")
    assert_no_stop_follows(other)
    until(page, "!studio.map.going")


def test_a_page_that_watches_says_why_it_cannot_command(page: Page, shared_studio: Program, open_page: Opener) -> None:
    other = open_page(shared_studio.url)
    until(other, "robot?.pose")
    other.evaluate("document.querySelectorAll('details').forEach((group) => { group.open = true; })")
    usable = other.evaluate(
        "[...document.querySelectorAll('fieldset.commands :is(button, input, select)')]"
        ".filter((control) => !control.matches(':disabled')).map((control) => control.id)"
    )
    assert usable == []
    assert other.locator("fieldset.commands button").count() > 30
    assert "Take over" in (other.text_content("#watching") or "")
    assert other.is_enabled("#stop")
    assert other.is_enabled("#disarm")
    assert other.is_enabled("#stop-path")
    other.locator("#map").click()
    until(other, "document.getElementById('notice').textContent.includes('Take over')")
    other.click("#take-over")
    until(other, "state.commands === 'this page'")
    assert other.is_enabled("#arm")
    assert other.text_content("#watching") == ""


def test_what_stopped_the_robot_stays_in_sight_until_it_is_armed_again(page: Page) -> None:
    arm(page)
    break_encoder(page, 2)
    until(page, "document.getElementById('stopped-what').textContent.includes('wheel 2')")
    assert "encoder" in (page.text_content("#stopped-what") or "")
    assert "rad/s" in (page.text_content("#stopped-values") or ""), "the last values"
    page.click("#start-path")
    until(page, "document.getElementById('notice').textContent !== ''")
    assert "Disarm first" in (page.text_content("#notice") or "")
    assert page.is_disabled("#arm")
    assert "Disarm first" in (page.get_attribute("#arm", "title") or ""), "the hints agree"
    page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    box = page.locator("#stopped").bounding_box()
    assert box is not None
    assert 0 <= box["y"] < 200, "in the header, wherever the page is scrolled to"
    page.click("#mend")
    page.click("#stopped-next")
    until(page, "robot.state === 'disarmed'")
    assert page.is_visible("#stopped")
    page.reload()
    until(page, "document.getElementById('stopped-what').textContent.includes('wheel 2')")
    take_over(page)
    until(page, "robot.faults.length === 0")
    page.click("#stopped-next")
    until(page, "robot.state === 'armed' && document.getElementById('stopped').hidden")


def test_after_an_emergency_stop_the_next_step_is_to_release_it(page: Page) -> None:
    places = "['arm', 'disarm', 'record', 'stop'].map((name) => document.getElementById(name).offsetLeft)"
    before = page.evaluate(places)
    arm(page)
    page.keyboard.press("Space")
    until(page, "robot.state === 'estop' && !document.getElementById('stopped').hidden")
    assert page.evaluate(places) == before, "no button moves under the finger"
    page.click("#start-path")
    until(page, "document.getElementById('notice').textContent.includes('Release stop first')")
    page.click("#stopped-next")
    until(page, "robot.state === 'disarmed'")


def test_a_path_that_is_started_again_while_it_is_driven_begins_smoothly(page: Page) -> None:
    arm(page)
    page.select_option("#path", "circle")
    page.fill("#laps", "5")
    page.click("#start-path")
    until(page, "robot.phase === 'path' && robot.path_time_s > 1")
    begin = page.evaluate("studio.plots.newest")
    page.click("#start-path")
    until(page, "robot.phase === 'lead-in'")
    until(page, "robot.phase === 'path'")
    duties = page.evaluate(
        f"""[1, 2, 3].flatMap((wheel) => {{
            const {{ time, value }} = studio.plots.samples_of(`wheels.duty.${{wheel}}`);
            return value.filter((_, n) => time[n] > {begin}).map(Math.abs);
        }})"""
    )
    assert len(duties) > 100
    assert max(duties) < 1.0, "no motor is at its limit"
    assert page.evaluate("studio.state.robot.faults") == []
    assert page.evaluate("studio.state.robot.state") == "armed"
