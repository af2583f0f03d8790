# SPDX-License-Identifier: MIT
"""The USB cable is pulled, its host stops reading, an upload is asked for: each while the robot drives."""

from __future__ import annotations

from emulated_teensy.machine import Channel, Stop
from hil_sim.fault_bench import TURN_TWIST
from hil_sim.fault_cases import CIRCLE, TURN
from image_check.bench import BOOT_LIMIT_S, Bench, CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.fault_drive import Drive
from image_check.faults import on_the_floor
from image_check.stops import COMMAND_LIMIT_S, LATE_S
from omniwheel.dialect import mavlink
from omniwheel.robot import FORCE, Robot
from omniwheel.telemetry import Status

TICK_S = 0.001
DRIVE_S = 0.3
LINK_TO_S = 0.8
"""SAFE_LINK_TO of the pulled cable: the default would only take longer."""
TEXTS_S = 1.0
"""In this time the radio's 960 bytes per second have carried the texts of a stop."""
UPLOADER_BAUD = 134
UPLOAD_S = 0.010
"""docs/guides/bring-up.md: pin off and ALL_LED_OFF in the 10 ms that Teensyduino leaves until the bootloader runs."""
LOOK_NS = 100_000
PHASE_NS = 170_000
"""An upload is asked for at moments so far apart: some are in the middle of an update of the PWM chip."""
CHANNELS, OFF_H, FULL_OFF = 16, 9, 0x10
"""The PWM chip's channels; register LED0_OFF_H; its bit for an output that is always low."""
DEAF_S = 0.5


def cable_pulled(context: Context) -> list[str]:
    """The ground station on USB had the command: the robot stops, stays so when it is back; the radio may take over."""
    with context.booted(scenario=on_the_floor(context.scenario)) as bench:
        drive = Drive(bench, CIRCLE)
        radio = bench.connect(Channel.UART)
        drive.prepare()
        drive.robot.parameters.set_many({"SAFE_LINK_TO": LINK_TO_S})
        drive.start()
        drive.run(DRIVE_S)
        figures = [_pull(bench, radio)]
        _plug_in(bench)
        figures.append("plugged in again: a new session, still in failsafe")
        radio.disarm()
        radio.arm()
        # Not drive(), which would first ask for the robot's limits by radio.
        radio.repeat(lambda: radio.set_velocity(*TURN_TWIST), DRIVE_S)
        if not bench.powered:
            raise CheckError("the radio has disarmed, armed and set a velocity, and no motor turns")
        figures.append("the radio takes over")
    return figures


def _pull(bench: Bench, radio: Robot) -> str:
    pulled_s = bench.clock_s()
    bench.machine.usb_cable(False)
    while bench.powered and bench.clock_s() < pulled_s + 2 * LINK_TO_S:
        radio.pump(0.0)
        bench.advance(TICK_S)
    off_s = bench.clock_s() - pulled_s
    if off_s > LINK_TO_S + LATE_S:
        raise CheckError(
            f"cable pulled: bridges off after {1e3 * off_s:.0f} ms, {1e3 * LINK_TO_S:.0f} ms are the limit"
        )
    radio.pump(TEXTS_S)
    texts = [text.text for text in radio.texts.all]
    if "failsafe: link loss" not in texts or bench.powered:
        raise CheckError(f"cable pulled: the radio gets no message of the stop, but {texts}")
    return f"cable pulled: bridges off after {1e3 * off_s:.0f} ms ({1e3 * LINK_TO_S:.0f} ms)"


def _plug_in(bench: Bench) -> None:
    bench.machine.usb_cable(True)
    bench.until(lambda: bench.machine.usb_ready, BOOT_LIMIT_S, "USB serial port after the cable was plugged in again")
    robot = bench.connect(Channel.USB)
    robot.commands.request_message(Status.message, TEXTS_S)
    if robot.status.state != "failsafe" or bench.powered:
        raise CheckError(f"plugged in again: the robot's state is {robot.status.state}, failsafe is expected")


def host_stops_reading(context: Context) -> list[str]:
    """Its program sends but does not read: ticks keep their time, and a disarm is obeyed."""
    with context.booted(scenario=on_the_floor(context.scenario)) as bench:
        drive = Drive(bench, TURN)
        drive.robot.pump(DRIVE_S)
        drive.start()
        drive.run(DRIVE_S)
        bench.machine.usb_deaf(True)
        drive.deaf = True
        drive.run(DEAF_S)
        if not bench.powered:
            raise CheckError("a host that sends setpoints but does not read: the robot stops")
        off_s = _disarm_unheard(bench, drive.robot)
        bench.machine.usb_deaf(False)
        status = drive.robot.commands.request_message(Status.message, TEXTS_S)
        if status.overruns != 0:
            raise CheckError(f"a host that does not read: {status.overruns} ticks overran")
        return [
            f"{DEAF_S:g} s without a reader: drives on, no tick overran, disarmed in {1e3 * off_s:.1f} ms, "
            "replies resume"
        ]


def _disarm_unheard(bench: Bench, robot: Robot) -> float:
    target = (robot.connection.target_system, robot.connection.target_component)
    numbers = (0.0, FORCE, 0.0, 0.0, 0.0, 0.0, 0.0)
    robot.send(mavlink.MAVLink_command_long_message(*target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, *numbers))
    off_s = bench.until(lambda: not bench.powered, DEAF_S, "a host that does not read disarms: bridges off")
    if off_s > COMMAND_LIMIT_S:
        raise CheckError(f"a host that does not read disarms: bridges off after {1e3 * off_s:.1f} ms")
    return off_s


def upload_asked(context: Context) -> list[str]:
    """134 baud while armed: the pin lets go and the PWM chip is told before the processor stops for the uploader."""
    worst_s = [0.0, 0.0, 1.0]
    with context.booted(scenario=on_the_floor(context.scenario)) as bench:
        drive = Drive(bench, TURN)
        drive.start()
        drive.run(DRIVE_S)
        driving = bench.machine.snapshot()
        for turn in range(context.pick(2, 6, 30)):
            bench.machine.restore(driving)
            bench.machine.run_until_ns(bench.machine.time_ns + turn * PHASE_NS)
            oe_s, told_s, gone_s = _upload(bench)
            worst_s = [max(worst_s[0], oe_s), max(worst_s[1], told_s), min(worst_s[2], gone_s)]
    return [
        f"upload asked for while armed: output-enable off within {1e3 * worst_s[0]:.1f} ms, ALL_LED_OFF within "
        f"{1e3 * worst_s[1]:.1f} ms, uploader after {1e3 * worst_s[2]:.1f} ms"
    ]


def _all_off(bench: Bench) -> bool:
    registers = bench.world.c.chip.registers
    return all(registers[OFF_H + 4 * channel] & FULL_OFF for channel in range(CHANNELS))


def _upload(bench: Bench) -> tuple[float, float, float]:
    """Ask for an upload; return when the pin is off, when the chip is told, and when the uploader runs."""
    begin_ns = bench.machine.time_ns
    bench.machine.usb_open(True, UPLOADER_BAUD)
    powered_until_s = told_s = 0.0
    stop = Stop.TIME
    while stop != Stop.UPLOAD:
        stop = bench.machine.run_until_ns(bench.machine.time_ns + LOOK_NS)
        now_s = (bench.machine.time_ns - begin_ns) * 1e-9
        powered_until_s = now_s if bench.powered else powered_until_s
        told_s = told_s if _all_off(bench) else now_s
        if now_s > 2 * UPLOAD_S or stop not in (Stop.TIME, Stop.UPLOAD):
            raise CheckError(f"134 baud: no uploader within {1e3 * now_s:.0f} ms ({stop.name})")
    if powered_until_s >= now_s or told_s >= now_s:
        raise CheckError("134 baud: the uploader runs before output-enable is off and the PWM chip told")
    return powered_until_s, told_s, now_s


CHECKS = (
    Check("cable", "USB pulled while driving, plugged in again; the radio", cable_pulled, (CI, NIGHTLY)),
    Check("deaf-host", "a USB host that stops reading", host_stops_reading, (CI, NIGHTLY)),
    Check("upload", "an upload asked for while armed", upload_asked),
)
