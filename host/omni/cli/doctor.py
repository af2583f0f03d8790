# SPDX-License-Identifier: MIT
"""``omni doctor``: what is installed, what is missing and what it would be for."""

from __future__ import annotations

import importlib.metadata
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli.common import JsonOption, console, examples, print_json
from omniwheel import __version__
from omniwheel.paths import MissingFileError, firmware_path
from omniwheel.robots import robot_names

if TYPE_CHECKING:
    from omniwheel.ports import Port

EXAMPLES = examples("omni doctor", "omni doctor --json")
_PYTHON = (3, 10)
_VERSION_TIMEOUT_S = 5.0
_TOOLS = {
    "mavproxy.py": ("MAVProxy", "a command-line ground station"),
    "pio": ("PlatformIO", "building and flashing the Teensy firmware: pip install 'omniwheel[flash]'"),
    "qemu-system-arm": ("QEMU", "running the firmware on an emulated Cortex-M7"),
    "arm-none-eabi-gcc": ("Arm GCC", "compiling core and firmware for the emulated Cortex-M7"),
    "cmake": ("CMake", "building from source"),
}

_EXTRAS = {
    "intelhex": ("flash", "omni flash"),
    "pyelftools": ("flash", "python -m omni.checks image, omni flash, --image of omni run and omni sitl"),
    "unicorn": ("flash", "python -m omni.checks image, omni flash, --image of omni run and omni sitl"),
    "mcap": ("mcap", "logs for Foxglove: robot.run.save('drive.mcap')"),
    "scipy": ("study", "omni identify, omni reproduce, omni replay, omni sweep --sobol"),
    "optuna": ("optimize", "omni optimize"),
    "distributed": ("cluster", "--cluster of omni montecarlo, sweep and optimize"),
}
"""Optional packages: the extra that brings each, and what it is for."""


@dataclass(frozen=True)
class Finding:
    """One thing looked at: ``ok`` None means optional and absent."""

    name: str
    ok: bool | None
    detail: str


def doctor(as_json: JsonOption = False) -> None:
    """Check the installation, list serial ports and tools. Exit code 1: something required is missing."""
    from omniwheel.ports import serial_ports

    ports = serial_ports()
    findings = [*_required(), *_extras(), *_tools(), *_access(ports)]
    healthy = all(finding.ok is not False for finding in findings)
    if as_json:
        print_json({"ok": healthy, "checks": [asdict(f) for f in findings], "ports": [asdict(p) for p in ports]})
    else:
        console.print(_findings_table(findings))
        console.print(_ports_text())
    if not healthy:
        raise typer.Exit(1)


def _required() -> list[Finding]:
    checks: list[tuple[str, Callable[[], str]]] = [
        ("omniwheel", lambda: __version__),
        ("Python", _python_version),
        ("packages", _package_versions),
        ("control core", _core_version),
        ("MAVLink dialect", _dialect_size),
        ("robot files", lambda: ", ".join(robot_names())),
        ("PC firmware", _firmware_version),
    ]
    return [_checked(name, check) for name, check in checks]


def _checked(name: str, check: Callable[[], str]) -> Finding:
    try:
        return Finding(name, True, check())
    except Exception as error:  # a doctor must survive whatever is broken
        return Finding(name, False, f"{error}")


def _python_version() -> str:
    if sys.version_info < _PYTHON:
        raise RuntimeError(f"{platform.python_version()} is too old; install Python 3.10 or newer")
    return f"{platform.python_version()} on {platform.system()} {platform.machine()}"


def _package_versions() -> str:
    names = ("pymavlink", "pyserial", "numpy", "matplotlib", "typer", "rich")
    return ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names)


def _core_version() -> str:
    from omniwheel import _core
    from omniwheel.build_record import load_record

    record = load_record()
    own = f", controller {record.controller} from {record.controller_folder}" if record and record.controller else ""
    return f"loaded, {_core.lib.OMNI_PARAM_COUNT} parameters{own}"


def _dialect_size() -> str:
    from omniwheel.dialect import mavlink

    return f"{len(mavlink.mavlink_map)} messages"


def _firmware_version() -> str:
    try:
        path = firmware_path()
    except MissingFileError:
        if sys.platform == "win32":
            return "not on Windows; connect to a robot or to a simulation on another computer"
        raise
    answer = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=_VERSION_TIMEOUT_S, check=True)
    return answer.stdout.strip() or answer.stderr.strip()


def _extras() -> list[Finding]:
    return [_extra(package, extra, purpose) for package, (extra, purpose) in _EXTRAS.items()]


def _extra(package: str, extra: str, purpose: str) -> Finding:
    try:
        return Finding(package, True, f"{importlib.metadata.version(package)}, for {purpose}")
    except importlib.metadata.PackageNotFoundError:
        return Finding(package, None, f"not installed; for {purpose}: pip install 'omniwheel[{extra}]'")


def _tools() -> list[Finding]:
    return [_tool(program, name, purpose) for program, (name, purpose) in _TOOLS.items()]


def _tool(program: str, name: str, purpose: str) -> Finding:
    beside_python = str(Path(sys.executable).parent)
    path = shutil.which(program) or shutil.which(program, path=beside_python)
    return Finding(name, True if path else None, f"{path}, for {purpose}" if path else f"not found; for {purpose}")


def _access(ports: Sequence[Port]) -> list[Finding]:
    """What Linux wants to be told before a Teensy may be used; never a reason to call the installation broken."""
    from omniwheel.usb_access import SERIAL_GROUPS, missing_group, refused_ports, teensy_rule

    if sys.platform != "linux":
        return []
    rule = teensy_rule()
    no_rule = (
        "not found; for flashing without root: put https://www.pjrc.com/teensy/00-teensy.rules into /etc/udev/rules.d"
    )
    findings = [Finding("Teensy udev rule", True if rule else None, str(rule) if rule else no_rule)]
    refused, group = refused_ports([port.device for port in ports]), missing_group()
    if refused or group:
        what = f"no permission for {', '.join(refused)}" if refused else f"you are not in the group {group}"
        how = f"sudo usermod -aG {group or SERIAL_GROUPS[0]} $USER, then log in again"
        return [*findings, Finding("serial ports", None, f"{what}; {how}")]
    return [*findings, Finding("serial ports", True, "may be opened")]


def _findings_table(findings: list[Finding]) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False)
    for _ in range(2):
        table.add_column()
    table.add_column(overflow="fold")
    marks = {True: "[green]✓[/]", False: "[bold red]✗[/]", None: "[dim]·[/]"}
    for finding in findings:
        style = "dim" if finding.ok is None else None
        table.add_row(marks[finding.ok], finding.name, escape(finding.detail), style=style)
    return table


def _ports_text() -> str:
    from omniwheel.ports import serial_ports

    ports = serial_ports()
    if not ports:
        return "[dim]· no serial ports; is the robot's USB cable plugged in?[/]"
    guesses = {"teensy": "[green]looks like a Teensy[/]", "xbee": "[green]looks like an XBee adapter[/]"}
    lines = [f"  {port.device}  {escape(port.description)}  {guesses.get(port.guess, '')}" for port in ports]
    return "\n".join(["serial ports:", *lines])
