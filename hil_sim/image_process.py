# SPDX-License-Identifier: MIT
"""The program behind :class:`omniwheel.ImageFirmware`: one flashed image, alive, for others to connect to.

``python -m hil_sim.image_process IMAGE --usb tcp:127.0.0.1:0`` prints a line of JSON with its links when they listen.

A client of the USB link is a program that has the port open (DTR); when it goes the port is closed. When the board
restarts its USB port vanishes, so the client is hung up. The pose fixes of a world at the pins come over USB. They go
between the client's own frames, as from a motion-capture bridge on the same port. Robot time follows the wall clock,
and falls behind where this computer is too slow. With ``--lockstep`` it stands still once the robot has answered a tick
of a host in the loop, until the host speaks again.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import FrameType

from emulated_teensy.image_file import read_image
from emulated_teensy.machine import STORAGE_SIZE, Channel, Options, Stop
from hil_sim.frame_watch import FrameWatch
from hil_sim.image_links import ImagePort, open_port
from hil_sim.lockstep import WORLD_COMPONENT_ID, WORLD_SYSTEM_ID
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from hil_sim.teensy import Teensy, wiring_of
from omniwheel import files
from omniwheel.dialect import mavlink
from omniwheel.errors import FirmwareStartError, OmniError
from omniwheel.frames import Pose
from omniwheel.robots import read_robot
from omniwheel.setpoints import compact_fix_message
from omniwheel.storage_file import hold_storage

SLICE_NS = 1_000_000
LAG_S = 0.1
"""Behind the wall clock by more than this, robot time no longer tries to catch up."""
SAVE_SLICES = 200
"""Slices between two looks at the parameter memory and the findings."""
WAIT_S = 0.1
CLOSED_NS = 50_000_000
"""The port stays closed for so long between two clients, so that the board sees that it is another one."""
MAX_WAITING = 1 << 16
_ANSWER = mavlink.MAVLINK_MSG_ID_OMNI_HIL_ACTUATORS
_ENDINGS = {
    Stop.REFUSED: "the emulated chip cannot continue",
    Stop.UPLOAD: "the program jumped to the uploader",
    Stop.POWER: "the power was cut",
}


@dataclass
class Link:
    """A link of the board, its outer end, and the bytes from there that the board has not taken yet."""

    channel: Channel
    port: ImagePort
    waiting: bytes = b""
    watch: FrameWatch = field(default_factory=FrameWatch)

    def to_robot(self, machine: Teensy, fix: bytes = b"") -> None:
        """Hand on what the client sent, and ``fix`` unless the client is in the middle of a frame."""
        if len(self.waiting) < MAX_WAITING:
            sent = self.port.read()
            self.watch.feed(sent)
            self.waiting += sent + (fix if self.watch.between else b"")
        if self.waiting:
            self.waiting = self.waiting[machine.send(self.channel, self.waiting) :]

    def from_robot(self, machine: Teensy) -> bytes:
        """Hand on and return what the board sent; with a client that does not read, the board waits, too."""
        self.port.flush()
        if self.port.full:
            return b""
        data = machine.receive(self.channel)
        if data:
            self.port.write(data)
        return data


class Server:
    """Keeps a machine and its clients going."""

    def __init__(self, machine: Teensy, links: list[Link], storage: StorageFile | None, *, lockstep: bool) -> None:
        self.ended = False
        self._machine = machine
        self._links = links
        self._usb = next((link for link in links if link.channel == Channel.USB), None)
        self._fixes = mavlink.MAVLink(None, WORLD_SYSTEM_ID, WORLD_COMPONENT_ID)
        self._session = 0
        self._open = False
        self._closed_ns = 0
        self._ready = False
        self._watch = FrameWatch() if lockstep else None
        self._answered = False
        self._storage = storage
        self._saved = machine.storage
        self._told = 0
        self._zero_s = 0.0
        if lockstep:
            machine.stop_on(Stop.OUTPUT)

    def run(self) -> int:
        """Serve until told to end; return the exit code."""
        self._start_clock()
        slices = 0
        while not self.ended:
            self._follow_client()
            if self._answered and not self._host_spoke():
                continue
            for link in self._links:
                link.to_robot(self._machine, self._fix() if link is self._usb and self._open else b"")
            stop = self._machine.run_until_ns(self._machine.time_ns + SLICE_NS)
            self._take_output()
            slices += 1
            if slices % SAVE_SLICES == 0:
                self.supervise()
            if stop in _ENDINGS:
                return self._end(stop)
            if not self._answered:
                self._pace()
        self.supervise()
        return 0

    def _follow_client(self) -> None:
        """Open and close the board's USB port as clients come and go; hang up on one whose port has vanished."""
        if self._usb is None:
            return
        ready = self._machine.usb_ready
        if self._ready and not ready:
            self._usb.port.hang_up()
        self._ready = ready
        session = self._usb.port.session
        if session != self._session:
            self._session = session
            self._usb.waiting, self._usb.watch = b"", FrameWatch()
            if self._open:
                self._machine.usb_open(False)
                self._open, self._closed_ns = False, self._machine.time_ns
        if ready and session and not self._open and self._machine.time_ns - self._closed_ns >= CLOSED_NS:
            self._open = True
            self._machine.usb_open(True)

    def _fix(self) -> bytes:
        """Return the pose fix that is due in the world at the pins, as a frame; its time is left to FIX_DELAY."""
        if self._machine.world is None or self._watch is not None:
            return b""
        sensors = self._machine.world.sense()
        if not sensors.has_fix or sensors.link_silent:
            return b""
        return bytes(compact_fix_message(Pose(*sensors.fix.pose), 0).pack(self._fixes))

    def _host_spoke(self) -> bool:
        """Wait a moment for the host in the loop; time goes on, too, when it has gone."""
        assert self._usb is not None
        self._usb.waiting += self._usb.port.read()
        if not self._usb.waiting and self._usb.port.connected:
            self._usb.port.wait(WAIT_S)
            self._usb.waiting += self._usb.port.read()
        if self._usb.port.connected and not self._usb.waiting:
            return False
        self._answered = False
        self._start_clock()
        return True

    def _take_output(self) -> None:
        for link in self._links:
            data = link.from_robot(self._machine)
            if data and link is self._usb and self._watch is not None:
                self._answered = _ANSWER in self._watch.feed(data)

    def _start_clock(self) -> None:
        self._zero_s = time.monotonic() - self._machine.time_s

    def _pace(self) -> None:
        ahead_s = self._machine.time_s - (time.monotonic() - self._zero_s)
        if ahead_s > 0.0:
            time.sleep(ahead_s)
        elif ahead_s < -LAG_S:
            self._start_clock()

    def supervise(self) -> None:
        """Write the parameter memory to its file if it has changed, and tell what is new among the findings."""
        content = self._machine.storage
        if self._storage is not None and content != self._saved:
            self._storage.write(content)
        self._saved = content
        findings = self._machine.findings()
        for finding in findings[self._told :]:
            print(f"finding: {finding}", file=sys.stderr, flush=True)
        self._told = len(findings)

    def _end(self, stop: Stop) -> int:
        self.supervise()
        why = self._machine.why
        print(_ENDINGS[stop] + (f": {why}" if why else ""), file=sys.stderr, flush=True)
        return 1


class StorageFile:
    """The file of a parameter memory, held against other firmwares until :meth:`close`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._held = hold_storage(path)

    def read(self) -> bytes | None:
        """Return what is in it, None if that is nothing. Raises FirmwareStartError."""
        try:
            content = self._path.read_bytes()
        except OSError as error:
            raise FirmwareStartError(f"--storage {self._path}: {error.strerror}") from error
        if len(content) in (0, STORAGE_SIZE):
            return content or None
        raise FirmwareStartError(
            f"--storage {self._path}: {len(content)} bytes do not fit the parameter memory of {STORAGE_SIZE}"
        )

    def write(self, content: bytes) -> None:
        """Replace the file at once, so that it is never half a memory. Raises OutputFileError."""
        files.write_bytes(self._path, content)
        replaced, self._held = self._held, hold_storage(self._path)
        replaced.close()

    def close(self) -> None:
        """Let go of the file."""
        self._held.close()


def end_with_stdin(end: Callable[[], None]) -> None:
    """Call ``end`` when standard input is closed: the parent has ended."""

    def wait() -> None:
        while sys.stdin.buffer.read(256):
            pass
        end()

    threading.Thread(target=wait, daemon=True).start()


def _arguments(words: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m hil_sim.image_process", description=__doc__)
    parser.add_argument("image", type=Path, help="ELF or Intel hex file")
    parser.add_argument("--usb", metavar="LINK", help="tcp:HOST:PORT or pty[:SYMLINK]")
    parser.add_argument(
        "--uart", metavar="LINK", help="link of Serial1, the radio's port: tcp:HOST:PORT or pty[:SYMLINK]"
    )
    parser.add_argument("--robot", default="three_wheel", help="robot file with the wiring")
    parser.add_argument("--scenario", help="scenario of the world at the pins; without it the wheels stand still")
    parser.add_argument("--world-robot", help="robot to simulate, if different")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--storage", type=Path, help="file of the stored parameters")
    parser.add_argument(
        "--lockstep", action="store_true", help="stop the simulated time while the host in the loop computes"
    )
    parser.add_argument("--end-with-stdin", action="store_true", help="end when standard input is closed")
    parser.add_argument("--instruction-ns", type=int, default=Options.instruction_ns, help="duration of an instruction")
    return parser.parse_args(words)


def _machine(arguments: argparse.Namespace) -> Teensy:
    wiring = wiring_of(read_robot(arguments.robot))
    options = Options(instruction_ns=arguments.instruction_ns, strict=False, seed=arguments.seed or Options.seed)
    world = None
    if arguments.scenario is not None:
        scenario = load_scenario(arguments.scenario, arguments.robot, arguments.world_robot).with_seed(arguments.seed)
        world = new_world(scenario)
    return Teensy(read_image(arguments.image), wiring=wiring, world=world, options=options)


def _serve(arguments: argparse.Namespace) -> int:
    with ExitStack() as stack:
        machine = stack.enter_context(_machine(arguments))
        links = []
        for channel, wanted in ((Channel.USB, arguments.usb), (Channel.UART, arguments.uart)):
            if wanted:
                port = open_port(wanted)
                stack.callback(port.close)
                links.append(Link(channel, port))
        storage = StorageFile(arguments.storage) if arguments.storage is not None else None
        if storage is not None:
            stack.callback(storage.close)
            machine.storage = storage.read() or machine.storage
        machine.power_on()
        machine.usb_cable(arguments.usb is not None)
        server = Server(machine, links, storage, lockstep=arguments.lockstep)

        def end(number: int, frame: FrameType | None) -> None:
            server.ended = True

        if arguments.end_with_stdin:
            end_with_stdin(partial(end, 0, None))
        signal.signal(signal.SIGTERM, end)
        signal.signal(signal.SIGINT, end)
        print(json.dumps({"ready": True, "links": [link.port.name for link in links]}), flush=True)
        return server.run()


def main(words: list[str] | None = None) -> int:
    """Run until the end of the process is asked for; return the exit code."""
    try:
        return _serve(_arguments(words))
    except OmniError as error:
        print(*filter(None, (error.hint, str(error))), sep="\n", file=sys.stderr)  # the last line is the summary
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main())
