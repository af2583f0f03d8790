# SPDX-License-Identifier: MIT
"""Several real firmwares on one line, as on a radio channel: each hears everything, and all answer."""

from __future__ import annotations

import selectors
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

from omniwheel.dialect import mavlink
from tests.firmware.client import Client, Firmware, connect, firmware

POLL_S = 0.05


@dataclass
class SharedLine:
    """Robots by system id, and the address at which one program at a time reaches all of them."""

    url: str
    observers: dict[int, Client]
    connected: set[int] = field(default_factory=set)
    """The robots that are on the line now."""

    def pose_of(self, system: int) -> tuple[float, float, float]:
        """Return the pose that a robot estimates now."""
        observer = self.observers[system]
        observer.heartbeat()
        observer.mav.ping_send(1, 1, 0, 0)
        observer.wait("PING")
        observer.inbox.clear()  # what was said before
        x, y, theta = observer.wait("OMNI_TRACKING").pose
        return x, y, theta


@contextmanager
def shared_line(systems: Sequence[int]) -> Iterator[SharedLine]:
    """Run one firmware per system id, all on one line."""
    with ExitStack() as stack:
        links = ("tcp:127.0.0.1:0", "tcp:127.0.0.1:0")
        robots = {system: stack.enter_context(firmware(links=links)) for system in systems}
        observers = {system: _numbered(robot, system) for system, robot in robots.items()}
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        line = SharedLine(f"tcp:127.0.0.1:{listener.getsockname()[1]}", observers, set(systems))
        ended = threading.Event()
        relay = threading.Thread(target=_relay, args=(listener, robots, line, ended))
        relay.start()
        stack.callback(relay.join)
        stack.callback(ended.set)
        yield line


def _numbered(robot: Firmware, system: int) -> Client:
    observer = connect(robot, 1)
    observer.heartbeat()
    observer.set("SYS_ID", system)
    return observer


def _relay(listener: socket.socket, robots: dict[int, Firmware], line: SharedLine, ended: threading.Event) -> None:
    """Serve one program after the other."""
    listener.settimeout(POLL_S)
    while not ended.is_set():
        try:
            program, _ = listener.accept()
        except TimeoutError:
            continue
        ports = {system: connect(robot).socket for system, robot in robots.items()}
        try:
            _serve(program, ports, line, ended)
        except OSError:
            pass  # the program has gone
        finally:
            for port in (program, *ports.values()):
                port.close()


def _serve(program: socket.socket, ports: dict[int, socket.socket], line: SharedLine, ended: threading.Event) -> None:
    codecs = {system: mavlink.MAVLink(None) for system in ports}
    for codec in codecs.values():
        codec.robust_parsing = True
    with selectors.DefaultSelector() as selector:
        selector.register(program, selectors.EVENT_READ, 0)
        for system, port in ports.items():
            selector.register(port, selectors.EVENT_READ, system)
        while not ended.is_set():
            for key, _ in selector.select(POLL_S):
                data = key.fileobj.recv(65536)  # type: ignore[union-attr]
                if not data:
                    return
                if key.data == 0:
                    for system in line.connected:
                        ports[system].sendall(data)
                    continue
                frames = codecs[key.data].parse_buffer(data) or []  # whole ones: the line mixes no two
                if key.data in line.connected:
                    program.sendall(b"".join(bytes(frame.get_msgbuf()) for frame in frames))
