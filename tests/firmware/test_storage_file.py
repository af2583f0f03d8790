# SPDX-License-Identifier: MIT
"""The file behind ``--storage``: a full disk, a size limit, two processes. A store that failed never comes back."""

from __future__ import annotations

import os
import resource
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from omniwheel import FirmwareProcess
from omniwheel.emulated_firmware import EmulatedFirmware
from omniwheel.paths import firmware_path
from tests.arm import need_emulated_firmware
from tests.faults.shim import BROKEN_ONCE, FAILURES, FULL, Failure, environment, need_shim
from tests.firmware.client import WAIT_S, Client, Firmware, connect, firmware, lockstep_robot, mav, storage_arguments

STORAGE = mav.MAV_CMD_PREFLIGHT_STORAGE
LOAD, SAVE = 0, 1
NAME = "ISMC_LAM_XY"
OLD, NEW = 7.0, 8.0
ACCEPTED, FAILED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_FAILED
CALLS_AT_START = 1
"""The file is opened."""
CALLS_OF_A_STORE = 4
"""Open, write, sync, rename."""


def store(robot: Client, value: float) -> int:
    assert robot.set(NAME, value) == value
    return robot.command(STORAGE, SAVE)


def loaded(robot: Client) -> float:
    assert robot.command(STORAGE, LOAD) == ACCEPTED
    return robot.get(NAME)


@contextmanager
def firmware_client(running: EmulatedFirmware) -> Iterator[Client]:
    client = connect(Firmware(None, list(running.links), running))
    try:
        yield client
    finally:
        client.socket.close()


@pytest.fixture
def memory(tmp_path: Path) -> Path:
    """Return a storage file that holds OLD."""
    path = tmp_path / "disk" / "memory"
    path.parent.mkdir()
    with lockstep_robot(*storage_arguments(path)) as robot:
        assert store(robot, OLD) == ACCEPTED
    return path


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: failure.name)
@pytest.mark.parametrize("call", range(1, CALLS_OF_A_STORE + 1))
def test_a_store_that_failed_is_never_what_a_later_load_yields(
    memory: Path, monkeypatch: pytest.MonkeyPatch, failure: Failure, call: int
) -> None:
    need_shim()
    with monkeypatch.context() as patch:
        for name, value in environment(memory.parent, CALLS_AT_START + call, failure).items():
            patch.setenv(name, value)
        with lockstep_robot(*storage_arguments(memory)) as robot:
            assert store(robot, NEW) == FAILED
            assert any("nothing stored" in text for text in robot.texts())
            assert loaded(robot) == OLD
    assert list(memory.parent.iterdir()) == [memory]
    with lockstep_robot(*storage_arguments(memory)) as robot:
        assert robot.get(NAME) == OLD


def test_a_store_after_one_that_failed_works(memory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need_shim()
    with monkeypatch.context() as patch:
        for name, value in environment(memory.parent, CALLS_AT_START + 1, BROKEN_ONCE).items():
            patch.setenv(name, value)
        with lockstep_robot(*storage_arguments(memory)) as robot:
            assert store(robot, NEW) == FAILED
            assert store(robot, NEW) == ACCEPTED
    with lockstep_robot(*storage_arguments(memory)) as robot:
        assert robot.get(NAME) == NEW


def test_a_folder_that_cannot_be_synced_does_not_undo_a_store(memory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need_shim()
    with monkeypatch.context() as patch:
        for name, value in environment(memory.parent, CALLS_AT_START + CALLS_OF_A_STORE + 1, BROKEN_ONCE).items():
            patch.setenv(name, value)
        with lockstep_robot(*storage_arguments(memory)) as robot:
            assert store(robot, NEW) == ACCEPTED
            assert loaded(robot) == NEW
    with lockstep_robot(*storage_arguments(memory)) as robot:
        assert robot.get(NAME) == NEW


def test_a_link_to_the_file_stays_one(memory: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(memory)
    memory.chmod(0o600)
    with lockstep_robot(*storage_arguments(link)) as robot:
        assert store(robot, NEW) == ACCEPTED
    assert link.is_symlink()
    assert memory.stat().st_mode & 0o777 == 0o600
    with lockstep_robot(*storage_arguments(memory)) as robot:
        assert robot.get(NAME) == NEW


def test_a_file_size_limit_is_a_store_that_fails_and_not_the_end(memory: Path) -> None:
    """SIGXFSZ kills by default."""
    with firmware("--lockstep", *storage_arguments(memory)) as running:
        assert running.process.pid > 0
        resource.prlimit(running.process.pid, resource.RLIMIT_FSIZE, (1000, 1000))
        robot = connect(running)
        assert store(robot, NEW) == FAILED
        assert loaded(robot) == OLD
        robot.socket.close()
        assert running.process.poll() is None
    with lockstep_robot(*storage_arguments(memory)) as robot:
        assert robot.get(NAME) == OLD


def test_a_second_process_on_the_same_file_is_refused_and_the_first_keeps_its_set(memory: Path) -> None:
    with lockstep_robot(*storage_arguments(memory)) as robot:
        command = [str(firmware_path()), "--link", "tcp:127.0.0.1:0", *storage_arguments(memory)]
        second = subprocess.run(command, capture_output=True, text=True, timeout=WAIT_S, check=False)
        assert second.returncode == 2
        assert "another firmware uses it" in second.stderr
        assert store(robot, NEW) == ACCEPTED
    with lockstep_robot(*storage_arguments(memory)) as robot:
        assert robot.get(NAME) == NEW


def test_a_killed_process_leaves_no_lock(memory: Path) -> None:
    with firmware("--lockstep", *storage_arguments(memory)) as running:
        running.process.kill()
        running.process.wait(WAIT_S)
    with lockstep_robot(*storage_arguments(memory)) as robot:
        assert robot.get(NAME) == OLD


def test_it_ends_with_its_standard_input_if_it_is_told_to() -> None:
    for words, ends in (["--end-with-stdin"], True), ([], False):
        reading, writing = os.pipe()
        command = [str(firmware_path()), "--link", "tcp:127.0.0.1:0", *words]
        with subprocess.Popen(command, stdin=reading, stdout=subprocess.PIPE) as process:
            os.close(reading)
            assert process.stdout is not None
            assert process.stdout.readline()
            os.write(writing, b"what is written there does not matter")
            os.close(writing)
            if ends:
                assert process.wait(WAIT_S) == 0
            else:
                with pytest.raises(subprocess.TimeoutExpired):
                    process.wait(0.5)
                process.terminate()


@pytest.mark.full
def test_the_emulated_firmware_forgets_a_store_that_failed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need_shim()
    need_emulated_firmware()
    path = tmp_path / "disk" / "memory"
    path.parent.mkdir()
    with EmulatedFirmware(storage=path) as running, firmware_client(running) as robot:
        assert store(robot, OLD) == ACCEPTED
    with monkeypatch.context() as patch:
        for name, value in environment(path.parent, 1, FULL).items():
            patch.setenv(name, value)
        with EmulatedFirmware(storage=path) as running, firmware_client(running) as robot:
            patch.undo()
            assert store(robot, NEW) == FAILED
            assert loaded(robot) == OLD
    with EmulatedFirmware(storage=path) as running, firmware_client(running) as robot:
        assert robot.get(NAME) == OLD


@pytest.mark.parametrize("kind", [FirmwareProcess, EmulatedFirmware])
def test_two_of_any_kind_do_not_share_a_file(tmp_path: Path, kind: type[FirmwareProcess | EmulatedFirmware]) -> None:
    if kind is EmulatedFirmware:
        need_emulated_firmware()
    path = tmp_path / "memory"
    with kind(storage=path), pytest.raises(Exception, match="another firmware uses it"), FirmwareProcess(storage=path):
        pass
    with FirmwareProcess(storage=path), pytest.raises(Exception, match="another firmware uses it"), kind(storage=path):
        pass
