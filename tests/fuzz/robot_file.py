# SPDX-License-Identifier: MIT
"""Fuzzes the reader of robot files: any bytes give a SchemaError, or a Robot that keeps its promises, and nothing else.

usage: python -m tests.fuzz.robot_file SEED BYTES. Inputs come from a seeded generator: the project's own files with
values, lines and bytes changed, and raw bytes. The output is one JSON object of figures.
"""

from __future__ import annotations

import json
import math
import os
import random
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from omni_schema import ParameterTable, Robot, SchemaError, load_parameters, load_robot

SHARED = Path(__file__).resolve().parents[2] / "shared"
KEPT = 64

VALUES = (
    "0", "-1", "3", "4", "5", "nan", "-inf", "1e999", "1e-400", "0x7fffffffffffffff", "9" * 400, "0x" + "f" * 5000,
    "8" * 5000, "true", '""', '"three"', "[]", "[[]]", "{}", "{ a = 1 }", "[1, 2, 3]", "[1, 2, 3, 4]", "[1.0, nan, 3]",
    "[[1, 2], [3, 4], [5, 6]]", "[[1, 1], [2, 3], [4, 5]]", "[" * 3000 + "]" * 3000, "1979-05-27", "07:32:00",
    '"\\u0000"',
    "16777217", "0.0508", "-0.0", "'''\n'''", "[true, false, true]", "2.5", "1e39", '[["a", "b"], [1, 2], [3, 4]]',
)  # fmt: skip
TABLES = (
    "[geometry]",
    "[wiring]",
    "[parameters]",
    "[simulation]",
    "[[motor]]",
    "[robot.name]",
    "[nonsense]",
    "[a.b.c]",
)
KEYS = (
    "output_enable_pin",
    "stop_button_pin",
    "battery_pin",
    "encoder_decoder",
    "light_pin",
    "i2c_speed_Hz",
    "wheels",
    "CTL_MODE",
    "mass_kg",
    "name",
    "encoder_pins",
    "LINK2_BUDGET",
    "a" + ".a" * 500,
    '"\\u0000"',
    "W1_ANGLE",
)
_VALUE = re.compile(rb"=[^\n]*")


@dataclass
class Figures:
    """What a run has done."""

    executions: int = 0
    bytes: int = 0
    robots: int = 0
    refused: int = 0


def seeds() -> list[bytes]:
    """Return the project's own robot files."""
    return [path.read_bytes() for path in sorted((SHARED / "robots").glob("*.toml"))]


def check_robot(robot: Robot, table: ParameterTable) -> None:
    """Assert what everybody who gets a Robot relies on."""
    assert re.fullmatch(r"[a-z][a-z0-9_]{0,31}", robot.name), robot.name
    assert robot.wheels in (3, 4)
    values = robot.parameter_values()
    assert list(values) == list(table)
    for name, value in values.items():
        assert isinstance(value, float)
        assert table[name].problem_with(value) is None, (name, value)
    assert values["WHEELS"] == robot.wheels
    board = robot.board
    assert len(board.encoder_pins) in (0, robot.wheels)
    single = (board.output_enable_pin, board.stop_button_pin, board.battery_pin, board.light_pin)
    optional = [pin for pin in single if pin is not None]
    pins = [pin for pair in board.encoder_pins for pin in pair] + optional
    assert all(type(pin) is int and 0 <= pin <= 39 for pin in pins)
    assert len(set(pins)) == len(pins), pins
    assert board.i2c_speed_Hz in (100_000, 400_000, 1_000_000)
    assert math.isfinite(board.battery_divider)
    for given in robot.simulation.values():
        assert all(math.isfinite(item) for item in (given if isinstance(given, list) else [given]))


def run_one(path: Path, data: bytes, table: ParameterTable, figures: Figures) -> None:
    """Read one file with these bytes."""
    path.write_bytes(data)
    figures.executions += 1
    figures.bytes += len(data)
    try:
        robot = load_robot(path, table)
    except SchemaError:
        figures.refused += 1
    else:
        check_robot(robot, table)
        figures.robots += 1


def _other_value(data: bytes, rng: random.Random) -> bytes:
    places = list(_VALUE.finditer(data))
    if not places:
        return data
    place = rng.choice(places)
    return data[: place.start()] + b"= " + rng.choice(VALUES).encode() + data[place.end() :]


def _other_lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            del lines[at]
        case 1:
            lines.insert(at, lines[rng.randrange(len(lines))])
        case 2:
            lines.insert(at, rng.choice(TABLES).encode())
        case 3:
            lines.insert(at, f"{rng.choice(KEYS)} = {rng.choice(VALUES)}".encode())
        case _:
            lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
    return b"\n".join(lines)


def _other_bytes(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data or b"\n")
    for _ in range(rng.randrange(1, 5)):
        at = rng.randrange(len(changed))
        match rng.randrange(3):
            case 0:
                changed[at] = rng.randrange(256)
            case 1:
                changed[at:at] = rng.randbytes(rng.randrange(1, 4))
            case _:
                del changed[at : at + rng.randrange(1, 20)]
                changed = changed or bytearray(b"\n")
    return bytes(changed)


def _raw(_: bytes, rng: random.Random) -> bytes:
    return rng.randbytes(rng.randrange(200))


MUTATIONS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _other_value, _other_value, _other_value, _other_lines, _other_lines, _other_bytes, _raw,
)  # fmt: skip


def run(seed: int, size: int) -> Figures:
    """Read mutated files until ``size`` bytes have been read. Any exception but SchemaError is a finding."""
    rng = random.Random(seed)
    table = load_parameters(SHARED / "params.toml")
    kept = seeds()
    figures = Figures()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.toml"
        while figures.bytes < size:
            data = rng.choice(kept)
            for _ in range(rng.choice((1, 1, 1, 2, 4))):
                data = rng.choice(MUTATIONS)(data, rng)
            before = figures.robots
            try:
                run_one(path, data, table, figures)
            except Exception:
                Path(os.environ.get("FUZZ_LAST", "robot_file-last")).write_bytes(data)
                raise
            if figures.robots > before and len(data) < 8000:
                kept = [*kept[:2], *kept[2:][-KEPT:], data]
    return figures


if __name__ == "__main__":
    sys.stdout.write(json.dumps(asdict(run(int(sys.argv[1]), int(sys.argv[2])))) + "\n")
