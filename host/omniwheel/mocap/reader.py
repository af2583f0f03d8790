# SPDX-License-Identifier: MIT
"""A stream of poses that a library reads in a process of its own.

Such libraries block Python, print, or start threads that end with an error. None of that may reach the program that
has a robot to stop. The process connects again by itself when the stream was lost.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection as Pipe
from typing import Protocol

from omniwheel.errors import MocapError, MocapLostError
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.mocap.source import MocapPose

RETRY_S = 1.0
_STARTING_S = 10.0


class LibraryStream(Protocol):
    """What runs in the process."""

    def connect(self) -> None:
        """Connect, or connect again. Raises MocapLostError."""
        ...

    def read(self) -> MocapPose | None:
        """Return the next pose; None if none came for a while, or it cannot be used. Raises MocapError."""
        ...

    def close(self) -> None:
        """Disconnect."""
        ...


class ProcessSource:
    """Such a stream as a :class:`~omniwheel.mocap.source.MocapSource`.

    ``make`` makes the stream, in the process; it must be a function of a module, or a partial of one. The process
    starts anew from the program's own file, so a program that uses it needs ``if __name__ == "__main__":``. Raises
    MocapLibraryError, MocapSourceError (no such object) or MocapLostError (not reachable within ``timeout_s``).
    """

    def __init__(self, name: str, make: Callable[[], LibraryStream], *, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        self.name = name
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=_serve, args=(theirs, make), daemon=True)
        self._process.start()
        theirs.close()
        try:
            if not self._pipe.poll(_STARTING_S + timeout_s):
                waited = f"{_STARTING_S + timeout_s:g} s"
                raise MocapLostError(f"{self.name} did not respond within {waited}", hint="check the host")
            self._take()
        except BaseException:
            self.close()
            raise

    def clock(self) -> float:
        """Return the present time [s]: the monotonic clock, which all processes share."""
        return time.monotonic()

    @property
    def ended(self) -> bool:
        """Never: a lost stream is connected to again."""
        return False

    def read(self, timeout_s: float) -> MocapPose | None:
        """Return the next pose. Raises MocapSourceError if the object is gone, MocapLostError if the reader ended."""
        try:
            there = self._pipe.poll(max(0.0, timeout_s))
        except OSError:  # on Windows, where the other end is gone
            there = True
        return self._take() if there else None

    def _take(self) -> MocapPose | None:
        try:
            said: MocapPose | MocapError | None = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise MocapLostError(f"the process that reads {self.name} ended", hint="restart the command") from error
        if isinstance(said, MocapError):
            raise said
        return said

    def close(self) -> None:
        """End the reader."""
        self._pipe.close()
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(3.0)


def _serve(pipe: Pipe, make: Callable[[], LibraryStream]) -> None:
    """Read the stream into ``pipe`` for as long as the parent lives: None once connected, then poses, or an error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which still has a robot to stop
    sys.stdout = None  # what a library prints is not the program's output
    with suppress(BrokenPipeError):
        try:
            stream = make()
            stream.connect()
            pipe.send(None)
            _forward(pipe, stream)
        except MocapError as error:
            pipe.send(error)
        except BrokenPipeError:
            raise
        except Exception as error:  # a library may raise anything, and the reason must not be lost
            pipe.send(MocapLostError(f"the library failed: {type(error).__name__}: {' '.join(str(error).split())}"))
    pipe.close()
    os._exit(0)  # threads of a library may never end


def _forward(pipe: Pipe, stream: LibraryStream) -> None:
    parent = multiprocessing.parent_process()
    while parent is None or parent.is_alive():
        try:
            pose = stream.read()
            if pose is not None:
                pipe.send(pose)
        except MocapLostError:
            time.sleep(RETRY_S)
            with suppress(MocapLostError):
                stream.connect()
