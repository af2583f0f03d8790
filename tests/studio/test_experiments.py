# SPDX-License-Identifier: MIT
"""Experiments on the page, on the real firmware: results, and everything that has to end one at once."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page
from websockets.sync.client import ClientConnection, connect

from omni.studio.experiments import KINDS, Experiment, Wanted
from omni.studio.session import Session
from omni.studio.tuned import Tuned
from omniwheel.autotune.procedure import Settings
from omniwheel.robots import read_robot
from tests.studio.parts import NIGHTLY, Opener, Program, studio, take_over, until
from tests.studio.test_hostile import ask, socket_url
from tests.waiting import wait_until

TEXT = "document.getElementById('experiment-text').textContent"
RUN = "state?.experiment"
FIELDS = "[...document.querySelectorAll('[id^=field-]')].map((one) => [one.id, one.value])"
LONG = "position-sweep"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    with studio("sitl", "--out", str(tmp_path_factory.mktemp("runs"))) as program:
        program.hear_robot()
        yield program


@pytest.fixture
def page(simulated: Program, open_page: Opener) -> Page:
    found = open_page(simulated.url)
    until(found, "robot?.pose && state.world?.on")
    if found.evaluate("studio.state.commands") != "this page":
        found.click("#take-over")
    until(found, f"state.commands === 'this page' && !{RUN}?.running")
    found.click("#disarm")
    if found.evaluate("studio.state.robot.state") == "estop":
        found.click("#release")
    until(found, "robot.state === 'disarmed'")
    return found


def start(page: Page, name: str) -> None:
    """Start an experiment. One whose page a busy computer kept silent for too long has ended: it begins again."""
    lost = f"({RUN}?.trouble ?? '').includes('the page in command was closed')"
    page.select_option("#experiment-kind", name)
    assert page.is_disabled("#experiment-start")
    for _ in range(5):
        page.click("#experiment-look")
        until(page, "!document.getElementById('experiment-start').disabled")
        assert "square of" in (page.text_content("#experiment-needs") or "")
        number = page.evaluate("studio.state.experiment?.number ?? 0")
        page.click("#experiment-start")
        until(page, f"{RUN}?.running || ({RUN}?.number > {number} && {lost})")
        if page.evaluate("studio.state.experiment.running"):
            return
        take_over(page)
        until(page, "robot.state === 'disarmed'")
    raise AssertionError(page.evaluate("studio.state.experiment"))


def run_to_the_end(page: Page, name: str) -> None:
    """Run the chosen experiment. One whose setpoints a busy computer held up is over: it begins again."""
    done = f"{TEXT}.startsWith('{name} is done')"
    lost = f"({RUN}?.trouble ?? '').includes('command loss')"
    for _ in range(5):
        page.click("#experiment-look")
        until(page, "!document.getElementById('experiment-start').disabled")
        number = page.evaluate("studio.state.experiment?.number ?? 0")
        page.click("#experiment-start")
        until(page, f"{RUN}?.number > {number} && !{RUN}.running && ({done} || {lost})")
        if page.evaluate(done):
            return
        page.click("#disarm")
        until(page, "robot.state === 'disarmed'")
    raise AssertionError(page.evaluate("studio.state.experiment"))


def parameters(page: Page) -> Any:
    return page.evaluate(FIELDS)


def test_a_step_is_shown_as_figures_and_picture_and_leaves_the_robot_as_it_was(page: Page, simulated: Program) -> None:
    before = parameters(page)
    start(page, "wheel-step")
    newest = page.evaluate("studio.plots.newest")
    until(page, "robot.armed")
    until(page, f"studio.plots.newest > {newest} + 0.5 && {RUN}.running")  # telemetry goes on meanwhile
    until(page, f"{RUN} && !{RUN}.running")
    until(page, f"{TEXT}.startsWith('wheel-step is done')")
    rows = page.locator("#experiment-figures tr")
    assert rows.count() == len(page.evaluate("studio.state.experiment.figures"))
    assert "rise time [s]" in (rows.first.text_content() or "")
    until(page, "document.getElementById('experiment-picture').naturalWidth > 500")
    until(page, "robot.state === 'disarmed'")
    assert len(before) > 100
    assert parameters(page) == before
    folder = Path(page.evaluate("studio.state.experiment.folder"))
    names = {path.name for path in folder.iterdir()}
    assert {"experiment.json", "experiment.png", "burst.npz", "telemetry.tlog", "drive.json"} <= names
    assert "parameters_after.toml" not in names
    found = Axe().run(page).response["violations"]
    assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in found] == []


def test_a_push_can_be_chosen_by_wheel_size_and_time(page: Page) -> None:
    page.select_option("#experiment-kind", "disturbance")
    page.locator("#experiment-choices select").first.select_option(label="wheel 3")
    page.get_by_label("Amplitude [V]").fill("99")
    page.click("#experiment-look")
    until(page, f"{TEXT}.includes('LIM_WHEEL')")
    assert page.is_disabled("#experiment-start")
    page.get_by_label("Amplitude [V]").fill("1.5")
    page.get_by_label("Duration [s]").fill("0.2")
    run_to_the_end(page, "disturbance")
    settings = json.loads((Path(page.evaluate("studio.state.experiment.folder")) / "experiment.json").read_text())
    assert settings["settings"]["wheel"] == 3
    assert settings["settings"]["amplitude_V"] == 1.5
    assert settings["settings"]["duration_s"] == 0.2


def test_too_little_room_is_refused_before_it_can_be_started(page: Page) -> None:
    page.select_option("#experiment-kind", "wheel-step")
    page.get_by_label("Side of the free square").fill("0.2")
    page.click("#experiment-look")
    until(page, f"{TEXT}.includes('square of')")
    assert page.is_disabled("#experiment-start")
    assert "--" not in page.evaluate(TEXT)


@pytest.mark.parametrize("way", ["#stop", *(pytest.param(one, marks=NIGHTLY) for one in ("Space", "#disarm"))])
def test_a_stop_ends_it_at_once(page: Page, way: str) -> None:
    before = parameters(page)
    start(page, LONG)
    until(page, f"{RUN}.phase === 'moving'")
    if way == "Space":
        page.keyboard.press("Space")
    else:
        page.click(way)
    state = "disarmed" if way == "#disarm" else "estop"
    until(page, f"robot.state === '{state}'")
    until(page, f"!{RUN}.running")
    assert page.evaluate(TEXT) == f"{LONG} ended: stopped"
    if state == "estop":
        page.click("#release")
        until(page, "robot.state === 'disarmed'")
    assert parameters(page) == before
    # Nothing of it is left: the robot holds its place, with telemetry and requests as before.
    page.click("#arm")
    until(page, "robot.armed")
    x, y, _ = page.evaluate("studio.state.robot.pose")
    newest = page.evaluate("studio.plots.newest")
    until(page, f"studio.plots.newest > {newest} + 2")
    assert page.evaluate("studio.state.robot.state") == "armed"
    assert page.evaluate(f"Math.hypot(studio.state.robot.pose[0] - {x}, studio.state.robot.pose[1] - {y})") < 0.01


def tune(page: Page) -> None:
    page.select_option("#experiment-kind", "autotune")
    page.click("#experiment-look")
    until(page, "!document.getElementById('experiment-start').disabled")
    assert "drives by itself for some minutes in a square of side 1 m" in (page.text_content("#experiment-needs") or "")
    page.click("#experiment-start")
    until(page, f"{RUN}?.running && {RUN}.phase.includes('legs of') && robot.armed")


def test_autotune_that_is_stopped_leaves_the_old_values(page: Page) -> None:
    before = parameters(page)
    tune(page)
    page.keyboard.press("Space")
    until(page, "robot.state === 'estop'")
    until(page, f"!{RUN}.running")
    assert page.evaluate(TEXT) == "autotune ended: stopped"
    until(page, f"JSON.stringify({FIELDS}) === JSON.stringify({json.dumps(before)})")


def test_after_autotune_a_button_puts_the_other_values_on_the_robot(page: Page) -> None:
    """The server's messages get the result of an autotune that was not driven; the buttons reach the real robot."""
    old = page.evaluate("studio.parameters.value_of('WS_P')")
    sets = {"old": {"WS_P": old}, "new": {"WS_P": old + 1.0}}
    result = {"number": 1, "name": "autotune", "running": False, "needs": "", "trouble": "", "folder": "runs/autotune"}
    outcome = SimpleNamespace(old=sets["old"], new=sets["new"])
    known = {"WS_P": old}

    def with_result(server: Any, message: str | bytes) -> None:
        if isinstance(message, str):
            news = json.loads(message)
            known.update(news.get("parameters", {}))
            gains = Tuned(cast(Any, outcome), Settings(), cast(Any, None)).gains(known)
            if "state" in news:
                news["state"]["experiment"] = {**result, "figures": [], "remarks": [], "picture": False, "gains": gains}
            message = json.dumps(news)
        server.send(message)

    def connected(socket: Any) -> None:
        socket.connect_to_server().on_message(lambda message: with_result(socket, message))

    page.route_web_socket("**/socket*", connected)
    page.reload()
    until(page, "robot?.pose")
    take_over(page)
    for which in ("new", "old"):
        page.click(f"#keep-{which}")
        until(page, f"studio.parameters.value_of('WS_P') === {sets[which]['WS_P']}")
        until(page, f"document.getElementById('keep-{which}').getAttribute('aria-pressed') === 'true'")
        assert page.is_disabled(f"#keep-{which}")


@pytest.mark.nightly
def test_autotune_measures_and_tells_what_came_of_it(page: Page) -> None:
    tune(page)
    until(page, f"!{RUN}.running", wait_s=400.0)
    assert page.evaluate(TEXT).startswith("autotune is done")
    assert "volts per wheel speed [V s/rad]" in (page.text_content("#experiment-figures") or "")
    remarks = page.text_content("#experiment-remarks") or ""
    assert "WS_P 4 →" in remarks
    assert "The new values are kept: " in remarks or "The old values are restored: " in remarks
    kept = "new" if "The new values are kept: " in remarks else "old"
    for which in ("new", "old") if kept == "old" else ("old", "new"):
        page.click(f"#keep-{which}")
        until(page, f"{RUN}.gains.on_robot === '{which}'")
        assert page.get_attribute(f"#keep-{which}", "aria-pressed") == "true"
    folder = Path(page.evaluate("studio.state.experiment.folder"))
    assert {"autotune.md", "autotune.png", "before.toml", "after.toml"} <= {path.name for path in folder.iterdir()}


@pytest.mark.nightly
def test_identification_leaves_a_robot_file(page: Page) -> None:
    page.select_option("#experiment-kind", "identify")
    page.get_by_label("Robot file", exact=True).first.select_option("three_wheel")
    page.get_by_label("Side of the free square").fill("2")
    page.click("#experiment-look")
    until(page, "!document.getElementById('experiment-start').disabled")
    assert "circles and spins for 160 s in a square of about" in (page.text_content("#experiment-needs") or "")
    page.click("#experiment-start")
    until(page, f"{RUN}?.running")
    until(page, f"!{RUN}.running", 900.0)
    assert page.evaluate(f"studio.{RUN}.trouble".replace("?", "")) == ""
    folder = Path(page.evaluate("studio.state.experiment.folder"))
    found = read_robot(str(folder / "identified.toml"))
    assert found.motor["coulomb_friction_N_m"] == pytest.approx(0.05, rel=0.5)
    assert page.is_hidden("#experiment-picture")
    assert "motor inertia" in (page.text_content("#experiment-figures") or "")


def test_a_closed_page_ends_it(page: Page, simulated: Program) -> None:
    start(page, LONG)
    until(page, f"{RUN}.phase === 'moving'")
    page.close()
    wait_until(lambda: not simulated.state()["experiment"]["running"], "it goes on without its page")
    state = simulated.state()
    assert "the page in command was closed" in state["experiment"]["trouble"]
    wait_until(lambda: not simulated.state()["robot"]["armed"], "the robot is armed")


def test_a_fault_in_the_middle_ends_it_with_the_robots_words(page: Page) -> None:
    start(page, "wheel-chirp")
    until(page, f"{RUN}.phase === 'moving'")
    page.click("[data-fault='motor_stalled 1']")
    until(page, f"{TEXT}.includes('ended: the robot stopped by itself (failsafe)')")
    page.click("#mend")
    until(page, "state.world.on.length === 0")


@contextmanager
def taken_over(simulated: Program) -> Iterator[ClientConnection]:
    with connect(socket_url(simulated)) as socket:
        ask(socket, "take_over")
        ask(socket, "disarm")
        ask(socket, "release")
        wait_until(lambda: simulated.state()["robot"]["state"] == "disarmed", "it is not disarmed")
        wait_until(
            lambda: not (simulated.state()["experiment"] or {"running": False})["running"], "another is under way"
        )
        yield socket


def alive(socket: ClientConnection, condition: Callable[[], bool], what: str) -> None:
    """Wait as a page does that lives."""
    wait_until(lambda: ask(socket, "here")["answer"] == 7 and condition(), what)


def until_armed(program: Program, socket: ClientConnection) -> None:
    """Start an experiment. One that a busy computer has ended, because the robot lives in real time, begins again."""

    def seen() -> tuple[bool, bool]:
        state = program.state()
        return bool(state["robot"]["armed"]), bool((state["experiment"] or {"running": False})["running"])

    for _ in range(5):
        ask(socket, "disarm")
        alive(socket, lambda: program.state()["robot"]["state"] == "disarmed", "it is not disarmed")
        wait_until(lambda: "error" not in ask(socket, "experiment", name=LONG, start=True), "it does not start")
        alive(socket, lambda: seen() != (False, True), "it does not move")
        if seen() == (True, True):
            return
    raise AssertionError(program.state()["experiment"])


BAD: list[dict[str, Any]] = [
    {},
    {"name": 3},
    {"name": "no such thing"},
    {"name": "wheel-step", "room_m": "x"},
    {"name": "wheel-step", "room_m": 0},
    {"name": "wheel-step", "room_m": 1e300},
    {"name": "wheel-step", "wheel": 4},
    {"name": "wheel-step", "wheel": -1},
    {"name": "wheel-step", "wheel": 1.5},
    {"name": "wheel-step", "wheel": True},
    {"name": "wheel-step", "on_stand": 1},
    {"name": "position-step", "axis": "z"},
    {"name": "position-step", "axis": ["x"]},
    {"name": "disturbance", "wheel": 0},
    {"name": "identify", "room_m": 10},
    {"name": "identify", "room_m": 10, "file": "no such robot"},
    {"name": "identify", "room_m": 10, "file": ["three_wheel"]},
    {"name": "identify", "room_m": 10, "file": "four_wheel"},
    {"name": "identify", "room_m": 0.5, "file": "three_wheel"},
    {"name": "wheel-step", "file": "three_wheel"},
    {"name": "disturbance", "amplitude": 0},
    {"name": "disturbance", "amplitude": "1"},
    {"name": "disturbance", "amplitude": 1e300},
    {"name": "position-step", "amplitude": 100},
    {"name": "wheel-step", "duration_s": 0},
    {"name": "wheel-step", "duration_s": 1000},
    {"name": "wheel-step", "duration_s": None},
    {"name": "autotune", "rounds": 3},
    {"name": "autotune", "rounds": "many"},
]


@pytest.mark.parametrize("begin", [False, True])
def test_bad_requests_move_nothing(simulated: Program, begin: bool) -> None:
    with taken_over(simulated) as socket:
        for request in BAD:
            answer = ask(socket, "experiment", **request, start=begin)
            if "error" not in answer:  # what only the robot's own numbers can tell is refused before it arms
                assert begin
                alive(socket, lambda: not simulated.state()["experiment"]["running"], "it goes on")
                assert simulated.state()["experiment"]["trouble"], request
            assert not simulated.state()["robot"]["armed"]


def test_while_it_runs_nothing_else_is_done_and_other_pages_watch(simulated: Program) -> None:
    with taken_over(simulated) as socket, connect(socket_url(simulated)) as other:
        assert "another page" in ask(other, "experiment", name=LONG, start=True)["error"]
        assert "error" not in ask(socket, "world", speed=0.5)
        alive(socket, lambda: bool(simulated.state()["world"]["speed"] == 0.5), "the speed stays")
        assert "real time" in ask(socket, "experiment", name=LONG, start=True)["error"]
        ask(socket, "world", speed=1)
        alive(socket, lambda: bool(simulated.state()["world"]["speed"] == 1), "the speed stays")
        assert "error" not in ask(socket, "experiment", name=LONG, start=True)
        for action, content in (
            ("experiment", {"name": LONG}),
            ("experiment", {"name": LONG, "start": True}),
            ("set", {"values": {"ISMC_LAM_XY": 5}}),
            ("velocity", {"vx": 0.1, "vy": 0, "wz": 0}),
            ("arm", {}),
            ("world", {"speed": 0.5}),
        ):
            assert "running" in ask(socket, action, **content)["error"], action
        ask(other, "stop")  # from any page
        alive(socket, lambda: not simulated.state()["experiment"]["running"], "it goes on")
        assert simulated.state()["robot"]["state"] == "estop"
        assert simulated.state()["experiment"]["trouble"] == "stopped"
        ask(socket, "release")


def test_an_armed_robot_is_left_alone(simulated: Program) -> None:
    with taken_over(simulated) as socket:
        assert "error" not in ask(socket, "arm")
        wait_until(lambda: simulated.state()["robot"]["armed"], "it is not armed")
        assert "armed" in ask(socket, "experiment", name="wheel-step", start=True)["error"]
        assert "armed" in ask(socket, "experiment", name="wheel-step")["error"]
        ask(socket, "disarm")


@pytest.mark.full
def test_letting_go_of_the_robot_ends_it(tmp_path: Path) -> None:
    with studio("sitl", "--out", str(tmp_path)) as program, connect(socket_url(program)) as socket:
        wait_until(lambda: bool((program.state()["robot"] or {}).get("pose")), "no robot")
        ask(socket, "take_over")
        until_armed(program, socket)
        assert "error" not in ask(socket, "disconnect")
        wait_until(lambda: not program.state()["experiment"]["running"], "it goes on")
        assert "disconnected" in program.state()["experiment"]["trouble"]


def test_a_stop_before_it_has_begun_keeps_it_from_beginning(tmp_path: Path) -> None:
    """The robot's thread comes to it only after the stop: it must not arm then."""
    touched: list[str] = []
    robot = SimpleNamespace(parameters=SimpleNamespace(download=lambda: touched.append("download")))

    def do_long(work: Any) -> Future[Any]:
        session.stops += 1  # pressed while the experiment was on its way to the robot's thread
        future: Future[Any] = Future()
        try:
            future.set_result(work(robot))
        except Exception as error:
            future.set_exception(error)
        return future

    session = SimpleNamespace(stops=0, do_long=do_long)
    experiment = Experiment(1, cast(Session, session), Wanted(KINDS[0].name, 1.0, 0, "x", False), tmp_path)
    experiment.start()
    wait_until(lambda: not experiment.running, "it does not end")
    assert experiment.state()["trouble"] == "stopped"
    assert touched == []
