# SPDX-License-Identifier: MIT
"""What comes late, twice or not at all: answers, robots, servers. The page shows what is true now."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page
from starlette.websockets import WebSocketState

import omniwheel
from omni.studio.access import Access
from omni.studio.outbox import Outbox
from omni.studio.server import StudioServer
from omni.studio.session import Session
from omni.studio.studio import Page as StudioPage
from omni.studio.studio import Studio
from omniwheel.telemetry import StatusText
from tests.studio.parts import Opener, Program, let_live, run_async, running, studio, until
from tests.waiting import receive_until, wait_until

PLOTS = """
const { Plots } = await import("/page/plots.js");
const { MORE, WHOLE, PART } = await import("/page/socket.js");
const asked = [];
const socket = { ask: (action, content) => { asked.push({ action, ...content }); return new Promise(() => {}); } };
const root = document.body.appendChild(document.createElement("div"));
const said = [];
const plots = new Plots(root, socket, (words) => said.push(words), { stored: "test" });
const signal = (key, absent = false) => ({ key, group: "g", label: key, unit: "m", doc: key, absent });
plots.tables([signal("a"), signal("b")], { plots: [{ keys: ["a"], xy: false }], span_s: 10 });
const number = () => asked.filter(({ action }) => action === "show").at(-1).number;
const trace = (place, first, count) => ({ place, time: Float64Array.from({ length: count }, (_, n) => first + n),
  value: new Float32Array(count) });
const count = (key) => plots.samples_of(key).time.length;
"""
"""Plots without a server: `asked` is what they asked for, and nothing is answered."""


@pytest.fixture(scope="module")
def program() -> Iterator[Program]:
    """Run a studio without a robot."""
    with studio() as found:
        yield found


@pytest.fixture
def page(program: Program, open_page: Opener) -> Page:
    found = open_page(program.url)
    until(found, "state")
    return found


def run(page: Page, script: str) -> Any:
    return page.evaluate(f"async () => {{ {PLOTS} {script} }}")


def test_a_part_that_comes_after_going_on_loses_no_samples(page: Page) -> None:
    kept = run(
        page,
        """
        plots.samples({ kind: MORE, number: number(), traces: [trace(0, 0, 100)], arrived: 0 });
        plots.pause(10, 20);
        plots.live();
        plots.samples({ kind: PART, number: number(), traces: [trace(0, 10, 11)], arrived: 0 });
        return count("a");""",
    )
    assert kept == 100


def test_samples_of_another_list_of_signals_are_not_taken_for_these(page: Page) -> None:
    kept = run(
        page,
        """
        const before = number();
        plots.tables([signal("a"), signal("b")], { plots: [{ keys: ["b"], xy: false }], span_s: 10 });
        plots.samples({ kind: MORE, number: before, traces: [trace(0, 0, 5)], arrived: 0 });
        const old = count("b");
        plots.samples({ kind: WHOLE, number: number(), traces: [trace(0, 0, 7)], arrived: 0 });
        return [old, count("b")];""",
    )
    assert kept == [0, 7]


@pytest.mark.parametrize(("again", "found"), [(True, [True, 100, 99]), (False, [False, 0, 0])])
def test_a_link_that_comes_back_leaves_the_plots_another_robot_does_not(
    page: Page, again: bool, found: list[Any]
) -> None:
    script = """
        plots.samples({ kind: MORE, number: number(), traces: [trace(0, 0, 100)], arrived: 0 });
        plots.pause(10, 20);
        plots.tables([signal("a"), signal("b")], null, AGAIN);
        return [plots.paused, count("a"), plots.newest];"""
    assert run(page, script.replace("AGAIN", str(again).lower())) == found


@pytest.mark.parametrize("xy", [False, True])
def test_a_plot_keeps_a_signal_that_the_robot_does_not_have_yet(page: Page, xy: bool) -> None:
    """A sensor that is switched on later, or whose robot comes later."""
    script = """
        const view = { plots: [{ keys: ["b", "a"], xy: XY }], span_s: 10 };
        plots.tables([signal("a"), signal("b", true)], view);
        const first = [...plots.keys];
        plots.tables([signal("a"), signal("b")], null, true);
        return [first, [...plots.keys], plots.view.plots, JSON.parse(localStorage.getItem("test")), said];"""
    first, then, plots, stored, said = run(page, script.replace("XY", str(xy).lower()))
    assert first == ([] if xy else ["a"])
    assert then == ["b", "a"]
    assert plots == [{"keys": ["b", "a"], "xy": xy}]
    assert stored == [{"xy": ["b", "a"]} if xy else ["b", "a"]]
    assert said == []


def test_a_signal_that_is_not_there_is_not_offered_and_stays_chosen(page: Page) -> None:
    chosen = run(
        page,
        """
        const view = { plots: [{ keys: ["b"], xy: false }], span_s: 10 };
        plots.tables([signal("a"), signal("b", true), signal("c", true)], view);
        [...root.querySelectorAll("button")].find((one) => one.textContent.startsWith("Signals")).click();
        const offered = [...document.querySelectorAll("#signal-list input")].map((one) => one.value);
        document.getElementById("close-signals").click();
        await new Promise((done) => setTimeout(done, 100));
        return [offered, plots.view.plots];""",
    )
    assert chosen == [["a", "b"], [{"keys": ["b"], "xy": False}]]


def test_a_key_that_no_signal_has_is_said_and_removed(page: Page) -> None:
    kept, said = run(
        page,
        """
        const plot = (xy, ...keys) => ({ keys, xy });
        const view = { plots: [plot(false, "a", "aa"), plot(true, "a", "aa")], span_s: 10 };
        plots.tables([signal("a"), signal("b")], view);
        return [plots.view.plots, said];""",
    )
    assert kept == [{"keys": ["a"], "xy": False}]
    assert len(said) == 1
    assert "aa" in said[0]


def test_an_added_plot_does_not_end_a_pause(page: Page) -> None:
    paused, last = run(page, "plots.pause(10, 20); plots.add(['b']); return [plots.paused, asked.at(-1)];")
    assert paused
    assert (last["action"], last["begin_s"], last["end_s"]) == ("window", 10, 20)


def test_signals_with_as_many_samples_at_other_times_keep_their_times(page: Page) -> None:
    times, first, second = page.evaluate(
        """async () => {
        const { aligned } = await import("/page/buffers.js");
        const [times, ...columns] = aligned([{ time: [1, 2, 4], value: [10, 20, 40] },
                                             { time: [1, 3, 4], value: [11, 31, 41] }]);
        return [times, ...columns.map((column) => column.map((value) => value ?? null))]; }"""
    )
    assert times == [1, 2, 3, 4]
    assert first == [10, 20, None, 40]
    assert second == [11, None, 31, 41]


@pytest.mark.nightly
def test_a_robot_with_a_younger_clock_is_drawn_at_once(open_page: Opener) -> None:
    with studio("sitl") as program:
        page = open_page(program.url)
        until(page, "studio.plots.newest > 12")
        page.select_option("#rate", "50")
        page.click("#choose")
        until(page, "document.getElementById('scenario').options.length > 0")
        page.click("#simulate-form button")
        until(page, "!document.getElementById('connect-dialog').open && state.link.phase === 'connected'")
        until(page, "studio.plots.samples_of('tracking.pose.x').time.length > 5")
        last = page.evaluate("studio.plots.samples_of('tracking.pose.x').time.at(-1)")
        assert page.evaluate("studio.plots.newest") - last < 1.0
        assert page.input_value("#rate") == "", "a new connection has the automatic rates"


def test_only_the_main_button_moves_the_robot(page: Page) -> None:
    page.fill("#target-x", "7")
    page.locator("#map").click(button="right", position={"x": 40, "y": 40})
    page.locator("#map").click(button="middle", position={"x": 40, "y": 40})
    assert page.input_value("#target-x") == "7"
    page.locator("#map").click(position={"x": 40, "y": 40})
    assert page.input_value("#target-x") != "7"


def test_a_finger_that_the_browser_took_sets_no_target(page: Page) -> None:
    page.fill("#target-x", "7")
    page.evaluate(
        """() => { const map = document.getElementById("map");
        map.setPointerCapture = () => {};
        for (const [type, button] of [["pointerdown", 0], ["pointercancel", -1], ["pointerup", 0]])
          map.dispatchEvent(new PointerEvent(type, { isPrimary: true, button, clientX: 900, clientY: 300 })); }"""
    )
    assert page.input_value("#target-x") == "7"


def test_a_server_that_hangs_is_said_and_comes_back(open_page: Opener) -> None:
    with studio() as program:
        page = open_page(program.url)
        until(page, "state")
        os.kill(program.process.pid, signal.SIGSTOP)
        try:
            page.click("#run-refresh")
            until(page, "state === null && document.getElementById('notice').textContent.includes('does not respond')")
        finally:
            os.kill(program.process.pid, signal.SIGCONT)
        until(page, "state?.commands === 'this page'")
        assert "last request" in (page.text_content("#notice") or "")


def test_a_page_that_was_busy_for_long_does_not_lose_its_server(page: Page) -> None:
    """What the server said meanwhile waits behind the page's own timers."""
    page.evaluate("() => { window.told = studio.state; const end = Date.now() + 7000; while (Date.now() < end); }")
    let_live(page, 1500)
    assert page.evaluate("studio.state === window.told"), "another state comes with another connection"
    assert page.text_content("#notice") == ""


def test_without_a_server_the_page_says_so_once_and_its_windows_do(open_page: Opener) -> None:
    with studio() as program:
        page = open_page(program.url)
        until(page, "state")
        program.end()
        until(page, "state === null && document.getElementById('notice').textContent !== ''")
        page.evaluate(
            """() => { window.said = 0;
            new MutationObserver(() => { window.said += 1; }).observe(
              document.getElementById("notice"), { childList: true, characterData: true, subtree: true }); }"""
        )
        let_live(page, 2000)  # it looks for the server twice a second
        assert page.evaluate("window.said") == 0
        page.click("#choose")
        until(page, "document.getElementById('connect-trouble').textContent.includes('does not respond')")


SPECTRA = """async () => {
  const { showSpectrum } = await import("/page/spectrum.js");
  const answers = [];
  const socket = { ask: () => new Promise((done) => answers.push(done)) };
  const range = { begin: 0, end: 1 };
  const what = (label) => ({ signals: ["a"], labels: [label], units: ["m"], looks: [{ stroke: "red" }], ...range });
  const found = [{ key: "a", Hz: [1, 2], amplitude: [1, 2], peak: { Hz: 2, amplitude: 2 }, resolution_Hz: 1 }];
  const both = [showSpectrum(socket, what("first")), showSpectrum(socket, what("second"))];
  answers[1](found);
  answers[0](found);
  await Promise.all(both);
  const dialog = document.getElementById("spectrum-dialog");
  const shown = [document.querySelectorAll("#spectrum-plot .uplot").length,
    document.getElementById("spectrum-list").textContent];
  const closed = new Promise((done) => dialog.addEventListener("close", () => setTimeout(done)));
  dialog.close();
  await closed;
  return [...shown, document.querySelectorAll("#spectrum-plot .uplot").length];
}"""


def test_of_two_spectra_the_one_asked_for_last_is_shown_and_goes_with_its_window(page: Page) -> None:
    plots, listed, afterwards = page.evaluate(SPECTRA)
    assert (plots, afterwards) == (1, 0)
    assert listed.startswith("second")


def test_a_path_that_was_forgotten_while_it_was_looked_at_cannot_be_followed(page: Page) -> None:
    found = page.evaluate(
        """async () => {
        const { DrawnPath } = await import("/page/draw.js");
        let answer;
        const map = { line: [[0, 0], [1, 0]], heading: 0, planned: (line) => { if (!line) map.line = []; } };
        const path = new DrawnPath(map, () => new Promise((done) => { answer = done; }), () => true);
        const found = { line: [[0, 0], [1, 0]], length_m: 1, duration_s: 1, way_s: 0, slowed: 1 };
        const seen = path.drawn();
        answer(found);
        await seen;
        const again = path.drawn();
        document.getElementById("forget-line").click();
        answer(found);
        await again;
        return [document.getElementById("follow-line").disabled, document.getElementById("draw-text").textContent]; }"""
    )
    assert found == [True, ""]


def test_a_browser_that_keeps_nothing_shows_plots_all_the_same(program: Program, open_page: Opener) -> None:
    page = open_page("about:blank")
    page.add_init_script(
        "Object.defineProperty(window, 'localStorage', { get() { throw new DOMException('no', 'SecurityError'); } });"
    )
    page.goto(program.url)
    until(page, "state")
    assert run(page, "plots.add(['b']); return plots.view.plots.length;") == 2


def test_open_groups_of_parameters_stay_open_when_the_link_comes_back(page: Page) -> None:
    found = page.evaluate(
        """async () => {
        const { ParameterList } = await import("/page/parameters.js");
        const list = new ParameterList(document.createElement("div"), null);
        const info = (name, group) => ({ name, group, kind: "int", unit: "", min: 0, max: 1, default: 0, doc: "",
          values: {}, disarmed_only: false });
        list.tables([info("A_1", "A"), info("B_1", "B")]);
        list.root.querySelectorAll("details")[1].open = true;
        list.tables([info("A_1", "A"), info("B_1", "B")]);
        return [...list.root.querySelectorAll("details")].map(({ open }) => open); }"""
    )
    assert found == [False, True]


def test_a_signal_too_many_is_refused_in_words(page: Page) -> None:
    page.evaluate(
        """async () => {
        const { chooseSignals } = await import("/page/signals.js");
        const signal = (n) => ({ key: `s${n}`, group: "g", label: `s${n}`, unit: "", doc: "" });
        const signals = [...Array(13).keys()].map(signal);
        chooseSignals(signals, signals.slice(0, 12).map(({ key }) => key)); }"""
    )
    page.locator("input[value=s12]").click()
    assert "12 signals at most" in (page.text_content("#signal-text") or "")
    assert not page.is_checked("input[value=s12]")
    page.uncheck("input[value=s0]")
    assert page.text_content("#signal-text") == ""


# ---- the server's side


def told(studio_: Studio, page: StudioPage) -> dict[str, Any]:
    """Return the first news with tables."""
    return receive_until(lambda _: studio_.news(page), lambda found: "tables" in found, "no tables")


class Leaving(Session):
    """A session whose robot goes while a page is told of it."""

    looks = 0

    @property
    def robot(self) -> Any:
        self.looks += 1
        return Robot() if self.looks == 1 else None

    @robot.setter
    def robot(self, _robot: Any) -> None:
        pass


class Robot:
    """Stands for a robot that is asked for its parameters only."""

    def __init__(self) -> None:
        self.parameters = self
        self.known = {"WHEELS": 3.0}


def test_a_robot_that_goes_while_a_page_is_told_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    studio_ = Studio(tmp_path)
    studio_.session = session = Leaving("silent")
    session.phase = "connected"
    page = studio_.open_page()
    monkeypatch.setattr(studio_, "state", lambda page: {})
    monkeypatch.setattr(studio_, "tables", lambda robot: {})
    assert studio_.news(page)["parameters"] == {"WHEELS": 3.0}
    studio_.session = None
    studio_.close()


@pytest.mark.full
def test_a_page_gets_a_robots_tables_once_and_only_when_values_can_be_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fields that come before the robot takes values would lose what is typed into them meanwhile."""
    reached, go_on = threading.Event(), threading.Event()

    def held(_robot: object, _rate_hz: object) -> None:
        reached.set()
        go_on.wait(60.0)

    monkeypatch.setattr("omni.studio.session.set_rate", held)
    link = str(tmp_path / "robot")
    studio_ = Studio(tmp_path)
    page = studio_.open_page()
    try:
        with running("sitl", "--link", f"pty:{link}", "--storage", str(tmp_path / "storage")):
            studio_.session = session = Session(link)
            session.start()
            assert reached.wait(60.0)
            assert session.edits is not None, "all that the tables need is known"
            assert "tables" not in studio_.news(page)
            go_on.set()
            found = told(studio_, page)
            assert found["tables"]["again"] is False
            assert found["parameters"]["ISMC_LAM_XY"] > 0.0
            assert "tables" not in studio_.news(page)
            assert session.do(lambda robot: robot.parameters["ISMC_LAM_XY"]).result(60.0) > 0.0
    finally:
        go_on.set()
        studio_.close()


@pytest.mark.full
def test_a_page_that_comes_while_an_experiment_reads_the_parameters_anew_is_told_all(tmp_path: Path) -> None:
    link = str(tmp_path / "robot")
    studio_ = Studio(tmp_path)
    news: list[dict[str, Any]] = []

    def read_anew(robot: omniwheel.Robot) -> None:
        pages = [StudioPage(number) for number in range(3)]
        robot.connection.add_listener(lambda _: news.extend(studio_.news(page) for page in pages))
        robot.parameters.download()

    try:
        with running("sitl", "--link", f"pty:{link}", "--storage", str(tmp_path / "storage")):
            studio_.session = session = Session(link)
            session.start()
            wait_until(lambda: session.phase == "connected", "no robot is connected")
            parameters = told(studio_, studio_.open_page())["parameters"]
            session.do(read_anew).result(60.0)
    finally:
        studio_.close()
    tables = [found for found in news if "tables" in found]
    assert len(tables) == 3, "once for each page"
    assert all(found["parameters"] == parameters for found in tables)
    assert sum("parameters" in found for found in news) == 3


def test_a_robots_texts_are_told_once_and_before_its_tables(tmp_path: Path) -> None:
    """Why a robot restarted is not to wait for its parameters, and is not said again when the link comes back."""
    studio_ = Studio(tmp_path)
    page = studio_.open_page()
    studio_.session = session = Session("silent")
    for number, words in enumerate(("restarted by the watchdog", "disarmed"), start=1):
        session.text_count = number
        session.texts.append((number, StatusText(4, words)))
        assert studio_.news(page)["texts"] == [{"severity": 4, "text": words}]
    session.connections += 1
    assert "texts" not in studio_.news(page)
    studio_.session = session = Session("another")
    session.text_count = 1
    session.texts.append((1, StatusText(4, "disarmed")))
    assert len(studio_.news(page)["texts"]) == 1
    studio_.session = None
    studio_.close()


class Socket:
    """Stands for a page's socket."""

    application_state = WebSocketState.CONNECTED

    def __init__(self) -> None:
        self.closed: list[int] = []

    async def close(self, code: int) -> None:
        self.closed.append(code)


def test_a_page_that_cannot_be_told_anything_more_is_closed_so_that_it_comes_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    studio_ = Studio(tmp_path)

    def broken(_page: Any) -> Any:
        raise RuntimeError("planted")

    monkeypatch.setattr(studio_, "news", broken)
    server = StudioServer(studio_, Access("127.0.0.1"), tmp_path, dict)
    socket: Any = Socket()
    run_async(server._send(socket, studio_.open_page(), Outbox()))
    assert socket.closed == [1011]
    assert "planted" in caplog.text
    studio_.close()
