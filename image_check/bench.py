# SPDX-License-Identifier: MIT
"""A test bench for a firmware image: the emulated chip, the simulated robot at its pins, clients on its links."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from emulated_teensy.image_file import Image
from emulated_teensy.machine import Channel, Finding, FindingKind, Options, Stop
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario
from hil_sim.teensy import Teensy, wiring_of
from hil_sim.world import World
from omniwheel.connection import Connection
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkLostError, OmniError
from omniwheel.robot import Robot

BOOT_LIMIT_S = 2.0
STEP_S = 0.001
TAKE_LIMIT_S = 3.0
"""Upper bound of a start: a port opened right after a reset is written to after this time."""
_SYSTEM_ID = {Channel.USB: 251, Channel.UART: 252}


class CheckError(OmniError):
    """The image does not do what it must."""


class MachineLink:
    """A link of the emulated board. Waiting on it lets the robot's time go on, for all links alike."""

    def __init__(self, bench: Bench, channel: Channel) -> None:
        self.url = f"image:{channel.name.lower()}"
        self._bench = bench
        self._channel = channel

    def read(self, timeout_s: float) -> bytes:
        """Return what the robot sent; if there is nothing and time is given, after one millisecond more."""
        data = self._bench.take(self._channel)
        if data or timeout_s <= 0.0:
            return data
        self._bench.advance(STEP_S)
        return self._bench.take(self._channel)

    def write(self, data: bytes) -> None:
        """Give bytes to the robot; they take the line's time. Raises LinkLostError if it takes no more."""
        at = 0
        give_up_s = self._bench.clock_s() + TAKE_LIMIT_S
        while at < len(data):
            taken = self._bench.machine.send(self._channel, data[at:])
            at += taken
            if taken > 0:
                give_up_s = self._bench.clock_s() + TAKE_LIMIT_S
            elif self._bench.clock_s() > give_up_s:
                raise LinkLostError(f"the robot accepts no byte from {self.url} for {TAKE_LIMIT_S:g} s")
            if at < len(data):
                self._bench.advance(STEP_S)

    def close(self) -> None:
        """Close the serial port of the USB link; a radio has none."""
        if self._channel == Channel.USB:
            self._bench.machine.usb_open(False)


@dataclass
class Bench:
    """One machine with its world and its links, running."""

    machine: Teensy
    world: World
    scenario: Scenario
    _waiting: dict[Channel, bytes] = field(default_factory=dict)
    _watchers: list[Callable[[], None]] = field(default_factory=list)

    def clock_s(self) -> float:
        """Return the robot's time since power-on."""
        return self.machine.time_s

    def advance(self, duration_s: float) -> None:
        """Advance the time in steps of 1 ms, calling the watchers. Raises LinkLostError if the machine can't."""
        end_ns = self.machine.time_ns + round(duration_s * 1e9)
        while self.machine.time_ns < end_ns:
            step_ns = min(end_ns, self.machine.time_ns + round(STEP_S * 1e9)) if self._watchers else end_ns
            stop = self.machine.run_until_ns(step_ns)
            for watcher in self._watchers:
                watcher()
            if stop not in (Stop.TIME, Stop.OUTPUT, Stop.RESET):
                raise LinkLostError(f"the emulated chip stopped ({stop.name}): {self.machine.why}")

    @contextmanager
    def watched(self, watcher: Callable[[], None]) -> Iterator[None]:
        """Call ``watcher`` after each millisecond while the context lasts."""
        self._watchers.append(watcher)
        try:
            yield
        finally:
            self._watchers.remove(watcher)

    def take(self, channel: Channel) -> bytes:
        """Return the bytes that came from a link."""
        return self.machine.receive(channel)

    def drain(self) -> None:
        """Forget the bytes that have come from all links, as after going back in time."""
        for channel in Channel:
            while self.take(channel):
                pass

    def connect(self, channel: Channel = Channel.USB, *, heartbeat: bool = True) -> Robot:
        """Open a link as a ground station does. Raises what :func:`omniwheel.robot.connect` raises."""
        if channel == Channel.USB:
            self.machine.usb_open(True)
        link = MachineLink(self, channel)
        connection = Connection(link, clock=self.clock_s, heartbeat=heartbeat)
        connection.target_system = int(self.scenario.parameter_values()["SYS_ID"])
        connection.target_component = mavlink.MAV_COMP_ID_AUTOPILOT1
        return Robot(connection, table=self.scenario.robot.table)

    def until(self, condition: Callable[[], bool], limit_s: float, what: str) -> float:
        """Run until ``condition`` holds; return how long that took. Raises CheckError after ``limit_s``."""
        begin_s = self.clock_s()
        while not condition():
            if self.clock_s() - begin_s >= limit_s:
                raise CheckError(f"{what}: not within {limit_s:g} s")
            self.advance(STEP_S)
        return self.clock_s() - begin_s

    @property
    def duties(self) -> list[float]:
        """Return what the bridges get, IN1 minus IN2, each a share of the period from 0 to 1."""
        c, wheels = self.world.c, self.world.c.config.wheels
        return [float(c.in1[wheel]) - float(c.in2[wheel]) for wheel in range(wheels)]

    @property
    def powered(self) -> bool:
        """Whether any bridge input is high for any share of the period."""
        c, wheels = self.world.c, self.world.c.config.wheels
        return any(float(c.in1[wheel]) > 0.0 or float(c.in2[wheel]) > 0.0 for wheel in range(wheels))

    def findings(self) -> list[Finding]:
        """Return what the chip objected to."""
        return self.machine.findings()


@dataclass
class Context:
    """What all checks of a run share: the image, the robot that it is for, how much to do."""

    image: Image
    scenario: Scenario
    seed: int = 1
    instruction_ns: int = 10
    depth: str = "ci"
    """``short`` before an upload, ``ci``, or ``nightly``."""

    @contextmanager
    def bench(
        self,
        *,
        options: Options | None = None,
        scenario: Scenario | None = None,
        expected: frozenset[FindingKind] = frozenset(),
    ) -> Iterator[Bench]:
        """Make a machine whose power is off.

        Raises CheckError in the end if the chip objected to something that was not expected, at whatever time. If
        something else went wrong, with both.
        """
        scenario = scenario or self.scenario
        world = new_world(scenario)
        options = options or self.options()
        with Teensy(self.image, wiring=wiring_of(scenario.robot), world=world, options=options) as machine:
            failure: OmniError | None = None
            try:
                yield Bench(machine, world, scenario)
            except OmniError as error:
                failure = error
            objections = [str(finding) for finding in machine.all_findings() if finding.kind not in expected]
            if objections:
                said = [str(failure)] if failure is not None else []
                raise CheckError("; ".join([*said, *(text for text in objections[:3] if text not in "".join(said))]))
            if failure is not None:
                raise failure

    def options(self, *, words: bool = False) -> Options:
        """Return how a machine runs; ``words``: it finds words that are not aligned, which takes time."""
        return Options(instruction_ns=self.instruction_ns, seed=self.seed, words=words)

    @contextmanager
    def booted(
        self, *, scenario: Scenario | None = None, expected: frozenset[FindingKind] = frozenset()
    ) -> Iterator[Bench]:
        """Make a machine whose program serves its links."""
        with self.bench(scenario=scenario, expected=expected) as bench:
            boot(bench)
            yield bench

    def pick(self, short: int, ci: int, nightly: int) -> int:
        """Return how often to do something."""
        return {"short": short, "ci": ci, "nightly": nightly}[self.depth]


def boot(bench: Bench, *, usb: bool = True) -> None:
    """Switch the power on and wait until the robot serves its links. Raises CheckError."""
    bench.machine.power_on()
    bench.machine.usb_cable(usb)
    if usb:
        bench.until(lambda: bench.machine.usb_ready, BOOT_LIMIT_S, "USB serial port")
    else:
        bench.until(lambda: bool(bench.take(Channel.UART)), BOOT_LIMIT_S, "first bytes on the radio's line")
