# SPDX-License-Identifier: MIT
"""Writes the parameter table, the lists of rows that follow from it, and the built-in robots as C99 source."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from omni_schema import Parameter, ParameterTable, Robot, SchemaError, as_float32

NOTICE = """\
/* SPDX-License-Identifier: MIT
 * Written by shared/generate; edit shared/params.toml or shared/robots/ instead. */
"""

_KIND = {"real": "OMNI_PARAM_REAL", "int": "OMNI_PARAM_INT", "bool": "OMNI_PARAM_INT", "enum": "OMNI_PARAM_INT"}


def float_literal(value: float) -> str:
    """Return the shortest C float literal that has exactly the bits of the float32 ``value``."""
    text = next(text for text in (f"{value:.{digits}g}" for digits in range(1, 10)) if as_float32(float(text)) == value)
    return f"{text}f" if "." in text or "e" in text else f"{text}.0f"


def c_string(text: str) -> str:
    """Return ``text`` as a C string literal; only ASCII is allowed."""
    return json.dumps(text)


def params_header(table: ParameterTable) -> str:
    """Return ``omni/params_gen.h``: the parameters' indices and the names of enum values."""
    lines = [
        NOTICE,
        "#ifndef OMNI_PARAMS_GEN_H",
        "#define OMNI_PARAMS_GEN_H",
        "",
        "#include <stdint.h>",
        "",
        "/** Index of each parameter: in the table, in a parameter set and on the link. */",
        "typedef enum omni_param_id {",
        *(f"  OMNI_PARAM_{p.name} = {p.index}, /**< {_comment(p)} */" for p in table.parameters),
        f"  OMNI_PARAM_COUNT = {len(table)}",
        "} omni_param_id_t;",
        "",
        "/** Version of what params.toml can say. Stored values do not depend on it: they are kept by name. */",
        f"enum {{ OMNI_PARAM_SCHEMA_VERSION = {table.schema_version} }};",
        "",
        "/** CRC-32 over names, order, kinds, units, ranges, defaults and enum values of the table. */",
        "extern const uint32_t omni_param_schema_crc;",
    ]
    for p in table.parameters:
        if p.values:
            lines += ["", f"/** {p.doc}. */", f"enum omni_{p.name.lower()} {{"]
            lines += [f"  OMNI_{p.name}_{k.upper()} = {v}," for k, v in p.values.items()]
            lines += [f"  OMNI_{p.name}_COUNT = {max(p.values.values()) + 1} /**< one more than the largest */", "};"]
            rows = "".join(f" ROW({k.upper()}, {k})" for k in p.values)
            lines += ["/** ROW(NAME, name) for each value. */", f"#define OMNI_{p.name}_ROWS(ROW){rows}"]
    return "\n".join([*lines, "", "#endif", ""])


def modules_header(table: ParameterTable, headers: Sequence[Path]) -> str:
    """Return ``omni/modules_gen.h``: the modules that rows bring, as members of the robot's configuration and state.

    A module without a type of configuration or of state has no such member; its header, in one of the folders
    ``headers``, says so.
    Raises SchemaError for a header that does not exist.
    """
    lines = [NOTICE, "#ifndef OMNI_MODULES_GEN_H", "#define OMNI_MODULES_GEN_H", ""]
    texts: dict[str, str] = {}
    for p in table.parameters:
        for name, header in p.modules.items():
            path = next((path for folder in headers if (path := folder / f"{header}.h").is_file()), None)
            if path is None:
                raise SchemaError(table.source, f"{p.name}.modules.{name}", f"names {header}.h, which is not there")
            texts[header] = path.read_text(encoding="utf-8")
    lines += [f'#include "omni/{header}.h"' for header in sorted(texts)]
    for p in table.parameters:
        for kind in ("config", "state") if p.modules else ():
            types = {name: f"omni_{name}_{kind}_t" for name in p.modules}
            members = [f" {types[name]} {name};" for name, header in p.modules.items() if types[name] in texts[header]]
            lines += ["", f"/** Members for the {kind} of each module of {p.name}. */"]
            lines += [f"#define OMNI_{p.name}_{kind.upper()}_MEMBERS{''.join(members)}"]
    return "\n".join([*lines, "", "#endif", ""])


def _comment(parameter: Parameter) -> str:
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    return f"{parameter.doc}{unit}"


def params_source(table: ParameterTable) -> str:
    """Return ``params_gen.c``: omni_param_table, one entry per parameter."""
    rows = [
        f"    [OMNI_PARAM_{p.name}] = {{\n"
        f"        .name = {c_string(p.name)},\n"
        f"        .unit = {c_string(p.unit)},\n"
        f"        .minimum = {float_literal(p.minimum)},\n"
        f"        .maximum = {float_literal(p.maximum)},\n"
        f"        .initial = {float_literal(p.default)},\n"
        f"        .kind = {_KIND[p.kind]},\n"
        f"        .locked_while_armed = {int(p.disarmed_only)},\n"
        f"        .storage_key = {p.storage_key:#06x},\n"
        "    },"
        for p in table.parameters
    ]
    return "\n".join(
        [
            NOTICE,
            '#include "omni/params.h"',
            "",
            f"const uint32_t omni_param_schema_crc = {table.crc:#010x}u;",
            "",
            "const omni_param_info_t omni_param_table[OMNI_PARAM_COUNT] = {",
            *rows,
            "};",
            "",
        ]
    )


def motor_drivers_header(table: ParameterTable) -> str:
    """Return ``omni/motor_drivers_gen.h``: MotorDrivers, which holds one driver of each class."""
    drivers = list(table.motor_drivers.values())
    lines = [
        NOTICE,
        "#pragma once",
        "",
        *(f'#include "app/drivers/{driver.name}.h"' for driver in drivers),
        "",
        "namespace omni {",
        "",
        "class MotorDrivers {",
        "public:",
        f"    /// Driver by number. @param number omni_mot_driver; an unknown one gives {drivers[0].class_name}.",
        "    MotorDriver &of(uint8_t number) {",
        "        switch (number) {",
    ]
    for driver in drivers[1:]:
        lines += [f"        case OMNI_MOT_DRIVER_{driver.name.upper()}:", f"            return {driver.name}_;"]
    lines += ["        default:", f"            return {drivers[0].name}_;", "        }", "    }", "", "private:"]
    lines += [f"    {driver.class_name} {driver.name}_;" for driver in drivers]
    return "\n".join([*lines, "};", "", "} // namespace omni", ""])


def robots_source(robots: Sequence[Robot]) -> str:
    """Return ``robots_gen.c``: omni_builtin_robots, one full parameter set per robot file."""
    lines = [
        NOTICE,
        '#include "omni/params.h"',
        "",
        f"const int32_t omni_builtin_robot_count = {len(robots)};",
        "",
        "const omni_builtin_robot_t omni_builtin_robots[] = {",
    ]
    for robot in robots:
        lines += ["    {", f"        .name = {c_string(robot.name)},", "        .values = {"]
        lines += [
            f"            [OMNI_PARAM_{name}] = {float_literal(value)},"
            for name, value in robot.parameter_values().items()
        ]
        lines += ["        },", "    },"]
    return "\n".join([*lines, "};", ""])


def write_c_tables(table: ParameterTable, robots: Sequence[Robot], headers: Sequence[Path], out: Path) -> None:
    """Write the five files below ``out``. ``headers``: folders of the modules' headers."""
    files = {
        out / "include" / "omni" / "params_gen.h": params_header(table),
        out / "include" / "omni" / "motor_drivers_gen.h": motor_drivers_header(table),
        out / "include" / "omni" / "modules_gen.h": modules_header(table, headers),
        out / "src" / "params_gen.c": params_source(table),
        out / "src" / "robots_gen.c": robots_source(robots),
    }
    for path, text in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
