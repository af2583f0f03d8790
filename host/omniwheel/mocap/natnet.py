# SPDX-License-Identifier: MIT
"""OptiTrack's NatNet, through the library ``natnet`` (the extra ``natnet``).

Motive sends metres and a quaternion (x, y, z, w). Each frame has three times in ticks of its computer: when the cameras
exposed, when it had the data, and when it sent them. The part that the library reads does not say how long a tick is.
So that is measured: two frames are so many ticks apart, and by their own stamps so many seconds.
"""

from __future__ import annotations

import importlib
import math
import queue
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from omniwheel.errors import MocapLibraryError, MocapLostError, MocapSourceError
from omniwheel.frames import Pose
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.mocap.reader import ProcessSource
from omniwheel.mocap.source import MocapPose
from omniwheel.quaternion import heading, tilt

LIBRARY = "natnet"
COMMAND_PORT = 1510
SILENCE_S = 1.0
"""Without a frame for so long the stream is lost."""
LARGEST_TILT = math.radians(15.0)
TILT_S = 1.0
"""For so long the robot may lie farther over than that, as when it is carried."""
_ANSWER_S = 2.0
_ASKS = 4
_SIGN_OF_LIFE_S = 0.25
_FIRST_VERSION = 3
_TICKS_OVER_S, _TICKS_WITHIN_S = 0.2, 3.0
_TICKS_PER_S = (1e5, 1e10)
_LARGEST_LATENCY_S = 1.0
_NAMES_SHOWN = 20
_WAITING = 1000


def load_library() -> Any:
    """Return the library; MocapLibraryError if it is not installed, or cannot read times on this computer."""
    if struct.calcsize("L") != struct.calcsize("Q"):
        problem = f"the NatNet library {LIBRARY} misreads the times of frames on Windows and on 32-bit systems"
        raise MocapLibraryError(problem, hint="use 64-bit Linux or macOS")
    try:
        return importlib.import_module(LIBRARY)
    except ImportError as error:
        hint = "pip install 'omniwheel[natnet]'"
        raise MocapLibraryError(f"the NatNet library {LIBRARY} is not usable here: {error}", hint=hint) from error


@dataclass
class TickLength:
    """How long a tick of the server's clock is, from two frames' times in ticks and in seconds."""

    first: tuple[float, int] | None = None
    seconds: float | None = None

    def latency(self, suffix: Any) -> float | None:
        """Return how long before the frame was sent the cameras exposed [s]; None while that cannot be told."""
        exposed, sent = int(suffix.stamp_camera_mid_exposure), int(suffix.stamp_transmit)
        if self.seconds is None:
            self._measure(float(suffix.timestamp), exposed)
        if self.seconds is None:
            return None
        latency_s = (sent - exposed) * self.seconds
        return latency_s if 0.0 <= latency_s < _LARGEST_LATENCY_S else None

    def _measure(self, stamp_s: float, ticks: int) -> None:
        if self.first is None or stamp_s < self.first[0] or ticks <= self.first[1]:
            self.first = stamp_s, ticks
            return
        apart_s = stamp_s - self.first[0]
        if apart_s >= _TICKS_OVER_S:
            per_s = (ticks - self.first[1]) / apart_s
            if _TICKS_PER_S[0] <= per_s <= _TICKS_PER_S[1]:
                self.seconds = 1.0 / per_s
            else:
                self.first = stamp_s, ticks


class NatNetStream:
    """The library as a stream of poses, in this process: :meth:`read` blocks for up to a second.

    ``library`` is the module, ``clock`` gives the stamps. Motive sends to a multicast group (239.255.42.99, port 1511),
    or to each client that gives signs of life. Nothing that the library reads says which, so both are tried.
    """

    def __init__(
        self, host: str, port: int, subject: str, *, library: Any, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.host, self.port, self.subject = host, port, subject
        self.occluded = 0
        self.connections = 0
        self.multicast = True
        self._library = library
        self._clock = clock
        self._client: Any = None
        self._frames: queue.Queue[tuple[float, Any]] = queue.Queue(_WAITING)
        self._ids: dict[str, int] | None = None
        self._ticks = TickLength()
        self._last_frame: int | None = None
        self._talked_s = self._tilted_s = self._unmeasured_s = 0.0
        self._failure = ""

    def connect(self) -> None:
        """Connect, and wait for the first frame and the objects' names."""
        problems = []
        for multicast in (self.multicast, not self.multicast):
            self.close()
            try:
                self._try(multicast)
                lacking = self._wait()
            except MocapSourceError:
                self.close()
                raise
            except (OSError, ValueError, TypeError, struct.error, self._library.NatNetError) as error:
                problems.append(" ".join(str(error).split()) or "no reply")  # TimeoutError is an OSError
                continue
            if not lacking:
                self.multicast = multicast
                self.connections += 1
                return
            problems.insert(0, f"it responds, but sends no {lacking}")
        self.close()
        hint = "check that Motive is running with Streaming > Enable on, on that network's interface"
        raise MocapLostError(f"no NatNet stream from {self.host}:{self.port}: {problems[0]}", hint=hint)

    def _try(self, multicast: bool) -> None:
        address = socket.gethostbyname(self.host)
        self._client = self._library.NatNetClient(
            server_ip_address=address,
            local_ip_address=_address_towards(address, self.port),
            command_port=self.port,
            use_multicast=multicast,
        )
        self._client.connect(timeout=_ANSWER_S)
        version = self._client.server_info.nat_net_protocol_version
        if version.major < _FIRST_VERSION:
            problem = f"the NatNet server {self.host} has NatNet {version}, without exposure times"
            raise MocapSourceError(problem, hint="use Motive 2.0 or later, with NatNet 3")
        self._client.update_sync()  # what came while it waited for the answer is old
        self._client.on_data_frame_received_event.handlers.append(self._on_frame)
        self._client.on_data_description_received_event.handlers.append(self._on_description)
        self._client.run_async()

    def _wait(self) -> str:
        """Wait for the first frame and the names. Return which of them did not come, or ""."""
        for _ in range(_ASKS):
            self._client.request_modeldef()
            end_s = time.monotonic() + _ANSWER_S / _ASKS
            while time.monotonic() < end_s:
                if self._ids is not None and not self._frames.empty():
                    return ""
                time.sleep(0.01)
        return "frames" if self._frames.empty() else "names of its objects"

    def _on_frame(self, frame: Any) -> None:
        if self._frames.full():
            self._frames.get_nowait()
        self._frames.put_nowait((self._clock(), frame))

    def _on_description(self, described: Any) -> None:
        self._ids = {str(body.name): int(body.id_num) for body in described.rigid_bodies}

    def on_thread_error(self, failure: Any) -> None:
        """Note that a thread of the library ended with an error: a ``threading.excepthook``."""
        self._failure = f"{failure.exc_type.__name__}: {' '.join(str(failure.exc_value).split())}"

    def read(self) -> MocapPose | None:
        """Return the next frame's pose; None if the object is not seen. Raises MocapLostError after a silence."""
        if self._failure:
            problem, self._failure = self._failure, ""
            raise MocapLostError(f"the NatNet library failed: {problem}")
        try:
            arrived_s, frame = self._frames.get(timeout=SILENCE_S)
        except queue.Empty as error:
            self.multicast = not self.multicast
            raise MocapLostError(f"the NatNet server {self.host} is silent") from error
        self._talk(arrived_s, bool(frame.suffix.tracked_models_changed))
        number = int(frame.prefix.frame_number)
        latency_s = self._latency(arrived_s, frame.suffix)
        if number == self._last_frame or latency_s is None:
            return None
        self._last_frame = number
        pose = self._pose(arrived_s, frame)
        if pose is None:
            self.occluded += 1
            return None
        return MocapPose(pose, arrived_s - latency_s, arrived_s, number)

    def _talk(self, now_s: float, changed: bool) -> None:
        """Give a sign of life, which a server that sends to each client wants; ask for names that have changed."""
        if now_s - self._talked_s < _SIGN_OF_LIFE_S:
            return
        self._talked_s = now_s
        try:
            self._client.send_request(self._client.NAT_KEEPALIVE)
            if changed:
                self._client.request_modeldef()
        except OSError as error:
            raise MocapLostError(f"the NatNet server {self.host} is no longer reachable: {error}") from error

    def _latency(self, arrived_s: float, suffix: Any) -> float | None:
        latency_s = self._ticks.latency(suffix)
        if self._ticks.seconds is None:
            self._unmeasured_s = self._unmeasured_s or arrived_s
            if arrived_s - self._unmeasured_s > _TICKS_WITHIN_S:
                problem = f"the times in the frames of the NatNet server {self.host} are invalid"
                raise MocapSourceError(problem, hint="check that Motive is live, not at the end of a recording")
        return latency_s

    def _pose(self, arrived_s: float, frame: Any) -> Pose | None:
        ids = self._ids or {}
        if self.subject not in ids:
            raise self._unknown_object(ids)
        wanted = ids[self.subject]
        for body in frame.rigid_bodies:
            if int(body.id_num) == wanted:
                return self._of_body(arrived_s, body) if body.tracking_valid else None
        return None

    def _of_body(self, arrived_s: float, body: Any) -> Pose | None:
        x, y, z, w = (float(value) for value in body.rot)
        quaternion = (w, x, y, z)
        if tilt(quaternion) > LARGEST_TILT:
            self._tilted_s = self._tilted_s or arrived_s
            if arrived_s - self._tilted_s > TILT_S:
                problem = f"{self.subject} is tilted, {math.degrees(tilt(quaternion)):.0f} degrees"
                raise MocapSourceError(problem, hint="set Up Axis to Z in Motive's streaming settings")
            return None
        self._tilted_s = 0.0
        pose = Pose(float(body.pos[0]), float(body.pos[1]), heading(quaternion))
        return pose if all(math.isfinite(value) for value in pose) else None

    def _unknown_object(self, ids: dict[str, int]) -> MocapSourceError:
        names = sorted(ids)[:_NAMES_SHOWN]
        hint = f"it has {', '.join(names)}" if names else "it has no rigid bodies: create one in Motive and enable it"
        return MocapSourceError(f"the NatNet server {self.host} has no rigid body {self.subject!r}", hint=hint)

    def close(self) -> None:
        """Disconnect."""
        if self._client is not None:
            self._client.shutdown()
            self._client = None
        self._frames = queue.Queue(_WAITING)
        self._ids = None
        self._ticks = TickLength()
        self._last_frame = None
        self._talked_s = self._tilted_s = self._unmeasured_s = 0.0
        self._failure = ""


def _address_towards(host: str, port: int) -> str:
    """Return the address of this computer's interface towards a host."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect((host, port))
        return str(probe.getsockname()[0])


class NatNetSource(ProcessSource):
    """A NatNet stream as a :class:`~omniwheel.mocap.source.MocapSource`; connects again by itself when it was lost.

    Starts a process: see :class:`~omniwheel.mocap.reader.ProcessSource`. Raises MocapLibraryError, MocapSourceError (no
    such object) or MocapLostError (not reachable within ``timeout_s``).
    """

    def __init__(
        self, host: str, subject: str, *, port: int = COMMAND_PORT, timeout_s: float = DEFAULT_TIMEOUT_S
    ) -> None:
        super().__init__(f"natnet:{host}/{subject}", partial(_open, host, port, subject), timeout_s=timeout_s)


def _open(host: str, port: int, subject: str) -> NatNetStream:
    stream = NatNetStream(host, port, subject, library=load_library())
    threading.excepthook = stream.on_thread_error
    return stream
