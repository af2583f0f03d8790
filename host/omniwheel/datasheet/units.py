# SPDX-License-Identifier: MIT
"""Torques and lengths as data sheets write them: "14 kg.cm", "0.5 N.m", "96 mm"."""

from __future__ import annotations

import re
from collections.abc import Mapping

from omniwheel.errors import DataSheetError

TORQUES_N_M = {
    "n.m": 1.0,
    "n.cm": 1e-2,
    "mn.m": 1e-3,
    "kg.m": 9.80665,
    "kg.cm": 9.80665e-2,
    "kg.mm": 9.80665e-3,
    "g.cm": 9.80665e-5,
    "oz.in": 7.0615518e-3,
    "lb.in": 0.112984829,
}
LENGTHS_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
LINES_PER = {"cpr": 0.25, "ppr": 1.0, "lines": 1.0, "line": 1.0, "pulses": 1.0, "counts": 0.25}
"""Encoder lines per unit of a data sheet: CPR are the edges of both channels, four per line."""
_QUANTITY = re.compile(r"\s*([-+0-9.eE]+)\s*([a-zA-Z.·⋅*\-]*)\s*")


def torque_N_m(text: str) -> float:
    """Read a torque with its unit. Raises DataSheetError, also without one: sheets use kg.cm, N.m and oz.in."""
    return _read(text, TORQUES_N_M, "", "a torque with its unit", "14 kg.cm, 0.5 N.m, 190 oz.in")


def length_m(text: str) -> float:
    """Read a length with its unit; without one it is metres. Raises DataSheetError."""
    return _read(text, LENGTHS_M, "m", "a length", "96 mm, 0.096, 3.8 in")


def encoder_lines(text: str) -> float:
    """Read an encoder's resolution with its unit, as lines (pulses of one channel). Raises DataSheetError."""
    return _read(text, LINES_PER, "", "an encoder's resolution with its unit", "64 CPR (all edges), 16 PPR, 16 lines")


def _read(text: str, units: Mapping[str, float], default: str, what: str, examples: str) -> float:
    match = _QUANTITY.fullmatch(text)
    if match is not None:
        unit = re.sub(r"[·⋅*\-]", ".", match.group(2).lower()).replace("kgf", "kg") or default
        unit = {"nm": "n.m", "ncm": "n.cm", "mnm": "mn.m", "kgcm": "kg.cm", "ozin": "oz.in"}.get(unit, unit)
        try:
            if unit in units:
                return float(match.group(1)) * units[unit]
        except ValueError:
            pass
    raise DataSheetError(
        f"{text!r} is not {what}", hint=f"a number and a unit, like {examples}; units: {', '.join(units)}"
    )
