# SPDX-License-Identifier: MIT
"""The port and the sockets around a :class:`Hub`, in one thread."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any

from omni.hub.addresses import Budget, budget_of, listen_address
from omni.hub.clients import TcpClients, UdpClients
from omni.hub.core import Hub, HubSettings
from omniwheel.errors import LinkError, LinkOpenError, OutputFileError
from omniwheel.hub import places
from omniwheel.link import FileLink, LinkAddress, open_link, parse_url
from omniwheel.ports import serial_ports
from omniwheel.signing import Signer

REOPEN_S = 0.2
"""How long between two looks for a port that has gone."""
AT_ONCE_S = 0.3
"""A connection that is closed within this time, without data: the robot has another client."""
SLOWEST_REOPEN_S = 5.0
"""Longest back-off while a robot closes every connection."""
HAND_OVER_S = 0.02
"""... and for one that another program is about to let go."""
WAIT_S = 0.1
BUDGET_S = 0.005
"""How long to wait while frames wait for the budget."""
OWN_ADDRESS = "tcp:127.0.0.1:0"
"""A free TCP port of this computer."""
HAND_OVER_WITHIN_S = 10.0
"""A program of ours that has the port lets go of it within this time, or goes on alone."""
NAME_CHARACTERS = 20
"""Of a port's name in a status text, which has 50."""


def short_name(device: str) -> str:
    """Return what clients are told of a port: the end of its path."""
    name = device.rpartition("/")[2]
    return name if len(name) <= NAME_CHARACTERS else f"..{name[2 - NAME_CHARACTERS :]}"


class HubServer:
    """Serves the robot's link ``url`` at the addresses ``listen``; a context manager.

    ``budget`` None: what the link's kind allows. ``system_id`` chooses a robot where several share the link. Raises
    LinkUrlError; LinkOpenError if it cannot listen, or if another hub serves the port; OutputFileError if no program
    could find it. A port that is not there is waited for.
    """

    def __init__(
        self,
        url: str,
        listen: Sequence[str],
        *,
        budget: Budget | None = None,
        signer: Signer | None = None,
        system_id: int | None = None,
    ) -> None:
        if not places.can_share():
            raise LinkOpenError("the hub needs Linux or macOS, and a folder for temporary files")
        self._address = parse_url(url)
        self._url = url
        self.device = self._address.place if self._address.kind == "serial" else url
        budget = budget_of(url, os.path.realpath(self.device)) if budget is None else budget
        settings = HubSettings(short_name(self.device), budget.bytes_s, budget.burst_bytes, system_id)
        self.hub = Hub(settings, time.monotonic, signer)
        self.was_open = False
        self._link: FileLink | None = None
        self._next_open_s = float("-inf")
        self._opened_s = float("-inf")
        self._reopen_s = REOPEN_S
        self._serial_number = ""
        self._waiting_because = ""
        addresses = [listen_address(text) for text in listen]
        if not any(address.kind == "tcp" for address in addresses):  # for programs that find it by the port's name
            addresses.append(listen_address(OWN_ADDRESS))
        self._clients = [self._clients_at(address) for address in addresses]
        self._claim = places.Claim(places.HUB, {"address": self._tcp_url, "pid": os.getpid()})
        self._hand_over_until_s = float("-inf")
        try:
            self._claim_all()
        except (LinkOpenError, OutputFileError):
            self.close()
            raise

    def _claim_all(self) -> None:
        if not self._claim.take(self.device):
            other = places.find(places.HUB, self.device) or {}
            hint = f"connect to {other.get('address', 'it')}, or stop it first"
            raise LinkOpenError(f"another hub serves {self.device} (pid {other.get('pid', 'unknown')})", hint=hint)
        for address in self.urls:
            self._claim.take(address)

    def _clients_at(self, address: LinkAddress) -> TcpClients | UdpClients:
        if address.kind == "tcp":
            return TcpClients(self.hub, address)
        return UdpClients(self.hub, address, time.monotonic)

    def __enter__(self) -> HubServer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    @property
    def urls(self) -> list[str]:
        """Where clients find it, a port of 0 being the one that it has become."""
        return [clients.url for clients in self._clients]

    @property
    def _tcp_url(self) -> str:
        return next(url for url in self.urls if url.startswith("tcp:"))

    def ask_owner(self, within_s: float) -> None:
        """Ask the program of ours that has the port, if one has, to let go and to go on as a client.

        Raises OutputFileError.
        """
        if places.find(places.OWNER, self.device) is not None:
            self._hand_over_until_s = time.monotonic() + within_s
            places.ask_for(self.device, self._tcp_url)

    def serve(self, wait_s: float = WAIT_S) -> None:
        """Move what there is to move, waiting up to ``wait_s`` for it."""
        self._open_if_due()
        readable = [socket for clients in self._clients for socket in clients.sockets()]
        writable = [socket for clients in self._clients for socket in clients.unsent()]
        waits_s = wait_s if self._link is not None and not self.hub.waits else min(wait_s, self._soon_s())
        port: list[Any] = [] if self._link is None else [self._link.fileno()]
        ready: set[Any] = set(select.select([*readable, *port], writable, [], waits_s)[0])
        for clients in self._clients:
            clients.read(ready)
        self._serve_port(ready)
        for clients in self._clients:
            clients.write()

    def close(self) -> None:
        """Close everything."""
        if self._hand_over_until_s > float("-inf"):
            places.withdraw(self.device)
        for clients in self._clients:
            clients.close()
        if self._link is not None:
            self._link.close()
        self._claim.close()

    def _soon_s(self) -> float:
        if self._link is not None:
            return BUDGET_S
        return max(0.0, self._next_open_s - time.monotonic())

    def _serve_port(self, ready: set[Any]) -> None:
        link = self._link
        if link is None:
            self.hub.to_port()
            return
        try:
            if link.fileno() in ready:
                self.hub.from_port(link.read(0.0))
                self._confirm_port()
            while select.select([], [link], [], 0.0)[1] and (frame := self.hub.to_port()):
                link.write(frame)
        except (LinkError, OSError):
            link.close()
            self._link = None
            self.hub.port_lost(quiet=self._backs_off)
            self._back_off()

    @property
    def _backs_off(self) -> bool:
        """Whether the last connection was closed before any data came."""
        return self._reopen_s > REOPEN_S

    def _back_off(self) -> None:
        """Double the time to the next connection if this one was closed before any data came."""
        now_s = time.monotonic()
        if now_s - self._opened_s >= AT_ONCE_S:
            self._reopen_s = REOPEN_S
            return
        self._reopen_s = min(2.0 * self._reopen_s, SLOWEST_REOPEN_S)
        self._next_open_s = now_s + self._reopen_s
        self._log_once(f"waiting: {self._url} closes every connection; is another program connected to the robot?")

    def _confirm_port(self) -> None:
        """Data came: end the back-off, and announce a port that was opened quietly."""
        self._opened_s = float("-inf")
        if self._backs_off:
            self._reopen_s = REOPEN_S
            self._waiting_because = ""
            self.hub.announce_open()

    def _open_if_due(self) -> None:
        now_s = time.monotonic()
        if self._link is not None or now_s < self._next_open_s:
            return
        self._next_open_s = now_s + (HAND_OVER_S if now_s < self._hand_over_until_s else REOPEN_S)
        try:
            self._link = open_link(self._url_now(), timeout_s=REOPEN_S)
        except LinkOpenError as error:
            self._log_once(f"waiting: {error}")
            return
        if not self._backs_off:
            self._waiting_because = ""
        if self._hand_over_until_s > float("-inf"):
            places.withdraw(self.device)
            self._hand_over_until_s = float("-inf")
        self._claim_again(self._link)
        self.was_open = True
        self._opened_s = now_s
        self.hub.port_opened(quiet=self._backs_off)

    def _log_once(self, line: str) -> None:
        if line != self._waiting_because:
            self._waiting_because = line
            self.hub.events.append(line)

    def _claim_again(self, link: FileLink) -> None:
        """A port may come back with another name: be found by that, too; and remember which USB device it is."""
        if self._address.kind == "serial":
            device = parse_url(link.url).place
            try:
                self._claim.take(device)
            except OutputFileError as error:  # those that are there go on
                self.hub.events.append(f"cannot make {device} known to other programs: {error}")
            path = os.path.realpath(device)
            found = [port.serial_number for port in serial_ports() if port.device == path]
            self._serial_number = next(iter(found), self._serial_number)

    def _url_now(self) -> str:
        """Return the URL under which the port is to be had now: the same USB device, if its name has changed."""
        if self._address.kind != "serial" or os.path.exists(self.device) or not self._serial_number:
            return self._url
        same = [port.device for port in serial_ports() if port.serial_number == self._serial_number]
        return f"{same[0]},{self._address.number}" if same else self._url
