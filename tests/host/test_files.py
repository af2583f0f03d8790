# SPDX-License-Identifier: MIT
"""Writing files: whole or not at all, nothing left behind, links and rights as before; recordings while they grow."""

from __future__ import annotations

import errno
import os
import resource
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from omni.cli import app
from omniwheel import files, signing
from omniwheel.errors import OutputFileError, OutputPathError
from omniwheel.growing_file import FLUSH_S, GrowingFile
from omniwheel.tlog import TlogWriter, whole_records
from tests.waiting import wait_until

FRAME = b"\xfd\x03\x00\x00\x01\xff\xbe\x00\x00\x00abcXY"


def test_a_file_is_replaced_whole_with_its_rights_and_through_a_link(tmp_path: Path) -> None:
    target, link = tmp_path / "file", tmp_path / "link"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    files.write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert sorted(tmp_path.iterdir()) == [target, link]


def test_a_block_that_raises_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "file"
    target.write_text("old")
    with pytest.raises(KeyboardInterrupt), files.replaced(target) as file:  # noqa: PT012
        file.write(b"half of the n")
        raise KeyboardInterrupt
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_new_file_is_never_written_over_another(tmp_path: Path) -> None:
    target = tmp_path / "file"
    files.create(target, b"first", 0o600)
    with pytest.raises(FileExistsError):
        files.create(target, b"second")
    assert target.read_bytes() == b"first"
    assert stat.S_IMODE(target.stat().st_mode) == 0o600
    assert list(tmp_path.iterdir()) == [target]


def test_where_there_are_no_hard_links_a_new_file_is_made_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EPERM, "no links here")

    monkeypatch.setattr(os, "link", refuse)
    files.create(tmp_path / "file", b"first")
    with pytest.raises(FileExistsError):
        files.create(tmp_path / "file", b"second")
    assert (tmp_path / "file").read_bytes() == b"first"


def test_what_is_no_file_is_written_as_it_is(tmp_path: Path) -> None:
    files.write_text("/dev/null", "gone")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
    with pytest.raises(OutputFileError, match="No space left"):
        files.write_text("/dev/full", "too much")


@pytest.mark.parametrize("place", ["absent/file", ".", "file/below"])
def test_a_bad_place_is_bad_input(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("a file")
    with pytest.raises(OutputPathError, match="cannot write") as caught:
        files.write_text(tmp_path / place, "text")
    assert caught.value.exit_code == 2


def test_a_picture_of_no_known_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputPathError, match="docx"):
        files.save_picture(Figure(), tmp_path / "picture.docx")
    files.save_picture(Figure(), tmp_path / "picture.svg")
    assert (tmp_path / "picture.svg").read_text().rstrip().endswith("</svg>")


def test_a_file_size_limit_keeps_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "file"
    target.write_text("old")
    code = f"from omniwheel import files; files.write_text({str(target)!r}, 'n' * 10000)"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    done = subprocess.run(
        [sys.executable, "-c", code],
        preexec_fn=limit,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert "OutputFileError" in done.stderr
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.full
def test_results_on_a_full_standard_output_are_an_error_and_not_a_traceback() -> None:
    command = [sys.executable, "-c", "from omni.cli import main; main()", "params", "list", "--presets", "--json"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert "No space left" in done.stderr


def test_a_key_that_cannot_be_written_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    result = CliRunner().invoke(app, ["radio", "--new-key", str(tmp_path / "robot.key")])
    assert result.exit_code == 1
    assert "the disk is full" in result.output
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OutputFileError):
        signing.new_key_file(tmp_path / "robot.key")


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def test_a_recording_is_on_the_disk_after_a_second(tmp_path: Path) -> None:
    clock = Clock()
    file = GrowingFile(tmp_path / "log", whole_records, clock)
    file.write(b"first")
    clock.now_s = FLUSH_S
    file.flush_if_due()
    assert (tmp_path / "log").read_bytes() == b"first"
    file.write(b"second")
    clock.now_s = 2.0 * FLUSH_S
    file.write(b"third")
    assert (tmp_path / "log").read_bytes() == b"firstsecondthird"
    file.close()


def test_a_full_disk_leaves_whole_records_and_is_told_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = TlogWriter(tmp_path / "log.tlog", lambda: 1)
    record = (1).to_bytes(8, "big") + FRAME
    room = 2 * len(record) + 5
    real = os.write

    def write(descriptor: int, data: bytes) -> int:
        left = room - os.fstat(descriptor).st_size
        if left <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(descriptor, data[:left])

    for _ in range(4):
        log.write(FRAME)
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", write)
        with pytest.raises(OutputFileError, match="what was recorded before is kept"):
            log.close()
    assert (tmp_path / "log.tlog").read_bytes() == 2 * record
    log.write(FRAME)  # who stops a robot over this connection must not be hindered


def test_a_full_disk_keeps_the_recording_that_was_to_be_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    old = tmp_path / "old.tlog"
    for call in ("write", "replace"):
        old.write_bytes(b"old")
        log = TlogWriter(old, lambda: 1)
        log.write(FRAME)
        with monkeypatch.context() as patch:
            patch.setattr(os, call, fail)
            with pytest.raises(OutputFileError):
                log.close()
        assert old.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [old]


def test_a_recording_goes_into_a_pipe_too(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reading = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with TlogWriter(pipe, lambda: 1) as log:
        log.write(FRAME)
    assert os.read(reading, 1000) == (1).to_bytes(8, "big") + FRAME
    os.close(reading)
    assert pipe.exists()


def test_a_recording_without_a_record_is_none_and_keeps_what_was_there(tmp_path: Path) -> None:
    TlogWriter(tmp_path / "new.tlog").close()
    assert not (tmp_path / "new.tlog").exists()
    (tmp_path / "old.tlog").write_bytes(b"old")
    TlogWriter(tmp_path / "old.tlog").close()
    assert (tmp_path / "old.tlog").read_bytes() == b"old"
    with TlogWriter(tmp_path / "old.tlog", lambda: 1) as log:
        log.write(FRAME)
    assert (tmp_path / "old.tlog").read_bytes() == (1).to_bytes(8, "big") + FRAME


@pytest.mark.parametrize("cut", range(1, 24))
def test_whole_records_are_counted(cut: int) -> None:
    record = (1).to_bytes(8, "big") + FRAME
    signed = (1).to_bytes(8, "big") + FRAME[:2] + b"\x01" + FRAME[3:] + bytes(13)
    for data in (record, signed):
        assert whole_records(data * 2) == 2 * len(data)
        assert whole_records((data * 2)[:-cut]) in (len(data), 0)
        assert whole_records(data + data[: len(data) - min(cut, len(data) - 1)]) == len(data)


@pytest.mark.full
def test_a_recording_that_is_killed_has_lost_a_second_at_most(url: str, tmp_path: Path) -> None:
    path = tmp_path / "killed.tlog"
    command = [str(Path(sys.executable).with_name("omni")), "record", str(path), "--link", url]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:

        def begun() -> bool:
            assert process.poll() is None
            return path.exists() and path.stat().st_size > 0

        wait_until(begun, "nothing is recorded")
        process.send_signal(signal.SIGKILL)
        process.wait(60.0)
    data = path.read_bytes()
    assert whole_records(data) == len(data) > 0
