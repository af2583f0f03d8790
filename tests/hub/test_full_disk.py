# SPDX-License-Identifier: MIT
"""A disk that is full where programs find each other: a stop goes through, and who cannot go on says why."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from omni.hub.server import HubServer
from omniwheel.errors import LinkOpenError, OutputFileError
from omniwheel.hub import places
from omniwheel.hub.shared_link import open_shared
from omniwheel.robot import connect
from tests.faults.shim import BROKEN, FAILURES, FULL, SHORT, Failure, environment, need_shim
from tests.hub.parts import PROGRAM, WAIT_S, Cable

CALLS = 6
"""More calls than a program makes to find others and to be found."""
CLAIMS = """
import json, sys
from omniwheel.errors import OutputFileError
from omniwheel.hub import places
try:
    print(json.dumps(places.Claim(places.HUB, {"address": "tcp:127.0.0.1:1"}).take(sys.argv[1])))
except OutputFileError as error:
    print(json.dumps(str(error)))
print(json.dumps(places.find(places.HUB, sys.argv[1])))
"""


def program(folder: Path, number: int, failure: Failure, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command while call ``number`` of it below ``folder`` fails."""
    failing = environment(folder, number, failure)
    return subprocess.run(
        list(words), env={**os.environ, **failing}, capture_output=True, text=True, timeout=WAIT_S, check=False
    )


@pytest.mark.full
@pytest.mark.parametrize("number", range(1, CALLS))
def test_a_stop_goes_through_whatever_call_fails(cable: Cable, tmp_path: Path, number: int) -> None:
    need_shim()
    places.folder().rmdir()
    failure = FAILURES[number % len(FAILURES)]
    done = program(tmp_path / "omniwheel", number, failure, PROGRAM, "stop", "--link", str(cable.path))
    assert done.returncode == 0, done.stderr
    assert "stopped; release it" in done.stdout
    with connect(str(cable.path)) as robot:
        robot.wait_until(lambda status: status.state == "estop", WAIT_S, "stopped")


@pytest.mark.full
def test_who_cannot_be_found_says_so_and_has_the_port(cable: Cable, tmp_path: Path) -> None:
    need_shim()
    done = program(tmp_path / "omniwheel", 2, FULL, PROGRAM, "stop", "--link", str(cable.path))
    assert done.returncode == 0, done.stderr
    assert f"no other program can share {cable.path}: cannot write" in done.stderr


@pytest.mark.full
@pytest.mark.parametrize("failure", [FULL, SHORT, BROKEN], ids=lambda failure: failure.name)
def test_a_hub_that_nobody_would_find_does_not_start(own_places: None, tmp_path: Path, failure: Failure) -> None:
    need_shim()
    words = ("link", "--link", str(tmp_path / "robot"), "--listen", "tcp:127.0.0.1:0")
    done = program(tmp_path / "omniwheel", 2, failure, PROGRAM, *words)
    assert done.returncode == 1
    assert "cannot write" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("number", range(1, 5))
def test_half_a_claim_is_none(own_places: None, tmp_path: Path, number: int) -> None:
    need_shim()
    places.can_share()
    said = program(tmp_path / "omniwheel", number, SHORT, sys.executable, "-c", CLAIMS, str(tmp_path / "port"))
    assert said.returncode == 0, said.stderr
    taken, found = said.stdout.splitlines()
    assert (taken == "true") == (found != "null"), said.stdout


def test_a_claim_that_was_cut_short_by_its_holder_is_none(own_places: None, tmp_path: Path) -> None:
    port = str(tmp_path / "port")
    claim = places.Claim(places.HUB, {"address": "tcp:127.0.0.1:1"})
    assert claim.take(port)
    (file,) = places.folder().glob("*.hub")
    os.truncate(file, 9)
    assert places.find(places.HUB, port) is None
    claim.close()


def test_an_owner_cannot_be_asked_on_a_full_disk(
    own_places: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner = places.Claim(places.OWNER, {"pid": 1})
    assert owner.take(str(tmp_path / "robot"))
    with HubServer(str(tmp_path / "robot"), ["tcp:127.0.0.1:0"]) as server:
        monkeypatch.setattr(os, "fsync", _no_room)
        with pytest.raises(OutputFileError, match="No space left"):
            server.ask_owner(1.0)
    assert places.asked_for(str(tmp_path / "robot")) == ""
    owner.close()


def _no_room(_: int) -> None:
    raise OSError(28, "No space left on device")


@pytest.mark.full
def test_another_users_folder_keeps_nobody_from_a_robot(cable: Cable, robot_urls: list[str], tmp_path: Path) -> None:
    places.folder().chmod(0o777)
    done = subprocess.run(
        [PROGRAM, "stop", "--link", str(cable.path)], capture_output=True, text=True, timeout=WAIT_S, check=False
    )
    assert done.returncode == 0, done.stderr
    over_tcp = open_shared(robot_urls[1])
    over_tcp.close()


@pytest.mark.full
def test_who_finds_a_port_busy_is_told_what_keeps_it_from_a_hub(cable: Cable) -> None:
    first = open_shared(str(cable.path))
    places.folder().chmod(0o777)
    with pytest.raises(LinkOpenError, match=r"if a hub uses it: the folder .* is accessible"):
        open_shared(str(cable.path))
    first.close()
