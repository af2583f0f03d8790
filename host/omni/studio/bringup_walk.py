# SPDX-License-Identifier: MIT
"""Bring-up on the page: the checks of ``omni bringup``, run by the robot's thread. The page asks the person."""

from __future__ import annotations

import itertools
import re
from collections import deque
from collections.abc import Collection, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any

from omni.studio.actions import BadRequestError
from omni.studio.error_text import in_words
from omni.studio.session import Session, set_automatic_rate
from omni_schema import Robot as RobotFile
from omniwheel.bringup.person import HandMotion
from omniwheel.errors import OmniError
from omniwheel.logs.run_folder import new_run_folder
from omniwheel.robot import Robot
from omniwheel.robots import read_robot, robot_names

ALL = "all"
WORDS = {
    ALL: "all checks in order, up to the first failure",
    "link": "link: versions, parameters, latency",
    "i2c": "I2C: does the PWM board respond?",
    "encoders": "encoders: turn each wheel by hand",
    "gyro": "gyro: rest, then turn the robot by hand",
    "flow": "floor odometry: push the robot by hand along a metre",
    "motors": "motors: each wheel turns, on a stand",
    "estop": "stops: three ways to stop, on a stand",
    "oe": "output enable: its pin alone stops, on a stand",
    "button": "stop button: press it, on a stand",
    "drive": "drive: a small square on the floor",
}
CONFIRM, SAW = "confirm", "saw"
"""Kinds of questions: yes or no, where only yes goes on; yes, no or unknown."""
_SIMULATED: Mapping[HandMotion, Mapping[str, Any]] = {
    HandMotion.WHEEL: {"fault": "wheel_turned", "on": True, "duration_s": 2.0},  # half a revolution per second
    HandMotion.PRESS_BUTTON: {"fault": "stop_button", "on": True},
    HandMotion.RELEASE_BUTTON: {"fault": "stop_button", "on": False},
}
"""Faults of the simulated world that do what a hand does."""
_WHEEL = re.compile(r"\b[Ww]heel (\d)\b")
_WAIT_S = 0.05
_LINES_KEPT = 8


@dataclass(frozen=True)
class Question:
    """What the person is asked; ``number`` tells an answer to it from one to an earlier question."""

    number: int
    text: str
    kind: str


class PagePerson:
    """The person at the page: the robot's link is served while an answer is awaited."""

    def __init__(self, robot: Robot) -> None:
        self.question: Question | None = None
        self.lines: deque[str] = deque(maxlen=_LINES_KEPT)
        self._motion: HandMotion | None = None
        self._robot = robot
        self._numbers = itertools.count(1)
        self._answered = Event()
        self._answer: bool | None = None

    def show(self, text: str) -> None:
        """Show a line."""
        self._motion = None
        self.lines.append(text)

    def move_by_hand(self, motion: HandMotion, text: str) -> None:
        """Show the request; :meth:`simulated_hand` says what fulfils it in a simulated world."""
        self.show(text)
        self._motion = motion

    def simulated_hand(self, faults: Collection[str]) -> dict[str, Any] | None:
        """Return what moves a simulated robot in place of a hand: a text and buttons; None if no hand is needed.

        ``faults`` are what this page can switch in the world. A button has ``words``, and as ``fault`` a request that
        switches one. Without a button the text says what to do elsewhere.
        """
        motion = self._motion
        if motion is None or not self._robot.status.simulated:
            return None
        fault = _SIMULATED.get(motion)
        if fault is None or fault["fault"] not in faults:
            return {"text": motion.value, "buttons": []}
        if motion is HandMotion.WHEEL:
            button = {"words": f"Turn wheel {self.wheel} in the simulation", "fault": {**fault, "wheel": self.wheel}}
        else:
            verb = "Press" if motion is HandMotion.PRESS_BUTTON else "Release"
            button = {"words": f"{verb} the stop button in the simulation", "fault": fault}
        return {"text": "", "buttons": [button]}

    def confirm(self, question: str) -> bool:
        """Ask yes or no."""
        return self._prompt(question, CONFIRM) is True

    def saw(self, question: str) -> bool | None:
        """Ask yes, no or unknown."""
        return self._prompt(question, SAW)

    def answer(self, number: Any, answer: Any) -> None:
        """Take an answer, from another thread. Raises BadRequestError for one to an earlier question."""
        question = self.question
        if question is None or question.number != number or isinstance(number, bool):
            raise BadRequestError("this question is no longer open")
        if answer is not None and not isinstance(answer, bool):
            raise BadRequestError(f"an answer is true, false or null, not {answer!r}")
        self._answer = answer
        self._answered.set()

    @property
    def wheel(self) -> int | None:
        """The wheel that is spoken of, counting from 1."""
        text = self.question.text if self.question is not None else self.lines[-1] if self.lines else ""
        found = _WHEEL.search(text)
        return None if found is None else int(found.group(1))

    def _prompt(self, text: str, kind: str) -> bool | None:
        self._answered.clear()
        self._motion = None
        self.question = Question(next(self._numbers), text, kind)
        try:
            while not self._answered.is_set():
                self._robot.pump(_WAIT_S)  # a stop, or the loss of the page, ends it here
            return self._answer
        finally:
            self.question = None


class BringUp:
    """The bring-up of one studio, one walk at a time. ``out`` is where its results are kept."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self._future: Future[Any] | None = None
        self._person: PagePerson | None = None
        self._results: list[Any] = []
        self._trouble = self._folder = ""

    @property
    def running(self) -> bool:
        """Whether a walk is under way."""
        return self._future is not None and not self._future.done()

    def forget(self) -> None:
        """Forget the last walk: another robot comes. Its folder stays."""
        if not self.running:
            self._future, self._person, self._results = None, None, []
            self._trouble = self._folder = ""

    def require_idle(self) -> None:
        """Raise BadRequestError while a walk is under way."""
        if self.running:
            raise BadRequestError("the bring-up is running", hint="wait for its end, or press its Cancel")

    def start(self, session: Session, request: Mapping[str, Any]) -> None:
        """Begin; returns at once. Raises BadRequestError if the robot is armed, or it is not known what to check."""
        self.require_idle()
        check, file = request.get("check"), robot_file(request.get("robot"))
        if check not in WORDS:
            raise BadRequestError(f"unknown check {check!r}")
        robot = session.robot
        if robot is None or session.phase != "connected":
            raise BadRequestError("no robot is connected")
        if robot.status.armed:
            raise BadRequestError("the robot is armed", hint="press Disarm: the checks arm the robot themselves")
        only = None if check == ALL else str(check)
        self._results, self._trouble, self._folder, self._person = [], "", "", None
        self._future = session.do_long(lambda robot: self._walk(robot, file, only))
        self._future.add_done_callback(self._ended)

    def answer(self, request: Mapping[str, Any]) -> None:
        """Take the person's answer. Raises BadRequestError."""
        if self._person is None:
            raise BadRequestError("no question is open")
        self._person.answer(request.get("number"), request.get("yes"))

    def state(self, faults: Collection[str] = ()) -> dict[str, Any]:
        """Return what a page shows: what is said and asked, the wheel that is meant, results so far.

        ``faults`` are what the page can switch in the simulated world.
        """
        person = self._person
        question = None if person is None else person.question
        return {
            "running": self.running,
            "lines": [] if person is None else list(person.lines),
            "question": None if question is None else vars(question),
            "wheel": person.wheel if person is not None and self.running else None,
            "hand": person.simulated_hand(faults) if person is not None and self.running else None,
            "results": [
                {"check": result.check, "ok": result.ok, "findings": [vars(one) for one in result.findings]}
                for result in tuple(self._results)
            ],
            "trouble": self._trouble,
            "folder": self._folder,
        }

    def _walk(self, robot: Robot, file: RobotFile | None, only: str | None) -> None:
        from omniwheel.bringup.sequence import bring_up

        self._person = PagePerson(robot)
        try:
            for result in bring_up(robot, self._person, file=file, only=only):
                self._results.append(result)
        finally:
            set_automatic_rate(robot)

    def _ended(self, future: Future[Any]) -> None:
        error = None if future.cancelled() else future.exception()
        if error is not None:
            self._trouble = in_words(error)
        if not self._results:
            return
        from omniwheel.bringup.results_page import write_results

        try:
            folder = new_run_folder(self._out, "bringup")
            write_results(self._results, folder, "Bring-up")
            self._folder = str(folder)
        except OmniError as problem:
            self._trouble = " ".join(filter(None, (self._trouble, f"The results could not be saved: {problem}")))


def catalogue(simulated: str | None) -> dict[str, Any]:
    """Return what a page offers: checks with their words, robot files, and the one that a simulated robot has."""
    names = robot_names()
    return {"checks": list(WORDS.items()), "robots": names, "robot": simulated if simulated in names else None}


def robot_file(name: Any) -> RobotFile | None:
    """Return the robot file of this name; None for none. Raises BadRequestError."""
    if name is None:
        return None
    if name not in robot_names():
        raise BadRequestError(f"unknown robot {name!r}")
    return read_robot(str(name))


def wiring_picture(name: str) -> str:
    """Return the wiring diagram of a robot of the package as SVG. Raises BadRequestError."""
    from omniwheel.wiring import plan_wiring
    from omniwheel.wiring.diagram import draw_wiring

    file = robot_file(name)
    assert file is not None
    return draw_wiring(plan_wiring(file))
