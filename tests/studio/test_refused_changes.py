# SPDX-License-Identifier: MIT
"""A request that would replace the robot, and is refused, leaves the robot as it is: connected, and driving."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect

from omni.studio.flasher import Flasher, firmware_of
from omni.studio.processors import IMAGE
from omni.studio.session import Session
from omni.studio.simulated import Simulation
from omni.studio.studio import Page, Studio
from omniwheel.errors import OmniError
from tests.studio.parts import studio
from tests.studio.test_flasher import finished, stand_in
from tests.studio.test_hostile import ask, socket_url
from tests.waiting import wait_until

FIRMWARE = {"robot": "three_wheel", "file": "", "port": "/dev/a", "blank": False}
UPLOAD = {**FIRMWARE, "upload": True}
REFUSED: list[tuple[str, dict[str, Any]]] = [
    ("flash", UPLOAD),
    ("flash", {**UPLOAD, "port": "-x"}),
    ("connect", {"url": "no:such:scheme"}),
    ("simulate", {"scenario": "demo", "processor": IMAGE, "image": "/missing.elf"}),
]


class Connected(Session):
    """Stands for the session with a robot; ``closed`` if it was let go of, which disarms it."""

    closed = False

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def connected(tmp_path: Path) -> Iterator[tuple[Studio, Page, Connected]]:
    studio_ = Studio(tmp_path)
    studio_.session = session = Connected("silent")
    yield studio_, studio_.open_page(), session
    studio_.session = None
    studio_.close()


def not_checked(_folder: Path, flasher: Flasher) -> None:
    """Leave it as it is."""


def checked(_folder: Path, flasher: Flasher) -> None:
    flasher.check(firmware_of(FIRMWARE))
    finished(flasher)


def changed_since(folder: Path, flasher: Flasher) -> None:
    checked(folder, flasher)
    (folder / "firmware.hex").write_bytes(b"another image")


def checked_with_a_problem(folder: Path, flasher: Flasher) -> None:
    script = folder / "flash.py"
    script.write_text(script.read_text().replace('"problem": None', '"problem": "there is no port /dev/a"'))
    checked(folder, flasher)


def checked_without_a_loader(folder: Path, flasher: Flasher) -> None:
    script = folder / "flash.py"
    script.write_text(script.read_text().replace('"problem": None', '"problem": None, "loader": None'))
    checked(folder, flasher)


def checked_and_checking_again(folder: Path, flasher: Flasher) -> None:
    checked(folder, flasher)
    flasher._command = [sys.executable, "-c", "import time; time.sleep(60)"]
    remembered = flasher._checked
    flasher.check(firmware_of(FIRMWARE))
    flasher._checked = remembered


@pytest.mark.parametrize(
    "prepare",
    [not_checked, changed_since, checked_with_a_problem, checked_without_a_loader, checked_and_checking_again],
)
def test_an_upload_that_is_refused_keeps_the_robot(
    connected: tuple[Studio, Page, Connected], tmp_path: Path, prepare: Callable[[Path, Flasher], None]
) -> None:
    studio_, page, session = connected
    studio_.flasher, _ = stand_in(tmp_path)
    prepare(tmp_path, studio_.flasher)
    with pytest.raises(OmniError):
        studio_.flash(page, UPLOAD)
    assert studio_.session is session
    assert not session.closed


def test_an_upload_of_what_was_checked_lets_go_of_the_robot(
    connected: tuple[Studio, Page, Connected], tmp_path: Path
) -> None:
    studio_, page, session = connected
    studio_.flasher, _ = stand_in(tmp_path)
    checked(tmp_path, studio_.flasher)
    studio_.flash(page, UPLOAD)
    assert session.closed
    assert finished(studio_.flasher)["trouble"] == ""


@pytest.mark.parametrize("bad", [{"port": "-x"}, {"robot": "no such"}, {"blank": 1}])
def test_an_upload_that_is_no_request_keeps_the_robot(
    connected: tuple[Studio, Page, Connected], bad: dict[str, Any]
) -> None:
    studio_, page, session = connected
    with pytest.raises(OmniError):
        studio_.flash(page, {**UPLOAD, **bad})
    assert not session.closed


@pytest.mark.parametrize("url", ["tcp:nowhere", "no:such:scheme", "tcp:host:99999", "http://a/b", "/dev/ttyACM0,fast"])
def test_an_address_that_is_none_keeps_the_robot(connected: tuple[Studio, Page, Connected], url: str) -> None:
    studio_, _, session = connected
    with pytest.raises(OmniError):
        studio_.connect(url)
    assert studio_.session is session
    assert not session.closed


def test_a_simulation_that_does_not_start_keeps_the_robot(
    connected: tuple[Studio, Page, Connected], tmp_path: Path
) -> None:
    studio_, _, session = connected
    with pytest.raises(OmniError):
        studio_.simulate(Simulation("demo", processor=IMAGE, image=str(tmp_path / "missing.elf")))
    assert studio_.session is session
    assert not session.closed


@pytest.mark.full
def test_a_driving_robot_goes_on_when_an_upload_is_refused() -> None:
    """The robot lives in real time: one that a busy computer kept waiting for its page is armed again."""
    with studio("sitl") as program:
        wait_until(lambda: program.state()["link"]["phase"] == "connected", "no robot is connected")
        with connect(socket_url(program)) as socket:
            for _ in range(5):
                ask(socket, "take_over")
                ask(socket, "disarm")
                wait_until(lambda: "error" not in ask(socket, "arm"), "it cannot be armed")
                for action, request in REFUSED:
                    assert "error" in ask(socket, action, **request)
                state = program.state()
                assert state["link"]["phase"] == "connected"
                if state["robot"]["state"] != "failsafe":
                    break
            assert state["robot"]["armed"]
            ask(socket, "disarm")
