# SPDX-License-Identifier: MIT
"""The map shows what the robot knows: its pose fixes, and how unsure it is of its place."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

from tests.studio.parts import Opener, Program, studio, take_over, until
from tests.studio.test_page import arm
from tests.studio.test_simulator import mend, switch

SIGMA = 3


@pytest.fixture
def page(simulated: Program, open_page: Opener) -> Page:
    found = open_page(simulated.url)
    until(found, "robot?.pose && state.world?.on && studio.map.marked.length > 0")
    take_over(found)
    mend(found)
    found.click("#disarm")
    until(found, "robot.state === 'disarmed'")
    return found


def shown(page: Page, result: str) -> list[dict[str, Any]]:
    marks: list[dict[str, Any]] = page.evaluate("studio.map.marked")
    return [mark for mark in marks if mark["result"] == result]


def test_fixes_that_the_robot_uses_are_marked_where_they_are(page: Page) -> None:
    until(page, "studio.map.marked.filter(({ result }) => result === 'used').length > 20")
    x, y, _ = page.evaluate("studio.state.robot.pose")
    used = shown(page, "used")
    spread = [math.hypot(mark["x"] - x, mark["y"] - y) for mark in used]
    assert 0.0 < max(spread) < 0.05, "around the robot, each with its own noise"
    assert len({(mark["x"], mark["y"]) for mark in used}) > 10
    assert "0 rejected" in (page.text_content("#fix-text") or "")
    assert re.match(r"pose ±\S+ mm, ±\S+° \(95 %\)$", page.text_content("#quality-text") or "")
    assert page.text_content("#quality-advice") == ""


def test_a_covered_camera_brings_no_more_and_the_marks_fade(page: Page) -> None:
    switch(page, "pose_loss")
    until(page, "studio.map.marked.length === 0")
    mend(page)
    until(page, "studio.map.marked.length > 0")


def test_a_fix_that_is_refused_is_another_mark_with_its_reason(page: Page) -> None:
    x, y, _ = page.evaluate("studio.state.robot.pose")
    switch(page, "pose_jump")
    until(page, "studio.map.marked.some(({ result }) => result === 'too far')")
    far = shown(page, "too far")[0]
    assert math.hypot(far["x"] - x, far["y"] - y) > 0.4
    until(page, "document.getElementById('fix-text').textContent.includes('it failed the outlier gate')")
    mend(page)


def test_every_sign_is_drawn_and_they_differ_without_colour(page: Page) -> None:
    """A plus has its middle and no corners, a cross has both diagonals, a ring is empty in its middle."""
    page.uncheck("#follow")
    signs = {}
    for result in ("used", "too far", "ignored"):
        fix = {"pose": [30.0, 30.0, 0.0], "age_s": 0.0, "result": result}
        signs[result] = page.evaluate(SIGN, fix)
    page.check("#follow")
    assert all(sum(map(sum, sign)) > 5 for sign in signs.values())
    assert len({str(sign) for sign in signs.values()}) == 3
    assert signs["ignored"][6][6] == 0


SIGN = """async (fix) => {
  const { Fixes } = await import("/page/fixes.js");
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 13;
  const c = canvas.getContext("2d");
  const fixes = new Fixes();
  fixes.add([fix], performance.now());
  fixes.draw(c, () => [6.5, 6.5], () => "black", performance.now());
  const { data } = c.getImageData(0, 0, 13, 13);
  const places = [...Array(13).keys()];
  return places.map((y) => places.map((x) => Number(data[4 * (13 * y + x) + 3] > 100)));
}"""
"""Which pixels one mark covers: no colours."""


def test_marks_do_not_grow_without_end(page: Page) -> None:
    many = [{"pose": [0.0, 0.0, 0.0], "age_s": 0.0, "result": "too far"}] * 5000
    page.evaluate("(fixes) => studio.map.fixes(fixes)", many)
    assert page.evaluate("studio.map.marked.length") <= 400


def test_another_robot_begins_without_marks(open_page: Opener) -> None:
    far = [{"pose": [9.0, 9.0, 0.0], "age_s": 0.0, "result": "too far"}]
    with studio("sitl") as program:
        page = open_page(program.url)
        until(page, "studio.map.marked.length > 0")
        page.evaluate("(fixes) => { performance.now = () => 1e6; studio.map.fixes(fixes); }", far)  # nothing fades
        page.click("#choose")
        until(page, "document.getElementById('scenario').options.length > 0")
        page.click("#simulate-form button")
        until(page, "studio.map.marked.length > 0 && !studio.map.marked.some(({ x }) => x === 9)")


POINTED = """(pointerType) => {
  const canvas = document.getElementById("map"), { on } = studio.map, { target } = on;
  const how = { pointerType, pointerId: 1, isPrimary: true, button: 0, bubbles: true };
  let targets = 0;
  on.target = () => { targets += 1; };
  canvas.setPointerCapture = () => {}; // of a pointer that is there
  for (const type of ["pointerdown", "pointerup"]) canvas.dispatchEvent(new PointerEvent(type, how));
  canvas.dispatchEvent(new MouseEvent("click", { button: 0, bubbles: true }));
  on.target = target;
  delete canvas.setPointerCapture;
  return targets;
}"""
"""How often a click sets a target in a browser whose click does not say what pointed."""


def test_a_click_sets_one_target_whatever_points(shared_page: Page) -> None:
    until(shared_page, "state")
    pointers = ["touch", "mouse", "touch", "pen"]
    assert [shared_page.evaluate(POINTED, pointer) for pointer in pointers] == [1, 1, 1, 1]


def numpy_ellipse(covariance: np.ndarray) -> tuple[float, float, float]:
    """Half axes [m] and the longer one's angle in 0..pi, by the eigenvectors."""
    variance, vectors = np.linalg.eigh(covariance)
    minor, major = SIGMA * np.sqrt(variance)
    return major, minor, math.atan2(vectors[1, 1], vectors[0, 1]) % math.pi


@pytest.mark.parametrize("correlation", [-0.95, -0.3, 0.0, 0.4, 0.999])
@pytest.mark.parametrize(("sd_x", "sd_y"), [(0.2, 0.1), (0.02, 0.3), (0.1, 0.1)])
def test_the_ellipse_is_that_of_numpys_eigenvectors(
    shared_page: Page, sd_x: float, sd_y: float, correlation: float
) -> None:
    found = shared_page.evaluate(
        "async ([sd, correlation]) => (await import('/page/ellipse.js')).ellipse(sd, correlation, 3)",
        [[sd_x, sd_y], correlation],
    )
    xy = correlation * sd_x * sd_y
    major, minor, angle = numpy_ellipse(np.array([[sd_x**2, xy], [xy, sd_y**2]]))
    assert (found["major"], found["minor"]) == pytest.approx((major, minor), rel=1e-9, abs=1e-12)
    if major > 1.0001 * minor:  # a circle has no direction
        assert abs(math.remainder(found["angle"] - angle, math.pi)) < 1e-9


@pytest.fixture(scope="module")
def shared_page(simulated: Program, browser: Any) -> Iterator[Page]:
    found = browser.new_page()
    found.goto(simulated.url)
    yield found
    found.close()


TURNED = """(correlation) => new Promise((done) => {
  const { map } = studio, canvas = document.getElementById("map");
  map.state({ pose: [5, 5, 0], pose_sd: [0.2, 0.2], pose_correlation: correlation, armed: false, slip_m_s: [] });
  const scale = canvas.width / 2;  // the map is 2 m wide, the robot in its middle
  const at = 3 * 0.2 * Math.sqrt(1 + Math.abs(correlation)) / Math.SQRT2;
  const [left, top] = [canvas.width / 2 - 3, canvas.height / 2 - 3];
  const warn = [0x8a, 0x4b, 0x00];
  const near = (data, n) => data[n + 3] > 60 && warn.every((part, k) => Math.abs(data[n + k] - part) < 25);
  const covered = (x, y) => {
    const { data } = canvas.getContext("2d").getImageData(left + x * scale, top - y * scale, 7, 7);
    return data.some((_, n) => n % 4 === 0 && near(data, n));
  };
  requestAnimationFrame(() => requestAnimationFrame(() => done([covered(at, at), covered(at, -at)])));
})"""
"""Whether the ellipse's line passes the ends of its longer axis, to the upper right and to the lower right."""


@pytest.mark.parametrize(("correlation", "where"), [(0.6, [True, False]), (-0.6, [False, True])])
def test_the_ellipse_is_drawn_askew_to_the_right_side(
    open_page: Opener, tmp_path: Any, correlation: float, where: list[bool]
) -> None:
    with studio() as program:
        page = open_page(program.url)
        until(page, "state")
        assert page.evaluate(TURNED, correlation) == where


@pytest.mark.nightly
def test_a_robot_that_drives_blind_has_a_tilted_ellipse(page: Page, simulated: Program) -> None:
    """Without fixes its heading gets unsure, and so its place across the way: along (1, 1) the ellipse tilts."""
    x, y, _ = page.evaluate("studio.state.robot.pose")
    page.fill("#target-x", f"{x + 0.7:.3f}")
    page.fill("#target-y", f"{y + 0.7:.3f}")
    page.fill("#target-theta", "0")
    page.select_option("#world-speed", "0.25")  # a busy machine may hold the setpoints up for half a second
    until(page, "state.world.speed === 0.25")
    arm(page)
    page.click("#go")
    switch(page, "pose_loss")
    until(page, f"Math.abs(robot.pose[0] - {x + 0.7}) < 0.02 && Math.abs(robot.pose[1] - {y + 0.7}) < 0.02")
    until(page, "robot.pose_correlation < -0.2")
    page.select_option("#world-speed", "1")
    state, found = page.evaluate("[studio.state.robot, studio.map.ellipse]")
    sd_x, sd_y, _ = state["pose_sd"]
    xy = state["pose_correlation"] * sd_x * sd_y
    major, minor, angle = numpy_ellipse(np.array([[sd_x**2, xy], [xy, sd_y**2]]))
    assert (found["major"], found["minor"]) == pytest.approx((major, minor), rel=1e-3)
    assert abs(math.remainder(found["angle"] - angle, math.pi)) < 1e-3
    assert math.radians(95) < angle < math.radians(175), "across the way"
    until(page, "document.getElementById('quality-text').textContent.startsWith('pose drifting: no fix for ')")
    assert "check the pose source" in (page.text_content("#quality-advice") or "")
    assert state["quality"]["verdict"] == "drifting"
    mend(page)
