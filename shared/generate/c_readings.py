# SPDX-License-Identifier: MIT
"""Writes the readings of [sensors] as C and C++: members of what carries them to the estimator, and the copies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from omni_schema.errors import SchemaError, did_you_mean
from omni_schema.readings import Reading
from omni_schema.world import WorldSchema

NOTICE = """\
/* SPDX-License-Identifier: MIT
 * Written by shared/generate; edit [sensors] of shared/world.toml instead. */
"""
_INPUT = {"real": "omni_real_t", "int": "omni_int_t"}
_WORLD = {"real": "hil_real_t", "int": "hil_int_t"}
_FIRMWARE = {"real": "float", "int": "int32_t"}


def _text(lines: Sequence[str]) -> str:
    return "\n".join([NOTICE, *lines, ""])


def _array(reading: Reading) -> str:
    return f"[{reading.count}]" if reading.count else ""


def _members(readings: Sequence[Reading], types: dict[str, str]) -> str:
    lines = []
    for reading in readings:
        lines.append(f"{types[reading.kind]} {reading.name}{_array(reading)}; /**< {reading.meaning} */")
        if reading.valid:
            lines.append(f"uint8_t {reading.valid}; /**< {reading.valid_meaning} */")
    return _text(lines)


def input_members(readings: Sequence[Reading]) -> str:
    """Return ``omni/input_readings_gen.h``: the readings as members of ``omni_inputs_t``."""
    return _members(readings, _INPUT)


def world_members(readings: Sequence[Reading]) -> str:
    """Return ``hil_sim/sensor_members_gen.h``: the readings as members of ``hil_sensors_t``."""
    return _members(readings, _WORLD)


def _struct(name: str, meaning: str, lines: Sequence[str]) -> str:
    """Return a header of C++ with one struct, in the firmware's namespace."""
    body = [f"    {line}" if line else "" for line in lines]
    head = ["#pragma once", "", "#include <cstdint>", "#include <cstring>", "", "namespace omni {", ""]
    return _text([*head, f"/// {meaning}", f"struct {name} {{", *body, "};", "", "} // namespace omni"])


def tick_readings(readings: Sequence[Reading]) -> str:
    """Return ``omni/tick_readings_gen.h``: TickReadings, the readings of one tick, and ways in and out."""
    lines = []
    for reading in readings:
        initial = "{}" if reading.count else "0.0f" if reading.kind == "real" else "0"
        lines.append(f"{_FIRMWARE[reading.kind]} {reading.name}{_array(reading)} = {initial}; ///< {reading.meaning}")
        if reading.valid:
            lines.append(f"uint8_t {reading.valid} = 0; ///< {reading.valid_meaning}")
    lines += ["", "/// Into omni_inputs_t.", "template <typename Inputs>", "void to_inputs(Inputs *inputs) const {"]
    lines += [line for r in readings for line in _copies(r, ("inputs->", r.name), ("", r.name))]
    lines += ["}", "", "/// From OMNI_HIL_SENSORS.", "template <typename Message>"]
    lines.append("void from_message(const Message &message) {")
    lines += [line for r in readings for line in _copies(r, ("", r.name), ("message.", r.message_field))]
    lines += ["}", "", "/// From the drivers that the board has for rows of the table.", "template <typename Readers>"]
    lines += ["void from_board([[maybe_unused]] const Readers &board) {"]
    for reading in readings:
        if reading.boards:
            target = reading.name if reading.count else f"&{reading.name}"
            read = f"board.{reading.sensor} != nullptr ? board.{reading.sensor}({target}) : uint8_t{{0}}"
            lines.append(f"    {reading.valid} = {read};")
    return _struct("TickReadings", "Sensor readings of one tick.", [*lines, "}"])


def _copies(reading: Reading, to: tuple[str, str], source: tuple[str, str]) -> list[str]:
    """Return statements of C++ that copy a reading and its flag, from object to object: prefix and member's name."""
    (to_prefix, to_name), (from_prefix, from_name) = to, source
    if reading.count:
        target = f"{to_prefix}{to_name}"
        lines = [f"    std::memcpy({target}, {from_prefix}{from_name}, sizeof {target});"]
    else:
        lines = [f"    {to_prefix}{to_name} = {from_prefix}{from_name};"]
    if reading.valid and reading.kind == "real":
        # What is not new is not copied, so that robots without the sensor do not pay for it in each tick.
        lines = [f"    if ({from_prefix}{reading.valid} != 0) {{", *("    " + line for line in lines), "    }"]
    if reading.valid:
        lines.append(f"    {to_prefix}{reading.valid} = {from_prefix}{reading.valid};")
    return lines


def board_readings(readings: Sequence[Reading], boards: Sequence[str], source: str) -> str:
    """Return ``omni/board_readings_gen.h``: BoardReadings, the drivers that boards have for rows of the table.

    ``boards``: those that there are. Raises SchemaError for a row that names another.
    """
    lines = []
    for reading in readings:
        for board in reading.boards:
            if board not in boards:
                problem = f"names {board!r}{did_you_mean(board, boards)}; there are {', '.join(boards)}"
                raise SchemaError(source, f"sensors.{reading.sensor}.boards", problem)
        if reading.boards:
            lines += _board_reader(reading)
    for board in boards:
        lines += [f"/// Called once by the board {board}: its drivers of the table begin.", f"void use_{board}() {{"]
        for reading in readings:
            if board in reading.boards:
                lines += [f"    begin_{reading.sensor}();", f"    {reading.sensor} = read_{reading.sensor};"]
        lines.append("}")
    return _struct("BoardReadings", "Drivers of the sensors that name their boards in [sensors].", lines)


def _board_reader(reading: Reading) -> list[str]:
    argument = f"{_FIRMWARE[reading.kind]} *{reading.name}"
    new = "a bit per element that has a new value" if reading.count else "1 if there is a new value, else 0"
    return [
        f"/// {reading.meaning}. Called once per tick; never waits. nullptr: not measured.",
        f"/// @return {reading.valid}: {new}.",
        f"uint8_t (*{reading.sensor})({argument}) = nullptr;",
        f"static void begin_{reading.sensor}(); ///< of the board's driver",
        f"static uint8_t read_{reading.sensor}({argument}); ///< of the board's driver",
    ]


def input_copies(readings: Sequence[Reading]) -> str:
    """Return ``take_readings_gen.h``: from the simulated sensors to the input of a tick in this process."""
    lines = ['#include "hil_sim/world.h"', '#include "omni/robot.h"', ""]
    lines += ["static void take_readings(omni_inputs_t *inputs, const hil_sensors_t *sensors) {"]
    for reading in readings:
        lines += _world_copy(reading, f"inputs->{reading.name}", _INPUT[reading.kind])
        if reading.valid:
            lines.append(f"    inputs->{reading.valid} = sensors->{reading.valid};")
    return _text([*lines, "}"])


def message_copies(readings: Sequence[Reading]) -> str:
    """Return ``fill_readings_gen.h``: from the simulated sensors to OMNI_HIL_SENSORS."""
    lines = ["#include <omni/mavlink.h>", "", '#include "hil_sim/world.h"', ""]
    lines += ["static void fill_readings(mavlink_omni_hil_sensors_t *message, const hil_sensors_t *sensors) {"]
    for reading in readings:
        lines += _world_copy(reading, f"message->{reading.message_field}", reading.wire_type)
        if reading.valid:
            lines.append(f"    message->{reading.valid} = sensors->{reading.valid};")
    return _text([*lines, "}"])


def _world_copy(reading: Reading, target: str, kind: str) -> list[str]:
    if not reading.count:
        return [f"    {target} = ({kind})sensors->{reading.name};"]
    loop = f"    for (int i = 0; i < {reading.count}; i++) {{"
    return [loop, f"        {target}[i] = ({kind})sensors->{reading.name}[i];", "    }"]


def write_core_readings(world: WorldSchema, boards: Sequence[str], out: Path) -> None:
    """Write the headers that core and firmware include, below ``out``."""
    folder = out / "include" / "omni"
    _write(folder / "input_readings_gen.h", input_members(world.readings))
    _write(folder / "tick_readings_gen.h", tick_readings(world.readings))
    _write(folder / "board_readings_gen.h", board_readings(world.readings, boards, world.source))


def write_world_readings(world: WorldSchema, out: Path) -> None:
    """Write the headers that the simulated world includes, below ``out``."""
    _write(out / "include" / "hil_sim" / "sensor_members_gen.h", world_members(world.readings))
    _write(out / "world" / "take_readings_gen.h", input_copies(world.readings))
    _write(out / "world" / "fill_readings_gen.h", message_copies(world.readings))


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
