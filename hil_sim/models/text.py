# SPDX-License-Identifier: MIT
"""Numbers and XML as text, the same on every computer."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from hil_sim.models.parts import RobotParts


def numbers(*values: float) -> str:
    """Return numbers with spaces between them, with what a model needs of digits; no minus before a zero."""
    return " ".join(f"{value + 0.0:.9g}" if abs(value) > 1e-15 else "0" for value in values)


def motor_note(parts: RobotParts) -> str:
    """Return what formats without a rotor's inertia leave to the reader, as a sentence."""
    inertia = numbers(parts.wheels[0].armature_kg_m2)
    return f"Made by omni robots export. Not in here: motor and gear turn with {inertia} kg.m^2 at each axle. SI units."


def xml_text(root: ET.Element) -> str:
    """Return an XML document, indented, with its declaration."""
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
