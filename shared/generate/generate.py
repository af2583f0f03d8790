# SPDX-License-Identifier: MIT
"""Turns shared/params.toml, shared/world.toml, shared/robots/ and shared/link/ into C and Python source at build time.

    python shared/generate/generate.py --out build/generated [--robot my_robot.toml]... [--controller my_controller]
                                       [--part tables]...

Exit code 0: done. 1: a file is wrong; the message says which key and what is allowed.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from c_readings import write_core_readings  # noqa: E402
from c_tables import NOTICE, write_c_tables  # noqa: E402
from c_world import write_c_world  # noqa: E402
from controller_folder import load_controller, with_controller, write_controller, write_schema  # noqa: E402
from git_version import write_version_header  # noqa: E402
from omni_schema import ParameterTable, Robot, SchemaError, load_robot, parse_parameters  # noqa: E402
from omni_schema.errors import did_you_mean  # noqa: E402
from omni_schema.toml_file import read_toml  # noqa: E402
from omni_schema.world import load_world  # noqa: E402
from wiring_header import write_wiring_header  # noqa: E402

SHARED = HERE.parent
ROOT = SHARED.parent
WORLD = SHARED / "world.toml"
HEADERS = SHARED / "core" / "include" / "omni"
BOARDS = ROOT / "firmware" / "boards"
USUAL_PARTS = ("tables", "schema", "world", "mavlink-c", "mavlink-python", "version")
PARTS = (*USUAL_PARTS, "wiring")  # one robot's pins: only for that robot's own board


def project_version() -> str:
    """Return the version that pyproject.toml states."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    match = re.search(r'^version = "([^"]+)"', text, re.MULTILINE)
    if match is None:
        raise SchemaError(str(ROOT / "pyproject.toml"), "project.version", "is missing")
    return match.group(1)


def load_robots(table: ParameterTable, paths: list[Path]) -> list[Robot]:
    """Load the robot files; two robots of one name are an error."""
    robots: dict[str, Robot] = {}
    for path in paths:
        robot = load_robot(path, table)
        if robot.name in robots:
            problem = f"is {robot.name!r}, which {robots[robot.name].source} uses already"
            raise SchemaError(str(path), "robot.name", problem)
        robots[robot.name] = robot
    return list(robots.values())


def generate(
    out: Path, parts: list[str], robot_files: list[Path], params_path: Path, controller_folder: Path | None = None
) -> None:
    """Write the parts below ``out``."""
    document = read_toml(params_path)
    table = parse_parameters(document, str(params_path))
    controller = load_controller(controller_folder, HEADERS) if controller_folder else None
    if controller:
        document = with_controller(document, table, controller)
        table = parse_parameters(document, str(controller.parameters_path))
    if "version" in parts:
        write_version_header(ROOT, project_version(), out)
    if "tables" in parts:
        headers = [HEADERS, *([controller.source.parent] if controller else [])]
        write_c_tables(table, load_robots(table, robot_files), headers, out)
        write_controller(controller, NOTICE, out)
        boards = sorted(path.parent.name for path in BOARDS.glob("*/main.cpp"))
        write_core_readings(load_world(WORLD), boards, out)
    if "schema" in parts:
        write_schema(params_path, document if controller else None, out)
    if "world" in parts:
        write_c_world(load_world(WORLD), table.motor_drivers, out)
    if "wiring" in parts:
        write_wiring_header(load_robots(table, robot_files), out)
    if "mavlink-c" in parts or "mavlink-python" in parts:
        # Imported late: the tables must be buildable where pymavlink is not installed.
        from mavlink_dialect import generate_c, generate_python

        if "mavlink-c" in parts:
            generate_c(SHARED / "link", out)
        if "mavlink-python" in parts:
            generate_python(SHARED / "link", out)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--params", type=Path, default=SHARED / "params.toml")
    parser.add_argument("--robot", type=Path, action="append", help="robot file (default: all)")
    parser.add_argument("--controller", type=Path, help="folder of a controller outside the tree (default: none)")
    parser.add_argument("--part", action="append", help=f"one of {', '.join(PARTS)} (default: all but wiring)")
    options = parser.parse_args(arguments)
    for part in options.part or []:
        if part not in PARTS:
            hint = did_you_mean(part, PARTS)
            parser.error(f"--part {part}: unknown{hint}; one of {', '.join(PARTS)}")
    robots = options.robot or sorted((SHARED / "robots").glob("*.toml"))
    try:
        generate(options.out, options.part or list(USUAL_PARTS), robots, options.params, options.controller)
    except SchemaError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
