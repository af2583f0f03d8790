# SPDX-License-Identifier: MIT
"""The stop button, and what a restart must leave as it is: a stop stays a stop, and nothing arms but an arm command."""

from __future__ import annotations

from collections.abc import Callable

from emulated_teensy.machine import Channel, Options
from hil_sim.fault_cases import Kind
from image_check.bench import BOOT_LIMIT_S, Bench, CheckError, Context, boot
from image_check.check import CI, NIGHTLY, Check
from image_check.fault_drive import FINE_S, install
from image_check.stops import COMMAND_LIMIT_S, TURN_RAD_S, driving
from omniwheel.bringup.other_stops import safety_of
from omniwheel.errors import ArmingRefusedError, CommandRefusedError
from omniwheel.robot import SETPOINT_PERIOD_S, Robot

SLOW = 20
"""Time of an instruction [ns]: a tick still ends within its millisecond."""
PASS_ns = 900_000
"""Time of a pass of the main loop, which then costs few instructions, too."""
TICK_S = 0.001
TICKS_LIMIT_S = 2 * TICK_S
"""From the contact to the output-enable pin: two ticks."""
FOREVER_S = 1e6
SHOWN_S = 0.003
STORED_S = 0.3
"""By then the memory rests again."""
LIMIT_S = 0.01
"""From the stop to its last byte in the memory, where an empty memory's first sector is begun, and otherwise."""
RELEASE_STORED_S = 0.8
"""A release is written 0.5 s later (``StopLatch::release_delay_us``)."""
STAYS_S = 0.3
OPENED = "stop button open: pressed, or its wire is cut"
NOT_RELEASED = "not released: the stop button is still open"
SINCE_BEFORE = "stopped since before the restart: release it"


def _power(bench: Bench) -> None:
    bench.machine.power_on()
    bench.machine.usb_cable(True)


def _reset(flags: int) -> Callable[[Bench], None]:
    return lambda bench: bench.machine.reset(flags)


RESTARTS: dict[str, Callable[[Bench], None]] = {
    "power": _power,
    "watchdog": _reset(0x80),
    "software": _reset(0x2),
    "over-temperature": _reset(0x100),
}
"""Bits of SRC_SRSR (i.MX RT1060 reference manual, chapter SRC). A supply too low for the chip is a power-on."""
FLICKERS_S = (0.02, 0.07, 0.2, 0.4)
DIP_S = 0.1
GONE_S = 0.05
"""After a reset: the USB port is gone by then, and not there again yet."""


def _options(context: Context) -> Options:
    return Options(instruction_ns=SLOW, pause_ns=PASS_ns, seed=context.seed)


def _press(bench: Bench, pressed: bool = True) -> None:
    kinds = [Kind("stop_button")] if pressed else []
    install(bench, kinds, float(bench.world.c.time_us) * 1e-6, FOREVER_S)


def _restart(bench: Bench, name: str, way: Callable[[Bench], None]) -> Robot:
    """Restart and connect; no bridge gets anything, whatever comes over the link. Raises CheckError."""

    def stays_off() -> None:
        if bench.powered:
            raise CheckError(f"a bridge has power after a restart ({name})")

    with bench.watched(stays_off):
        way(bench)
        bench.advance(GONE_S)
        bench.until(lambda: bench.machine.usb_ready, BOOT_LIMIT_S, f"USB serial port after a restart ({name})")
        bench.drain()
        robot = bench.connect(Channel.USB)
        robot.repeat(lambda: robot.set_velocity(0.0, 0.0, TURN_RAD_S), STAYS_S)
    return robot


def _stream(robot: Robot, duration_s: float) -> None:
    """Go on asking for a turn, also of a robot that has stopped."""
    end_s = robot.connection.clock() + duration_s
    while robot.connection.clock() < end_s:
        robot.set_velocity(0.0, 0.0, TURN_RAD_S)
        robot.pump(SETPOINT_PERIOD_S)


def _must_be(robot: Robot, state: str, when: str) -> None:
    found = safety_of(robot).state
    if found != state:
        raise CheckError(f"the robot is in state {found} {when}, not {state}")


def _require_text(robot: Robot, words: str, when: str) -> None:
    texts = [text.text for text in robot.texts.all]
    if words not in texts:
        raise CheckError(f"{when} the robot does not say '{words}', but {texts}")


def _must_not_arm(robot: Robot, when: str) -> None:
    try:
        robot.arm()
    except ArmingRefusedError:
        return
    raise CheckError(f"the robot arms in an emergency stop {when}")


def stop_button(context: Context) -> list[str]:
    """Press it while the robot drives; it stays stopped over restarts, and is released only with the button closed."""
    pin = context.scenario.robot.board.stop_button_pin
    if pin is None:
        return ["this robot has no stop button"]
    with context.booted() as bench:
        robot = driving(bench)
        figure = _time_to_off(bench)
        robot.pump(STORED_S)
        _require_text(robot, OPENED, "pressed,")
        _must_refuse_release(robot)
        robot = _restart(bench, "power", _power)
        _must_be(robot, "estop", "after a power cut with the button open")
        _require_text(robot, OPENED, "started with the button open,")
        _press(bench, False)
        bench.advance(SHOWN_S)
        robot = _restart(bench, "watchdog", RESTARTS["watchdog"])
        _must_be(robot, "estop", "after a reset with the button closed again")
        _must_not_arm(robot, "after a reset with the button closed again")
        robot.estop_clear()
        driving(bench)
    return [figure, "a release while it is open is refused", "stopped over a power cut and a reset, until released"]


def _time_to_off(bench: Bench) -> str:
    """Press; return how soon the motors' power is gone. Raises CheckError."""
    pin = bench.scenario.robot.board.output_enable_pin
    limit_s = COMMAND_LIMIT_S if pin is None else TICKS_LIMIT_S

    def is_off() -> bool:
        return not bench.powered if pin is None else bench.machine.pin(pin) == 1

    _press(bench)
    while not bench.world.sense().stop_button:
        bench.advance(FINE_S)
    begin_s = bench.clock_s()
    while not is_off():
        if bench.clock_s() - begin_s > limit_s:
            raise CheckError(f"the motors have power {1e3 * limit_s:g} ms after the button opened")
        bench.advance(FINE_S)
    off_s = bench.clock_s() - begin_s
    bench.advance(COMMAND_LIMIT_S)
    for _ in range(50):
        bench.advance(TICK_S)
        if bench.powered or any(bench.duties):
            raise CheckError("a motor has power or a duty with the button open")
    what = "bridges" if pin is None else "output-enable"
    return f"{what} off at most {1e3 * (off_s + FINE_S):.2f} ms after it opened"


def _must_refuse_release(robot: Robot) -> None:
    try:
        robot.estop_clear()
    except CommandRefusedError as refusal:
        if NOT_RELEASED not in refusal.reasons:
            raise CheckError(f"a release with the button open is refused for: {refusal.reasons}") from refusal
        return
    raise CheckError("a release with the button open is accepted")


def _stored_s(bench: Bench, robot: Robot, limit_s: float, what: str) -> float:
    """Stop by a command; return how long after its answer the memory changes for the last time. Raises CheckError."""
    before = content = bench.machine.storage
    robot.estop()
    last_s = begin_s = bench.clock_s()
    while bench.clock_s() < begin_s + STORED_S:
        robot.pump(TICK_S)
        now = bench.machine.storage
        last_s, content = (last_s, content) if now == content else (bench.clock_s(), now)
    stored_s = last_s - begin_s
    if content == before or stored_s > limit_s:
        how = "not at all" if content == before else f"only after {1e3 * stored_s:.0f} ms"
        raise CheckError(f"{what} is kept {how}")
    return stored_s


def stop_outlives(context: Context) -> list[str]:
    """An emergency stop by a command, one restart of each kind after the other, then the release, which stays, too."""
    names = list(RESTARTS)[: context.pick(1, len(RESTARTS), len(RESTARTS))]
    with context.bench(options=_options(context)) as bench:
        boot(bench)
        robot = driving(bench)
        first_s = _stored_s(bench, robot, LIMIT_S, "the first stop of an empty memory")
        for name in names:
            robot = _restart(bench, name, RESTARTS[name])
            _must_be(robot, "estop", f"after an emergency stop and a restart ({name})")
            _require_text(robot, SINCE_BEFORE, f"after a restart ({name})")
            _must_not_arm(robot, f"after a restart ({name})")
        robot.estop_clear()
        robot.pump(RELEASE_STORED_S)
        robot = _restart(bench, "power", _power)
        _must_be(robot, "disarmed", "after a release and a restart")
        later_s = _stored_s(bench, driving(bench), LIMIT_S, "a later stop")
    stored = f"kept after {1e3 * first_s:.0f} ms in an empty memory, {1e3 * later_s:.0f} ms otherwise"
    return [stored, f"an emergency stop outlives: {', '.join(names)}; its release a power cut"]


NO_DIP = "a dip that the processor survives was not tried: without a PWM chip nothing forgets, and the drive goes on"


def _flicker(bench: Bench) -> None:
    """A supply that comes and goes: each time the program gets a little further."""
    for on_s in FLICKERS_S:
        bench.machine.power_on()
        bench.advance(on_s)
    _power(bench)


def _dip(bench: Bench) -> str:
    """The supply falls, but not too low for the processor; the PWM chip forgets everything. Raises CheckError."""
    robot = driving(bench)
    kinds = [Kind("battery_sag", value=5.0), Kind("chip_power")]
    install(bench, kinds, float(bench.world.c.time_us) * 1e-6, DIP_S)
    _stream(robot, DIP_S + SHOWN_S)

    def stays_off() -> None:
        if bench.powered:
            raise CheckError("a bridge has power again after the supply was low")

    with bench.watched(stays_off):
        _stream(robot, STAYS_S)
    _must_be(robot, "failsafe", "after the supply was low")
    return f"5 V for {1e3 * DIP_S:g} ms: stays off until disarmed"


def never_arms(context: Context) -> list[str]:
    """Restart a driving robot in each way, its setpoints and heartbeats going on: it comes up disarmed."""
    ways = {**RESTARTS, "a supply that flickers": _flicker}
    with context.bench(options=_options(context)) as bench:
        boot(bench)
        driving(bench)
        moving = bench.machine.snapshot()
        for name, way in ways.items():
            bench.machine.restore(moving)
            bench.drain()
            robot = _restart(bench, name, way)
            _must_be(robot, "disarmed", f"after a restart while it drove ({name})")
        figure = NO_DIP if context.scenario.robot.board.motor_pins else _dip(bench)
    return [f"{', '.join(ways)} while it drives: disarmed, no bridge has power", figure]


CHECKS = (
    Check("stop-button", "the stop button stops, holds over restarts, and needs a release", stop_button),
    Check("stop-kept", "an emergency stop outlives every restart until it is released", stop_outlives, (CI, NIGHTLY)),
    Check("never-arms", "no restart arms: power, brown-out, watchdog, software, heat", never_arms, (CI, NIGHTLY)),
)
