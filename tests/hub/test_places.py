# SPDX-License-Identifier: MIT
"""How programs find each other: nothing is believed of a program that is not there any more."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from omni.hub.server import HubServer
from omniwheel.errors import LinkOpenError
from omniwheel.hub import places
from omniwheel.hub.shared_link import open_shared, program_name

HOLDER = """
import sys
from omniwheel.hub import places
claim = places.Claim(places.HUB, {"address": "tcp:127.0.0.1:1"})
print(claim.take(sys.argv[1]), flush=True)
sys.stdin.read()
"""


def test_who_holds_a_port_is_found_under_all_its_names_until_it_is_killed(own_places: None, tmp_path: Path) -> None:
    port, name = tmp_path / "pts", tmp_path / "robot"
    port.touch()
    name.symlink_to(port)
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(name)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout is not None
    assert holder.stdout.readline() == "True\n"
    for known in (port, name):
        assert places.find(places.HUB, str(known)) == {"address": "tcp:127.0.0.1:1"}
    assert places.find(places.OWNER, str(port)) is None
    assert not places.Claim(places.HUB, {}).take(str(port))
    holder.kill()
    holder.communicate()
    assert places.find(places.HUB, str(port)) is None
    claim = places.Claim(places.HUB, {})
    assert claim.take(str(port))
    claim.close()


def test_a_folder_that_others_can_write_to_is_refused(own_places: None, tmp_path: Path) -> None:
    (tmp_path / "omniwheel").mkdir()
    (tmp_path / "omniwheel").chmod(0o777)
    with pytest.raises(LinkOpenError, match="accessible to other users"):
        places.find(places.HUB, "/dev/ttyACM0")


def test_a_request_is_there_until_it_is_withdrawn(own_places: None, tmp_path: Path) -> None:
    port = str(tmp_path / "port")
    assert places.asked_for(port) == ""
    places.ask_for(port, "tcp:127.0.0.1:7")
    assert places.asked_for(port) == "tcp:127.0.0.1:7"
    places.withdraw(port)
    places.withdraw(port)
    assert places.asked_for(port) == ""


def test_without_a_folder_a_port_is_opened_as_ever(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "omniwheel").write_text("a file is in the way")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert not places.can_share()
    with pytest.raises(LinkOpenError, match="no such port"):
        open_shared(str(tmp_path / "nowhere"))


def test_the_address_of_a_hub_is_known_as_one(own_places: None, tmp_path: Path) -> None:
    with HubServer(str(tmp_path / "nowhere"), ["tcp:127.0.0.1:0"]) as server:
        link = open_shared(server.urls[0])
        server.serve(0.1)
        server.serve(0.1)
        assert getattr(link, "notice", "") == f"{server.urls[0]} is a hub"
        assert f"{program_name()} is here" in server.hub.events
        link.close()
