# SPDX-License-Identifier: MIT
"""Experiments on the page: the same as ``omni experiment``, run by the robot's thread while telemetry goes on.

What an experiment does to the robot is :mod:`omniwheel.experiments`' matter. Here are its words and choices for the
page, and how it is begun, watched and ended.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from omni.studio.actions import BadRequestError, Request, number_of
from omni.studio.error_text import in_words
from omni.studio.session import Session, WorkEndedError
from omniwheel.connection import Recorder
from omniwheel.drive_log import DriveLog
from omniwheel.errors import LimitError, OmniError
from omniwheel.number_text import finite
from omniwheel.robot import Robot
from omniwheel.robots import robot_names
from omniwheel.tuning import AXES

if TYPE_CHECKING:
    from omni.studio.identified import Identified
    from omni.studio.tuned import Tuned
    from omniwheel.experiments import Outcome

SMALLEST_ROOM_M, LARGEST_ROOM_M, USUAL_ROOM_M = 0.1, 20.0, 1.0
_ALL = 0
SHORTEST_S, LONGEST_S = 0.05, 120.0
_POSITION, _WHEEL = ("position-step", "position-sweep"), ("wheel-step", "wheel-chirp")
_AUTOTUNE, _IDENTIFY = "autotune", "identify"
_ROUNDS = ((2, "quick: 2 rounds"), (4, "4 rounds"), (10, "sure: 10 rounds"))
_PHASES = ("preparing", "moving", "fetching the recording", "drawing")


@dataclass(frozen=True)
class Kind:
    """One experiment: its name as of ``omni experiment``, what it shows, and what must be chosen."""

    name: str
    words: str
    choices: tuple[str, ...]
    unit: str = ""
    """Of the signal's size; "" where there is none to choose."""
    duration_s: float = 0.0
    """Of the signal, usually."""


KINDS = (
    Kind("wheel-step", "Step response of a wheel's speed loop", ("wheel number or all", "on_stand"), "rad/s", 0.5),
    Kind(
        "wheel-chirp",
        "Bandwidth, margins and delay of a wheel's loop",
        ("wheel number or all", "on_stand"),
        "rad/s",
        2.5,
    ),
    Kind("position-step", "Step response of the position loop, without ramps", ("axis",), "m or rad", 1.0),
    Kind("position-sweep", "Bandwidth and margins of the position loop", ("axis",), "m or rad", 12.0),
    Kind("disturbance", "Deviation after a voltage step on one wheel", ("wheel",), "V", 0.1),
    Kind(_AUTOTUNE, "Tune the gains automatically, and compare with the old ones", ("rounds",)),
    Kind(_IDENTIFY, "Identify motors, friction and inertia; write a robot file", ("file",)),
)
"""In the order of docs/guides/experiments.md, then autotune. Each moves the robot by itself."""


@dataclass(frozen=True)
class Wanted:
    """What a page chose. ``wheel`` counts from 1; 0 is all of them.

    ``file`` is the robot file whose layout it has. ``amplitude`` is the signal's size in its own unit; NaN: as the
    robot allows.
    """

    name: str
    room_m: float
    wheel: int
    axis: str
    on_stand: bool
    rounds: int = 4
    file: str = ""
    amplitude: float = math.nan
    duration_s: float = 1.0

    def run(self, robot: Robot, tell: Callable[[str], None]) -> Outcome | Tuned | Identified:
        """Do it; the first thing told is what it needs. Raises LimitError before the robot moves, ExperimentError."""
        from omniwheel import experiments

        if self.name == _AUTOTUNE:
            from omni.studio.tuned import tune

            return tune(robot, self.room_m, self.rounds, tell)
        if self.name == _IDENTIFY:
            from omni.studio.identified import identify

            return identify(robot, self.file, self.room_m, tell)
        if self.name in _WHEEL:
            wheel_run = experiments.wheel_step if self.name == "wheel-step" else experiments.wheel_chirp
            wheels = experiments.WheelPlan(
                self.wheel, amplitude_rad_s=self.amplitude, duration_s=self.duration_s, on_stand=self.on_stand
            )
            return wheel_run(robot, wheels, self.room_m, tell)
        if self.name in _POSITION:
            run = experiments.position_step if self.name == "position-step" else experiments.position_sweep
            plan = experiments.PositionPlan(self.axis, self.amplitude, self.duration_s)
            return run(robot, plan, self.room_m, tell)
        push = experiments.PushPlan(self.wheel, self.amplitude, self.duration_s)
        return experiments.disturbance(robot, push, self.room_m, tell)


class _ReportedError(Exception):
    """Ends a preview after the experiment has said what it needs, before it does anything."""


def catalogue(robot: Robot) -> list[dict[str, Any]]:
    """Return the experiments as a page shows them; each choice has ``key``, ``label`` and its ``options``, or a range.

    An option is a value and its words. A range without a default may stay empty.
    """
    wheels = [[number, f"wheel {number}"] for number in range(1, int(robot.parameters.known["WHEELS"]) + 1)]
    choices = {
        "wheel": {"key": "wheel", "label": "Wheel", "options": wheels},
        "wheel number or all": {"key": "wheel", "label": "Wheel", "options": [[_ALL, "all wheels"], *wheels]},
        "axis": {"key": "axis", "label": "Axis", "options": [[axis, axis] for axis in AXES]},
        "rounds": {
            "key": "rounds",
            "label": "Comparison of old and new gains",
            "options": [list(option) for option in _ROUNDS],
        },
        "file": {"key": "file", "label": "Robot file", "options": [[name, name] for name in robot_names()]},
        "on_stand": {
            "key": "on_stand",
            "label": "The robot",
            "options": [[False, "stands on the floor"], [True, "is on a stand, wheels lifted"]],
        },
    }
    room = {
        "key": "room_m",
        "label": "Side of the free square [m]",
        "min": SMALLEST_ROOM_M,
        "max": LARGEST_ROOM_M,
        "default": USUAL_ROOM_M,
    }
    return [
        {
            "name": kind.name,
            "words": kind.words,
            "choices": [*(choices[name] for name in kind.choices), *_signal(kind), room],
        }
        for kind in KINDS
    ]


def _signal(kind: Kind) -> list[dict[str, Any]]:
    """Return the fields for the size of an experiment's signal, which may stay empty, and for its duration."""
    if not kind.unit:
        return []
    size = {"key": "amplitude", "label": f"Amplitude [{kind.unit}]", "min": None, "max": None, "default": None}
    time = {
        "key": "duration_s",
        "label": "Duration [s]",
        "min": SHORTEST_S,
        "max": LONGEST_S,
        "default": kind.duration_s,
    }
    return [size, time]


def wanted_of(request: Request) -> Wanted:
    """Return what a page asks for. Raises BadRequestError."""
    name, axis, on_stand = request.get("name"), request.get("axis", AXES[0]), request.get("on_stand", False)
    if not isinstance(name, str) or name not in {kind.name for kind in KINDS}:
        raise BadRequestError(f"unknown experiment {name!r}")
    if not isinstance(axis, str) or axis not in AXES:
        raise BadRequestError(f"unknown axis {axis!r}")
    if not isinstance(on_stand, bool):
        raise BadRequestError(f"on_stand must be true or false, not {on_stand!r}")
    room_m, wheel = number_of(request, "room_m", USUAL_ROOM_M), number_of(request, "wheel", 1.0)
    if not SMALLEST_ROOM_M <= room_m <= LARGEST_ROOM_M:
        raise BadRequestError(f"room_m must be from {SMALLEST_ROOM_M:g} to {LARGEST_ROOM_M:g}, not {room_m:g}")
    if not wheel.is_integer():
        raise BadRequestError(f"unknown wheel {wheel:g}")
    usual_s = next(kind.duration_s for kind in KINDS if kind.name == name)
    amplitude, duration_s = request.get("amplitude"), number_of(request, "duration_s", usual_s or SHORTEST_S)
    if not SHORTEST_S <= duration_s <= LONGEST_S:
        raise BadRequestError(f"duration_s must be from {SHORTEST_S:g} to {LONGEST_S:g}, not {duration_s:g}")
    size = math.nan if amplitude is None else number_of(request, "amplitude")
    if size == 0.0:
        raise BadRequestError("the amplitude must not be 0", hint="leave it empty for the default")
    rounds = number_of(request, "rounds", _ROUNDS[0][0])
    if rounds not in {number for number, _ in _ROUNDS}:
        raise BadRequestError(f"rounds must be {', '.join(str(number) for number, _ in _ROUNDS)}, not {rounds:g}")
    file = request.get("file", "")
    if file not in (robot_names() if name == _IDENTIFY else ("",)):
        raise BadRequestError(f"unknown robot file {file!r}")
    return Wanted(name, room_m, int(wheel), axis, on_stand, int(rounds), file, size, duration_s)


def needs_of(robot: Robot, wanted: Wanted) -> str:
    """Return what an experiment will use, in words; nothing moves. Raises BadRequestError if it cannot be."""
    said: list[str] = []

    def tell(text: str) -> None:
        said.append(text)
        raise _ReportedError

    try:
        with suppress(_ReportedError):
            wanted.run(robot, tell)
    except LimitError as error:
        raise BadRequestError(in_words(error)) from error
    return said[0]


def prepare() -> None:
    """Import what experiments compute and draw with: it takes a second, which no stop shall wait for.

    Raises MissingPackageError.
    """
    from omniwheel.identification.estimate import require_scipy

    for module in ("linalg", "signal", "special"):
        require_scipy(module)
    for module in ("omniwheel.experiments.folder", "omni.studio.identified", "omni.studio.tuned"):
        import_module(module)


class Experiment:
    """One experiment under way, or its result. Begun by :meth:`start`; :meth:`state` is for any thread."""

    def __init__(self, number: int, session: Session, wanted: Wanted, out: Path) -> None:
        self.number = number
        self.picture: Path | None = None
        self._session, self._wanted, self._out = session, wanted, out
        self._stops = session.stops
        self._began_s = time.monotonic()
        self._phase = _PHASES[0]
        self._needs = self._step = self._trouble = ""
        self._outcome: Outcome | Tuned | Identified | None = None
        self._folder = ""
        self._thread = threading.Thread(target=self._run, name=f"experiment {wanted.name}", daemon=True)

    def start(self) -> None:
        """Begin; returns at once."""
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it is under way."""
        return self._thread.is_alive()

    def state(self) -> dict[str, Any]:
        """Return how far it is, and its figures once it is done, as plain data; numbers in SI, null where unknown."""
        outcome, running = self._outcome, self.running
        found: dict[str, Any] = {"number": self.number, "name": self._wanted.name, "running": running}
        found |= {"needs": self._needs, "trouble": self._trouble}
        if running:
            return {**found, "phase": self._step or self._phase, "seconds": int(time.monotonic() - self._began_s)}
        if outcome is not None:
            rows = [{"name": figure.name, **figure.as_dict()} for figure in outcome.figures]
            found |= {"figures": finite(rows), "remarks": list(outcome.remarks), "folder": self._folder}
            found["picture"] = self.picture is not None
            found["gains"] = self._gains(outcome)
        return found

    def _gains(self, outcome: Outcome | Tuned | Identified) -> dict[str, Any] | None:
        """Return old and new gains to choose from; None for an experiment that changes none."""
        robot = self._session.robot  # once: its own thread lets go of it
        if robot is None or self._wanted.name != _AUTOTUNE:
            return None
        return cast("Tuned", outcome).gains(robot.parameters.known)

    def _run(self) -> None:
        try:
            with DriveLog(self._out, self._wanted.name, self._wanted.name) as log:
                outcome = self._session.do_long(lambda robot: self._measured(robot, log)).result()
                self._phase, self._step, self._folder = _PHASES[3], "", str(log.folder)
                self.picture = _written(outcome, log.folder)
                self._outcome = outcome
        except OmniError as error:
            self._trouble = in_words(error)
        except Exception as error:
            self._trouble = f"internal error, please report it: {error!r}"
            raise

    def _measured(self, robot: Robot, log: DriveLog) -> Outcome | Tuned | Identified:
        """Run in the robot's thread. The robot is disarmed at the end, whatever happens."""
        if self._session.stops != self._stops:
            raise WorkEndedError("stopped")
        log.connected(robot, set_rates=False)  # the studio's own are higher
        recording = robot.connection.recorder  # of the page, which goes on meanwhile
        robot.connection.recorder = log.write if recording is None else _both(recording, log.write)
        remove = robot.connection.add_listener(lambda _: self._note_phase(robot))
        try:
            return self._wanted.run(robot, self._report_progress)
        finally:
            remove()
            robot.connection.recorder = recording

    def _report_progress(self, text: str) -> None:
        if self._needs:
            self._step = text
        else:
            self._needs = text

    def _note_phase(self, robot: Robot) -> None:
        if robot.status.armed:
            self._phase = _PHASES[1]
        elif self._phase == _PHASES[1]:
            self._phase = _PHASES[2]


def _written(outcome: Outcome | Tuned | Identified, folder: Path) -> Path | None:
    """Write everything into a folder and return the picture, if there is one. Raises OmniError."""
    from omni.studio.identified import Identified
    from omni.studio.tuned import Tuned
    from omniwheel.experiments.folder import PICTURE_FILE, write_outcome

    if isinstance(outcome, Identified):
        outcome.write(folder)
        return None
    if isinstance(outcome, Tuned):
        return outcome.write(folder)
    write_outcome(outcome, folder)
    return folder / PICTURE_FILE


def _both(one: Recorder, other: Recorder) -> Recorder:
    def record(frame: bytes) -> None:
        one(frame)
        other(frame)

    return record


class Experiments:
    """The experiments of one studio, one at a time. ``out`` is where their folders are made."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self._last: Experiment | None = None

    @property
    def running(self) -> bool:
        """Whether one is under way."""
        return self._last is not None and self._last.running

    @property
    def picture(self) -> Path | None:
        """The last one's picture."""
        return None if self._last is None else self._last.picture

    def state(self) -> dict[str, Any] | None:
        """Return the last one's state; None if there was none."""
        return None if self._last is None else self._last.state()

    def forget(self) -> None:
        """Forget the last one: another robot comes. Its folder stays."""
        if not self.running:
            self._last = None

    def require_idle(self) -> None:
        """Raise BadRequestError while one is under way."""
        if self.running:
            raise BadRequestError("an experiment is running", hint="wait for its end, or stop it with STOP or Disarm")

    def needs(self, session: Session, request: Mapping[str, Any]) -> Future[str]:
        """Return a future of what an experiment will use, in words. Raises BadRequestError as :meth:`start`."""
        wanted = self._checked(session, request)
        return session.do(lambda robot: needs_of(robot, wanted))

    def start(self, session: Session, request: Mapping[str, Any]) -> None:
        """Begin one. Raises BadRequestError if another is under way, or the robot is armed."""
        wanted = self._checked(session, request)
        number = 1 if self._last is None else self._last.number + 1
        self._last = Experiment(number, session, wanted, self._out)
        self._last.start()

    def _checked(self, session: Session, request: Mapping[str, Any]) -> Wanted:
        self.require_idle()
        wanted = wanted_of(request)
        robot = session.robot
        if robot is None or session.phase != "connected":
            raise BadRequestError("no robot is connected")
        if robot.status.armed:
            raise BadRequestError("the robot is armed", hint="press Disarm: an experiment arms the robot itself")
        return wanted
