# SPDX-License-Identifier: MIT
"""Writes the telemetry table as C++ for the firmware and as Python classes for the host."""

from __future__ import annotations

import re

from telemetry_table import Field, Report, TelemetryTable

NOTICE = "Written by shared/generate; edit shared/link/telemetry.toml or shared/link/omni.xml instead."

_PYTHON_HEAD = '''\
# SPDX-License-Identifier: MIT
"""{notice}

Telemetry as typed, immutable values: a class per message of ours that the robot reports by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

from omniwheel.dialect import Message
from omniwheel.frames import Pose, Twist
from omniwheel.telemetry_parts import Telemetry, fault_names, named, state_name
'''


def cpp_header(table: TelemetryTable) -> str:
    """Return ``omni/telemetry_gen.h``: how many messages the robot reports by itself."""
    return (
        f"// SPDX-License-Identifier: MIT\n// {NOTICE}\n#pragma once\n\n#include <cstddef>\n\n"
        f"namespace omni {{\nconstexpr size_t telemetry_stream_count = {len(table.reports)};\n}}\n"
    )


def cpp_reports(table: TelemetryTable) -> str:
    """Return ``omni/reports_gen.h``: the function that fills each message, and the table of them.

    firmware/app/services/reports.cpp includes it within namespace omni, behind the functions that the table's
    expressions call.
    """
    parts = [f"// SPDX-License-Identifier: MIT\n// {NOTICE}\n"]
    parts += [_cpp_function(report, table) for report in table.reports]
    rows = "".join(
        f"    {{MAVLINK_MSG_ID_{report.name}, Group::{report.group}, report_{report.name.lower()}}},\n"
        for report in table.reports
    )
    parts.append(f"const Stream streams[telemetry_stream_count] = {{\n{rows}}};\n")
    return "\n".join(parts)


def _cpp_function(report: Report, table: TelemetryTable) -> str:
    lower = report.name.lower()
    priority = "Priority::reply" if report.reply else "priority"
    lines = [f"static bool report_{lower}(const ReportSources &sources, Link &link, Priority priority, bool asked) {{"]
    lines.append("    static_cast<void>(priority), static_cast<void>(asked);")
    used = _sources_of([field.source for field in report.fields], table)
    lines += [f"    const auto &{name} = {text};" for name, text in table.sources.items() if name in used]
    lines.append(f"    mavlink_{lower}_t message{{}};")
    lines += [f"    {_cpp_assignment(field)}" for field in report.fields]
    lines.append(f"    return link.send(MAVLINK_MSG_ID_{report.name}, message, {priority});\n}}\n")
    return "\n".join(lines)


def _sources_of(texts: list[str], table: TelemetryTable) -> set[str]:
    """Return the names that the expressions use, and those that these use."""
    found: set[str] = set()
    while texts:
        words = {word for text in texts for word in re.findall(r"(?<![\w.>:])[A-Za-z_]\w*", text)}
        new = {word for word in words if word in table.sources and word not in found}
        found |= new
        texts = [table.sources[name] for name in new]
    return found


def _cpp_assignment(field: Field) -> str:
    if field.length and field.index is None:
        values = f"array_of<{field.type}, {field.length}>({field.source})"
        return f"std::memcpy(message.{field.name}, {values}.data(), sizeof message.{field.name});"
    target = f"message.{field.name}" if field.index is None else f"message.{field.name}[{field.index}]"
    return f"{target} = static_cast<{field.type}>({field.source});"


def python_module(table: TelemetryTable) -> str:
    """Return ``omniwheel/telemetry_gen.py``."""
    classes = sorted(report.class_name for report in table.reports if report.class_name)
    parts = [_PYTHON_HEAD.format(notice=NOTICE), f"__all__ = {classes!r}"]
    for name, values in table.names.items():
        parts.append(f"{_constant(name)} = {values!r}")
    parts += [_python_class(report) for report in table.reports if report.class_name]
    return "\n\n".join(parts) + "\n"


def _constant(name: str) -> str:
    return f"{name.upper()}_NAMES"


def _python_class(report: Report) -> str:
    fields = [field for field in report.fields if field.host]
    lines = ["", "@dataclass(frozen=True)", f"class {report.class_name}(Telemetry):"]
    lines += [f'    """{report.doc}"""', "", f'    message = "{report.name}"']
    for field in fields:
        lines += [f"    {field.host}: {_python_type(field)}", f'    """{_python_doc(field)}"""']
    lines += ["", "    @classmethod", f"    def decoded(cls, m: Message) -> {report.class_name}:"]
    lines += [f'        """Return the values of a message ``{report.name}``."""', "        return cls("]
    lines += [f"            {field.host}={_python_value(field)}," for field in fields]
    return "\n".join([*lines, "        )"])


def _python_doc(field: Field) -> str:
    text = field.doc.replace("\\", "\\\\").replace('"', "'")
    unit = "" if field.scale is not None or not field.unit else f" [{field.unit}]"
    return f"{text}{unit}."


def _python_type(field: Field) -> str:
    if field.shown_as:
        fixed = {"pose": "Pose", "twist": "Twist", "bool": "bool", "faults": "tuple[str, ...]"}
        return fixed.get(field.shown_as, "str")
    single = "float" if field.scale is not None or field.type in ("float", "double") else "int"
    return f"tuple[{', '.join([single] * field.length)}]" if field.length else single


def _python_value(field: Field) -> str:
    raw = f"m.{field.name}"
    fixed = {
        "pose": f"Pose(*{raw})",
        "twist": f"Twist(*{raw})",
        "bool": f"bool({raw})",
        "faults": f"fault_names({raw})",
        "state": f"state_name({raw})",
        "hex": f'f"{{{raw}:08x}}"',
    }
    if field.shown_as:
        return fixed.get(field.shown_as, f"named({_constant(field.shown_as)}, {raw})")
    scaled = "" if field.scale is None else f" * {field.scale!r}"
    if field.length:
        elements = [f"{raw}[{i}]{scaled}" for i in range(field.length)]
        return f"({', '.join(elements)}{',' if field.length == 1 else ''})"
    return f"{raw}{scaled}"
