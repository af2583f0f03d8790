# SPDX-License-Identifier: MIT
"""Parameter files: one TOML table ``[parameters]``, one line per parameter, its meaning as a comment.

A preset (:mod:`omniwheel.presets`) is a parameter file too, with a table ``[preset]`` that says what it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omni_schema import Parameter, ParameterTable, SchemaError, as_float32
from omni_schema.toml_file import parse_toml, read_toml, refuse_misplaced_parameters, refuse_unknown_keys, take_table
from omniwheel import files
from omniwheel.errors import ParameterFileError


def format_value(parameter: Parameter | None, value: float) -> str:
    """Return the shortest text that gives the same float32 back; an enum's value by its name."""
    if parameter is not None:
        names = [name for name, number in parameter.values.items() if number == value]
        if names:
            return names[0]
    if float(value).is_integer() and abs(value) < 1e9:
        return str(int(value))
    return next((text for text in (f"{value:.7g}", f"{value:.8g}") if _same_float32(text, value)), f"{value:.9g}")


def shortest(value: float) -> float:
    """Return the float with the fewest digits that is the same float32, for people and JSON: 0.1, not 0.100000001."""
    return float(format_value(None, value))


def _same_float32(text: str, value: float) -> bool:
    return as_float32(float(text)) == as_float32(value)


def write(path: Path | str, values: Mapping[str, float], table: ParameterTable) -> None:
    """Write ``values``; an existing file is replaced only once the new one is whole. Raises OutputFileError."""
    files.write_text(path, text_of(values, table))


def text_of(values: Mapping[str, float], table: ParameterTable) -> str:
    """Return what a parameter file with these values holds."""
    lines = ["# Parameters of an Omniwheel robot; `omni params load FILE` sets them.", "", "[parameters]"]
    lines += [_line(table.get(name), name, value) for name, value in values.items()]
    return "\n".join(lines) + "\n"


def _line(parameter: Parameter | None, name: str, value: float) -> str:
    text = format_value(parameter, value)
    if parameter is None:
        return f"{name} = {text}"
    quoted = f'"{text}"' if text in parameter.values else text
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    return f"{f'{name} = {quoted}':<32} # {parameter.doc}{unit}"


def read(path: Path | str, table: ParameterTable) -> dict[str, float]:
    """Read and check a parameter file. Raises ParameterFileError that names file, key, value and what is allowed."""
    try:
        return _checked(read_toml(Path(path)), str(path), table)
    except SchemaError as error:
        raise _bad_file(error) from error


def parse(text: str, source: str, table: ParameterTable) -> dict[str, float]:
    """Do the same with the text of such a file, which errors call ``source``."""
    try:
        return _checked(parse_toml(source, text), source, table)
    except SchemaError as error:
        raise _bad_file(error) from error


def _checked(document: Mapping[str, Any], source: str, table: ParameterTable) -> dict[str, float]:
    refuse_misplaced_parameters(source, document)
    refuse_unknown_keys(source, "", document, ("parameters", "preset"))
    section = take_table(source, "parameters", document.get("parameters"))
    return {name: table.find(source, name, name).parse(source, name, value) for name, value in section.items()}


def _bad_file(error: SchemaError) -> ParameterFileError:
    return ParameterFileError(str(error), hint="`omni params save FILE` writes a valid file")
