# SPDX-License-Identifier: MIT
"""Robot files: those that come with the package, by name, and the user's own, by path."""

from __future__ import annotations

import os
import re
from pathlib import Path

from omni_schema import ParameterTable, Robot, SchemaError, load_parameters, load_robot
from omni_schema.errors import did_you_mean
from omni_schema.toml_file import read_toml
from omniwheel import files
from omniwheel.errors import RobotFileError
from omniwheel.paths import params_path, robots_dir

_NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")
_NAME_LINE = re.compile(r"^name\s*=.*$", re.MULTILINE)


def parameter_table() -> ParameterTable:
    """Return the description of every parameter."""
    return load_parameters(params_path())


def robot_names() -> list[str]:
    """Return the names of the robot files that come with the package."""
    return sorted(path.stem for path in robots_dir().glob("*.toml"))


def find_robot_file(name_or_path: str | Path) -> Path:
    """Return the file of a robot named by a packaged name or by a path. Raises RobotFileError."""
    text = str(name_or_path)
    packaged = robots_dir() / f"{text}.toml"
    if _NAME.fullmatch(text) and packaged.is_file():
        return packaged
    path = Path(name_or_path)
    if path.is_file():
        return path
    names = robot_names()
    hint = f"the robots that come with omniwheel are {', '.join(names)}; `omni robots new` creates a robot file"
    if Path(f"{text}.toml").is_file():
        hint = f"give a file with its suffix: {text}.toml"
    raise RobotFileError(f"unknown robot or file {text}{did_you_mean(text, names)}", hint=hint)


def is_robot_file(path: str | Path) -> bool:
    """Return whether a file says of itself that it describes a robot: it has a table [robot]."""
    try:
        return "robot" in read_toml(Path(path))
    except SchemaError:
        return False


def read_robot(name_or_path: str | Path) -> Robot:
    """Read and check a robot. Raises RobotFileError that names file, key, value and what is allowed."""
    path = find_robot_file(name_or_path)
    try:
        return load_robot(path, parameter_table())
    except SchemaError as error:
        raise RobotFileError(str(error), hint=f"correct the file, then: omni robots check {path}") from error


def free_robot_path(name: str, folder: Path) -> Path:
    """Return the path that a new robot's file would have. Raises RobotFileError if it cannot be written there."""
    if not _NAME.fullmatch(name):
        raise RobotFileError(f"{name!r} is not a valid robot name", hint="a letter, then up to 31 of a-z 0-9 _")
    target = folder / f"{name}.toml"
    if target.exists():
        raise RobotFileError(f"{target} exists already", hint="choose another name")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RobotFileError(f"cannot write {target}", hint="check folder and permissions")
    return target


def new_robot_file(name: str, template: str, folder: Path) -> Path:
    """Copy a robot file under a new name, comments and all, and return its path; never overwrites.

    Raises RobotFileError, OutputFileError.
    """
    target = free_robot_path(name, folder)
    source = find_robot_file(template)
    text = _NAME_LINE.sub(f'name = "{name}"', source.read_text(encoding="utf-8-sig"), count=1)
    try:
        files.create(target, text.encode("utf-8"))
    except FileExistsError:
        raise RobotFileError(f"{target} exists already", hint="choose another name") from None
    return target
