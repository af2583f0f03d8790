# SPDX-License-Identifier: MIT
"""The fuzzers find nothing, do the same everywhere, and would find what is planted for them."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import struct
import subprocess
from pathlib import Path

import pytest

from omni_schema import toml_file
from tests.fuzz import fuzz, robot_file
from tests.native import untimed
from tests.needs import need

BYTES = 150_000
TIMEOUT_S = 600


@pytest.fixture(scope="session")
def built() -> None:
    need("clang")
    with untimed():
        fuzz.build(["fuzzers"])


def run(command: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    # Runtime libraries that are preloaded for other tests have no business here.
    inherited = {name: value for name, value in os.environ.items() if name not in ("LD_PRELOAD", "FUZZ_LAST")}
    environment = {**inherited, "PYTHONPATH": str(fuzz.ROOT / "shared" / "generate"), **environment}
    return subprocess.run(
        command, capture_output=True, text=True, errors="replace", env=environment, check=False, cwd=fuzz.ROOT,
        timeout=TIMEOUT_S,
    )  # fmt: skip


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize(
    "target", [pytest.param(one, marks=pytest.mark.nightly if one == "app" else ()) for one in fuzz.TARGETS]
)
def test_a_seeded_run_finds_nothing_and_is_the_same_every_time(target: str) -> None:
    runs = [run(fuzz.seeded_command(target, 7, BYTES)) for _ in range(2)]
    assert runs[0].returncode == 0, runs[0].stdout + runs[0].stderr
    assert runs[0].stdout == runs[1].stdout
    figures = json.loads(runs[0].stdout)
    assert figures["bytes"] >= BYTES
    if target == "sequence":
        assert figures["stops_in_motion"] > 5
    if target == "app":
        assert figures["armed_ticks"] > figures["driving_ticks"] > 50  # so that "no motor command" means something


KINDS = re.search(r"enum class Kind : uint8_t \{([^}]*)\}", (fuzz.ROOT / "tests/fuzz/action.h").read_text("utf-8"))


def sequence_of(*actions: tuple[str, int]) -> bytes:
    """Return an input of `sequence`: a set-up with four links, then actions by name and link."""
    assert KINDS is not None
    kinds = [name.strip() for name in KINDS[1].split(",")]
    setup = struct.pack("<BBBBHh", 0, 0, 0, 2, 0, 0)
    return setup + b"".join(struct.pack("<BBBBHh", kinds.index(kind), link, 0, 0, 30, 12000) for kind, link in actions)


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize(
    "actions",
    [
        [("key", 0), ("ticks", 0), ("arm", 3), ("power_cut", 0), ("disarm", 1), ("ticks", 0), ("estop", 1)],
        [("key", 0), ("ticks", 0), ("arm", 1), ("reboot", 0), ("power_cut", 0), ("ticks", 0), ("estop", 1)],
        [("key", 0), ("ticks", 0), ("enter_hil", 1), ("ticks", 0), ("host_ticks", 1), ("arm", 1), ("estop", 1)],
    ],
    ids=["at once after a power cut while armed", "after the robot was heard", "from the host in the loop"],
)  # fmt: skip
def test_a_signed_stop_that_the_robot_may_not_take_for_a_recording_is_answered(
    tmp_path: Path, actions: list[tuple[str, int]]
) -> None:
    """The first was found with seed 7: the station did not follow the robot's clock, as every MAVLink signer does."""
    script = tmp_path / "actions"
    script.write_bytes(sequence_of(*actions))
    done = run([str(fuzz.program("sequence")), str(script)])
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["stops"] >= 1


DRAWS = r"""
#include <cstdio>
#include "script.h"
int main() {
    const unsigned numbers[] = {
        400, 176, 20, 23, 60110, 60118, 66, 84, 11, 511, 4, 8, 111, 117, 119, 12, 76, 75, 69, 0};
    for (size_t count = 19; count <= 20; ++count) {
        for (uint32_t draw = 0; draw < 65536; ++draw) {
            std::printf("%u ", numbers[fuzz::entry_for(draw, count, [&](size_t i) { return numbers[i]; })]);
        }
        std::puts("");
    }
}
"""


def test_a_new_message_leaves_what_the_kept_inputs_mean(tmp_path: Path) -> None:
    source, program = tmp_path / "draws.cpp", tmp_path / "draws"
    source.write_text(DRAWS)
    subprocess.run(["c++", "-std=c++17", f"-I{fuzz.ROOT}/tests/fuzz", source, "-o", program], check=True)
    before, after = (line.split() for line in run([str(program)]).stdout.splitlines())
    changed = [new for old, new in zip(before, after, strict=True) if old != new]
    assert set(changed) == {"0"}  # what changed went to the new one
    counts = [after.count(number) for number in set(after)]
    assert len(counts) == 20
    assert 0.7 * 65536 / 20 < min(counts) <= max(counts) < 1.3 * 65536 / 20


PLANTED: dict[str, tuple[str, str, str, str, str | signal.Signals]] = {
    "a bound that is not checked": (
        "app",
        "firmware/app/services/parameters.cpp",
        "return index < OMNI_PARAM_COUNT ? index : -1;",
        "return index;",
        "parameters.cpp",
    ),
    "motors driven while disarmed": (
        "app",
        "shared/core/src/tick/tick.c",
        "finite && supervisor->state == OMNI_STATE_ARMED;",
        "finite;",
        signal.SIGILL,  # an invariant of the core
    ),
    "a command that arms although another was meant": (
        "app",
        "firmware/app/services/arming.cpp",
        "if (wanted == 1.0f) {",
        "if (wanted > 0.5f) {",
        "the robot arms when asked to and not otherwise",
    ),
    "a disarm that is left out while nothing drives yet": (
        "sequence",
        "firmware/app/services/arming.cpp",
        "    control_.stop(event);",
        "    if (robot_.latest().outputs.drive) {\n        control_.stop(event);\n    }",
        "zero volts within two ticks",
    ),
    "an emergency stop that another host in the loop forgets": (
        "sequence",
        "firmware/app/tick/control_loop.cpp",
        "if (robot_.supervisor.state == OMNI_STATE_ESTOP && !released) {",
        "if (robot_.supervisor.state == OMNI_STATE_ESTOP && released) {",
        "an emergency stop",
    ),
    "an emergency stop that a restart forgets": (
        "sequence",
        "firmware/app/app.cpp",
        "if (stop_latch_.boot() != StopLatch::AtBoot::released) {",
        "if (stop_latch_.boot() == StopLatch::AtBoot::unknown) {",
        "an emergency stop",
    ),
    "a stop without an answer": (
        "sequence",
        "firmware/app/services/commands.cpp",
        "    links_[command.sender.link].send(MAVLINK_MSG_ID_COMMAND_ACK, ack,",
        "    if (command.id != cmd_terminate)\n"
        "        links_[command.sender.link].send(MAVLINK_MSG_ID_COMMAND_ACK, ack,",
        "every stop is acknowledged",
    ),
    "a stop that is said to be refused": (
        "sequence",
        "firmware/app/services/arming.cpp",
        "robot_.expect_stop();\n    return MAV_RESULT_ACCEPTED;",
        "robot_.expect_stop();\n    return robot_.hil() ? MAV_RESULT_TEMPORARILY_REJECTED : MAV_RESULT_ACCEPTED;",
        "no stop is refused",
    ),
    "a stop that waits for the end of half a frame": (
        "sequence",
        "firmware/app/link/codec.cpp",
        "return find_stop(frame);",
        "return frame->early && find_stop(frame);",
        "stop",
    ),
    "a stop over a signed radio that host-in-the-loop does not hear": (
        "sequence",
        "firmware/app/app.cpp",
        "!by_us && channel.admits(frame)) {",
        "!by_us && channel.admits(frame) && !(robot_.hil() && frame.is_signed)) {",
        "every stop is acknowledged",
    ),
    "a station that follows the robot's clock and is taken for a recording": (
        "sequence",
        "firmware/app/link/signing.cpp",
        "return time + new_stream_slack >= time_ ? vacant() : nullptr;",
        "return time > time_ + new_stream_slack ? vacant() : nullptr;",
        "stop",  # refused ones leave no emergency stop behind, and have no answer: whichever is seen first
    ),
    "a checksum that is checked by half": (
        "parser",
        "firmware/app/link/codec.cpp",
        " && bytes[covered + 1] == crc >> 8",
        "",
        "broken promise",
    ),
    "a frame that hides another": (
        "parser",
        "firmware/app/link/codec.cpp",
        "    begin_ += 1;\n}",
        "    begin_ += std::min<size_t>(4, end_ - begin_);\n}",
        "a stop comes with its last byte",
    ),
    "a loop without end": (
        "parser",
        "firmware/app/link/codec.cpp",
        "    begin_ += 1;\n}",
        "}",
        signal.SIGALRM,
    ),
    "a memory that is read beyond its end": (
        "store",
        "firmware/app/storage/param_store.cpp",
        "count > (size - header_length - crc_length) / entry_length",
        "false",
        "param_store.cpp",
    ),
}


def plant(folder: Path, target: str, source: str, old: str, new: str) -> Path:
    """Build a seeded fuzzer in which one source file is another; the archive's own object then is not taken."""
    original = fuzz.ROOT / source
    text = original.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{source} has changed: plant another bug"
    changed = folder / original.name
    changed.write_text(text.replace(old, new), encoding="utf-8")
    commands = json.loads((fuzz.BUILD / "compile_commands.json").read_text(encoding="utf-8"))
    commands.sort(key=lambda entry: "omni_fuzz" not in entry["command"])  # the firmware of the PC has other flags
    command = shlex.split(next(entry["command"] for entry in commands if entry["file"] == str(original)))
    planted = folder / "planted.o"
    command[command.index("-o") + 1] = str(planted)
    command[command.index("-c") + 1] = str(changed)
    subprocess.run([*command, f"-I{original.parent}"], check=True, cwd=fuzz.BUILD)
    objects = [
        fuzz.PROGRAMS / "CMakeFiles" / f"{part}.dir" / f"{name}.cpp.o"
        for part, name in ((f"omni_fuzz_{target}", f"fuzz_{target}"), (f"seeded_{target}", "seeded"))
    ]
    archives = [fuzz.PROGRAMS / "libomni_fuzz_common.a", fuzz.PROGRAMS / "libomni_fuzz_firmware.a"]
    core = fuzz.BUILD / "shared" / "core" / "libomni_core.a"
    program = folder / "planted"
    flags = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
    subprocess.run(["clang++", *flags, planted, *objects, *archives, core, "-o", program], check=True)
    return program


FIRST_OF = {target: bug for bug, (target, *_) in reversed(PLANTED.items())}
"""One bug for each fuzzer; the others are for `make nightly`."""
BUGS = [pytest.param(bug, marks=[] if bug in FIRST_OF.values() else pytest.mark.nightly) for bug in PLANTED]


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize("bug", BUGS)
def test_a_planted_bug_is_found(tmp_path: Path, bug: str) -> None:
    target, source, old, new, sign = PLANTED[bug]
    program = plant(tmp_path, target, source, old, new)
    last = tmp_path / "last"
    found = run([str(program), "7", "20000000"], FUZZ_LAST=str(last), FUZZ_HANG_S="3")
    assert found.returncode != 0
    if isinstance(sign, str):
        assert sign in found.stdout + found.stderr
    else:
        assert found.returncode == -sign
    again = run([str(program), str(last)], FUZZ_HANG_S="3")
    assert again.returncode == found.returncode


def test_a_reader_that_lets_monsters_through_is_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(toml_file, "_refuse_monsters", lambda *_: None)
    monkeypatch.setenv("FUZZ_LAST", str(tmp_path / "last"))
    with pytest.raises((OverflowError, RecursionError, ValueError)):
        robot_file.run(1, 2_000_000)
    assert (tmp_path / "last").stat().st_size > 0
