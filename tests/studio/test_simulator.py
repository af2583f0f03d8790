# SPDX-License-Identifier: MIT
"""Breaking and mending the simulated robot on the page: the real firmware reacts as its safety table says."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page
from websockets.sync.client import connect

from omni.studio.processors import EMULATED
from omni.studio.simulated import SimulatedRobot, Simulation
from omni.studio.simulated_memory import SimulatedMemory
from omniwheel.errors import LinkError
from tests.studio.parts import NIGHTLY, Opener, Program, running, studio, take_over, until
from tests.studio.test_hostile import ask, socket_url
from tests.studio.test_page import arm, set_gain
from tests.waiting import Stopwatch, wait_until

TEXTS = "[...document.querySelectorAll('#texts li')].map((item) => item.textContent).join('|')"


@pytest.fixture
def page(simulated: Program, open_page: Opener) -> Page:
    found = open_page(simulated.url)
    until(found, "robot?.pose && state.world?.on")
    take_over(found)
    mend(found)
    found.click("#disarm")
    if found.evaluate("studio.state.robot.state") == "estop":
        found.click("#release")
    until(found, "robot.state === 'disarmed'")
    return found


def mend(page: Page) -> None:
    if page.is_enabled("#mend"):
        page.click("#mend")
    until(page, "state.world.on.length === 0 && document.getElementById('mend').disabled")


def drive(page: Page) -> None:
    arm(page)
    page.select_option("#path", "circle")
    page.click("#start-path")
    until(page, "robot.phase === 'path' || robot.phase === 'lead-in'")


def switch(page: Page, fault: str, wheel: str = "") -> None:
    page.click(f"[data-fault='{fault} {wheel}']")


@pytest.mark.parametrize("wheel", ["2", pytest.param("1", marks=NIGHTLY)])
def test_a_pulled_encoder_stops_the_robot_names_its_wheel_and_is_mended(page: Page, wheel: str) -> None:
    drive(page)
    said = page.locator("#texts li").count()
    switch(page, "encoder_stuck", wheel)
    until(page, "robot.state === 'failsafe'")
    until(page, f"{TEXTS}.split('|').slice({said}).some((text) => text.startsWith('wheel {wheel}: given'))")
    assert "failsafe: stall" in page.evaluate(TEXTS)
    assert page.get_attribute(f"[data-fault='encoder_stuck {wheel}']", "aria-pressed") == "true"
    assert f"wheel {wheel}" in (page.text_content("#world-text") or "")
    page.click("#mend")
    until(page, "document.getElementById('world-text').textContent === 'No active faults.'")
    page.click("#disarm")
    until(page, "robot.state === 'disarmed'")
    drive(page)
    x, y, _ = page.evaluate("studio.state.robot.pose")
    until(page, f"Math.hypot(robot.pose[0] - {x}, robot.pose[1] - {y}) > 0.05")


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("i2c_stuck", "failsafe: driver"),
        pytest.param("battery_sag", "failsafe: battery", marks=NIGHTLY),
        pytest.param("ice", "", marks=NIGHTLY),
    ],
)
def test_other_faults_do_what_their_words_say(page: Page, fault: str, said: str) -> None:
    drive(page)
    before = page.locator("#texts li").count()
    switch(page, fault)
    until(page, f"state.world.on.some((one) => one.fault === '{fault}')")
    if said:
        until(page, f"{TEXTS}.split('|').slice({before}).some((text) => text.startsWith('{said}'))")
        reaction = page.locator(".breakable", has=page.locator(f"[data-fault='{fault} ']")).locator(".hint")
        assert said in (reaction.text_content() or "")
    switch(page, fault)
    until(page, "state.world.on.length === 0")


def test_a_pressed_stop_button_is_an_emergency_stop_and_mending_lets_it_go(page: Page) -> None:
    arm(page)
    switch(page, "stop_button")
    until(page, "robot.state === 'estop'")
    page.click("#release")
    until(page, "document.getElementById('notice').textContent !== ''")
    assert page.evaluate("studio.state.robot.state") == "estop"
    mend(page)
    page.click("#release")
    until(page, "robot.state === 'disarmed'")


@pytest.mark.parametrize("speed", ["0.25", pytest.param("2", marks=NIGHTLY)])
def test_the_space_bar_stops_at_every_speed(page: Page, speed: str) -> None:
    page.select_option("#world-speed", speed)
    until(page, f"state.world.speed === {speed}")
    drive(page)
    page.locator("#world-speed").focus()
    page.keyboard.press("Space")
    until(page, "robot.state === 'estop'")
    page.select_option("#world-speed", "1")
    until(page, "state.world.speed === 1")


def test_slow_motion_is_slow_and_loses_nobody(page: Page) -> None:
    page.select_option("#world-speed", "0.25")
    until(page, "state.world.speed === 0.25")
    newest = "studio.plots.newest"
    watch, begin = Stopwatch(), page.evaluate(newest)
    until(page, f"{newest} > {begin} + 2")  # two robot's seconds, with heartbeats 4 s apart
    assert watch.passed_s > 4.0
    assert page.evaluate("studio.state.link.phase") == "connected"
    page.select_option("#world-speed", "1")
    until(page, "state.world.speed === 1")


def test_a_scenarios_own_fault_shows_and_can_be_mended(open_page: Opener) -> None:
    with studio("fault_battery_sag") as program:
        page = open_page(program.url)
        until(page, "state?.world?.on?.some((one) => one.fault === 'battery_sag')")
        until(page, "robot?.supply_V < 9")
        page.click("#mend")
        until(page, "robot.supply_V > 9 && state.world.on.length === 0")


def test_a_robot_that_is_not_the_studios_own_has_no_simulator(tmp_path: Path, open_page: Opener) -> None:
    link = str(tmp_path / "robot")
    with running("sitl", "--link", f"pty:{link}"), studio("--link", link) as program:
        page = open_page(program.url)
        until(page, "robot?.pose")
        assert page.is_hidden("#simulator")
        with connect(socket_url(program)) as socket:
            ask(socket, "take_over")
            assert "not simulated" in ask(socket, "world", mend=True)["error"]


BAD: list[dict[str, Any]] = [
    {},
    {"fault": "no such thing", "on": True},
    {"fault": ["ice"], "on": True},
    {"fault": "ice"},
    {"fault": "ice", "on": 1},
    {"fault": "encoder_stuck", "on": True},
    {"fault": "encoder_stuck", "on": True, "wheel": 9},
    {"fault": "encoder_stuck", "on": True, "wheel": True},
    {"fault": "encoder_stuck", "on": True, "wheel": {}},
    {"speed": 0},
    {"speed": -1},
    {"speed": True},
    {"speed": [1]},
    {"speed": 1e300},
    {"mend": 1},
]


def test_bad_requests_and_watching_pages_change_nothing(simulated: Program) -> None:
    with connect(socket_url(simulated)) as socket, connect(socket_url(simulated)) as other:
        ask(socket, "take_over")
        ask(socket, "world", mend=True)
        wait_until(lambda: simulated.state()["world"]["on"] == [], "it was not mended")
        for request in BAD:
            assert ask(socket, "world", **request).get("error"), request
        assert "another page" in ask(other, "world", fault="ice", on=True)["error"]
        # What else is in a request goes nowhere: the world gets the words it knows.
        assert "error" not in ask(socket, "world", fault="ice", on=True, value=-1, more="\n{}\n")
        wait_until(lambda: simulated.state()["world"]["on"] == [{"fault": "ice", "wheel": None}], "there is no ice")
        assert simulated.state()["world"]["refusal"] == ""
        ask(socket, "world", mend=True)


@pytest.mark.full
def test_a_world_that_hangs_holds_up_no_stop() -> None:
    """Its process is frozen. The firmware runs on: it leaves the loop and stops."""
    with studio("sitl") as program, connect(socket_url(program)) as socket:
        wait_until(lambda: bool((program.state()["robot"] or {}).get("pose")), "no robot")
        ask(socket, "take_over")
        child = _child_of(program)
        os.kill(child, signal.SIGSTOP)
        try:
            assert "error" not in ask(socket, "world", fault="ice", on=True)
            socket.send(json.dumps({"do": "stop", "id": 1}))
            wait_until(lambda: program.state()["robot"]["state"] == "estop", "the stop was lost")
        finally:
            os.kill(child, signal.SIGCONT)


@pytest.mark.full
def test_commands_to_a_world_that_hangs_are_refused_once_its_pipe_is_full() -> None:
    robot = SimulatedRobot(Simulation("sitl"))
    try:
        os.kill(robot.process_id, signal.SIGSTOP)
        with pytest.raises(LinkError, match="does not accept commands"):
            _flood(robot)
    finally:
        os.kill(robot.process_id, signal.SIGCONT)
        robot.close()
    assert not robot.running
    with pytest.raises(LinkError, match="does not accept commands"):
        robot.change({"mend": True})


def _flood(robot: SimulatedRobot) -> None:
    for _ in range(200_000):
        robot.change({"mend": True})


def _child_of(program: Program) -> int:
    tasks = Path(f"/proc/{program.process.pid}/task").glob("*/children")
    children = [child for task in tasks for child in task.read_text(encoding="utf-8").split()]
    return next(int(child) for child in children if b"\0sitl\0" in Path(f"/proc/{child}/cmdline").read_bytes())


def test_a_restarted_simulation_has_what_was_stored_and_a_stop_that_was_not_released(open_page: Opener) -> None:
    gain = "studio.parameters.value_of('ISMC_LAM_XY')"
    with studio("sitl") as program:
        page = open_page(program.url)
        until(page, "robot?.pose")
        set_gain(page, "ISMC_LAM_XY", "7")
        until(page, f"{gain} === 7")
        page.click("#store")
        until(page, "document.getElementById('notice').textContent.startsWith('Stored')")
        set_gain(page, "ISMC_LAM_XY", "8")
        until(page, f"{gain} === 8")
        page.keyboard.press("Space")
        until(page, "robot.state === 'estop'")
        page.click("#choose")
        until(page, "document.getElementById('scenario').options.length > 0")
        page.select_option("#scenario", "sitl")
        page.click("#simulate-form button")
        until(page, f"{gain} === 7 && robot?.state === 'estop'")
        page.click("#release")
        until(page, "robot.state === 'disarmed'")
        drive(page)


def test_each_kind_of_simulated_robot_has_its_own_memory() -> None:
    memory, wanted = SimulatedMemory(), Simulation("sitl")
    first = memory.copy_for(wanted)
    assert not first.exists()
    memory.keep(wanted, first)
    first.write_bytes(b"stored")
    assert memory.copy_for(wanted).read_bytes() == b"stored"
    assert memory.copy_for(wanted) != first, "the robot before still has its file"
    for other in (Simulation("stand"), Simulation("sitl", "four_wheel"), Simulation("sitl", processor=EMULATED)):
        assert not memory.copy_for(other).exists()
    memory.close()
    assert not first.exists()
    assert not memory.copy_for(wanted).exists()
    memory.close()
