# SPDX-License-Identifier: MIT
"""Numbers and XML as text, the same on every computer."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from hil_sim.models.parts import RobotParts


def numbers(*values: float) -> str:
    """Return numbers with spaces between them, with what a model needs of digits; no minus before a zero."""
    return " ".join(f"{value + 0.0:.9g}" if abs(value) > 1e-15 else "0" for value in values)


def left_out(parts: RobotParts, *, friction: bool, rotor: bool = False) -> list[str]:
    """Return what of the robot's motors, gears and wheels a format cannot have, as sentences without a full stop.

    ``friction``: the format has each wheel's friction on the floor. ``rotor``: it has the inertia of motor and gear.
    """
    inertia = numbers(parts.wheels[0].armature_kg_m2)
    sentences = [] if rotor else [f"motor and gear turn with {inertia} kg.m^2 at each axle"]
    if parts.backlash_rad > 0.0:
        sentences.append(f"the gears have a play of {numbers(parts.backlash_rad)} rad at each wheel")
    if not friction:
        each = [wheel.friction for wheel in parts.wheels]
        if len(set(each)) == 1:
            sentences.append(f"the wheels' friction coefficient on the floor is {numbers(each[0])}")
        else:
            sentences.append(f"the wheels' friction coefficients on the floor are {numbers(*each)}")
    return sentences


def motor_note(parts: RobotParts, *, friction: bool = True) -> str:
    """Return what formats without a rotor's inertia leave to the reader. ``friction``: as in :func:`left_out`."""
    missing = left_out(parts, friction=friction)
    return f"Made by omni robots export. Not in here: {'; '.join(missing)}. SI units."


def xml_text(root: ET.Element) -> str:
    """Return an XML document, indented, with its declaration."""
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
