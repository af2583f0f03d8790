# SPDX-License-Identifier: MIT
"""An image is known by what it puts into flash memory, but for its commit, and by what checks it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from emulated_teensy.image_file import FLASH_BASE, read_image
from tests import kept
from tests.image import flashed
from tests.image_build import kept_check
from tests.needs import need

IMAGE = flashed.image_path()


@pytest.fixture
def elf_file() -> Path:
    need("image")
    return IMAGE


def changed(elf_file: Path, symbol: str, folder: Path) -> Path:
    """Return a copy of an image with another first byte of an object or a function."""
    image = read_image(elf_file)
    address = image.symbols[symbol] & ~1
    (segment,) = [s for s in image.elf.iter_segments("PT_LOAD") if 0 <= address - s["p_vaddr"] < s["p_filesz"]]
    content = bytearray(elf_file.read_bytes())
    content[segment["p_offset"] + address - segment["p_vaddr"]] ^= 1
    copy = folder / f"{symbol}.elf"
    copy.write_bytes(content)
    return copy


def test_every_byte_of_an_image_counts_but_those_of_its_commit(elf_file: Path, tmp_path: Path) -> None:
    before = kept_check.image_content(elf_file)
    another_commit = changed(elf_file, kept_check.BUILD_ID, tmp_path)
    assert read_image(another_commit).flash != read_image(elf_file).flash
    assert kept_check.image_content(another_commit) == before
    assert kept_check.image_content(changed(elf_file, "omni_robot_tick", tmp_path)) != before


def test_the_bytes_of_a_variable_are_found_where_they_lie_in_flash_memory(elf_file: Path) -> None:
    image = read_image(elf_file)
    begin = kept_check.load_offset(image, image.symbols[kept_check.BUILD_ID])
    commit = int.from_bytes(image.flash[begin : begin + 8], "little")
    header = next((elf_file.parent / "generated").rglob("version_gen.h"), None)
    if header is not None:
        assert f"OMNI_GIT_HASH UINT64_C({commit:#018x})" in header.read_text()
    with pytest.raises(ValueError, match="loads nothing"):
        kept_check.load_offset(image, FLASH_BASE - 4096)


def test_checks_and_simulated_world_are_among_what_counts() -> None:
    names = {path.relative_to(kept.ROOT).as_posix() for path in kept_check.python_code()}
    assert {
        "image_check/storage.py",
        "emulated_teensy/machine.py",
        "host/omniwheel/robot.py",
        "tests/image/static/stack.py",
    } <= names
    assert not {name for name in names if name.startswith(("host/omni/cli", "host/omni/studio"))}


def test_a_command_runs_until_it_has_passed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_check, "image_content", lambda path: path.read_bytes())
    monkeypatch.setattr(kept_check, "check_code", lambda: "")
    monkeypatch.setenv(kept.VARIABLE, kept.WRITE)
    for function in (kept.has_passed, kept.note_passed):
        monkeypatch.setattr(function, "__defaults__", (tmp_path / "kept.txt",))
    image, status, runs = tmp_path / "image", tmp_path / "status", tmp_path / "runs"
    program = f"open({str(runs)!r}, 'a').write('x'); raise SystemExit(int(open({str(status)!r}).read()))"
    monkeypatch.setattr(sys, "argv", ["", "a check", str(image), "--", sys.executable, "-c", program])
    expected = (("one", 1, 1, "x"), ("one", 0, 0, "xx"), ("one", 1, 0, "xx"), ("two", 1, 1, "xxx"))
    for content, ends_with, code, ran in expected:
        image.write_text(content)
        status.write_text(str(ends_with))
        assert kept_check.main() == code
        assert runs.read_text() == ran


def test_what_python_compiles_and_keeps_beside_its_sources_does_not_count() -> None:
    compiled = kept.ROOT / "hil_sim" / "__pycache__" / "none.cpython-0.pyc"
    before = kept_check.check_code()
    compiled.parent.mkdir(exist_ok=True)
    compiled.write_bytes(b"\xa7")
    try:
        assert kept_check.check_code() == before
    finally:
        compiled.unlink()
