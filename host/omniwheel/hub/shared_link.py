# SPDX-License-Identifier: MIT
"""A serial port that several programs of one user can ask for: what a program of ours opens instead of a port.

The first one has the port itself. The second one starts a hub in the background. The first one lets go of its port and
both go on as the hub's clients. A hub that runs already is used at once.
"""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from omniwheel.default_key import default_key
from omniwheel.errors import LinkLostError, LinkOpenError, OutputFileError
from omniwheel.hub import places
from omniwheel.hub.rate_requests import RateRequests, is_from_robot
from omniwheel.link import Link, SerialLink, TcpLink, open_link, parse_url

LOOK_S = 0.05
"""Period at which the owner of a port checks for requests for it."""
START_S = 15.0
"""How long a hub may take to start and to get the port."""
_POLL_S = 0.05
NAME_CHARACTERS = 25
"""Of a program's name in a status text, which has 50."""
_OURS_S = 1.0
_HINT = "the hub has ended: start the command again"


def open_shared(url: str, *, timeout_s: float = 5.0) -> Link:
    """Open the link ``url``; a serial port that another program of ours uses is reached through a hub.

    Where programs cannot find each other the port is opened as ever: no stop may fail for the want of that. Raises
    LinkUrlError or LinkOpenError.
    """
    address = parse_url(url)
    try:
        shares = places.can_share()
    except LinkOpenError as problem:
        return _opened_alone(url, timeout_s, problem)
    if address.kind != "serial" and shares and (found := places.find(places.HUB, url)):
        return HubLink(url, found["address"])
    if address.kind != "serial" or not shares:
        return open_link(url, timeout_s=timeout_s)
    hub = places.find(places.HUB, address.place)
    try:
        return OwnedLink(url) if hub is None else HubLink(url, hub["address"])
    except LinkOpenError as error:
        if hub is not None:  # it has just ended
            return OwnedLink(url)
        if not _is_busy(error) or _owner_of(address.place) is None:
            raise
    return HubLink(url, _started_hub(address.place))


def _opened_alone(url: str, timeout_s: float, problem: LinkOpenError) -> Link:
    """Open a link without looking for a hub; if that fails, ``problem`` may be why."""
    try:
        return open_link(url, timeout_s=timeout_s)
    except LinkOpenError as error:
        if parse_url(url).kind != "serial" or not _is_busy(error):
            raise
        raise LinkOpenError(f"{error}; if a hub uses it: {problem}", hint=problem.hint) from error


def _is_busy(error: LinkOpenError) -> bool:
    return getattr(error.__cause__, "errno", None) in (None, errno.EAGAIN, errno.EBUSY)


def _owner_of(port: str) -> dict[str, Any] | None:
    """Return which program of ours has the port; one that has just opened it says so in a moment."""
    end_s = time.monotonic() + _OURS_S
    while time.monotonic() < end_s:
        found = places.find(places.OWNER, port) or places.find(places.HUB, port)
        if found is not None:
            return found
        time.sleep(_POLL_S)
    return None


def program_name() -> str:
    """Return what others are told of this program, like "omni drive (1234)"."""
    command = next((word for word in sys.argv[1:] if word.isalpha()), "")
    words = f"{Path(sys.argv[0]).name or 'python'} {command}".strip()
    number = f" ({os.getpid()})"
    return words[: NAME_CHARACTERS - len(number)] + number


def _started_hub(port: str) -> str:
    """Start a hub for a port of another program, and return its address once it has the port."""
    owner = places.find(places.OWNER, port) or {}
    log = places.folder() / "hub.log"
    key = default_key()
    with _opened_log(log) as output:
        hub = subprocess.Popen(
            [sys.executable, "-m", "omni.hub.background", str(owner.get("url", port))],
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    assert hub.stdin is not None
    hub.stdin.write(b"" if key is None else key.hex().encode("ascii"))
    hub.stdin.close()
    end_s = time.monotonic() + START_S
    while time.monotonic() < end_s:
        found = places.find(places.HUB, port)
        if found is not None and places.find(places.OWNER, port) is None:
            return str(found["address"])
        if found is None and hub.poll() is not None:
            break
        time.sleep(_POLL_S)
    why = _last_line(log) or f"{owner.get('name', 'another program')} keeps it locked"
    raise LinkOpenError(f"cannot share {port}: {why}", hint="end the other program, or start it behind `omni link`")


def _opened_log(path: Path) -> Any:
    """Return a file for what the hub says, or what throws it away where there is no room for it."""
    try:
        return path.open("wb")
    except OSError:
        return nullcontext(subprocess.DEVNULL)


def _last_line(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-1]
    except (OSError, IndexError):
        return ""


class HubLink:
    """A client of a hub. ``notice`` is a line for the user."""

    def __init__(self, url: str, address: str, how: str = "this is ") -> None:
        self.url = url
        self.notice = f"{url} is shared: through the hub at {address}" if url != address else f"{url} is a hub"
        self._tcp = TcpLink(address, parse_url(address), START_S)
        self._tcp.write(_hello(how + program_name()))

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, b"" if nothing did in time."""
        try:
            return self._tcp.read(timeout_s)
        except LinkLostError as error:
            raise self._lost() from error

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        try:
            self._tcp.write(data)
        except LinkLostError as error:
            raise self._lost() from error

    def fileno(self) -> int:
        """Return the socket's file descriptor."""
        return self._tcp.fileno()

    def close(self) -> None:
        """Close the socket."""
        self._tcp.close()

    def _lost(self) -> LinkLostError:
        return LinkLostError(f"the hub of {self.url} has closed the connection", hint=_HINT)


class OwnedLink:
    """A serial port of this program, until a hub asks for it. From then on it is a client of that hub."""

    def __init__(self, url: str) -> None:
        self.url = url
        self._link: SerialLink | HubLink = SerialLink(url, parse_url(url))
        port, _, rate = url.partition(",")
        self._name = os.path.realpath(port)
        whole = os.path.abspath(port) + (f",{rate}" if rate else "")
        self._claim = places.Claim(places.OWNER, {"pid": os.getpid(), "name": program_name(), "url": whole})
        self._alone = ""
        try:
            self._claim.take(port)
        except OutputFileError as error:
            self._alone = f"no other program can share {url}: {error}"
        self._look_s = time.monotonic()
        self._rates = RateRequests()

    @property
    def notice(self) -> str:
        """A line for the user, "" while the port is this program's own and others can ask for it."""
        return self._link.notice if isinstance(self._link, HubLink) else self._alone

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, b"" if nothing did in time. Lets go of the port if a hub asks for it."""
        if rest := self._handed_over():
            return rest
        data = self._link.read(timeout_s)
        if isinstance(self._link, HubLink) and is_from_robot(data) and (rates := self._rates.take()):
            self._link.write(rates)
        return data

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        if isinstance(self._link, SerialLink):
            self._rates.watch(data)
        self._link.write(data)

    def fileno(self) -> int:
        """Return the open file descriptor; another one after the port has been handed over."""
        return self._link.fileno()

    def close(self) -> None:
        """Close the port, or the connection to the hub."""
        self._link.close()
        self._claim.close()

    def _handed_over(self) -> bytes:
        now_s = time.monotonic()
        if now_s < self._look_s or not isinstance(self._link, SerialLink):
            return b""
        self._look_s = now_s + LOOK_S
        address = places.asked_for(self._name)
        if not address or (places.find(places.HUB, self._name) or {}).get("address") != address:
            return b""
        try:
            hub = HubLink(self.url, address, "this was ")
        except LinkOpenError:  # it has given up meanwhile
            return b""
        port = self._link
        rest = port.read(0.0)
        self._link = hub  # before the port is closed: another thread may be about to write
        port.close()
        self._claim.close()
        return rest


def _hello(text: str) -> bytes:
    """Return the frame with which a client says its name."""
    from omniwheel.dialect import mavlink

    speaker: Any = mavlink.MAVLink(None, 255, mavlink.MAV_COMP_ID_MISSIONPLANNER)
    message: Any = mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_INFO, text.encode())
    return bytes(message.pack(speaker))
