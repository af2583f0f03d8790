# SPDX-License-Identifier: MIT
"""Writes the simulated world's schema as C: names of plants and faults, members of the configuration, ranges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from c_readings import write_world_readings
from c_tables import c_string
from omni_schema.motor_drivers import MotorDriver
from omni_schema.world import FaultKind, Quantity, Range, WorldSchema

NOTICE = """\
/* SPDX-License-Identifier: MIT
 * Written by shared/generate; edit shared/world.toml or shared/params.toml instead. */
"""

_MEMBER = {"int": "int32_t", "bool": "bool"}
_BY_SIZE = ("hil_real_t", "double", "int32_t", "bool")
_ANY = Range("real", "", -1e6, 1e6)
"""What the number of a fault that needs none may be."""


def _enumeration(prefix: str, rows: list[tuple[str, int, str]]) -> list[str]:
    return [f"    {prefix}_{name.upper()} = {number}, /**< {doc} */" for name, number, doc in rows]


def names_header(world: WorldSchema, drivers: Mapping[str, MotorDriver]) -> str:
    """Return ``hil_sim/world_gen.h``: the plants', the faults' and the motor drivers' numbers."""
    rows = [(driver.name, driver.number, driver.doc) for driver in drivers.values()]
    plants = [(plant.symbol, plant.number, plant.doc) for plant in world.plants.values()]
    faults = [(fault.name, fault.number, _fault_doc(fault)) for fault in world.faults.values()]
    return "\n".join(
        [
            NOTICE,
            "#ifndef HIL_SIM_WORLD_GEN_H",
            "#define HIL_SIM_WORLD_GEN_H",
            "",
            "/** What moves when the motors are driven. Equation numbers are the report's. */",
            "typedef enum hil_plant_kind_t {",
            *_enumeration("HIL_PLANT", plants),
            f"    HIL_PLANT_KIND_COUNT = {len(plants)}",
            "} hil_plant_kind_t;",
            "",
            "/** What breaks. */",
            "typedef enum hil_fault_kind_t {",
            "    HIL_FAULT_NONE = 0,",
            *_enumeration("HIL_FAULT", faults),
            f"    HIL_FAULT_KIND_COUNT = {len(faults) + 1}",
            "} hil_fault_kind_t;",
            "",
            "/** What leads to the bridges. */",
            "typedef enum hil_driver_t {",
            *_enumeration("HIL_DRIVER", rows),
            f"    HIL_DRIVER_COUNT = {len(rows)}",
            "} hil_driver_t;",
            "",
            "#endif",
            "",
        ]
    )


def _fault_doc(fault: FaultKind) -> str:
    return f"{fault.doc}; value: {fault.value.allowed}" if fault.value else fault.doc


def members(world: WorldSchema) -> str:
    """Return ``hil_sim/world_members_gen.h``: the numbers as members of ``hil_world_config_t``."""
    by_size = sorted(world.numbers.values(), key=lambda quantity: _BY_SIZE.index(_kind(quantity)))  # no padding between
    return "\n".join([NOTICE, *(_member(quantity) for quantity in by_size), ""])


def _kind(quantity: Quantity) -> str:
    return _MEMBER.get(quantity.kind, "double" if quantity.deciding else "hil_real_t")


def _member(quantity: Quantity) -> str:
    count = "[HIL_MAX_WHEELS]" if quantity.per_wheel else f"[{len(quantity.elements)}]" if quantity.elements else ""
    unit = f" [{quantity.unit}]" if quantity.unit else ""
    return f"{_kind(quantity)} {quantity.field}{count}; /**< {quantity.doc}{unit} */"


def ranges_source(world: WorldSchema) -> str:
    """Return ``world_gen.c``: the tables of schema.h."""
    numbers = [quantity for quantity in world.numbers.values() if quantity.kind != "bool"]
    return "\n".join(
        [
            NOTICE,
            '#include "hil_sim/schema.h"',
            "",
            "#include <stddef.h>",
            "",
            "const hil_number_t hil_numbers[] = {",
            *(_number_row(quantity) for quantity in numbers),
            "};",
            f"const uint32_t hil_number_count = {len(numbers)};",
            "",
            "const hil_fault_rule_t hil_fault_rules[HIL_FAULT_KIND_COUNT] = {",
            "    [HIL_FAULT_NONE] = " + _rule("none", False, _ANY),
            *(
                f"    [HIL_FAULT_{fault.name.upper()}] = " + _rule(fault.name, fault.wheel, fault.value or _ANY)
                for fault in world.faults.values()
            ),
            "};",
            "",
        ]
    )


def drivers_header(drivers: Mapping[str, MotorDriver]) -> str:
    """Return ``drivers_gen.h``: what each motor driver's bridges do, in the order of their numbers."""
    return "\n".join(
        [
            NOTICE,
            "#ifndef HIL_SIM_DRIVERS_GEN_H",
            "#define HIL_SIM_DRIVERS_GEN_H",
            "",
            '#include "parts.h"',
            "",
            "static const hil_driver_rule_t HIL_DRIVERS[] = {",
            *(_driver_row(driver) for driver in drivers.values()),
            "};",
            "",
            "#endif",
            "",
        ]
    )


def _driver_row(driver: MotorDriver) -> str:
    low, first, second, both = (f"HIL_BRIDGE_{action.upper()}" for action in driver.bridge)
    actions = f"{low}, {{{first}, {second}}}, {both}"
    return f"    {{{str(bool(driver.pins)).lower()}, {actions}}}, /* {driver.name} */"


def _number_row(quantity: Quantity) -> str:
    count = 0 if quantity.per_wheel else max(len(quantity.elements), 1)
    place = f"offsetof(hil_world_config_t, {quantity.field})"
    whole = str(quantity.kind == "int").lower()
    ends = f"{quantity.minimum!r}, {quantity.maximum!r}"
    return f"    {{{c_string(quantity.field)}, {place}, {count}, {whole}, {ends}, {c_string(quantity.allowed)}}},"


def _rule(name: str, wheel: bool, value: Range) -> str:
    ends = f"{value.minimum!r}, {value.maximum!r}"
    return f"{{{c_string(name)}, {str(wheel).lower()}, {ends}, {c_string(value.allowed)}}},"


def _table(guard: str, include: str, kind: str, array: str, symbols: list[str]) -> str:
    return "\n".join(
        [
            NOTICE,
            f"#ifndef {guard}",
            f"#define {guard}",
            "",
            f'#include "{include}"',
            "",
            *(f"extern const {kind} {symbol};" for symbol in symbols),
            "",
            f"static const {kind} *const {array}[] = {{",
            *(f"    &{symbol}," for symbol in symbols),
            "};",
            "",
            "#endif",
            "",
        ]
    )


def plants_header(world: WorldSchema) -> str:
    """Return ``plants_gen.h``: the table of plants, in the order of their numbers."""
    symbols = [f"hil_plant_{plant.symbol}" for plant in world.plants.values()]
    return _table("HIL_SIM_PLANTS_GEN_H", "motion.h", "hil_plant_model_t", "HIL_PLANTS", symbols)


def sensors_header(world: WorldSchema) -> str:
    """Return ``sensors_gen.h``: the table of sensors."""
    symbols = [f"hil_sensor_{name}" for name in world.sensors]
    table = _table("HIL_SIM_SENSORS_GEN_H", "sensor.h", "hil_sensor_t", "HIL_SENSORS", symbols)
    return table.replace("#endif", f"enum {{ HIL_SENSOR_COUNT = {len(symbols)} }};\n\n#endif")


def sources(prefix: str, names: Iterable[str]) -> str:
    """Return a header that includes ``prefix_NAME.c`` of each name, for lanes, which compile all of them as one."""
    return "\n".join([NOTICE, *(f'#include "{prefix}_{name}.c"' for name in names), ""])


def write_c_world(world: WorldSchema, drivers: Mapping[str, MotorDriver], out: Path) -> None:
    """Write the files below ``out``; ``drivers``: the motor drivers by name."""
    files = {
        out / "include" / "hil_sim" / "world_gen.h": names_header(world, drivers),
        out / "include" / "hil_sim" / "world_members_gen.h": members(world),
        out / "world" / "world_gen.c": ranges_source(world),
        out / "world" / "drivers_gen.h": drivers_header(drivers),
        out / "world" / "plants_gen.h": plants_header(world),
        out / "world" / "plant_sources_gen.h": sources("plant", (plant.symbol for plant in world.plants.values())),
        out / "world" / "sensors_gen.h": sensors_header(world),
        out / "world" / "sensor_sources_gen.h": sources("sensor", world.sensors),
    }
    for path, text in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    write_world_readings(world, out)
