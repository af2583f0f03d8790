# SPDX-License-Identifier: MIT
"""The few sums behind the wiring advice, each with its source.

Sources: NXP PCA9685 data sheet rev. 4, table "Static characteristics" (address inputs, OE, EXTCLK). TI DRV8871 data
sheet SLVSCY9B, sections 6.3 and 7.3.3. PJRC's page on the Teensy 4.0 (supply, pin current, 3.3 V pin).
"""

from __future__ import annotations

LOGIC_V = 3.3
"""Supply of the PCA9685 chip, and the highest voltage that a Teensy 4.0 pin bears."""
OE_OFF_V = 0.7 * LOGIC_V
"""V_IH of the OE input, 0.7 VDD: from here on the chip's outputs are surely off."""
OE_ON_V = 0.3 * LOGIC_V
"""V_IL, 0.3 VDD: up to here they are surely on. Nothing is promised in between."""
BOARD_PULL_DOWN_OHM = 10_000.0
"""From OE to ground on many breakout boards (Adafruit 815 and its copies)."""
OE_PULL_UP_OHM = 1_000.0
"""What we recommend from OE to 3.3 V."""
PIN_LIMIT_A = 4e-3
"""Recommended for a Teensy 4.0 pin."""
PIN_PULL_UP_OHM = 22_000.0
"""The pull-up inside the processor, as Teensyduino's INPUT_PULLUP sets it."""
BUTTON_PULL_UP_OHM = 1_000.0
"""What we recommend beside it for a contact that wants more current, or a long wire."""
LOGIC_SUPPLY_A = 0.25
"""What the Teensy's 3.3 V pin may give to everything outside."""
TEENSY_SUPPLY_V = (3.6, 5.5)
"""At VIN."""
BRIDGE_SUPPLY_V = (6.5, 45.0)
"""VM of a DRV8871."""
BRIDGE_PEAK_A = 3.6
BRIDGE_LIMIT_KOHM = 30.0
"""The ILIM resistor on the usual breakout board."""
DIVIDER_LOW_KOHM = 10.0
_LIMIT_KV = 64.0


def oe_level_V(pull_up_ohm: float, pull_down_ohm: float | None = BOARD_PULL_DOWN_OHM) -> float:
    """Return the level of OE while the processor does not drive it; None: the board pulls nothing down."""
    if pull_down_ohm is None:
        return LOGIC_V
    return LOGIC_V * pull_down_ohm / (pull_up_ohm + pull_down_ohm)


def oe_sink_A(pull_up_ohm: float) -> float:
    """Return what the processor's pin takes while it holds OE low."""
    return LOGIC_V / pull_up_ohm


def button_A(pull_up_ohm: float | None = None) -> float:
    """Return the current through a closed stop button: by the processor's pull-up, with one outside beside it."""
    inside_A = LOGIC_V / PIN_PULL_UP_OHM
    return inside_A if pull_up_ohm is None else inside_A + LOGIC_V / pull_up_ohm


def trip_current_A(limit_kohm: float = BRIDGE_LIMIT_KOHM) -> float:
    """Return the current at which a DRV8871 with this ILIM resistor chops."""
    return _LIMIT_KV / limit_kohm


def divider_top_kohm(divider: float) -> float:
    """Return the upper resistor of the battery's divider above DIVIDER_LOW_KOHM."""
    return (divider - 1.0) * DIVIDER_LOW_KOHM


def bus_pull_up(speed_Hz: int) -> tuple[str, str]:
    """Return the pull-ups that SDA and SCL need, in two words (UM10204, 100 pF; the processor adds 22 kOhm)."""
    return ("1.4 kΩ", "added") if speed_Hz >= 1_000_000 else ("10 kΩ", "on the board")
