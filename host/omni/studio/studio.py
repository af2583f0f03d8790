# SPDX-License-Identifier: MIT
"""The studio without its web server: one robot, any number of pages, one of which commands."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from functools import cache
from pathlib import Path
from typing import Any

from omni.studio.actions import ACTIONS, ENDS_STREAM, FOR_EVERY_PAGE, MOVES, SETPOINTS, BadRequestError
from omni.studio.bringup_walk import BringUp
from omni.studio.bringup_walk import catalogue as bring_up_catalogue
from omni.studio.experiments import Experiments, catalogue
from omni.studio.flasher import Flasher, firmware_of
from omni.studio.parameter_view import table_as_json, values_as_json
from omni.studio.recording import Recorder
from omni.studio.samples import (
    CAPACITY,
    SAMPLES_PART,
    SAMPLES_SINCE,
    SAMPLES_WINDOW,
    SampleStore,
    packed,
    thinned,
)
from omni.studio.session import Session
from omni.studio.signals import (
    MOST_WHEELS,
    Signal,
    all_signals,
    possible_signals,
    require_possible,
    signals_as_json,
)
from omni.studio.simulated import SimulatedRobot, Simulation
from omni.studio.simulated_memory import SimulatedMemory
from omni.studio.spectra import spectrum
from omni.studio.state import fix_as_json, link_state, robot_state, shape_as_json
from omni.studio.views import checked_view, read_view, view_file, write_view
from omni.studio.worker import Worker
from omniwheel.errors import OmniError
from omniwheel.link import parse_url
from omniwheel.robot import Robot
from omniwheel.sensor_quality import SENSORS, Sensor

HISTORY_WIDTH = 2000
_STREAMED_S = 1.0
"""A page repeats its setpoints far more often; the robot takes them for lost after SAFE_CMD_TO."""


class Page:
    """What one open page has been told. Touched by the server's thread only."""

    def __init__(self, number: int) -> None:
        self.name = f"page {number}"
        self.shown: list[Signal] = []
        """Those that it wants. One that the robot does not have yet begins when it does."""
        self.shown_number = 0
        """What the page calls this list of signals: it may have asked for another one meanwhile."""
        self.sent: dict[str, int] = {}
        """Number of the next sample in ``sent_of``, by signal."""
        self.sent_of: SampleStore | None = None
        self.session: Session | None = None
        """Whose tables it has."""
        self.connection = 0
        self.existing: frozenset[str] = frozenset()
        """Keys of the signals that the robot of its tables has: a sensor or a wheel may come later."""
        self.heard: Session | None = None
        """Whose texts it has been told."""
        self.text_count = 0
        self.fix_count = 0
        self.mark_changes = -1
        self.values: dict[str, float] = {}
        self.state: dict[str, Any] = {}

    @property
    def keys(self) -> list[str]:
        """The shown signals' keys, in the order in which the page numbers them."""
        return [signal.key for signal in self.shown]


class Studio:
    """Everything that the pages share. ``out`` is where experiments leave their folders."""

    def __init__(self, out: Path = Path("runs")) -> None:
        self.experiments = Experiments(out)
        self.worker = Worker()
        self.recorder = Recorder(out, self.worker)
        self.flasher = Flasher()
        self.bring_up = BringUp(out)
        self.session: Session | None = None
        self.simulated: SimulatedRobot | None = None
        self.simulated_memory = SimulatedMemory()
        self.pages: list[Page] = []
        self.commanding: Page | None = None
        self._numbers = itertools.count(1)
        self._setpoint_s = float("-inf")
        """When a page sent the last setpoint of a stream that may still go on, on the monotonic clock."""

    # ---- pages

    def open_page(self) -> Page:
        """A page has come; the first one commands."""
        page = Page(next(self._numbers))
        self.pages.append(page)
        if self.commanding is None:
            self.take_over(page)
        return page

    def close_page(self, page: Page) -> None:
        """Handle a page's end. If it was in command, no page is until one takes over."""
        self.pages.remove(page)
        if self.commanding is page:
            self.commanding = None
            if self.session is not None:
                self.session.page_heard_s = float("-inf")

    def take_over(self, page: Page) -> None:
        """Let this page command. A robot that another page drives by setpoints comes to rest; a path goes on."""
        interrupts = self.commanding is not page and time.monotonic() - self._setpoint_s < _STREAMED_S
        self.commanding = page
        self.heard(page)
        if interrupts and self.session is not None:
            self.session.come_to_rest()

    def heard(self, page: Page) -> None:
        """Note that this page lives."""
        if self.session is not None and self.commanding is page:
            self.session.page_commands = True
            self.session.page_heard_s = time.monotonic()

    # ---- the robot

    def connect(self, url: str, system_id: int | None = None) -> None:
        """Connect to a robot instead of the one before.

        Raises LinkUrlError for an address that is none, BadRequestError during an upload; the robot is kept then.
        """
        parse_url(url)
        self.flasher.require_idle()
        self.disconnect()
        self._begin(url, system_id)

    def _begin(self, url: str, system_id: int | None = None) -> None:
        self.experiments.forget()
        self.bring_up.forget()
        simulated = self.simulated
        slowness = (lambda: 1.0) if simulated is None else (lambda: simulated.slowness)
        self.session = Session(url, slowness, system_id)
        if self.commanding is not None:
            self.heard(self.commanding)
        self.session.start()

    def disconnect(self) -> None:
        """Let go of the robot. It is disarmed if it was armed from here; a simulated one ends."""
        self.recorder.end()
        if self.session is not None:
            self.session.close()  # before the disk is waited for: it disarms the robot
            self.session = None
        self.recorder.stop()
        if self.simulated is not None:
            self.simulated.close()
            self.simulated = None

    def close(self) -> None:
        """Let go of everything; a recording gets its figures before."""
        self.flasher.close()
        self.disconnect()
        self.simulated_memory.close()
        self.recorder.close()
        self.worker.close()

    def simulate(self, wanted: Simulation) -> None:
        """Start a simulated robot and connect to it. Raises FirmwareStartError; the robot before is kept then."""
        memory = self.simulated_memory.copy_for(wanted)
        started = SimulatedRobot(wanted, memory)
        self.simulated_memory.keep(wanted, memory)
        self.disconnect()
        self.simulated = started
        self._begin(self.simulated.url)

    def flash(self, page: Page, request: Mapping[str, Any]) -> None:
        """Check firmware, upload what was checked with ``"upload": true``, or end that. Raises BadRequestError.

        An upload lets go of the robot before: its port is needed, and it is disarmed. One that is refused does not.
        """
        self.require_command(page)
        if request.get("end") is True:
            self.flasher.end()
        elif request.get("upload") is True:
            firmware = firmware_of(request)
            self.flasher.require_checked(firmware)
            self.disconnect()
            self.flasher.upload(firmware)
        else:
            self.flasher.check(firmware_of(request))

    def require_command(self, page: Page) -> None:
        """Raise BadRequestError for a page that only watches."""
        if page is not self.commanding:
            raise BadRequestError("another page is in command", hint="press Take over first")

    def require_session(self) -> Session:
        """Return the session with a robot. Raises BadRequestError."""
        if self.session is None:
            raise BadRequestError("no robot is connected", hint="connect to one at the top of the page")
        return self.session

    def change_world(self, page: Page, request: Mapping[str, Any]) -> None:
        """Break or mend something in the simulated world, or change its speed. Raises BadRequestError, LinkError."""
        self.require_command(page)
        if self.simulated is None:
            raise BadRequestError("the robot is not simulated by this studio")
        if "speed" in request:
            self.experiments.require_idle()
            self.bring_up.require_idle()
        self.simulated.change(request)

    def experiment(self, page: Page, request: Mapping[str, Any]) -> Future[Any] | None:
        """Begin an experiment; without ``"start": true`` only say what it will use. Raises BadRequestError."""
        self.require_command(page)
        session = self.require_session()
        self.bring_up.require_idle()
        if request.get("start") is not True:
            return self.experiments.needs(session, request)
        if self.simulated is not None and self.simulated.speed != 1.0:
            raise BadRequestError("the simulation is not in real time", hint="an experiment needs real time")
        self.experiments.start(session, request)
        return None

    def walk(self, page: Page, request: Mapping[str, Any]) -> None:
        """Begin the bring-up with ``"start": true``, or answer what it asks. Raises BadRequestError."""
        self.require_command(page)
        if request.get("start") is not True:
            self.bring_up.answer(request)
            return
        self.experiments.require_idle()
        if self.simulated is not None and self.simulated.speed != 1.0:
            raise BadRequestError("the simulation is not in real time", hint="the bring-up needs real time")
        self.bring_up.start(self.require_session(), request)

    def stop(self) -> bool:
        """Emergency stop, before everything; return whether a robot could be told."""
        return self.session is not None and self.session.stop_now()

    @property
    def stops(self) -> int:
        """How often the robot was to be stopped or disarmed from here."""
        return 0 if self.session is None else self.session.stops

    def disarm(self) -> bool:
        """Disarm, before everything; return whether a robot could be told."""
        return self.session is not None and self.session.disarm_now()

    def ask(self, page: Page, action: str, request: Mapping[str, Any]) -> Future[Any]:
        """Have the robot do one of :data:`ACTIONS`. Raises BadRequestError."""
        work = ACTIONS.get(action)
        if work is None:
            raise BadRequestError(f"unknown action {action!r}")
        if action not in FOR_EVERY_PAGE:
            self.require_command(page)
        session = self.require_session()
        self.experiments.require_idle()
        self.bring_up.require_idle()
        if action in SETPOINTS:
            self._setpoint_s = time.monotonic()
        elif action in ENDS_STREAM:
            self._setpoint_s = float("-inf")
        if "step" in request:  # each page numbers its own
            request = {**request, "step": (page.name, request["step"])}
        if action in MOVES:
            return session.do_long(lambda robot: work(robot, _edits(session), request))
        return session.do(lambda robot: work(robot, _edits(session), request), is_setpoint=action in SETPOINTS)

    # ---- what a page is told

    def show(self, page: Page, keys: Sequence[str], span_s: float, number: int = 0) -> bytes:
        """Note which signals a page shows, as its list ``number``; return what was there in the last ``span_s``.

        Signals that the robot does not have now begin as soon as it has them. Raises UnknownSignalError.
        """
        require_possible(keys, possible_signals())
        page.shown, page.shown_number = [possible_signals()[key] for key in keys], number
        page.sent = {}
        session = self.session
        if session is None:
            return b""
        shown = self._existing(page)
        with session.lock:
            begin_s = session.store.now_s - span_s
            traces = [session.store.window(signal, begin_s, float("inf"), HISTORY_WIDTH) for signal in shown]
            page.sent = {signal.key: session.store.count(signal) for signal in shown}
            page.sent_of = session.store
            arrived_s = session.store.arrived_s
        return packed(SAMPLES_WINDOW, arrived_s, traces, page.keys, page.shown_number)

    def window(self, page: Page, begin_s: float, end_s: float, width: int) -> bytes:
        """Return what a plot of the shown signals sees between two times."""
        session = self.session
        if session is None:
            return b""
        shown = self._existing(page)
        with session.lock:
            traces = [session.store.window(signal, begin_s, end_s, width) for signal in shown]
            arrived_s = session.store.arrived_s
        return packed(SAMPLES_PART, arrived_s, traces, page.keys, page.shown_number)

    def spectra(self, keys: Sequence[str], begin_s: float, end_s: float) -> list[dict[str, Any]]:
        """Return the spectra of signals between two times.

        Raises UnknownSignalError, BadRequestError without a robot, TooFewSamplesError.
        """
        require_possible(keys, possible_signals())
        session = self.require_session()
        found = []
        for signal in (possible_signals()[key] for key in keys):
            with session.lock:  # the robot's thread waits for it: one signal at a time
                trace = session.store.window(signal, begin_s, end_s, CAPACITY)
            found.append(spectrum(trace).as_json())
        return found

    def new_samples(self, page: Page) -> bytes:
        """Return what came since the last call for the signals that a page shows; b"" if nothing."""
        session = self.session
        if session is None or not page.shown:
            return b""
        shown = self._existing(page)
        with session.lock:
            if page.sent_of is not session.store:
                page.sent, page.sent_of = {}, session.store
            traces = [session.store.since(signal, page.sent.get(signal.key, 0)) for signal in shown]
            page.sent |= {signal.key: session.store.count(signal) for signal in shown}
            arrived_s = session.store.arrived_s
        if not any(len(trace.time_s) for trace in traces):
            return b""
        thin = [thinned(trace, HISTORY_WIDTH) for trace in traces]
        return packed(SAMPLES_SINCE, arrived_s, thin, page.keys, page.shown_number)

    def _existing(self, page: Page) -> list[Signal]:
        """Return those of the signals that a page shows which the connected robot has."""
        session = self.session
        robot = None if session is None else session.robot  # once: its own thread lets go of it
        if session is None or robot is None:
            return page.shown
        existing = _keys_of(session, robot)
        return [signal for signal in page.shown if signal.key in existing]

    def news(self, page: Page) -> dict[str, Any]:
        """Return what a page has not been told yet: state, parameters, texts, marks, tables of a new robot."""
        session = self.session
        found: dict[str, Any] = {}
        state = self.state(page)
        if state != page.state:
            page.state = found["state"] = state
        robot = None if session is None else session.robot  # once: its own thread lets go of it
        if page.heard is not session:
            page.heard, page.text_count = session, 0
            found["forget"] = True  # what is of the robot before
        if session is None:
            page.session = None
            return found
        texts = self._new_texts(page, session)
        if texts:
            found["texts"] = texts
        if robot is None or session.phase != "connected":
            return found  # a page shows nothing to set before it can be set
        existing = _keys_of(session, robot)  # once: the robot's own thread may change it
        if (page.session, page.connection, page.existing) != (session, session.connections, existing):
            again = page.session is session
            page.session, page.connection, page.existing = session, session.connections, existing
            page.fix_count = session.fix_count  # a map shows fixes from now on
            page.mark_changes, page.values = -1, {}
            found["tables"] = {**self.tables(robot), "again": again}
        values = robot.parameters.known
        if values != page.values:
            found["parameters"] = values_as_json(
                {name: value for name, value in values.items() if page.values.get(name) != value}
            )
            page.values = dict(values)
        with session.lock:
            fixes = [fix for number, fix in session.fixes if number > page.fix_count]
            page.fix_count = session.fix_count
            if session.mark_changes != page.mark_changes:
                page.mark_changes = session.mark_changes
                found["marks"] = [mark.as_json() for mark in session.marks.all()]
        if fixes:
            found["fixes"] = [fix_as_json(fix) for fix in fixes]
        return found

    def _new_texts(self, page: Page, session: Session) -> list[dict[str, Any]]:
        """Return what the robot has said, also while it is being connected: why it restarted, for one."""
        with session.lock:
            texts = [text for number, text in session.texts if number > page.text_count]
            page.text_count = session.text_count
        return [{"severity": text.severity, "text": text.text} for text in texts]

    def save_view(self, page: Page, view: Any) -> None:
        """Keep what the plots of this robot show. Raises BadRequestError, UnknownSignalError, OutputFileError."""
        self.require_command(page)
        path = self._view_file()
        if path is None:
            raise BadRequestError("no robot is connected")
        checked = checked_view(view)
        require_possible((key for plot in checked["plots"] for key in plot["keys"]), possible_signals())
        write_view(path, checked)

    def _view_file(self) -> Path | None:
        history = None if self.session is None else self.session.history
        return None if history is None else view_file(history, "" if self.simulated is None else self.simulated.robot)

    def tables(self, robot: Robot) -> dict[str, Any]:
        """Return what stays the same as long as a robot is connected: all signals and its parameters' table."""
        assert self.session is not None
        return {
            "signals": signals_as_json(possible_signals().values(), _keys_of(self.session, robot)),
            "view": None if (path := self._view_file()) is None else read_view(path),
            "parameters": table_as_json(robot.table),
            "world": None if self.simulated is None else self.simulated.catalogue,
            "bring_up": bring_up_catalogue(None if self.simulated is None else self.simulated.robot),
            "version": str(robot.version),
            **shape_as_json(robot),
            "experiments": catalogue(robot),
        }

    def state(self, page: Page | None = None) -> dict[str, Any]:
        """Return the state as the page shows it."""
        session = self.session
        robot = None if session is None else session.robot
        edits = None if session is None else session.edits
        undo, redo = (0, 0) if edits is None else edits.steps
        return {
            "link": link_state(session),
            "simulated": None if self.simulated is None else str(self.simulated.wanted),
            "world": None if self.simulated is None else self.simulated.state(),
            "experiment": self.experiments.state(),
            "robot": None if session is None or robot is None else robot_state(robot, session.sensors),
            "drive_ended": "" if session is None else session.drive_ended,
            "last_stop": None if session is None else session.last_stop.as_json(),
            "recording": self.recorder.state(),
            "flash": self.flasher.state(),
            "bring_up": self.bring_up.state(self._faults()),
            "undo": undo,
            "redo": redo,
            "commands": self._who_commands(page),
            "pages": len(self.pages),
        }

    def _faults(self) -> list[str]:
        """Return the faults that a page can switch in the simulated world."""
        world = None if self.simulated is None else self.simulated.catalogue
        return [] if world is None else [fault["name"] for fault in world["faults"]]

    def _who_commands(self, page: Page | None) -> str:
        if self.commanding is None:
            return "no page"
        return "this page" if self.commanding is page else self.commanding.name


def _keys_of(session: Session, robot: Robot) -> frozenset[str]:
    """Return the keys of what the connected robot can send: of a sensor that it does not have, nothing."""
    return _keys(int(robot.parameters.known.get("WHEELS", MOST_WHEELS)), session.sensors)


@cache
def _keys(wheels: int, sensors: tuple[Sensor, ...]) -> frozenset[str]:
    without = [sensor.kind for sensor in SENSORS if sensor not in sensors]
    return frozenset(signal.key for signal in all_signals(wheels, without))


def _edits(session: Session) -> Any:
    if session.edits is None:
        raise OmniError("the robot is not connected yet")
    return session.edits
