# SPDX-License-Identifier: MIT
"""The catalogue of common gear motors: ``catalogue.toml``, numbers as their data sheets give them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from omni_schema.errors import did_you_mean
from omni_schema.toml_file import read_toml
from omniwheel.datasheet.motor import GearMotor
from omniwheel.datasheet.units import TORQUES_N_M
from omniwheel.errors import DataSheetError

_FILE = Path(__file__).with_name("catalogue.toml")


@cache
def catalogue() -> Mapping[str, GearMotor]:
    """Return the motors by name, in the file's order."""
    return {motor.name: motor for family in read_toml(_FILE)["family"].values() for motor in _motors(family)}


def _motors(family: Mapping[str, Any]) -> list[GearMotor]:
    return [
        GearMotor(
            voltage_V=family["voltage_V"],
            no_load_rad_s=entry["no_load_rpm"] * math.pi / 30.0,
            stall_torque_N_m=entry["stall_torque_kg_mm"] * TORQUES_N_M["kg.mm"],
            stall_current_A=family["stall_current_A"],
            no_load_current_A=family["no_load_current_A"],
            gear=entry["gear"],
            encoder_lines=family["encoder_lines"],
            name=entry["name"],
            source=f"{family['title']}, {entry['gear']:g}:1 ({family['source']})",
        )
        for entry in family["motors"]
    ]


def find_motor(name: str) -> GearMotor:
    """Return a motor of the catalogue by name. Raises DataSheetError."""
    motors = catalogue()
    if name not in motors:
        raise DataSheetError(
            f"unknown motor {name}{did_you_mean(name, list(motors))}",
            hint="`omni robots --motors` lists them; numbers of other data sheets go into --no-load-rpm, ...",
        )
    return motors[name]
