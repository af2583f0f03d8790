# SPDX-License-Identifier: MIT
"""The Python type of a parameter's value: float, int, or a member of the parameter's own enumeration."""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from typing import Any

from omni_schema import Parameter


class ParameterEnum(IntEnum):
    """A value of an enum parameter: equal to its number, printed and formatted by its name.

    >>> mode = robot.parameters["CTL_MODE"]          # doctest: +SKIP
    >>> mode, mode == 1, mode.name, f"{mode}"        # doctest: +SKIP
    (<CTL_MODE.ismc: 1>, True, 'ismc', 'ismc')
    """

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        return format(int(self), spec) if spec and spec[-1] in "bcdeEfFgGnoxX%" else format(self.name, spec)

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return int, (int(self),)  # the enumerations are made at run time: another process gets the number


def enum_of(parameter: Parameter) -> type[ParameterEnum]:
    """Return the enumeration of an enum parameter; the same one each time. ValueError for another kind."""
    if parameter.kind != "enum":
        raise ValueError(f"{parameter.name} is no enumeration; allowed is {parameter.allowed}")
    return _enumeration(parameter.name, tuple(parameter.values.items()))


@cache
def _enumeration(name: str, values: tuple[tuple[str, int], ...]) -> type[ParameterEnum]:
    functional: Any = ParameterEnum  # its functional form, which mypy takes for a call with a number
    made: type[ParameterEnum] = functional(name, values)
    return made


def typed(parameter: Parameter | None, value: float) -> float:
    """Return a value as its parameter's type; as a float if it is of another table, or not allowed by this one."""
    if parameter is None or parameter.kind == "real" or parameter.problem_with(value) is not None:
        return value
    return enum_of(parameter)(int(value)) if parameter.kind == "enum" else int(value)
