# SPDX-License-Identifier: MIT
"""What `make release` writes, with a build that takes no compiler."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import pytest

from image_check.run import Outcome
from omni.cli import release
from omniwheel import __version__
from omniwheel.errors import HexFileError
from omniwheel.flashing import source
from omniwheel.flashing.source import Build
from omniwheel.robots import robot_names
from tests.host.hex_files import teensy_program, write_hex


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Build]:
    """Return what is "built" for each robot; change it to build something else."""
    builds = {}
    for robot in robot_names():
        folder = tmp_path / "build" / robot
        folder.mkdir(parents=True)
        (folder / "firmware.elf").write_text(robot)
        image = write_hex(folder / "firmware.hex", teensy_program())
        builds[robot] = Build(folder / "firmware.elf", image, "0123456789abcdef")
    monkeypatch.setattr(release, "build", lambda robot: builds[robot])
    monkeypatch.setattr(
        "image_check.run.run_checks", lambda *_, **__: [Outcome("boots", "it boots", ("0.3 s",), "", 0.1)]
    )
    return builds


def test_every_robot_has_its_files_and_all_are_in_the_checksums(tmp_path: Path, made: dict[str, Build]) -> None:
    out = tmp_path / "dist"
    out.mkdir()
    wheel = out / f"omniwheel-{__version__}-cp310-abi3-linux_x86_64.whl"
    wheel.write_text("wheel")
    (out / "omniwheel-0.0.0-old.whl").write_text("of another version")
    assert release.main(["--out", str(out)]) == 0
    wanted = {f"omniwheel-{__version__}-{robot}.{kind}" for robot in made for kind in ("hex", "elf", "check.md")}
    lines = (out / "SHA256SUMS").read_text().splitlines()
    sums = {name: digest for digest, name in (line.split("  ") for line in lines)}
    assert sums.keys() == wanted | {wheel.name}
    for name, digest in sums.items():
        assert hashlib.sha256((out / name).read_bytes()).hexdigest() == digest
    report = (out / f"omniwheel-{__version__}-four_wheel.check.md").read_text()
    assert "commit 0123456789abcdef\n" in report
    assert sums[f"omniwheel-{__version__}-four_wheel.hex"] in report


def test_the_checks_report_is_in_the_release_and_a_failure_ends_it(
    tmp_path: Path, made: dict[str, Build], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run_checks(image: Path, robot: str, *, depth: str, done: Callable[[Outcome], None]) -> list[Outcome]:
        return [Outcome("boots", f"at depth {depth}", ("0.3 s",), failure, 0.1)]

    failure = ""
    monkeypatch.setattr("image_check.run.run_checks", run_checks)
    assert release.main(["--out", str(tmp_path)]) == 0
    report = (tmp_path / f"omniwheel-{__version__}-three_wheel.check.md").read_text()
    assert "| boots | at depth ci | 0.3 s |" in report
    failure = "it does not"
    assert release.main(["--out", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert "boots" in said
    assert "--skip-check" not in said
    assert not (tmp_path / "SHA256SUMS").exists()


def test_a_changed_work_tree_is_no_release_unless_it_says_so(
    tmp_path: Path, made: dict[str, Build], capsys: pytest.CaptureFixture[str]
) -> None:
    old = made["four_wheel"]
    made["four_wheel"] = Build(old.elf, old.hex, old.git_hash, changed=True)
    assert release.main(["--out", str(tmp_path)]) == 1
    assert "ARGS=--changed" in capsys.readouterr().err
    assert release.main(["--out", str(tmp_path), "--changed"]) == 0
    assert ", changed" in (tmp_path / f"omniwheel-{__version__}-four_wheel.check.md").read_text()


def test_an_image_that_is_no_teensys_is_no_release(tmp_path: Path, made: dict[str, Build]) -> None:
    write_hex(made["three_wheel"].hex, teensy_program(chip_bytes=8 << 20))
    with pytest.raises(HexFileError):
        release.release(tmp_path, changed=False, depth="ci")


def test_the_commit_and_its_state_are_read_from_the_build() -> None:
    header = '#define OMNI_GIT_HASH_STRING "0123456789abcdef"\n#define OMNI_GIT_DIRTY {}\n'
    assert source._version(header.format(0)) == ("0123456789abcdef", False)
    assert source._version(header.format(1)) == ("0123456789abcdef", True)
    assert source._version("") == ("", False)
