# SPDX-License-Identifier: MIT
"""The wiring diagram: encoders, level shifter, Teensy, PWM chip, bridges, motors from left to right, a row per wheel.

All places follow from the columns below and the number of wheels; wires of a wheel run straight through its row.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from omni_schema import flow as floor_motion
from omni_schema import gyro as gyro_wires
from omniwheel import files
from omniwheel.wiring import electrics
from omniwheel.wiring.notes import Note, write_notes
from omniwheel.wiring.plan import RADIO_RX, RADIO_TX, SCL, SDA, WheelWiring, WiringPlan
from omniwheel.wiring.sheet import MOTOR, OUTLINE, SIGNAL, SMALL, SUPPLY, Sheet
from omniwheel.wiring.supply import draw_supply

WIDTH = 1500.0
LEFT = 40.0
ROWS = 118.0
ROW = 168.0
ENCODER_X, ENCODER_W = LEFT, 150.0
SHIFTER_X, SHIFTER_W = 290.0, 150.0
TEENSY_X, TEENSY_W = 560.0, 190.0
CHIP_X, CHIP_W = 930.0, 170.0
BRIDGE_X, BRIDGE_W = 1210.0, 130.0
MOTOR_X = 1435.0
PART = (24.0, 86.0)
"""Top and height of an encoder's or a bridge's box in its row."""
FIRST, SECOND = 54.0, 82.0
"""Where A and B, IN1 and IN2 are in a row."""
RADIO_H = 132.0
DIVIDER_H = 196.0
BUTTON_H = 88.0
SUPPLY_H = 190.0
SENSOR_H = 112.0


def draw_wiring(plan: WiringPlan) -> str:
    """Return the diagram as an SVG document."""
    sheet = Sheet(f"Wiring of {plan.name}")
    sheet.text((LEFT, 44), f"Wiring of {plan.name}", size=24, bold=True)
    wheels_end = ROWS + ROW * len(plan.wheels)
    radio = wheels_end + 24
    divider_end = radio + RADIO_H + (DIVIDER_H if plan.battery_pin is not None else 0)
    sensors = [wiring for wiring in (plan.gyro, plan.flow) if wiring is not None]
    button_end = divider_end + (BUTTON_H if plan.stop_button_pin is not None else 0)
    parts_end = max(button_end, radio + SENSOR_H * len(sensors) + 32)
    if plan.warnings:
        sheet.text((WIDTH - LEFT, 44), "Read the warning below", anchor="end", size=17, bold=True, kind="warning")
    _draw_shifter(sheet, plan, wheels_end)
    if plan.chip:
        _draw_chip(sheet, wheels_end)
    else:
        _draw_motor_pins(sheet, plan, wheels_end)
    _draw_teensy(sheet, parts_end)
    for wheel in plan.wheels:
        _draw_encoder(sheet, wheel, _row(wheel.number))
        _draw_bridge(sheet, plan, wheel, _row(wheel.number))
    if plan.chip:
        _draw_between(sheet, plan)
    _draw_radio(sheet, radio)
    if plan.battery_pin is not None:
        _draw_divider(sheet, plan, radio + RADIO_H)
    if plan.stop_button_pin is not None:
        _draw_button(sheet, plan, divider_end)
    _draw_light(sheet, plan, radio + (SENSOR_H * len(sensors) - 16 if sensors else 64))
    if plan.gyro is not None:
        _draw_sensor(sheet, plan.gyro.chip.name, GYRO, radio)
    if plan.flow is not None:
        _draw_sensor(sheet, plan.flow.chip.name, FLOOR_MOTION, radio + SENSOR_H * (len(sensors) - 1))
    draw_supply(sheet, plan, (LEFT, parts_end + 64))
    height = write_notes(sheet, plan, (LEFT, parts_end + 64 + SUPPLY_H), WIDTH - 2 * LEFT)
    return sheet.svg(WIDTH, height + LEFT)


def write_wiring(plan: WiringPlan, path: Path) -> None:
    """Write the diagram to a file; raise OutputFileError if it cannot be written."""
    files.write_text(path, draw_wiring(plan))


def _row(number: int) -> float:
    return ROWS + ROW * (number - 1)


def _draw_encoder(sheet: Sheet, wheel: WheelWiring, y: float) -> None:
    top, height = PART
    sheet.box((ENCODER_X, y + top), ENCODER_W, height)
    sheet.text((ENCODER_X + 12, y + top + 24), f"Encoder {wheel.number}", bold=True)
    if wheel.encoder_pins is None:
        sheet.text((ENCODER_X + 12, y + top + 48), "no pins given", size=SMALL)
        return
    sheet.flag((ENCODER_X + 40, y + top), "5 V")
    sheet.ground((ENCODER_X + 40, y + top + height))
    for name, offset, pin in zip("AB", (FIRST, SECOND), wheel.encoder_pins, strict=True):
        line_y = y + offset
        sheet.text((ENCODER_X + ENCODER_W - 10, line_y + 5), name, anchor="end")
        sheet.line(SIGNAL, (ENCODER_X + ENCODER_W, line_y), (SHIFTER_X, line_y))
        sheet.line(SIGNAL, (SHIFTER_X + SHIFTER_W, line_y), (TEENSY_X, line_y))
        sheet.text((SHIFTER_X + 10, line_y + 5), f"{name}{wheel.number}")
        sheet.text((SHIFTER_X + SHIFTER_W - 10, line_y + 5), f"{name}{wheel.number}", anchor="end")
        sheet.text((TEENSY_X + 10, line_y + 5), str(pin), bold=True)


def _draw_bridge(sheet: Sheet, plan: WiringPlan, wheel: WheelWiring, y: float) -> None:
    top, height = PART
    numbers = wheel.motor_pins or (wheel.in1_channel, wheel.in2_channel)
    ends = zip(plan.motor_inputs, "12", (FIRST, SECOND), numbers, strict=True)
    sheet.box((BRIDGE_X, y + top), BRIDGE_W, height)
    sheet.text((BRIDGE_X + BRIDGE_W / 2, y + top + 18), f"DRV8871 {wheel.number}", anchor="middle", bold=True)
    sheet.flag((BRIDGE_X + BRIDGE_W / 2, y + top), "VM", MOTOR)
    for name, output, offset, number in ends:
        line_y = y + offset
        sheet.text((CHIP_X + CHIP_W - 10, line_y + 5), str(number), anchor="end", bold=True)
        sheet.line(SIGNAL, (CHIP_X + CHIP_W, line_y), (BRIDGE_X, line_y))
        sheet.text((BRIDGE_X + 8, line_y + 5), name, size=SMALL)
        sheet.text((BRIDGE_X + BRIDGE_W - 8, line_y + 5), f"OUT{output}", anchor="end", size=SMALL)
        sheet.line(MOTOR, (BRIDGE_X + BRIDGE_W, line_y), (MOTOR_X - 20, line_y))
    sheet.circle((MOTOR_X, y + (FIRST + SECOND) / 2), 28)
    sheet.text((MOTOR_X, y + (FIRST + SECOND) / 2 + 6), f"M{wheel.number}", anchor="middle", size=18, bold=True)
    bottom = y + top + height
    sheet.text((BRIDGE_X + 8, bottom - 5), "ILIM", size=11)
    sheet.resistor((BRIDGE_X + 20, bottom), 38)
    sheet.ground((BRIDGE_X + 20, bottom + 36))
    sheet.text((BRIDGE_X + 34, bottom + 24), f"{electrics.BRIDGE_LIMIT_KOHM:g} kΩ", size=SMALL)
    sheet.ground((BRIDGE_X + BRIDGE_W - 24, bottom))
    if wheel.number == 1:
        sheet.marker((BRIDGE_X - 16, y + top + 8), Note.BRIDGE)


def _draw_shifter(sheet: Sheet, plan: WiringPlan, end: float) -> None:
    if not plan.encoders:
        return
    top = ROWS + PART[0]
    sheet.box((SHIFTER_X, top), SHIFTER_W, end - top - 36, fill="#ffffff")
    sheet.flag((SHIFTER_X + 30, top), "5 V")
    sheet.flag((SHIFTER_X + SHIFTER_W - 30, top), "3.3 V")
    sheet.text((SHIFTER_X + 18, top + 18), "HV", size=SMALL)
    sheet.text((SHIFTER_X + SHIFTER_W - 40, top + 18), "LV", size=SMALL)
    sheet.text((SHIFTER_X + SHIFTER_W / 2, top + 106), "Level shifter", anchor="middle", bold=True)
    sheet.text((SHIFTER_X + SHIFTER_W / 2, top + 126), "5 V to 3.3 V", anchor="middle", size=SMALL)
    sheet.ground((SHIFTER_X + SHIFTER_W / 2, end - 36))
    sheet.marker((SHIFTER_X + SHIFTER_W / 2, top - 14), Note.ENCODERS)


def _draw_motor_pins(sheet: Sheet, plan: WiringPlan, end: float) -> None:
    """Draw what stands in the chip's place where there is none: the Teensy's pins again, each with its resistor."""
    top = ROWS + PART[0]
    middle = CHIP_X + CHIP_W / 2
    bottom = end - 36
    sheet.box((CHIP_X, top), CHIP_W, bottom - top)
    sheet.text((middle, top - 12), "Teensy 4.0, motor pins", anchor="middle", size=16, bold=True)
    sheet.text((CHIP_X + CHIP_W - 10, top + 18), "pin", anchor="end", size=SMALL)
    for words, offset in (("each wire: 10 kΩ", 48), ("to ground", 30)):
        sheet.text((middle, bottom - offset), words, anchor="middle", size=SMALL)
    sheet.ground((middle, bottom))
    sheet.marker((CHIP_X - 16, top + 8), Note.CHIP_SUPPLY)
    if plan.output_enable_pin is not None:
        sheet.text((middle, bottom - 84), f"enable: pin {plan.output_enable_pin}", anchor="middle", size=SMALL)


def _draw_chip(sheet: Sheet, end: float) -> None:
    top = ROWS + PART[0]
    middle = CHIP_X + CHIP_W / 2
    sheet.box((CHIP_X, top), CHIP_W, end - top - 36)
    sheet.text((middle, top - 12), "PCA9685 board", anchor="middle", size=16, bold=True)
    sheet.text((CHIP_X + CHIP_W - 10, top + 18), "channel", anchor="end", size=SMALL)
    bottom = end - 36
    sheet.text((middle, bottom - 66), "address 0x40:", anchor="middle", size=SMALL)
    sheet.text((middle, bottom - 48), "A0 to A5 open", anchor="middle", size=SMALL)
    sheet.text((middle, bottom - 22), "V+ stays empty", anchor="middle", size=SMALL)
    sheet.ground((middle, bottom))


def _draw_teensy(sheet: Sheet, end: float) -> None:
    top = ROWS + PART[0]
    middle = TEENSY_X + TEENSY_W / 2
    sheet.box((TEENSY_X, top), TEENSY_W, end - top)
    sheet.text((middle, top - 44), "Teensy 4.0", anchor="middle", size=16, bold=True)
    sheet.flag((TEENSY_X + 34, top), "5 V")
    sheet.flag((TEENSY_X + TEENSY_W - 34, top), "3.3 V")
    sheet.text((TEENSY_X + 34, top + 18), "VIN", anchor="middle", size=SMALL)
    sheet.text((TEENSY_X + TEENSY_W - 34, top + 18), "3.3 V", anchor="middle", size=SMALL)
    sheet.marker((TEENSY_X - 14, top - 10), Note.SUPPLY)
    sheet.text((middle, top + 18), "USB", anchor="middle", size=SMALL)
    sheet.ground((middle, end))


def _draw_between(sheet: Sheet, plan: WiringPlan) -> None:
    """Draw the bus, OE and the chip's supply, with their pull-ups."""
    start, end, top = TEENSY_X + TEENSY_W, CHIP_X, ROWS + PART[0]
    vcc, sda, scl, enable = (top + offset for offset in (22, 96, 120, 236))
    sheet.line(SUPPLY, (end - 40, vcc), (end, vcc))
    sheet.flag((end - 40, vcc), "3.3 V")
    sheet.text((end + 10, vcc + 5), "VCC")
    sheet.marker((end - 74, vcc - 4), Note.CHIP_SUPPLY)
    for name, pin, y, x in (("SDA", SDA, sda, start + 40), ("SCL", SCL, scl, start + 80)):
        sheet.line(SIGNAL, (start, y), (end, y))
        sheet.text((start - 10, y + 5), f"{name} {pin}", anchor="end", bold=True)
        sheet.text((end + 10, y + 5), name)
        sheet.resistor((x, top + 22), y - top - 22)
        sheet.dot((x, y))
    sheet.line(SUPPLY, (start + 40, top + 22), (start + 80, top + 22))
    sheet.flag((start + 60, top + 22), "3.3 V")
    sheet.text((start + 94, sda - 30), electrics.bus_pull_up(plan.i2c_speed_Hz)[0], size=12)
    sheet.text((start + 94, sda - 14), electrics.bus_pull_up(plan.i2c_speed_Hz)[1], size=12)
    sheet.marker((start + 22, top + 14), Note.BUS)
    sheet.text((end + 10, enable + 5), "OE")
    if plan.output_enable_pin is None:
        sheet.line(SUPPLY, (end - 60, enable), (end, enable))
        sheet.ground((end - 60, enable))
        sheet.text((end - 84, enable + 5), "not wired", anchor="end", bold=True)
        sheet.marker((end - 30, enable - 18), Note.OUTPUT_ENABLE)
        return
    sheet.line(SIGNAL, (start, enable), (end, enable))
    sheet.text((start - 10, enable + 5), str(plan.output_enable_pin), anchor="end", bold=True)
    sheet.resistor((start + 90, enable - 64), 64)
    sheet.dot((start + 90, enable))
    sheet.flag((start + 90, enable - 64), "3.3 V")
    sheet.text((start + 106, enable - 27), "1 kΩ", bold=True)
    sheet.marker((start + 60, enable - 32), Note.OUTPUT_ENABLE)


def _draw_radio(sheet: Sheet, y: float) -> None:
    sheet.box((ENCODER_X, y + 20), ENCODER_W, 76)
    sheet.text((ENCODER_X + 12, y + 44), "XBee", bold=True)
    sheet.text((ENCODER_X + 12, y + 64), "(radio)", size=SMALL)
    sheet.flag((ENCODER_X + 40, y + 20), "3.3 V")
    sheet.ground((ENCODER_X + 40, y + 96))
    sheet.marker((ENCODER_X + 84, y + 8), Note.RADIO)
    pins = (("DOUT", RADIO_RX, "RX1"), ("DIN", RADIO_TX, "TX1"))
    for (name, pin, role), line_y in zip(pins, (y + 50, y + 78), strict=True):
        sheet.text((ENCODER_X + ENCODER_W - 10, line_y + 5), name, anchor="end")
        sheet.line(SIGNAL, (ENCODER_X + ENCODER_W, line_y), (TEENSY_X, line_y))
        sheet.text((TEENSY_X + 10, line_y + 5), f"{pin} {role}", bold=True)


def _draw_divider(sheet: Sheet, plan: WiringPlan, y: float) -> None:
    x = SHIFTER_X + SHIFTER_W / 2
    top = y + 34
    tap = top + 70
    sheet.flag((x, top), "VM", MOTOR)
    sheet.resistor((x, top), 70)
    sheet.resistor((x, tap), 62)
    sheet.ground((x, tap + 56))
    sheet.dot((x, tap))
    sheet.line(SIGNAL, (x, tap), (TEENSY_X, tap))
    sheet.text((x - 16, top + 40), f"{electrics.divider_top_kohm(plan.battery_divider):g} kΩ", anchor="end")
    sheet.text((x - 16, tap + 36), f"{electrics.DIVIDER_LOW_KOHM:g} kΩ", anchor="end")
    sheet.text((TEENSY_X + 10, tap + 5), f"{plan.battery_pin} battery", bold=True)
    sheet.marker((x + 40, tap - 20), Note.DIVIDER)


def _draw_button(sheet: Sheet, plan: WiringPlan, y: float) -> None:
    """Draw a normally-closed contact: the bar lies against it, the button pushes it off."""
    start, end = SHIFTER_X + 20, SHIFTER_X + 80
    line = y + 44
    sheet.text((start - 36, line + 5), "stop button", anchor="end", bold=True)
    sheet.line(SIGNAL, (start, line), (start - 20, line))
    sheet.ground((start - 20, line))
    sheet.circle((start, line), 4, kind="joint")
    sheet.line(SIGNAL, (start, line - 5), (end, line - 5))
    sheet.line(OUTLINE, ((start + end) / 2, line - 5), ((start + end) / 2, line - 22))
    sheet.line(SUPPLY, ((start + end) / 2 - 14, line - 22), ((start + end) / 2 + 14, line - 22))
    sheet.circle((end, line), 4, kind="joint")
    sheet.line(SIGNAL, (end, line), (TEENSY_X, line))
    sheet.text((TEENSY_X + 10, line + 5), f"{plan.stop_button_pin} stop button", bold=True)
    sheet.marker((end + 40, line - 20), Note.STOP_BUTTON)


@dataclass(frozen=True)
class SensorBus:
    """What a sensor is called, and its bus: pins of the Teensy, and the number in their names."""

    what: str
    sda_pin: int
    scl_pin: int
    number: int
    note: Note


GYRO = SensorBus("gyro", gyro_wires.SDA_PIN, gyro_wires.SCL_PIN, 1, Note.GYRO)
FLOOR_MOTION = SensorBus("floor motion", floor_motion.SDA_PIN, floor_motion.SCL_PIN, 2, Note.FLOW)


def _draw_sensor(sheet: Sheet, chip: str, bus: SensorBus, y: float) -> None:
    """Draw a sensor beside the Teensy, below the PWM chip, with its bus above the lamp."""
    start = TEENSY_X + TEENSY_W
    sheet.box((CHIP_X, y - 8), CHIP_W, 76)
    sheet.text((CHIP_X + CHIP_W - 12, y + 16), chip, anchor="end", bold=True)
    sheet.text((CHIP_X + CHIP_W - 12, y + 36), bus.what, anchor="end", size=SMALL)
    sheet.flag((CHIP_X + CHIP_W - 30, y - 8), "3.3 V")
    sheet.ground((CHIP_X + CHIP_W / 2, y + 68))
    for name, pin, line_y in (("SDA", bus.sda_pin, y + 12), ("SCL", bus.scl_pin, y + 36)):
        sheet.text((start - 10, line_y + 5), f"{name}{bus.number} {pin}", anchor="end", bold=True)
        sheet.line(SIGNAL, (start, line_y), (CHIP_X, line_y))
        sheet.text((CHIP_X + 10, line_y + 5), name, size=SMALL)
    sheet.marker((start + 60, y - 4), bus.note)


def _draw_light(sheet: Sheet, plan: WiringPlan, y: float) -> None:
    start = TEENSY_X + TEENSY_W
    if not plan.external_light:
        sheet.text((start - 10, y + 5), f"lamp {plan.light_pin}", anchor="end", bold=True)
        sheet.text((start + 14, y + 5), "on the board: nothing to wire", size=SMALL)
        return
    sheet.text((start - 10, y + 5), f"lamp {plan.light_pin}", anchor="end", bold=True)
    sheet.line(OUTLINE, (start, y), (start + 60, y))
    sheet.resistor((start + 60, y), 50)
    sheet.text((start + 76, y + 30), "470 Ω, LED", size=SMALL)
    sheet.ground((start + 60, y + 50))
