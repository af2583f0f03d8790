# SPDX-License-Identifier: MIT
"""The parameter table as a page shows it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from omni_schema import Parameter, ParameterTable
from omniwheel.parameter_file import shortest

_PER_WHEEL = re.compile(r"W[1-4]_")


def table_as_json(table: ParameterTable) -> list[dict[str, Any]]:
    """Return what the page needs to know of every parameter, in the table's order."""
    return [_entry(parameter) for parameter in table.values()]


def values_as_json(values: Mapping[str, float]) -> dict[str, float]:
    """Return values with the digits that a float32 has, so that 0.1 reads 0.1."""
    return {name: shortest(value) for name, value in values.items()}


def _entry(parameter: Parameter) -> dict[str, Any]:
    return {
        "name": parameter.name,
        "group": _group(parameter.name),
        "kind": parameter.kind,
        "unit": parameter.unit,
        "min": shortest(parameter.minimum),
        "max": shortest(parameter.maximum),
        "default": shortest(parameter.default),
        "doc": parameter.doc,
        "values": dict(parameter.values),
        "disarmed_only": parameter.disarmed_only,
    }


def _group(name: str) -> str:
    """Return the part of a name that related parameters share; those of one wheel stand together."""
    return "WHEEL" if _PER_WHEEL.match(name) else name.partition("_")[0].rstrip("0123456789")
