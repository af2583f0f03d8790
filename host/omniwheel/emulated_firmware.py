# SPDX-License-Identifier: MIT
"""The firmware on an emulated Cortex-M7, in place of :class:`omniwheel.FirmwareProcess`: QEMU as a child process."""

from __future__ import annotations

import re
import shutil
import socket
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO

from omniwheel.errors import FirmwareNotFoundError, FirmwareStartError, LinkOpenError
from omniwheel.firmware_child import FirmwareChild
from omniwheel.link import FileLink, StreamLink
from omniwheel.parameters import ParameterValue
from omniwheel.paths import MissingFileError, emulated_firmware_path
from omniwheel.storage_file import hold_storage
from omniwheel.tcp_server import listen_hint

COMPILER = "the Arm compiler (Debian: apt-get install gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib)"
DIRECT = "direct"
EMULATOR = "qemu-system-arm"
MACHINE = "mps2-an500"
MAX_LINKS = 4
READY = b'{"ready":true}'
_INJECT_UART = 4
_STORAGE = "storage"
_LOG = "log"
_LINK_KINDS = "tcp:HOST:PORT, udp:HOST:PORT or pty[:SYMLINK] expected"


class EmulatedFirmware(FirmwareChild):
    """Runs the firmware for one robot on QEMU's Cortex-M7 board; a context manager that always ends it.

    ``robot``, ``links``, ``lockstep``, ``storage`` and ``parameters`` are :class:`omniwheel.FirmwareProcess`'s. A link
    is a serial port there, which does not see clients come and go. So nothing greets a new one, a robot in
    host-in-the-loop stays in it, and a second client waits until the first has gone. The emulator moves its bytes one
    by one. With ``lockstep`` the last link may be ``direct`` instead: whole blocks, many times faster, to this process
    only (:meth:`open_link`). The processor stands still while it waits for them.

    With ``icount_shift`` every instruction takes 2**shift ns of the emulated time, which then runs as fast as this
    computer can. Without, it is real time. ``watchdog_ms`` 0 switches the watchdog off. With ``crash_resets`` the
    processor starts again after a crash, as the robot's does, instead of ending. ``injectable`` makes :meth:`crash` and
    :meth:`hang` work. With ``pins`` a world at the board's pins keeps step with the emulated time (hil_sim.pins).
    Its serial line is the robot's link 1, before ``links``.
    Raises RobotFileError, FirmwareNotFoundError, FirmwareStartError.
    """

    def __init__(
        self,
        robot: str | Path = "three_wheel",
        *,
        links: Sequence[str] = ("tcp:127.0.0.1:0",),
        lockstep: bool = False,
        storage: Path | str | None = None,
        parameters: Mapping[str, ParameterValue] | None = None,
        program: Path | str | None = None,
        icount_shift: int | None = None,
        watchdog_ms: int | None = None,
        reset_cause: str = "power_on",
        crash_resets: bool = False,
        injectable: bool = False,
        pins: bool = False,
    ) -> None:
        super().__init__(robot, parameters)
        if not 1 <= len(links) <= MAX_LINKS:
            raise FirmwareStartError(f"{len(links)} links: the emulated board has 1 to {MAX_LINKS}")
        if DIRECT in links[:-1] or (links[-1] == DIRECT and not lockstep):
            raise FirmwareStartError(f"only the last link may be {DIRECT}, and only with lockstep")
        self._wanted = tuple(links)
        self._direct: socket.socket | None = None
        self._storage = None if storage is None else Path(storage)
        self._held: IO[bytes] | None = None
        self._emulator = _emulator()
        self._program = Path(program) if program is not None else _program()
        self._icount = [] if icount_shift is None else ["-icount", f"shift={icount_shift},align=off,sleep=off"]
        self._words = ["--log", _LOG, "--links", str(len(links)), "--reset-cause", reset_cause]
        self._words += [] if watchdog_ms is None else ["--watchdog", str(watchdog_ms)]
        flags = {
            "--lockstep": lockstep,
            "--console-link": links[-1] == DIRECT,
            "--catch-up": not lockstep and icount_shift is None,
            "--crash-resets": crash_resets,
            "--pins": pins,
            "--inject": injectable,
        }
        self._words += [flag for flag, wanted in flags.items() if wanted]
        self._injectable = injectable
        self._uses_stdio = pins or links[-1] == DIRECT
        self._inject: socket.socket | None = None
        self._symlinks: list[Path] = []

    def open_link(self, number: int = 0) -> FileLink:
        """Connect to one of the links; to a direct one at most once. Raises LinkOpenError."""
        if self._wanted[number] != DIRECT:
            return super().open_link(number)
        if self._direct is None:
            raise LinkOpenError("the direct link to the emulated firmware can be opened only once")
        mine, self._direct = self._direct, None
        return StreamLink(DIRECT, mine)

    def open_pins(self) -> socket.socket:
        """Return the connection to the pins of a firmware with ``pins``; at most once. Closing it ends the emulator."""
        if not self._uses_stdio or self._direct is None:
            raise LinkOpenError("the emulated firmware has no pins for a world, or they are already in use")
        mine, self._direct = self._direct, None
        return mine

    def crash(self) -> None:
        """Make the program fault, at once."""
        self._send_injection(b"c")

    def hang(self) -> None:
        """Make the program stand still with its interrupts held off: only the watchdog helps."""
        self._send_injection(b"h")

    def _send_injection(self, what: bytes) -> None:
        if self._inject is None:
            raise ValueError("start the firmware with injectable=True")
        self._inject.sendall(what)

    def stop(self) -> int | None:
        """End the emulator; return its exit code. Harmless when it has ended."""
        for mine in (self._inject, self._direct):
            if mine is not None:
                mine.close()
        self._inject = self._direct = None
        for symlink in self._symlinks:
            symlink.unlink(missing_ok=True)
        self._symlinks.clear()
        code = super().stop()
        if self._held is not None:
            self._held.close()
            self._held = None
        return code

    def _launch(self, folder: Path, parameters: Path, log: IO[bytes]) -> tuple[str, ...]:
        # The guest's command line is made of words without blanks: it runs in the folder and sees short names only.
        words = ["omni-firmware", "--params", parameters.name, *self._words]
        if self._storage is not None:
            self._held = hold_storage(self._storage)
            (folder / _STORAGE).symlink_to(self._storage.resolve())
            words += ["--storage", _STORAGE]
        command = [*self._emulator, "-M", MACHINE, "-kernel", str(self._program), "-display", "none"]
        semihosting = ",".join(["enable=on", "target=native", *(f"arg={word}" for word in words)])
        command += ["-monitor", "none", "-semihosting-config", semihosting, *self._icount]
        with ExitStack() as ours:
            serial = _SerialPorts(ours)
            for link in self._wanted:
                serial.add_link(link)
            serial.skip_to(_INJECT_UART)
            if self._injectable:
                self._inject = serial.add_pair()
            command += serial.options
            if self._uses_stdio:
                self._direct, its = socket.socketpair()
                ours.enter_context(its)
                self._spawn(command, stdin=its, stdout=its, stderr=log, cwd=folder, pass_fds=serial.fds)
            else:
                self._spawn(command, stdout=log, stderr=log, cwd=folder, pass_fds=serial.fds)
        log_path = folder / _LOG
        if not self._wait_until(lambda: READY in log_path.read_bytes()):
            raise self._not_started()
        return self._named_links(serial.links, log_path.read_text(errors="replace"))

    def _named_links(self, links: Sequence[str], said: str) -> tuple[str, ...]:
        """Put in the names of the pseudo-terminals, which only QEMU knows, and make the links to them."""
        terminals = {label: path for path, label in re.findall(r"redirected to (\S+) \(label (link\d)\)", said)}
        return tuple(
            self._terminal(link, terminals[f"link{number}"]) if link.startswith("pty") else link
            for number, link in enumerate(links)
        )

    def _terminal(self, link: str, terminal: str) -> str:
        _, _, wanted = link.partition(":")
        if not wanted:
            return f"pty:{terminal}"
        path = Path(wanted)
        if path.is_symlink():
            path.unlink()
        try:
            path.symlink_to(terminal)
        except OSError as error:
            raise FirmwareStartError(f"cannot link {path} to the terminal: {error.strerror}") from error
        self._symlinks.append(path)
        return link


class _SerialPorts:
    """The emulator's serial ports. Sockets are opened here, so that no other program can take a port."""

    def __init__(self, ours: ExitStack) -> None:
        self.options: list[str] = []
        self.links: list[str] = []
        self.fds: list[int] = []
        self._ours = ours
        self._count = 0

    def add_link(self, link: str) -> None:
        kind, _, address = link.partition(":")
        if link == DIRECT:
            self.links.append(link)
        elif kind == "pty":
            self._add("pty")
            self.links.append(link)
        elif kind == "tcp":
            host, port = _split(link, address)
            listener = self._given_away(_listen(host, port))
            self._add("socket", f"fd={listener.fileno()}", "server=on", "wait=off")
            self.links.append(f"tcp:{host}:{listener.getsockname()[1]}")
        elif kind == "udp":
            host, port = _split(link, address)
            self._add("udp", f"host={host}", f"port={port}")
            self.links.append(link)
        else:
            raise FirmwareStartError(f"--link '{link}': {_LINK_KINDS}")

    def add_pair(self) -> socket.socket:
        """Add a port whose other end is returned."""
        mine, its = socket.socketpair()
        self._add("socket", f"fd={self._given_away(its).fileno()}")
        return mine

    def skip_to(self, number: int) -> None:
        while self._count < number:
            self.options += ["-serial", "null"]
            self._count += 1

    def _add(self, *chardev: str) -> None:
        name = f"link{self._count}"
        kind, *options = chardev
        self.options += ["-chardev", ",".join([kind, f"id={name}", *options]), "-serial", f"chardev:{name}"]
        self._count += 1

    def _given_away(self, item: socket.socket) -> socket.socket:
        self._ours.enter_context(item)
        self.fds.append(item.fileno())
        return item


def _split(link: str, address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal() or len(port) > 5 or int(port) > 65535:
        raise FirmwareStartError(f"--link '{link}'; must be HOST:PORT with a port from 0 to 65535")
    return host, int(port)


def _listen(host: str, port: int) -> socket.socket:
    try:
        listener = socket.create_server((host, port))
    except OSError as error:
        said = f"cannot listen at {host}:{port}: {error.strerror}"
        raise FirmwareStartError(said, hint=listen_hint(error.errno)) from error
    # Connections inherit it; the emulated serial port sends byte by byte, and each must go at once.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener


def require_emulator() -> None:
    """Raise FirmwareNotFoundError, which says what to install, where QEMU or the firmware for it is missing."""
    _emulator()
    _program()


def _program() -> Path:
    try:
        return emulated_firmware_path()
    except MissingFileError as error:
        message = "the firmware for the emulated Cortex-M7 has not been built"
        raise FirmwareNotFoundError(message, hint=f"install {COMPILER}, then run: make setup") from error


def _emulator() -> list[str]:
    """Return the command that runs QEMU; where that is possible it ends when this process is killed."""
    program = shutil.which(EMULATOR)
    if program is None:
        hint = "Debian: apt-get install qemu-system-arm; macOS: brew install qemu"
        raise FirmwareNotFoundError(f"{EMULATOR} is not installed", hint=hint)
    keeper = shutil.which("setpriv")
    # The signal comes when the starting thread ends, which must not be one of a pool.
    if keeper is None or threading.current_thread() is not threading.main_thread():
        return [program]
    return [keeper, "--pdeathsig", "TERM", "--", program]
