# SPDX-License-Identifier: MIT
"""A witness on the wire: a TCP relay between the studio and a robot, which notes when what passed."""

from __future__ import annotations

import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from omniwheel.dialect import mavlink

NOTES_KEPT = 100_000


class Wire:
    """Passes everything on, unchanged, and notes each OMNI_WHEELS message. ``url`` is for the studio.

    The robot is connected to when the studio is. ``pass_on(data, frames)``, if given, returns what the studio gets
    instead of what the robot sent. ``frames`` are the messages that end in ``data``.
    """

    def __init__(self, robot_url: str, pass_on: Callable[[bytes, list[Any]], bytes] | None = None) -> None:
        _, host, port = robot_url.split(":")
        self._robot = (host, int(port))
        self._pass_on = pass_on or (lambda data, frames: data)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"tcp:127.0.0.1:{self._listener.getsockname()[1]}"
        self.duties: deque[tuple[float, float]] = deque(maxlen=NOTES_KEPT)
        """When a message came from the robot [s since 1970], and its largest absolute duty."""
        self._studio: socket.socket | None = None
        self._sending = threading.Lock()
        threading.Thread(target=self._serve, daemon=True).start()

    def close(self) -> None:
        """Take no further connection."""
        self._listener.close()

    def send(self, data: bytes) -> None:
        """Send something else to the studio, between two messages of the robot. Waits until the studio takes it."""
        assert self._studio is not None, "the studio is not connected"
        with self._sending:
            self._studio.sendall(data)

    def first_zero_s(self, after_s: float) -> float:
        """Return when the robot first said that all duties are zero, after this time [s since 1970]."""
        while True:
            found = [at for at, duty in list(self.duties)[-1000:] if at > after_s and duty == 0.0]
            if found:
                return found[0]
            time.sleep(0.01)

    def _serve(self) -> None:
        while True:
            try:
                studio, _ = self._listener.accept()
            except OSError:  # closed
                return
            robot = socket.create_connection(self._robot)
            for end in (studio, robot):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._studio = studio
            threading.Thread(target=self._up, args=(studio, robot), daemon=True).start()
            self._down(robot, studio)

    def _up(self, studio: socket.socket, robot: socket.socket) -> None:
        try:
            while data := studio.recv(65536):
                robot.sendall(data)
        except OSError:  # an end is gone: so is the other
            pass
        robot.close()

    def _down(self, robot: socket.socket, studio: socket.socket) -> None:
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        try:
            while data := robot.recv(65536):
                now_s = time.time()
                frames = parser.parse_buffer(data) or []
                self.send(self._pass_on(data, frames))
                for frame in frames:
                    if frame.get_type() == "OMNI_WHEELS":
                        self.duties.append((now_s, max(abs(duty) for duty in frame.duty)))
        except OSError:
            pass
        studio.close()
