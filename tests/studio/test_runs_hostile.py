# SPDX-License-Identifier: MIT
"""Clients that are no page of the studio, at the routes for runs and logs; and a stop while a long log is read."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
from collections.abc import AsyncIterator, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect

from omni.studio import runs
from omni.studio.runs import LARGEST_UPLOAD, MOST_UPLOADS
from omniwheel.errors import LogError
from tests.studio.parts import Program, run_async, studio
from tests.studio.recorded import frames, write_run
from tests.studio.test_hostile import ask, socket_url
from tests.waiting import wait_until

ROUTES = ("/run-samples", "/run-log")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept")
    write_run(folder / "secret", gain=4.0, seconds=2.0)
    write_run(folder / "runs" / "good", gain=4.0, seconds=2.0)
    (folder / "runs" / "link").symlink_to(folder / "secret")
    return folder / "runs"


@pytest.fixture(scope="module")
def program(root: Path) -> Iterator[Program]:
    with studio("sitl", "--out", str(root)) as found:
        found.hear_robot()
        yield found


def post(program: Program, path: str, body: bytes, headers: dict[str, str] | None = None) -> tuple[int, bytes]:
    port = int(program.url.split(":")[2].split("/")[0])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=120)
    try:
        connection.request("POST", path, body, headers or {})
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


def window(log: Any, **other: Any) -> bytes:
    wanted = {"log": log, "signals": ["tracking.pose.x"], "begin_s": 0, "end_s": 10, "width": 100}
    return json.dumps({**wanted, **other}).encode()


@pytest.mark.parametrize("path", ROUTES)
@pytest.mark.parametrize(
    "headers",
    [{"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "evil.example"}, {"Origin": "http://localhost:1"}],
    ids=str,
)
def test_another_sites_page_reads_and_sends_no_log(program: Program, path: str, headers: dict[str, str]) -> None:
    assert post(program, path, window("run:good"), headers)[0] == 403


@pytest.mark.full
def test_beyond_this_computer_logs_need_the_token(root: Path) -> None:
    with studio("--host", "0.0.0.0", "--out", str(root)) as program:
        token = program.url.split("token=")[1]
        for path in ROUTES:
            assert post(program, path, window("run:good"))[0] == 403
            assert post(program, path + "?token=x" + token, window("run:good"))[0] == 403
        assert post(program, "/run-samples?token=" + token, window("run:good"))[0] == 200


@pytest.mark.parametrize(
    "name", ["..", "../secret", "/etc", "../runs/good", "link", "good/../../secret", "", "\0", "\ud800"]
)
def test_no_name_leads_outside_the_runs(program: Program, root: Path, name: str) -> None:
    names = [name, str(root.parent / "secret")]
    with connect(socket_url(program)) as socket:
        for one in names:
            assert post(program, "/run-samples", window(f"run:{one}"))[0] == 400
            assert "error" in ask(socket, "open_run", log=f"run:{one}")
            assert "error" in ask(socket, "compare_runs", one="good", other=one)
        listed = ask(socket, "runs", find="")["result"]["runs"]
        assert [run["name"] for run in listed] == ["good"]


BAD = [
    b"",
    b"x",
    b"[]",
    b"[" * 5000,
    b" " * 1_000_000,
    window(None),
    window({}),
    window("file:1"),
    window("file:../../etc/passwd"),
    window("run:good", signals=3),
    window("run:good", signals=[1]),
    window("run:good", signals=["x"] * 1000),
    window("run:good", begin_s="x"),
    window("run:good", end_s=float("nan")),
    window("run:good", width=None),
]


@pytest.mark.parametrize("body", BAD, ids=range(len(BAD)))
def test_what_is_no_request_for_samples_is_refused_with_words(program: Program, body: bytes) -> None:
    status, answer = post(program, "/run-samples", body)
    assert status == 400
    assert json.loads(answer)["error"]


@pytest.mark.parametrize("width", [-1e300, 0, 1e300])
def test_any_width_gives_an_answer_of_bounded_size(program: Program, width: float) -> None:
    status, answer = post(program, "/run-samples", window("run:good", width=width, begin_s=-1e300, end_s=1e300))
    assert status == 200
    assert 0 < len(answer) < 200_000


@pytest.mark.parametrize("request_", [{"find": 3}, {"find": None}, {"find": ["x"]}], ids=str)
def test_a_search_that_is_no_text_is_refused(program: Program, request_: dict[str, Any]) -> None:
    with connect(socket_url(program)) as socket:
        assert "error" in ask(socket, "runs", **request_)


def test_a_log_that_is_too_large_is_refused_before_it_is_sent(program: Program) -> None:
    status, answer = post(program, "/run-log", b"x", {"Content-Length": str(LARGEST_UPLOAD + 1)})
    assert status == 400
    assert "512 MB" in json.loads(answer)["error"]


def test_uploads_that_stall_keep_no_other_out(program: Program) -> None:
    port = int(program.url.split(":")[2].strip("/"))
    stalled = [http.client.HTTPConnection("127.0.0.1", port) for _ in range(MOST_UPLOADS - 1)]
    for connection in stalled:
        connection.putrequest("POST", "/run-log")
        connection.putheader("Content-Length", "1000000")
        connection.endheaders()
        connection.send(b"x" * 1000)
    status, _ = post(program, "/run-log", b"".join(frames(2.0)))
    assert status == 200
    for connection in stalled:
        connection.close()


def test_an_upload_that_stalls_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    class Stalled:
        async def stream(self) -> AsyncIterator[bytes]:
            yield b"x"
            await asyncio.Event().wait()

    monkeypatch.setattr(runs, "UPLOAD_TIMEOUT_S", 0.01)
    with pytest.raises(LogError):
        run_async(runs._received(Stalled(), BytesIO()))


def test_an_upload_that_breaks_off_leaves_the_server_at_work(program: Program) -> None:
    port = int(program.url.split(":")[2].strip("/"))
    for _ in range(5):
        connection = http.client.HTTPConnection("127.0.0.1", port)
        connection.putrequest("POST", "/run-log")
        connection.putheader("Content-Length", "1000000")
        connection.endheaders()
        connection.send(b"x" * 1000)
        connection.close()

    def uploaded() -> str | None:
        status, answer = post(program, "/run-log", b"".join(frames(2.0)))
        return json.loads(answer)["log"] if status == 200 else None

    log = wait_until(uploaded, "the broken uploads keep their places")  # the server needs a moment to notice
    with connect(socket_url(program)) as socket:
        assert ask(socket, "open_run", log=log)["result"]["duration_s"] == pytest.approx(2.0)


@pytest.mark.full
def test_old_uploads_go_and_are_said_to_be_gone(program: Program) -> None:
    logs = [json.loads(post(program, "/run-log", b"".join(frames(1.0)))[1])["log"] for _ in range(6)]
    with connect(socket_url(program)) as socket:
        assert "log" in ask(socket, "open_run", log=logs[0])["error"]
        assert "result" in ask(socket, "open_run", log=logs[-1])


@pytest.mark.full
@pytest.mark.parametrize("kill", [False, True], ids=["ended", "killed"])
def test_the_process_that_reads_logs_ends_with_the_studio(root: Path, kill: bool) -> None:
    with studio("--out", str(root)) as program:
        with connect(socket_url(program)) as socket:
            assert "result" in ask(socket, "open_run", log="run:good")
        tasks = Path(f"/proc/{program.process.pid}/task").glob("*/children")
        children = [int(word) for task in tasks for word in task.read_text().split()]
        assert children
        (program.process.kill if kill else program.process.terminate)()
        program.process.wait(timeout=60)
    wait_until(lambda: not any(Path(f"/proc/{child}").exists() for child in children), "a process is left")


@pytest.mark.full
def test_a_stop_comes_through_while_a_long_log_is_read(program: Program, root: Path) -> None:
    minute = b"".join(frames(60.0))
    folder = root.parent / "long"
    write_run(folder / "long", gain=4.0, seconds=1.0)
    with (folder / "long" / "telemetry.tlog").open("wb") as file:
        for _ in range(int(1e8 / len(minute))):
            file.write(minute)
    os.replace(folder / "long", root / "long")
    with connect(socket_url(program)) as socket, connect(socket_url(program)) as reader:
        ask(socket, "take_over")
        ask(socket, "release")
        assert "error" not in ask(socket, "arm")
        reader.send(json.dumps({"do": "open_run", "id": 1, "log": "run:long"}))
        socket.send(json.dumps({"do": "stop"}))
        wait_until(lambda: program.state()["robot"]["state"] == "estop", "the stop did not come through")
        ask(socket, "release")
        assert ask(reader, "open_run", log="run:long")["result"]["duration_s"] > 60.0
    os.replace(root / "long", folder / "long")
