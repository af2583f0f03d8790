# SPDX-License-Identifier: MIT
"""The commands of ``omni`` by group, one line each. A command's module is imported when the command is used."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from inspect import cleandoc
from typing import Any

import typer

from omni.cli.completion import complete_words_unquoted


@dataclass(frozen=True)
class Entry:
    """One command: its place in ``omni --help`` and its code.

    ``module`` is one of ``package``. ``function`` is the command in it; "" means that the module has an ``app``,
    which is a group of commands. ``package`` has the module.
    """

    name: str
    group: str
    summary: str
    module: str
    function: str = ""
    package: str = "omni.cli"


def by_name(table: tuple[Entry, ...]) -> dict[str, Entry]:
    """Return the entries of a table by their names."""
    return {entry.name: entry for entry in table}


@cache
def load(entry: Entry) -> Any:
    """Import the command's module and return the command."""
    module = import_module(f"{entry.package}.{entry.module}")
    parent = typer.Typer(add_completion=False, rich_markup_mode="rich")
    if entry.function:
        parent.command(entry.name, epilog=module.EXAMPLES)(getattr(module, entry.function))
    else:
        parent.add_typer(module.app, name=entry.name)
    parent.callback()(lambda: None)  # or a single command would take the group's place
    return complete_words_unquoted(fill_lines(typer.main.get_group(parent).commands[entry.name]))


def fill_lines(command: Any) -> Any:
    """Return a command, or a group, whose help fills the terminal's lines. Typer keeps those of the docstring."""
    paragraphs = cleandoc(command.help or "").split("\n\n")
    command.help = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    for inner in getattr(command, "commands", {}).values():
        fill_lines(inner)
    return command


DRIVE, TUNE, SIMULATE = "Drive a robot", "Tune a robot", "Simulate a robot"
STUDY, BUILD, RECORD = "Study many runs", "Build and check a robot", "Record, replay and compare"

TABLE = (
    Entry("drive", DRIVE, "Move the robot, by numbers or by keys", "drive"),
    Entry("stop", DRIVE, "Emergency stop, and its release", "stop", "stop"),
    Entry("monitor", DRIVE, "Show state, pose, wheels and faults", "monitor", "monitor"),
    Entry("mocap", DRIVE, "Send motion-capture poses to a robot, or record them", "mocap"),
    Entry("link", DRIVE, "Share one port between several programs", "link", "link"),
    Entry("radio", DRIVE, "Protect the radio with a key", "radio", "radio"),
    Entry("host-control", DRIVE, "Drive the original four-wheel robot from this computer", "host_control"),
    Entry("studio", TUNE, "See, drive and tune a robot in the browser", "studio", "studio"),
    Entry("params", TUNE, "Read, set, save and compare parameters", "params"),
    Entry("tune", TUNE, "Compare other gains with the present ones, keep or revert", "tune", "tune"),
    Entry("autotune", TUNE, "Choose gains automatically from measurements", "autotune", "autotune"),
    Entry("experiment", TUNE, "Measure a control loop's step or frequency response", "experiment", "experiment"),
    Entry("identify", TUNE, "Identify a robot's parameters from its motion", "identify"),
    Entry("run", SIMULATE, "Run a scenario with the real firmware, in simulated time", "run", "run"),
    Entry("sitl", SIMULATE, "Run firmware and simulated world in real time", "sitl", "sitl"),
    Entry("montecarlo", STUDY, "Run a scenario with many random seeds", "montecarlo", "montecarlo"),
    Entry("sweep", STUDY, "Run a scenario at many settings", "sweep", "sweep"),
    Entry("optimize", STUDY, "Optimise parameters, validate them on other seeds", "optimize", "optimize"),
    Entry("robots", BUILD, "Write, check, show and wire robot files", "robots"),
    Entry("flash", BUILD, "Build the firmware, check it and upload it", "flash", "flash"),
    Entry("bringup", BUILD, "Check a new robot step by step", "bringup", "bringup"),
    Entry("doctor", BUILD, "Check the installation and list serial ports", "doctor", "doctor"),
    Entry("record", RECORD, "Record every message of a link", "record", "record"),
    Entry("replay", RECORD, "Replay a log through the robot's estimator", "replay", "replay_command"),
    Entry("logs", RECORD, "Import, show and align logs of any robot", "logs"),
    Entry("plot", RECORD, "Plot a finished run or a telemetry log", "plot", "plot"),
    Entry("runs", RECORD, "List, compare, rename and delete runs", "runs", "runs"),
    Entry("reproduce", RECORD, "Reproduce the research report's experiments", "reproduce", "reproduce"),
)
"""In the order of ``omni --help``."""
