# SPDX-License-Identifier: MIT
"""What the Tab key offers for an argument: names of parameters, robots, scenarios, presets, trajectories and ports.

Each function takes what has been typed so far and returns what begins so. They run each time Tab is pressed, so they
read files and import nothing heavy. Whatever goes wrong, they offer nothing: a traceback would end up in the line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from omni_schema import ParameterTable, load_parameters
from omniwheel.paths import params_path, presets_dir, robots_dir

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
    return load_parameters(params_path())


def _scenarios() -> list[str]:
    import hil_sim

    return _stems(Path(hil_sim.__path__[0]) / "scenarios")


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
scenarios = _offered(_scenarios)
trajectories = _offered(lambda: _table()["TRJ_TYPE"].values)
ports = _offered(_ports)
