# SPDX-License-Identifier: MIT
"""The wires of a robot as a table: from, to, what to mind."""

from __future__ import annotations

from dataclasses import dataclass

from omni_schema import FlowWiring, GyroWiring
from omni_schema import flow as floor_motion
from omni_schema.gyro import SCL_PIN, SDA_PIN
from omniwheel.wiring import electrics
from omniwheel.wiring.plan import RADIO_RX, RADIO_TX, SCL, SDA, WiringPlan

HEADING = "note"
"""What stands above ``mind`` wherever a person reads the table."""


@dataclass(frozen=True)
class Connection:
    """One line of the table; ``mind`` says what to watch out for at this wire, "" if nothing."""

    start: str
    end: str
    note: str


def connections(plan: WiringPlan) -> tuple[Connection, ...]:
    """Return every wire of the robot, signals first."""
    signals = (
        *_bus(plan),
        *_output_enable(plan),
        *_wheels(plan),
        *_radio(),
        *_gyro(plan),
        *_flow(plan),
        *_extras(plan),
    )
    return (*signals, *_supplies(plan))


def bus_note(plan: WiringPlan) -> str:
    """Return what the bus needs at its speed."""
    if plan.i2c_speed_Hz >= 1_000_000:
        return "1 MHz: add 1.4 kΩ from each to 3.3 V, near the chip"
    speed = f"{plan.i2c_speed_Hz // 1000} kHz"
    return f"pull-ups to 3.3 V: the 10 kΩ on the usual board do for {speed} on wires of some 20 cm"


def oe_note() -> str:
    """Return the advice on the pull-up of OE, with its figures."""
    good = electrics.oe_level_V(electrics.OE_PULL_UP_OHM)
    poor = electrics.oe_level_V(electrics.BOARD_PULL_DOWN_OHM)
    sink = 1e3 * electrics.oe_sink_A(electrics.OE_PULL_UP_OHM)
    return (
        f"1 kΩ from OE to 3.3 V. Many boards pull OE down by 10 kΩ. Then 1 kΩ gives {good:.2f} V, enough for off "
        f"(≥ {electrics.OE_OFF_V:.2f} V), and 10 kΩ gives {poor:.2f} V, undefined. The Teensy sinks {sink:.1f} mA"
    )


def bridge_note(plan: WiringPlan) -> str:
    """Return the advice on the current limit of a bridge."""
    low, high = electrics.BRIDGE_SUPPLY_V
    limit = electrics.BRIDGE_LIMIT_KOHM
    return (
        f"VM {low:g} to {high:g} V. ILIM to ground: 64 A / R in kΩ, so {limit:g} kΩ limits to "
        f"{electrics.trip_current_A(limit):.1f} A; this motor would take {plan.stall_A:.1f} A blocked"
    )


def pull_down_note() -> str:
    """Return the advice on the resistors at the motors' pins."""
    return "10 kΩ from each wire to ground: during reset only the resistor holds it low"


def button_note() -> str:
    """Return the advice on the stop button's contact and its current."""
    weak, strong = 1e3 * electrics.button_A(), 1e3 * electrics.button_A(electrics.BUTTON_PULL_UP_OHM)
    return (
        f"normally closed, latching: a cut wire stops, too. {weak:.2f} mA flow; for a contact that needs more "
        f"current, or a long wire: 1 kΩ from the pin to 3.3 V ({strong:.1f} mA), 10 nF from the pin to ground"
    )


def gyro_note(gyro: GyroWiring) -> str:
    """Return how the gyro's chip is mounted and addressed."""
    way = "up" if gyro.axis > 0 else "down"
    chip = gyro.chip
    level = "ground" if gyro.address == chip.addresses[0] else "3.3 V"
    return (
        f"{'xyz'[abs(gyro.axis) - 1]} of the chip points {way}, anywhere on the robot, screwed down hard; "
        f"{chip.address_pin} to {level} (address 0x{gyro.address:02X}), {chip.select} to 3.3 V; "
        "pull-ups to 3.3 V: 10 kΩ do on wires of some 20 cm"
    )


def flow_note(flow: FlowWiring) -> str:
    """Return how the sensor of motion over the floor is mounted."""
    if not flow.chip.wheels:
        return "flat, at the mounting height of its data sheet, its window free; cable below 20 cm"
    return (
        f"x wheel {flow.x_wheel_mm:g} mm left of the robot's centre, y wheel {flow.y_wheel_mm:g} mm in front of it "
        "(negative: right, behind); cable below 20 cm"
    )


def divider_note(plan: WiringPlan) -> str:
    """Return the resistors of the battery's divider."""
    full = electrics.LOGIC_V * plan.battery_divider
    return (
        f"{electrics.divider_top_kohm(plan.battery_divider):g} kΩ over {electrics.DIVIDER_LOW_KOHM:g} kΩ: "
        f"the pin bears 3.3 V, which is {full:.1f} V of the battery"
    )


def _bus(plan: WiringPlan) -> list[Connection]:
    if not plan.chip:
        return []
    return [
        Connection(f"Teensy {SDA} (SDA), {SCL} (SCL)", "PCA9685 SDA, SCL", bus_note(plan)),
        Connection("Teensy 3.3 V", "PCA9685 VCC", "never 5 V: its pull-ups would put 5 V onto the Teensy's pins"),
    ]


def _output_enable(plan: WiringPlan) -> list[Connection]:
    if not plan.chip:
        pin = plan.output_enable_pin
        return [] if pin is None else [Connection(f"Teensy {pin}", "OE of the bridges' buffer", "1 kΩ to 3.3 V")]
    if plan.output_enable_pin is None:
        return [Connection("ground", "PCA9685 OE", "not wired to the Teensy: only the bus can stop a motor")]
    return [Connection(f"Teensy {plan.output_enable_pin}", "PCA9685 OE", oe_note())]


def _wheels(plan: WiringPlan) -> list[Connection]:
    numbers = ", ".join(str(wheel.number) for wheel in plan.wheels)
    channels = ", ".join(f"{wheel.in1_channel}/{wheel.in2_channel}" for wheel in plan.wheels)
    bridge = Connection("DRV8871 OUT1, OUT2", "its motor", bridge_note(plan))
    found = [Connection(f"PCA9685 channels {channels}", f"IN1/IN2 of the DRV8871 of wheel {numbers}", ""), bridge]
    if not plan.chip:
        motors = ", ".join("/".join(map(str, wheel.motor_pins or ())) for wheel in plan.wheels)
        end = f"{'/'.join(plan.motor_inputs)} of the bridge of wheel {numbers}"
        found = [Connection(f"Teensy {motors}", end, pull_down_note()), bridge]
    if plan.encoders:
        pins = ", ".join("/".join(map(str, wheel.encoder_pins or ())) for wheel in plan.wheels)
        mind = "5 V encoders through a level shifter: the Teensy's pins bear 3.3 V"
        found.append(Connection(f"encoder A/B of wheel {numbers}", f"Teensy {pins}", mind))
    else:
        found.append(Connection("encoders", "nothing", "the robot file has no encoder_pins: no firmware can be built"))
    return found


def _radio() -> list[Connection]:
    most = f"{1e3 * electrics.LOGIC_SUPPLY_A:g} mA"
    mind = f"XBee on 3.3 V. The Teensy's 3.3 V pin gives {most} to everything: an XBee-PRO needs its own regulator"
    return [Connection("XBee DOUT, DIN", f"Teensy {RADIO_RX} (RX1), {RADIO_TX} (TX1)", mind)]


def _gyro(plan: WiringPlan) -> list[Connection]:
    if plan.gyro is None:
        return []
    chip = plan.gyro.chip
    return [
        Connection(f"Teensy {SDA_PIN} (SDA1), {SCL_PIN} (SCL1)", f"{chip.name} SDA, SCL", gyro_note(plan.gyro)),
        Connection("Teensy 3.3 V", f"{chip.name} {chip.supply}", "never 5 V, unless its board has a regulator"),
    ]


def _flow(plan: WiringPlan) -> list[Connection]:
    if plan.flow is None:
        return []
    chip = plan.flow.chip
    pins = f"Teensy {floor_motion.SDA_PIN} (SDA2), {floor_motion.SCL_PIN} (SCL2)"
    return [
        Connection(pins, f"{chip.name} SDA, SCL", flow_note(plan.flow)),
        Connection("Teensy 3.3 V", f"{chip.name} {chip.supply}", "never 5 V: the Teensy's pins bear 3.3 V"),
    ]


def _extras(plan: WiringPlan) -> list[Connection]:
    found = []
    if plan.battery_pin is not None:
        found.append(Connection("VM through a divider", f"Teensy {plan.battery_pin}", divider_note(plan)))
    if plan.stop_button_pin is not None:
        found.append(Connection("ground through the stop button", f"Teensy {plan.stop_button_pin}", button_note()))
    if plan.external_light:
        found.append(Connection(f"Teensy {plan.light_pin}", "lamp: 470 Ω, LED, ground", ""))
    else:
        found.append(Connection(f"Teensy {plan.light_pin}", "the lamp on the board", "no wire"))
    return found


def _supplies(plan: WiringPlan) -> list[Connection]:
    low, high = electrics.TEENSY_SUPPLY_V
    both = f"{low} to {high} V. If USB is plugged in as well, cut the trace between VUSB and VIN under the Teensy"
    shifter = [Connection("5 V", "encoders, level shifter HV", "level shifter LV: the Teensy's 3.3 V")]
    return [
        Connection("5 V regulator, or USB alone", "Teensy VIN", both),
        *(shifter if plan.encoders else []),
        Connection("battery, fuse, switch", "VM of every DRV8871", f"{plan.supply_V:g} V; the switch within reach"),
        *([Connection("nothing", "PCA9685 V+", "not used: it only feeds servos")] if plan.chip else []),
        Connection("all grounds", "one point", "motor currents must not flow through the Teensy's ground wire"),
    ]
