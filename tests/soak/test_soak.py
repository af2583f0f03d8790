# SPDX-License-Identifier: MIT
"""A simulated day of wraps shows nothing, and would show a timer that does not survive one."""

from __future__ import annotations

import json
import shlex
import subprocess
from pathlib import Path

import pytest

from tests.fuzz import fuzz
from tests.needs import need
from tests.soak import soak

BUILD = fuzz.BUILDS["nothing"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("clang")
    state = tmp_path_factory.mktemp("soak")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(soak, "STATE", state)
        return soak.folder_of(soak.program())


def jumps(program: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    arguments = ["jumps", str(folder / "world"), str(folder / "parameters"), "1", "three_wheel"]
    return subprocess.run([str(program), *arguments], capture_output=True, text=True, check=False, timeout=300)


def planted(tmp_path: Path, source: str, old: str, new: str) -> Path:
    """Build the program with one source changed: its object stands before the archive that holds the sound one."""
    original = fuzz.ROOT / source
    text = original.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{source} has changed: plant another bug"
    changed = tmp_path / original.name
    changed.write_text(text.replace(old, new), encoding="utf-8")
    commands = json.loads((BUILD / "compile_commands.json").read_text(encoding="utf-8"))
    command = shlex.split(
        next(c["command"] for c in commands if c["file"] == str(original) and "omni_fuzz_firmware" in c["command"])
    )
    command[command.index("-o") + 1] = str(tmp_path / "planted.o")
    command[command.index("-c") + 1] = str(changed)
    subprocess.run([*command, f"-I{original.parent}"], check=True, cwd=BUILD)
    objects = sorted((BUILD / "tests" / "soak" / "CMakeFiles" / "soak_objects.dir").glob("*.o"))
    archives = sorted((BUILD / "tests" / "fuzz").glob("*.a")) + sorted(BUILD.glob("shared/*/*.a"))
    archives += sorted(BUILD.glob("hil_sim/*.a"))
    program = tmp_path / "soak"
    group = ["-Wl,--start-group", *map(str, archives), "-Wl,--end-group"]
    subprocess.run(
        ["clang++", str(tmp_path / "planted.o"), *map(str, objects), *group, "-ldl", "-lm", "-o", str(program)],
        check=True,
    )
    return program


@pytest.mark.nightly
def test_a_day_of_wraps_shows_nothing(folder: Path) -> None:
    done = jumps(folder / "soak", folder)
    assert done.returncode == 0, done.stdout
    figures = json.loads(next(line for line in done.stdout.splitlines() if "crossings" in line))
    assert figures["days"] >= 1.0
    assert figures["crossings"] == 41  # 86400 s / 2^31 us, and the day's end
    assert figures["distance_m"] > 1.0


PLANTED = {
    "a station whose silence is counted in 32 bits": (
        "firmware/app/link/stations.cpp",
        "now_us - heard_us <= timeout_us_);",
        "now_us - static_cast<uint32_t>(heard_us) <= timeout_us_);",
    ),
    "a budget that stands still after a wrap": (
        "firmware/app/link/link.cpp",
        "    refilled_us_ = now_us;",
        "    refilled_us_ = now_us;\n    budget_ = now_us > UINT32_MAX ? 0.0f : budget_;",
    ),
}


@pytest.mark.nightly
@pytest.mark.parametrize("bug", PLANTED)
def test_a_timer_that_does_not_survive_a_wrap_is_found(folder: Path, tmp_path: Path, bug: str) -> None:
    done = jumps(planted(tmp_path, *PLANTED[bug]), folder)
    assert done.returncode != 0
    assert "broken promise" in done.stdout


def test_what_is_not_flat_is_said() -> None:
    hour = {"overruns": 0, "i2c_errors": 0, "rx_errors": 0, "signing_refused": 0, "heap": 1000, "error_m_max": 0.004}
    soak.check_flat([hour] * 6)
    with pytest.raises(soak.SoakError, match="heap is not flat"):
        soak.check_flat([hour, hour, {**hour, "heap": 90_000}])
    with pytest.raises(soak.SoakError, match="error grew"):
        soak.check_flat([hour, hour, {**hour, "error_m_max": 0.02}])
    with pytest.raises(soak.SoakError, match="overruns is not 0"):
        soak.check_flat([hour, {**hour, "overruns": 1}])
