# SPDX-License-Identifier: MIT
"""The supplies, at the foot of the diagram: battery, fuse, switch, regulator, one point for all grounds."""

from __future__ import annotations

from omniwheel.wiring.notes import Note
from omniwheel.wiring.plan import WiringPlan
from omniwheel.wiring.sheet import MOTOR, OUTLINE, SMALL, SUPPLY, Point, Sheet

_HIGH, _LOW = 40.0, 110.0
"""Heights of the motor's and the logic's line."""


def draw_supply(sheet: Sheet, plan: WiringPlan, at: Point) -> None:
    """Draw the supplies, 1000 wide and 150 high."""
    x, y = at
    high, low = y + _HIGH, y + _LOW
    sheet.box((x, y + 10), 130, 90, fill="#ffffff")
    sheet.text((x + 65, y + 46), "Battery", anchor="middle", bold=True)
    sheet.text((x + 65, y + 68), f"{plan.supply_V:g} V", anchor="middle")
    sheet.ground((x + 65, y + 100))
    _draw_motor_line(sheet, x + 130, high)
    _draw_logic_line(sheet, x + 130, high, low)
    _draw_star(sheet, (x + 1010, high + 20))


def _draw_motor_line(sheet: Sheet, x: float, y: float) -> None:
    sheet.line(MOTOR, (x, y), (x + 150, y))
    sheet.box((x + 150, y - 9), 60, 18, fill="#ffffff")
    sheet.line(OUTLINE, (x + 150, y), (x + 210, y))
    sheet.text((x + 180, y - 18), "motor fuse", anchor="middle", size=SMALL)
    sheet.line(MOTOR, (x + 210, y), (x + 310, y))
    sheet.circle((x + 310, y), 4, kind="joint")
    sheet.line(MOTOR, (x + 312, y - 2), (x + 362, y - 24))
    sheet.circle((x + 370, y), 4, kind="joint")
    sheet.text((x + 300, y + 26), "motor switch", size=SMALL)
    sheet.line(MOTOR, (x + 370, y), (x + 560, y))
    sheet.flag((x + 560, y), "VM", MOTOR)
    sheet.text((x + 592, y + 5), "to every DRV8871", size=SMALL)
    sheet.marker((x + 250, y - 22), Note.MOTOR_SUPPLY)


def _draw_logic_line(sheet: Sheet, x: float, high: float, low: float) -> None:
    sheet.dot((x + 60, high))
    sheet.line(SUPPLY, (x + 60, high), (x + 60, low), (x + 150, low))
    sheet.box((x + 150, low - 26), 130, 52)
    sheet.text((x + 215, low + 5), "5 V regulator", anchor="middle", bold=True)
    sheet.ground((x + 215, low + 26))
    sheet.line(SUPPLY, (x + 280, low), (x + 560, low))
    sheet.flag((x + 560, low), "5 V")
    sheet.text((x + 592, low + 5), "to VIN, encoders, level shifter", size=SMALL)
    sheet.marker((x + 520, low - 20), Note.SUPPLY)


def _draw_star(sheet: Sheet, at: Point) -> None:
    x, y = at
    sheet.dot(at)
    for dx in (-36, 0, 36):
        sheet.line(SUPPLY, (x + dx, y - 34), at)
    sheet.ground(at)
    sheet.text((x + 54, y - 8), "all grounds meet", size=SMALL)
    sheet.text((x + 54, y + 10), "in one point", size=SMALL)
    sheet.marker((x + 24, y + 14), Note.GROUND)
