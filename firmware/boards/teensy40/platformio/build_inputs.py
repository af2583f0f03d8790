# SPDX-License-Identifier: MIT
"""What a build for the Teensy depends on: which robot file, which files the generated code comes from, how strict."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path


class InputError(ValueError):
    """A robot file that is not there, or not the one that the environment is for; says what to do."""


_CONFIG_FILE = re.compile(r"""^\s*(?:gyro\.)?config_file\s*=\s*(["'])(.*?)\1""", re.MULTILINE)
# A file that is written in another way is read all the same, but a build does not notice when it changes.

VARIABLE = "OMNI_ROBOT"
"""The environment variable that names a robot file of one's own; as ``custom_robot``: that file."""

CONTROLLER = "OMNI_CONTROLLER"
"""The environment variable that names the folder of a controller outside the tree."""


def robot_file(root: Path, project_option: str, environ: Mapping[str, str]) -> Path:
    """Return the robot file that an environment of platformio.ini is for.

    ``project_option`` is its ``custom_robot``: a path from ``root``, a whole one, or "OMNI_ROBOT". Raises InputError,
    also if OMNI_ROBOT names another file: whoever set it would otherwise drive with another robot's values.
    """
    wanted = environ.get(VARIABLE, "")
    option = wanted if project_option == VARIABLE else project_option
    if not option:
        raise InputError("which robot? OMNI_ROBOT=my_robot.toml pio run -e robot, or pio run -e three_wheel")
    path = root / option
    if wanted and (root / wanted).resolve() != path.resolve():
        raise InputError(
            f"this environment builds for {option}, but OMNI_ROBOT is {wanted}; "
            f"give `-e robot` for that file, or unset OMNI_ROBOT"
        )
    if not path.is_file():
        raise InputError(f"robot file {path} does not exist; give OMNI_ROBOT a path from {root}, or a whole one")
    return path


def controller_folder(root: Path, environ: Mapping[str, str]) -> Path | None:
    """Return the folder of the controller outside the tree, if OMNI_CONTROLLER names one."""
    wanted = environ.get(CONTROLLER, "")
    return root / wanted if wanted else None


def generator_inputs(root: Path, robot: Path, controller: Path | None = None) -> list[Path]:
    """Return all files that the generated code depends on, the version apart.

    They are robot, controller, schemas, dialect and generator.
    """
    shared = root / "shared"
    link = [path for path in (shared / "link").rglob("*") if path.is_file()]
    headers = (shared / "core" / "include" / "omni").glob("*.h")  # controllers and paths are looked up there
    schemas = [shared / "params.toml", shared / "world.toml"]
    named = files_named_in(robot)
    own = [path for path in controller.iterdir() if path.is_file()] if controller and controller.is_dir() else []
    return sorted([robot, *named, *own, *schemas, *link, *headers, *(shared / "generate").rglob("*.py")])


def files_named_in(robot: Path) -> list[Path]:
    """Return the files that a robot file names and that are there: the configuration file of its gyro's chip."""
    named = _CONFIG_FILE.search(robot.read_text(encoding="utf-8"))
    path = robot.parent / (named[2] if named else "")
    return [path] if path.is_file() else []


def fingerprint(root: Path, robot: Path, controller: Path | None = None) -> str:
    """Return a hash of the generator's inputs, their names and their contents."""
    state = hashlib.sha256()
    for path in generator_inputs(root, robot, controller):
        content = path.read_bytes()
        state.update(f"{path}\0{len(content)}\0".encode() + content)
    return state.hexdigest()


def dialect_number(folder: Path) -> int:
    """Return a number that is another one for another MAVLink codec: 32 bits of a hash of the headers in ``folder``.

    SCons does not look into system headers. With this number among the flags it compiles anew what includes them.
    """
    state = hashlib.sha256()
    for path in sorted(folder.rglob("*.h")):
        state.update(f"{path.relative_to(folder)}\0".encode() + path.read_bytes())
    return int.from_bytes(state.digest()[:4], "big")


def warnings_are_errors(environ: Mapping[str, str]) -> bool:
    """Return whether OMNI_WERROR asks for it; it is for our CI, whose compilers are known."""
    return environ.get("OMNI_WERROR", "0") not in ("", "0")
