# SPDX-License-Identifier: MIT
"""What the Tab key offers for an argument: names of parameters, robots, scenarios, presets, trajectories and ports.

Each function takes what has been typed so far and returns what begins so. They run each time Tab is pressed, so they
read files and import nothing heavy. Whatever goes wrong, they offer nothing: a traceback would end up in the line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import typer

from omniwheel.number_text import is_number_text
from omniwheel.paths import params_path, presets_dir, robots_dir

if TYPE_CHECKING:
    from omni_schema import ParameterTable

Completer = Callable[[str], list[str]]


def _offered(names: Callable[[], Iterable[str]]) -> Completer:
    def complete(incomplete: str) -> list[str]:
        try:
            return [name for name in names() if name.startswith(incomplete)]
        except (OSError, ValueError):  # SchemaError is a ValueError
            return []

    return complete


def _stems(folder: Path) -> list[str]:
    return sorted(path.stem for path in folder.glob("*.toml"))


def _table() -> ParameterTable:
    from omni_schema import load_parameters

    return load_parameters(params_path())


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the package."""
    package = find_spec("hil_sim")
    folders = (package.submodule_search_locations or ()) if package is not None else ()
    return [name for folder in folders for name in _stems(Path(folder) / "scenarios")]


def _experiments() -> list[str]:
    from omni_reproduce.registry import targets

    return targets()


def _ports() -> list[str]:
    from omniwheel.ports import serial_ports

    return [*(port.device for port in serial_ports()), "tcp:127.0.0.1:5760"]


def assignments(incomplete: str) -> list[str]:
    """Return NAME= for parameters, and the names of an enum's values after it."""
    name, equals, value = incomplete.partition("=")
    if not equals:
        return [f"{found}=" for found in parameters(name.upper())]
    return [f"{name}={word}" for word in _offered(lambda: _values(name.upper()))(value)]


def _values(parameter: str) -> Iterable[str]:
    info = _table().get(parameter)
    return info.values if info is not None else ()


parameters = _offered(_table)
robots = _offered(lambda: _stems(robots_dir()))
presets = _offered(lambda: _stems(presets_dir()))
scenarios = _offered(scenario_names)
trajectories = _offered(lambda: _table()["TRJ_TYPE"].values)
experiments = _offered(_experiments)
ports = _offered(_ports)


def complete_words_unquoted(command: Any) -> Any:
    """Return a command, or a group, whose options and arguments stay words while the Tab key is answered.

    Otherwise typer would make a number or a path of each with pydantic, which takes longer than all the rest.
    """
    parameters_of = command.get_params

    def get_params(ctx: Any) -> Any:
        found = parameters_of(ctx)
        for parameter in found:
            if ctx.resilient_parsing:
                _complete_unquoted(parameter)
            elif _is_number(_type_of(parameter)):
                _check_number(parameter)
        return found

    command.get_params = get_params
    for name in getattr(command, "commands", ()):
        complete_words_unquoted(command.commands[name])
    return command


def _type_of(parameter: Any) -> Any:
    """Return an argument's type; typer on its own and typer upon click keep it in different places."""
    descriptor = getattr(parameter, "type_descriptor", None)
    if descriptor is not None:
        return descriptor.annotation
    return {"float": float, "integer": int}.get(parameter.type.name.partition(" ")[0])


def _is_number(annotation: Any) -> bool:
    """Say whether an argument's type is a number, or a list or an option of such."""
    return annotation in (int, float) or any(map(_is_number, get_args(annotation)))


def _check_number(parameter: Any) -> None:
    """Reject words that are not numbers, also those that Python parses: 2_8, 1e_3, digits of other scripts."""
    if getattr(parameter, "omni_checked", False):
        return
    parameter.omni_checked = True
    convert = parameter.process_value

    def checked(ctx: Any, value: Any) -> Any:
        for word in value if isinstance(value, (list, tuple)) else (value,):
            if not isinstance(word, str) or is_number_text(word):
                continue
            if word.lower().lstrip("+-") != "nan" or parameter.param_type_name == "option":  # setpoints say which
                raise typer.BadParameter(f"{word!r} is not a number", ctx=ctx, param=parameter)
        return convert(ctx, value)

    parameter.process_value = checked


def _complete_unquoted(parameter: Any) -> None:
    convert = parameter.process_value
    parameter.process_value = lambda ctx, value: value if ctx.resilient_parsing else convert(ctx, value)
