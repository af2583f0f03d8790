# SPDX-License-Identifier: MIT
"""PlatformIO runs this before it builds: writes the robot's tables, its pins and the MAVLink codec into the build."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from SCons.Script import DefaultEnvironment

env: Any = DefaultEnvironment()
root = Path(env.subst("$PROJECT_DIR"))
sys.path.insert(0, str(root / "firmware" / "boards" / "teensy40" / "platformio"))

from build_inputs import (  # noqa: E402
    InputError,
    controller_folder,
    dialect_number,
    fingerprint,
    robot_file,
    warnings_are_errors,
)

PARTS = ("tables", "wiring", "mavlink-c")
# Module name and what pip installs for it.
PACKAGES = {"pymavlink": "pymavlink>=2.4.41"} | ({} if sys.version_info >= (3, 11) else {"tomli": "tomli>=2"})

# Run 50 times a second at most, never, or in the background with new parameters and paths: their loops unrolled by -O3
# would take 9 KB of the fast memory.
SMALL = tuple(
    f"*/shared/core/src/{part}.c"
    for part in (
        *("config/params", "config/robot_config", "control/laws_config", "reference/trajectory_plan"),
        *("estimate/flow", "estimate/pose_ekf_inflate", "estimate/pose_ekf_flow", "model/motor"),
    )
)

generated = Path(env.subst("$BUILD_DIR")) / "generated"
generator = root / "shared" / "generate"
controller = controller_folder(root, os.environ)


def stop(message: str) -> None:
    """End the build with a message that says what to do."""
    sys.stderr.write(f"Error: {message}\n")
    env.Exit(1)


def robot_of_environment() -> Path:
    """Return the robot file that this environment is for, or end the build."""
    try:
        return robot_file(root, env.GetProjectOption("custom_robot", ""), os.environ)
    except InputError as error:
        stop(str(error))
        raise


def need_packages() -> None:
    """Install what the generator needs into PlatformIO's own Python."""
    missing = [wanted for module, wanted in PACKAGES.items() if importlib.util.find_spec(module) is None]
    if not missing:
        return
    names = " ".join(f'"{name}"' for name in missing)
    command = f'"$PYTHONEXE" -m pip install {names}'
    if env.Execute(env.VerboseAction(command, f"Installing {names} for the code generator")):
        python = env.subst("$PYTHONEXE")
        stop(f"could not install {names} (no network?); install it by hand: {python} -m pip install {names}")


def generate(robot: Path, parts: tuple[str, ...]) -> None:
    """Run the generator; its own message says what is wrong with a robot file or a controller."""
    command = [env.subst("$PYTHONEXE"), str(generator / "generate.py"), "--out", str(generated), "--robot", str(robot)]
    if controller is not None:
        command += ["--controller", str(controller)]
    for part in parts:
        command += ["--part", part]
    if subprocess.run(command, check=False).returncode != 0:
        env.Exit(1)


def compile_small(source_env: Any, node: Any) -> Any:
    """Return how SCons makes an object of a source of SMALL. The last of several -O counts."""
    return source_env.Object(node, CCFLAGS=[*source_env["CCFLAGS"], "-O2"])


def prepare() -> None:
    """Bring the generated files up to date and put them and the system headers into the build."""
    robot = robot_of_environment()
    need_packages()
    stamp = generated / "stamp"
    wanted = fingerprint(root, robot, controller)
    if not stamp.is_file() or stamp.read_text(encoding="utf-8") != wanted:
        generate(robot, PARTS)
        stamp.write_text(wanted, encoding="utf-8")
    generate(robot, ("version",))
    framework = Path(env.PioPlatform().get_package_dir("framework-arduinoteensy")) / "cores" / "teensy4"
    # Headers of others, whose warnings are not ours to mend.
    for folder in (generated / "mavlink", framework):
        env.Append(CCFLAGS=["-isystem", str(folder)])
    env.Append(CPPPATH=[str(generated / "include")])
    env.Append(SRC_BUILD_FLAGS=[f"-DOMNI_DIALECT={dialect_number(generated / 'mavlink')}u"])
    if warnings_are_errors(os.environ):
        env.Append(SRC_BUILD_FLAGS=["-Werror"])
    for pattern in SMALL:
        env.AddBuildMiddleware(compile_small, pattern)
    env.BuildSources(str(generated / "objects"), str(generated / "src"))
    print(f"Robot file: {robot}")
    if controller is not None:
        print(f"Controller outside the tree: {controller}")


prepare()
