# SPDX-License-Identifier: MIT
"""The words of the diagram: warnings in a frame, then the notes that the numbers in the drawing refer to."""

from __future__ import annotations

from enum import IntEnum

from omniwheel.wiring import electrics
from omniwheel.wiring.connections import (
    bridge_note,
    bus_note,
    button_note,
    divider_note,
    flow_note,
    gyro_note,
    oe_note,
    pull_down_note,
)
from omniwheel.wiring.plan import WiringPlan
from omniwheel.wiring.sheet import LINE_HEIGHT, MOTOR, SIGNAL, SMALL, SUPPLY, Point, Sheet

_GAP = 10.0


class Note(IntEnum):
    """Numbers of the notes."""

    OUTPUT_ENABLE = 1
    CHIP_SUPPLY = 2
    BUS = 3
    ENCODERS = 4
    BRIDGE = 5
    SUPPLY = 6
    MOTOR_SUPPLY = 7
    RADIO = 8
    GROUND = 9
    DIVIDER = 10
    STOP_BUTTON = 11
    GYRO = 12
    FLOW = 13


def note_texts(plan: WiringPlan) -> dict[Note, str]:
    """Return the notes that this robot needs."""
    low, high = electrics.TEENSY_SUPPLY_V
    trip = len(plan.wheels) * electrics.trip_current_A()
    texts = {
        Note.OUTPUT_ENABLE: f"OE: {oe_note()}." if plan.output_enable_pin is not None else "OE: see the warning.",
        Note.CHIP_SUPPLY: "VCC of the PCA9685 is 3.3 V, never 5 V: its pull-ups would put 5 V onto the Teensy's pins.",
        Note.BUS: f"SDA, SCL: {bus_note(plan)}.",
        Note.ENCODERS: "The Teensy's pins bear 3.3 V. Encoders of 3.3 V need no level shifter.",
        Note.BRIDGE: f"{bridge_note(plan)}.",
        Note.SUPPLY: f"VIN takes {low} to {high} V. USB alone does as well. With both, cut the trace between VUSB and "
        "VIN under the Teensy, or one supply feeds the other.",
        Note.MOTOR_SUPPLY: f"Switch within reach. The fuse protects the wires: all motors at their limit take "
        f"{trip:.1f} A. The regulator's wire gets a fuse of its own, some 1 A.",
        Note.RADIO: "XBee on 3.3 V only. The Teensy's 3.3 V pin gives "
        f"{1e3 * electrics.LOGIC_SUPPLY_A:g} mA in all: an XBee-PRO needs its own regulator.",
        Note.GROUND: "Motor currents must not flow through the Teensy's ground wire.",
    }
    if not plan.chip:
        del texts[Note.BUS], texts[Note.OUTPUT_ENABLE]
        texts[Note.CHIP_SUPPLY] = f"Motor pins: {pull_down_note()}."
    if not plan.encoders:
        del texts[Note.ENCODERS]
    if plan.battery_pin is not None:
        texts[Note.DIVIDER] = f"Battery: {divider_note(plan)}."
    if plan.stop_button_pin is not None:
        texts[Note.STOP_BUTTON] = f"Stop button: {button_note()}."
    if plan.gyro is not None:
        texts[Note.GYRO] = f"Gyro: {gyro_note(plan.gyro)}."
    if plan.flow is not None:
        texts[Note.FLOW] = f"{plan.flow.chip.name}: {flow_note(plan.flow)}."
    return texts


def write_notes(sheet: Sheet, plan: WiringPlan, at: Point, width: float) -> float:
    """Write everything; return where it ends."""
    x, y = at
    y = _write_legend(sheet, (x, y)) + 2 * _GAP
    if plan.warnings:
        y = _write_warnings(sheet, plan, (x, y), width) + 2 * _GAP
    notes = list(note_texts(plan).items())
    half = (len(notes) + 1) // 2
    column = width / 2
    ends = [
        _write_column(sheet, part, (x + i * column, y + 14), column - 24)
        for i, part in enumerate((notes[:half], notes[half:]))
    ]
    return max(ends)


def _write_legend(sheet: Sheet, at: Point) -> float:
    x, y = at
    for style, words in ((SIGNAL, "signal"), (SUPPLY, "supply of the electronics"), (MOTOR, "motor supply")):
        sheet.line(style, (x, y - 4), (x + 40, y - 4))
        sheet.text((x + 50, y), words, size=SMALL)
        x += 280 if style is SUPPLY else 160
    sheet.dot((x + 20, y - 4))
    sheet.text((x + 36, y), "joined (no dot: wires only cross)", size=SMALL)
    x += 340
    sheet.text((x, y), "Flags with the same name are one wire.", size=SMALL)
    return y


def _write_warnings(sheet: Sheet, plan: WiringPlan, at: Point, width: float) -> float:
    x, y = at
    bottom = y + 44.0
    for warning in plan.warnings:
        bottom += sheet.paragraph((x + 20, bottom), warning, width - 40, size=15) + 4
    sheet.text((x + 20, y + 22), "Warning", size=17, bold=True, kind="warning")
    height = bottom - y - 8
    sheet.frame((x, y), width, height)
    return y + height


def _write_column(sheet: Sheet, notes: list[tuple[Note, str]], at: Point, width: float) -> float:
    x, y = at
    for number, words in notes:
        sheet.marker((x + 10, y - 4), number)
        y += max(sheet.paragraph((x + 30, y), words, width - 30), SMALL * LINE_HEIGHT) + _GAP
    return y
