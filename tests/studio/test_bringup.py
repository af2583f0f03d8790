# SPDX-License-Identifier: MIT
"""Bring-up at the page: asked before anything moves, shown which wheel is meant, ended by a stop."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from playwright.sync_api import Page

from omni.studio.actions import BadRequestError
from omni.studio.bringup_walk import ALL, CONFIRM, SAW, WORDS, PagePerson, robot_file, wiring_picture
from omniwheel.bringup import HandMotion
from omniwheel.bringup.sequence import CHECKS
from tests.studio.parts import Opener, Program, until


@pytest.fixture
def page(shared_studio: Program, open_page: Opener) -> Page:
    found = open_page(shared_studio.url)
    until(found, "robot?.pose && state.link.phase === 'connected'")
    return found


def begin(page: Page, check: str) -> None:
    page.select_option("#bring-up-check", check)
    page.click("#bring-up-start")


def test_every_check_has_words() -> None:
    assert list(WORDS) == [ALL, *CHECKS]


def test_a_check_is_run_and_its_results_are_kept(page: Page) -> None:
    assert page.locator("#bring-up-drawing g").count() == 3
    begin(page, "link")
    until(page, "state.bring_up.results.length === 1 && state.bring_up.folder")
    assert (page.text_content("#bring-up-state") or "").startswith("1 of 1 passed.")
    folder = Path(page.evaluate("studio.state.bring_up.folder"))
    assert json.loads((folder / "bringup.json").read_text())["ok"] is True
    assert "firmware" in (page.text_content("#bring-up-results") or "")


def test_nothing_moves_before_yes_the_wheel_is_shown_and_a_stop_ends_it(page: Page) -> None:
    begin(page, "motors")
    until(page, "state.bring_up.question")
    assert "Is the robot on a stand" in (page.text_content("#bring-up-question") or "")
    page.get_by_role("button", name="No", exact=True).click()
    until(page, "!state.bring_up.running")
    assert "no wheel was moved" in (page.text_content("#bring-up-state") or "")
    begin(page, "motors")
    until(page, "state.bring_up.question")
    page.click("#start-path")  # what else moves the robot waits
    page.get_by_role("button", name="Yes, continue").click()
    until(page, "state.bring_up.wheel === 2 && robot.armed")
    until(page, "document.querySelector('#bring-up-drawing .meant')?.dataset.wheel === '2'")
    page.keyboard.press("Space")
    until(page, "robot.state === 'estop' && !state.bring_up.running")
    assert "stopped" in (page.text_content("#bring-up-state") or "")
    page.click("#release")
    until(page, "robot.state === 'disarmed'")


def test_in_simulation_a_button_turns_the_wheel_and_cancel_ends_it(page: Page) -> None:
    """It was stuck at "turn wheel 1 by hand"."""
    begin(page, "encoders")
    for wheel in (1, 2):
        until(page, f"state.bring_up.wheel === {wheel}")
        page.get_by_role("button", name=f"Turn wheel {wheel} in the simulation").click()
    until(page, "state.bring_up.wheel === 3")
    page.click("#bring-up-cancel")
    until(page, "!state.bring_up.running && robot.state === 'disarmed'")
    assert "stopped" in (page.text_content("#bring-up-state") or "")
    assert page.locator("#bring-up-hands button").count() == 0
    assert page.is_disabled("#bring-up-cancel")


def test_the_wiring_of_the_robot_is_drawn(page: Page, shared_studio: Program) -> None:
    page.click("#wiring summary")
    until(page, "document.getElementById('wiring-picture').naturalWidth > 0")
    assert page.request.get(f"{shared_studio.url}wiring.svg?robot=../secret").status == 404
    assert wiring_picture("four_wheel").startswith("<?xml") or "<svg" in wiring_picture("four_wheel")
    with pytest.raises(BadRequestError):
        robot_file("no such robot")


class Listening:
    """Stands for a robot whose link is served: it calls back."""

    def __init__(self, then: Callable[[], None], *, simulated: bool = True) -> None:
        self.then = then
        self.status = SimpleNamespace(simulated=simulated)

    def pump(self, _seconds: float) -> None:
        self.then()


@pytest.mark.parametrize(
    ("kind", "answer", "found"), [(CONFIRM, True, True), (CONFIRM, None, False), (SAW, None, None)]
)
def test_answers_are_what_the_checks_take(kind: str, answer: Any, found: Any) -> None:
    person = PagePerson(Listening(lambda: person.answer(1, answer)))  # type: ignore[arg-type]
    asked = person.confirm if kind == CONFIRM else person.saw
    assert asked("Did wheel 3 turn?") is found
    assert person.question is None


def test_an_answer_to_an_earlier_question_and_nonsense_are_refused() -> None:
    person = PagePerson(Listening(lambda: None))  # type: ignore[arg-type]
    with pytest.raises(BadRequestError, match="question"):
        person.answer(1, True)
    asking = threading.Thread(target=lambda: person.saw("Did wheel 1 turn?"))
    asking.start()
    while person.question is None:
        pass
    assert person.wheel == 1
    for number, yes, words in ((0, True, "question"), (True, True, "question"), (1, "yes", "null")):
        with pytest.raises(BadRequestError, match=words):
            person.answer(number, yes)
    person.answer(1, False)
    asking.join()


@pytest.mark.parametrize("motion", HandMotion)
def test_every_motion_by_hand_has_its_way_in_simulation_only(motion: HandMotion) -> None:
    person = PagePerson(Listening(lambda: person.answer(1, True)))  # type: ignore[arg-type]
    person.move_by_hand(motion, "Turn wheel 2")
    elsewhere = person.simulated_hand(())
    assert elsewhere == {"text": motion.value, "buttons": []}
    here = person.simulated_hand(("wheel_turned", "stop_button"))
    assert here is not None
    faults = [button["fault"]["fault"] for button in here["buttons"]]
    assert faults or here["text"]
    if motion is HandMotion.WHEEL:
        assert here["buttons"][0]["fault"]["wheel"] == 2
    person.confirm("Did it turn?")
    assert person.simulated_hand(()) is None
    real = PagePerson(Listening(lambda: None, simulated=False))  # type: ignore[arg-type]
    real.move_by_hand(motion, "Turn wheel 2")
    assert real.simulated_hand(("wheel_turned", "stop_button")) is None


def test_the_wheel_that_is_meant_is_found_in_what_the_checks_say() -> None:
    person = PagePerson(Listening(lambda: None))  # type: ignore[arg-type]
    person.show("Turn wheel 2 by hand by one whole revolution")
    assert person.wheel == 2
    person.show("forward 20 cm")
    assert person.wheel is None
