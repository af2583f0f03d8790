# SPDX-License-Identifier: MIT
"""Which hardware decoder of a Teensy 4.0 counts which wheel, and what its build refuses.

The firmware settles the same at compile time (``firmware/boards/teensy40/encoders_wiring.h``, which has the sources).
It refuses to be built with the same words; a test holds the two together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from omni_schema.wiring import ENCODER_PINS_KEY, BoardWiring

# Teensy pin: input of the processor's crossbar
CROSSBAR_INPUTS = {0: 17, 1: 16, 2: 6, 3: 7, 4: 8, 5: 17, 7: 15, 8: 14, 30: 23, 31: 22, 32: 10, 33: 9}
INTERRUPTS_PER_S = 256_000
"""Edges of one encoder that interrupts take: 256 in a tick of 1 ms (Teensy40Encoders::edge_limit)."""

NO_PINS = f"give {ENCODER_PINS_KEY}, the Teensy pins [A, B] of every wheel's encoder"
NO_WAY_IN = (
    f"wiring.encoder_decoder asks for hardware, which only pins {' '.join(map(str, CROSSBAR_INPUTS))} reach; "
    'move the wire to one of them or use "auto"'
)
SHARED_INPUT = (
    "wiring.encoder_decoder asks for hardware on pins 0 and 5, which share one input; "
    'move one of the wires or use "auto"'
)


@dataclass(frozen=True)
class EncoderPlan:
    """``units``: per wheel the decoder 0 to 3, None: counted by interrupts. ``problems``: what the build refuses."""

    units: tuple[int | None, ...]
    problems: tuple[str, ...]


def plan_encoders(board: BoardWiring) -> EncoderPlan:
    """Give out the decoders: to wheels that demand one first, then to those that could use one."""
    wishes = board.encoder_decoder
    if not board.encoder_pins:
        return EncoderPlan((None,) * len(wishes), (NO_PINS,))
    units: list[int | None] = [None] * len(wishes)
    taken: set[int] = set()
    problems: list[str] = []
    given = 0
    for wheel in _in_turn(wishes):
        inputs = [CROSSBAR_INPUTS.get(pin) for pin in board.encoder_pins[wheel]]
        problem = _problem(inputs, taken)
        if problem is None:
            taken.update(number for number in inputs if number is not None)
            units[wheel] = given
            given += 1
        elif wishes[wheel] == "hardware" and problem not in problems:
            problems.append(problem)
    return EncoderPlan(tuple(units), tuple(problems))


def _in_turn(wishes: tuple[str, ...]) -> Iterator[int]:
    for wish in ("hardware", "auto"):
        yield from (wheel for wheel, wanted in enumerate(wishes) if wanted == wish)


def _problem(inputs: list[int | None], taken: set[int]) -> str | None:
    if None in inputs:
        return NO_WAY_IN
    return SHARED_INPUT if inputs[0] == inputs[1] or taken & set(inputs) else None
