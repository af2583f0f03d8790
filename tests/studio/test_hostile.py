# SPDX-License-Identifier: MIT
"""Clients that are no page of the studio: garbage, floods, other sites; and other programs at the same robot."""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import socket as py_socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import ClientConnection, connect

from omni.studio.server import MOST_PAGES
from omni.studio.signals import possible_signals
from tests.studio.parts import Opener, Program, running, studio, until
from tests.waiting import LONGEST_S, pass_time, receive_until, wait_until


def socket_url(program: Program, token: str = "") -> str:
    return program.url.split("?")[0].replace("http", "ws") + "socket?token=" + token


def ask(socket: ClientConnection, action: str, **content: Any) -> dict[str, Any]:
    """Send a request and return its answer; what comes in between is left out."""
    socket.send(json.dumps({"do": action, "id": 7, **content}))
    return said(socket, lambda message: message.get("answer") == 7)


def said(socket: ClientConnection, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Return the next message of the server that is wanted; samples are left out."""

    def receive(timeout_s: float) -> dict[str, Any]:
        message = socket.recv(timeout=timeout_s)
        return dict(json.loads(message)) if isinstance(message, str) else {}

    return receive_until(receive, wanted, "the server does not answer")


def signal_all(program: Program, number: signal.Signals) -> None:
    """Send a signal to a program and to those that it has started."""
    waiting = [program.process.pid]
    while waiting:
        pid = waiting.pop()
        os.kill(pid, number)
        for thread in Path(f"/proc/{pid}/task").iterdir():
            waiting += map(int, (thread / "children").read_text(encoding="ascii").split())


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://localhost:1"])
def test_another_sites_page_gets_no_socket(simulated: Program, origin: str) -> None:
    with pytest.raises(InvalidHandshake):
        connect(socket_url(simulated), origin=origin)


BAD = [
    "",
    "x",
    "[]",
    "null",
    "{}",
    '{"do": 1}',
    '{"do": "no such thing"}',
    '{"do": "here", "id": {}}',
    '{"do": "set"}',
    '{"do": "set", "values": {"ISMC_LAM_XY": null}}',
    '{"do": "set", "values": {"ISMC_LAM_XY": [1]}}',
    '{"do": "set", "values": {"ISMC_LAM_XY": NaN}}',
    '{"do": "set", "values": {"no": 1}}',
    '{"do": "set", "values": {"ISMC_LAM_XY": 1e999}}',
    '{"do": "velocity", "vx": "fast", "vy": 0, "wz": 0}',
    '{"do": "velocity", "vx": true, "vy": 0, "wz": 0}',
    '{"do": "velocity", "vx": NaN, "vy": 0, "wz": 0}',
    '{"do": "velocity", "vx": 1e300, "vy": 0, "wz": 0}',
    '{"do": "velocity"}',
    '{"do": "pose", "x": 1e9, "y": 0, "theta": 0}',
    '{"do": "show", "signals": 3}',
    '{"do": "show", "signals": [{}]}',
    '{"do": "show", "signals": ["tracking.pose.x"], "span_s": "x"}',
    '{"do": "window", "begin_s": -1e300, "end_s": 1e300, "width": 1e300}',
    '{"do": "window"}',
    '{"do": "here", "id": ' + "9" * 400 + "}",
    '{"do": "velocity", "vx": ' + "9" * 400 + ', "vy": 0, "wz": 0}',
    '{"do": "set", "values": {"ISMC_LAM_XY": ' + "9" * 400 + "}}",
    '{"do": "follow_line", "line": [[' + "9" * 400 + ', 0], [1, 1]], "speed": 1}',
    '{"do": "record", "on": ' + "9" * 400 + "}",
    '{"do": "rate", "hz": -1}',
    '{"do": "rate", "hz": 1e9}',
    '{"do": "start_trajectory", "type": "../../etc", "laps": -1}',
    '{"do": "simulate", "scenario": "../../x"}',
    '{"do": "simulate", "scenario": []}',
    '{"do": "simulate", "scenario": "demo", "processor": {}}',
    '{"do": "connect", "url": 3}',
    '{"do": "load", "text": "[parameters]\\nx = ' + "9" * 5000 + '"}',
    "[" * 5000,
]


@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_what_is_no_request_is_refused_and_nothing_moves(simulated: Program, text: str) -> None:
    with connect(socket_url(simulated)) as socket:
        ask(socket, "take_over")
        socket.send(text)
        message = said(socket, lambda found: "error" in found or "answer" in found)
        assert message.get("result") is None
        assert ask(socket, "here")["answer"] == 7
    assert not simulated.state()["robot"]["armed"]


def test_random_bytes_and_endless_messages_end_only_their_own_connection(simulated: Program) -> None:
    draw = random.Random(1)
    for _ in range(20):
        with connect(socket_url(simulated)) as socket:
            try:
                socket.send(draw.randbytes(draw.randint(0, 1000)))
                socket.send("x" * draw.choice([10, 10_000_000]))
                socket.recv(timeout=60)
            except ConnectionClosed:
                pass
    with connect(socket_url(simulated)) as socket:
        assert "result" in ask(socket, "choices")


def test_a_stop_comes_through_a_flood_of_requests(simulated: Program) -> None:
    with connect(socket_url(simulated)) as socket, connect(socket_url(simulated)) as flood:
        ask(socket, "take_over")
        ask(socket, "release")
        assert "error" not in ask(socket, "arm")
        for number in range(3000):
            flood.send(json.dumps({"do": "choices", "id": number}))
        socket.send(json.dumps({"do": "stop"}))
        wait_until(lambda: simulated.state()["robot"]["state"] == "estop", "the stop did not come through")
        ask(socket, "release")


def test_a_page_that_reads_nothing_takes_no_memory_and_still_stops_the_robot(simulated: Program) -> None:
    def resident_mb() -> float:
        pages = int(Path(f"/proc/{simulated.process.pid}/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    with connect(socket_url(simulated)) as socket:
        ask(socket, "take_over")
        ask(socket, "release")
        assert "error" not in ask(socket, "arm")
        keys = list(possible_signals())[:60]
        show = json.dumps({"do": "show", "signals": keys, "span_s": 1e4})
        look = json.dumps({"do": "window", "begin_s": 0, "end_s": 1e6, "width": 4000})
        before_mb = resident_mb()
        with connect(socket_url(simulated), max_queue=1, max_size=None) as deaf:  # a full queue reads no further
            deaf.send(show)
            for _ in range(1500):
                deaf.send(look)
            ask(socket, "here")
            assert resident_mb() < before_mb + 50.0
            deaf.send(json.dumps({"do": "stop"}))
            wait_until(lambda: simulated.state()["robot"]["state"] == "estop", "the stop did not come through")
        ask(socket, "release")


def test_only_the_page_in_command_records(simulated: Program) -> None:
    with connect(socket_url(simulated)) as driver, connect(socket_url(simulated)) as watcher:
        ask(driver, "take_over")
        assert "another page" in ask(watcher, "record", on=True)["error"]
        assert "error" not in ask(driver, "record", on=True)
        assert "another page" in ask(watcher, "record", on=False)["error"]
        assert "error" not in ask(driver, "record", on=False)


def test_files_outside_the_page_are_not_served(simulated: Program) -> None:
    import http.client

    port = int(simulated.url.split(":")[2].strip("/"))
    outside = ("/page/../server.py", "/page/%2e%2e%2fserver.py", "/vendor/LICENSE", "/page/..%5cserver.py")
    for path in (*outside, f"/page/{'x' * 300}.js"):
        connection = http.client.HTTPConnection("127.0.0.1", port)
        connection.request("GET", path)
        assert connection.getresponse().status in (403, 404), path
        connection.close()


def test_beyond_this_computer_nobody_gets_in_without_the_token(open_page: Opener) -> None:
    with studio("--host", "0.0.0.0") as program:
        token = program.url.split("token=")[1]
        url = program.url.replace("0.0.0.0", "127.0.0.1")
        program.ready["url"] = url
        for wrong in ("", "x" * len(token)):
            with pytest.raises((InvalidHandshake, ConnectionClosed)), connect(socket_url(program, wrong)) as socket:
                socket.recv(timeout=60)
        with connect(socket_url(program, token)) as socket:
            assert "result" in ask(socket, "choices")
        until(open_page(url), "state?.link.phase === 'none'")


def test_a_stop_by_another_program_shows_and_a_lost_robot_comes_back(tmp_path: Path, open_page: Opener) -> None:
    """Through a pseudo-terminal, which the studio and ``omni stop`` share as they would share a serial port."""
    link = str(tmp_path / "robot")
    robot = ("sitl", "--link", f"pty:{link}", "--storage", str(tmp_path / "storage"))
    changed = "document.querySelector('[data-name=ISMC_LAM_XY] .tag.start')"
    with studio("--link", link) as program:
        page = open_page(program.url)
        until(page, "state?.link.phase === 'lost'")
        with running(*robot):
            until(page, "robot?.pose")
            page.fill("#search", "ISMC_LAM_XY")
            page.fill("#field-ISMC_LAM_XY", "15")
            page.keyboard.press("Enter")
            until(page, changed)
            was = page.evaluate(f"{changed}.textContent")
            page.click("#store")
            until(page, "document.getElementById('notice').textContent.startsWith('Stored')")
            page.click("#arm")
            until(page, "robot.armed")
            subprocess.run([sys.executable, "-m", "omni", "stop", "--link", link], check=True)
            until(page, "robot?.state === 'estop'")
        until(page, "state.link.phase === 'lost'")
        assert page.text_content("#faults")
        with running(*robot):
            until(page, "state.link.phase === 'connected' && robot?.pose")
            assert page.evaluate(f"{changed}?.textContent") == was, "this page has changed it, before the loss"


@pytest.mark.nightly
def test_a_robot_is_not_lost_because_the_computer_stood_still() -> None:
    """As a suspended laptop does: studio and simulated robot stop together for longer than a lost robot is silent."""
    with studio("sitl") as program:
        wait_until(lambda: program.state()["link"]["phase"] == "connected", "no robot is heard")
        with connect(socket_url(program)) as socket:
            assert "error" not in ask(socket, "set", values={"ISMC_LAM_XY": 15.0}, step=1)
        signal_all(program, signal.SIGSTOP)
        pass_time(7.0)
        program.process.send_signal(signal.SIGCONT)
        pass_time(0.2)
        signal_all(program, signal.SIGCONT)
        with connect(socket_url(program)) as socket:
            ask(socket, "take_over")
            assert "error" not in ask(socket, "undo"), "a new connection knows of nothing to undo"


def test_a_server_that_is_gone_is_said_and_found_again(open_page: Opener) -> None:
    with studio() as program:
        page = open_page(program.url)
        until(page, "state?.link.phase === 'none'")
        port = program.url.split(":")[2].strip("/")
        program.end()
    until(page, "document.getElementById('notice').textContent.includes('does not respond')")
    with running("studio", "--no-browser", "--port", port):
        until(page, "state?.link.phase === 'none'")


@pytest.mark.full
def test_a_port_in_use_is_said() -> None:
    with studio() as program:
        port = program.url.split(":")[2].strip("/")
        command = [sys.executable, "-m", "omni", "studio", "--no-browser", "--port", port]
        answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 1
    assert "cannot listen" in answer.stderr
    assert "--port 0" in answer.stderr


@pytest.mark.full
@pytest.mark.parametrize("kill", [False, True], ids=["ended", "killed"])
def test_the_simulated_robot_ends_with_the_studio(kill: bool) -> None:
    with studio("sitl") as program:
        link = program.state()["link"]["url"]
        (program.process.kill if kill else program.process.terminate)()
        program.process.wait(timeout=60)

    def gone() -> bool:
        with py_socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", int(link.split(":")[2]))) != 0

    wait_until(gone, "the simulated robot goes on without the studio")


def test_a_simulation_that_does_not_start_is_said(simulated: Program) -> None:
    with connect(socket_url(simulated)) as socket:
        ask(socket, "take_over")
        answer = ask(socket, "simulate", scenario="no such world")
        assert "no such world" in answer["error"]
    assert simulated.state()["robot"] is not None


@pytest.fixture(scope="module")
def small_studio() -> Iterator[Program]:
    """Return a studio without a robot that may have 512 files open."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (512, before[1]))
    try:
        with studio() as program:
            resource.setrlimit(resource.RLIMIT_NOFILE, before)
            yield program
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.full
def test_idle_connections_keep_no_page_from_stopping(small_studio: Program) -> None:
    host, port = small_studio.url.split("/")[2].split(":")
    with ExitStack() as stack:
        for _ in range(600):
            stack.enter_context(py_socket.create_connection((host, int(port)), LONGEST_S))
        with connect(socket_url(small_studio), open_timeout=LONGEST_S) as page:
            assert ask(page, "stop")["result"] == {"told": False}


@pytest.mark.full
def test_more_pages_than_there_may_be_close_the_oldest_but_not_the_one_in_command(small_studio: Program) -> None:
    with ExitStack() as stack:
        pages = [stack.enter_context(connect(socket_url(small_studio))) for _ in range(MOST_PAGES + 1)]
        ask(pages[0], "take_over")
        stack.enter_context(connect(socket_url(small_studio)))
        with pytest.raises(ConnectionClosed):
            said(pages[1], lambda _: False)
        assert ask(pages[0], "stop")["result"] == {"told": False}
        assert ask(pages[-1], "stop")["result"] == {"told": False}
