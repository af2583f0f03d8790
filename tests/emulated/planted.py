# SPDX-License-Identifier: MIT
"""Bugs that show on the robot's processor and not on a PC, each with the test that must find it on the emulated one.

Each is a change that works on x86-64: what C++ leaves to the processor is used in a way that fits a PC. To add one: a
file, its text before and after, and a test that `make test-all` runs on the emulated processor, too.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from omniwheel.paths import emulated_firmware_path, firmware_path
from tests.native import ROOT, generated_dir

BUILD = {"pc": generated_dir().parent, "emulated": generated_dir().parent / "firmware" / "mps2"}
PROGRAM = {"pc": firmware_path, "emulated": emulated_firmware_path}
OVERRIDE = "OMNI_FIRMWARE_{}"
"""Names a program that tests/firmware/client.py runs in place of the installed one, for a board."""


@dataclass(frozen=True)
class Bug:
    """``source`` with ``old`` in place of ``new`` is wrong on the robot's processor; ``test`` finds it there."""

    what: str
    source: str
    old: str
    new: str
    test: str


BUGS = (
    Bug(
        "-1 in a char, which has no sign there",
        "firmware/app/services/parameters.cpp",
        "    if (index >= 0) {\n        return index < OMNI_PARAM_COUNT",
        "    const char given = index < 0 ? -1 : 0;\n    if (given >= 0) {\n        return index < OMNI_PARAM_COUNT",
        "tests/firmware/test_parameters.py::test_reading_by_index_and_by_name_agree",
    ),
    Bug(
        "a time in us in a long, which has 32 bits there",
        "firmware/app/link/stations.cpp",
        "const uint64_t heard = commander() == link ? stations_[commander_].heard_us : heard_us(link);",
        "const auto heard = static_cast<unsigned long>(commander() == link ? stations_[commander_].heard_us"
        " : heard_us(link));",
        "tests/firmware/test_clock_wraps.py::test_a_session_over_a_wrap_is_the_same_as_after_ten_seconds",
    ),
    Bug(
        "a time in ms computed as size_t, which has 32 bits there",
        "firmware/app/services/pose_fixes.cpp",
        "const uint64_t now_ms = now_us / 1000;",
        "const size_t now_ms = static_cast<size_t>(now_us) / 1000;",
        "tests/firmware/test_clock_wraps.py::test_a_session_over_a_wrap_is_the_same_as_after_ten_seconds",
    ),
    Bug(
        "the size of an enum, which is one byte there",
        "firmware/app/storage/param_store.cpp",
        "constexpr size_t crc_length = 4;",
        "constexpr size_t crc_length = sizeof(omni_result_t);",
        "tests/firmware/test_parameters.py::test_stored_parameters_come_back_and_reset_forgets_them_in_use_only",
    ),
    Bug(
        "a pair of words at an odd address, which faults there",
        "firmware/app/link/codec.cpp",
        "    std::memcpy(frame->payload, bytes + layout.header, length);\n",
        "    std::memcpy(frame->payload, bytes + layout.header, length);\n"
        "    const auto *pair = reinterpret_cast<const volatile uint64_t *>(bytes + 1);\n"
        "    (void)*pair;\n",
        "tests/firmware/test_parameters.py::test_reading_by_index_and_by_name_agree",
    ),
    Bug(
        "a negative float made an unsigned number, which is 0 there",
        "firmware/app/services/telemetry.cpp",
        "} else if (interval_us == -1.0f) {",
        "} else if (static_cast<uint32_t>(interval_us) == UINT32_MAX) {",
        "tests/firmware/test_link.py::test_streams_come_at_their_rates_and_are_adjustable",
    ),
    Bug(
        "a shift by more than 31 bits, which gives 0 there",
        "firmware/app/tick/i2c_scan.cpp",
        "1u << address_ % 8);",
        "(1u << address_) >> address_ / 8 % 4 * 8);",
        "tests/firmware/test_i2c_scan.py::test_a_scan_finds_who_is_there",
    ),
    Bug(
        "the highest bit as the sign of a long, which has 32 bits there",
        "firmware/app/tick/control_loop.cpp",
        "if ((flags & pending_setpoint) != 0 && setpoints_.update() &&",
        "if (static_cast<long>(flags & pending_setpoint) > 0 && setpoints_.update() &&",
        "tests/firmware/test_commands.py::test_body_velocity_drives_the_wheels_in_our_frame",
    ),
    Bug(
        "products fused with sums, which a PC's compiler leaves alone",
        "shared/core/src/control/ismc.c",
        "/* SPDX-License-Identifier: MIT */\n",
        '/* SPDX-License-Identifier: MIT */\n#pragma GCC optimize("-ffp-contract=fast")\n',
        "tests/emulated/test_runs.py::test_every_answer_is_the_same_on_both_processors_and_over_both_kinds_of_link",
    ),
    Bug(
        "an array that is larger than the stack",
        "firmware/app/services/parameters.cpp",
        "    list_next_[sender.link] = 0;",
        "    volatile uint8_t names[80'000];\n    names[0] = 0;\n    list_next_[sender.link] = names[0];",
        "tests/firmware/test_parameters.py::test_the_list_has_every_parameter_once_with_its_index",
    ),
)


def build(bug: Bug, board: str, folder: Path) -> Path:
    """Build the firmware of ``board`` with the bug, from the installed build's objects, and return the program."""
    original = ROOT / bug.source
    text = original.read_text(encoding="utf-8")
    if text.count(bug.old) != 1:
        raise ValueError(f"{bug.source} has changed: plant '{bug.what}' anew")
    changed, planted = folder / original.name, folder / "planted.o"
    changed.write_text(text.replace(bug.old, bug.new), encoding="utf-8")
    *compiling, linking = _commands(board)
    words = shlex.split(next(line for line in compiling if line.endswith(f"/{bug.source}") and " -fPIC " not in line))
    sound = words[words.index("-o") + 1]
    words[words.index("-o") + 1], words[words.index("-c") + 1] = str(planted), str(changed)
    _run([*words, "-Wno-error", f"-I{original.parent}"], BUILD[board])
    program = folder / PROGRAM[board]().name
    words = shlex.split(linking.removeprefix(": && ").removesuffix(" && :"))
    words[words.index("-o") + 1] = str(program)
    words = [str(planted) if word == sound else word for word in words]
    if str(planted) not in words:  # it is in an archive, which comes later
        words.insert(1, str(planted))
    _run(words, BUILD[board])
    return program


def passes(bug: Bug, board: str, program: Path) -> bool:
    """Run the bug's test on a board with this program."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-n", "0", "--tier", "all"]
    selected = [] if "tests/emulated" in bug.test else ["-k", f"[{board}"]
    environment = {**os.environ, OVERRIDE.format(board.upper()): str(program)}
    done = subprocess.run([*command, bug.test, *selected], cwd=ROOT, env=environment, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise ValueError(f"{bug.test} did not run: {done.stdout}{done.stderr}")
    return done.returncode == 0


def _commands(board: str) -> list[str]:
    """Return the commands that make a board's program, the last one links."""
    ninja = Path(sys.executable).with_name("ninja")
    target = PROGRAM[board]().name
    return _run([str(ninja), "-t", "commands", target], BUILD[board]).splitlines()


def _run(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ValueError(f"{shlex.join(command)}\n{done.stdout}{done.stderr}")
    return done.stdout
