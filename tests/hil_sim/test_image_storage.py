# SPDX-License-Identifier: MIT
"""The file of an emulated Teensy's parameter memory: whole, held against others, and an error where it cannot be."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from emulated_teensy.machine import STORAGE_SIZE
from hil_sim.image_process import StorageFile
from omniwheel import FirmwareProcess
from omniwheel.errors import FirmwareStartError, OutputFileError

OLD, NEW = b"\x01" * STORAGE_SIZE, b"\x02" * STORAGE_SIZE


def test_what_was_written_is_read_and_held_all_the_time(tmp_path: Path) -> None:
    path = tmp_path / "memory"
    storage = StorageFile(path)
    assert storage.read() is None
    for content in (OLD, NEW):
        storage.write(content)
        with pytest.raises(FirmwareStartError, match="another firmware uses it"):
            StorageFile(path)
        with pytest.raises(FirmwareStartError, match="another firmware uses it"), FirmwareProcess(storage=path):
            pass
    storage.close()
    again = StorageFile(path)
    assert again.read() == NEW
    again.close()
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_leaves_the_memory_that_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "memory"
    path.write_bytes(OLD)
    storage = StorageFile(path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        with pytest.raises(OutputFileError):
            storage.write(NEW)
    assert storage.read() == OLD
    storage.close()


def test_a_file_of_another_size_is_refused(tmp_path: Path) -> None:
    (tmp_path / "memory").write_bytes(b"short")
    with pytest.raises(FirmwareStartError, match="do not fit the parameter memory"):
        StorageFile(tmp_path / "memory").read()


@pytest.mark.full
def test_the_process_ends_with_its_standard_input() -> None:
    code = (
        "import os, threading; from hil_sim.image_process import end_with_stdin; ended = threading.Event();"
        "end_with_stdin(ended.set); print('ready', flush=True); os._exit(0 if ended.wait(60.0) else 1)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        assert process.poll() is None
        process.stdin.close()
        assert process.wait(60.0) == 0
