# SPDX-License-Identifier: MIT
"""Checks run in processes of their own: one that dies is reported as failed, with the cause, beside all others."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
from pathlib import Path

import pytest

from image_check import run
from image_check.bench import Context
from image_check.check import Check
from image_check.run import outcome_page, run_checks
from image_check.worker_processes import ProcessFailure, call_in_processes
from omniwheel.errors import FirmwareStartError
from tests.image.flashed import image_path
from tests.needs import need


def _act(what: int) -> int:
    if what == 1:
        faulthandler.disable()  # it would print the stack of a crash that is wanted
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == 2:
        os._exit(7)
    while what == 3:
        pass
    return 10 * what


def test_each_call_gives_its_result_or_the_cause_of_its_end() -> None:
    results = dict(call_in_processes(_act, [(0,), (1,), (2,), (4,)], 2))
    assert results[0] == 0
    assert results[1] == ProcessFailure("its process was ended by signal SIGSEGV")
    assert results[2] == ProcessFailure("its process ended by itself with exit code 7")
    assert results[3] == 40


def test_a_call_that_takes_too_long_is_ended() -> None:
    ((number, result),) = call_in_processes(_act, [(3,)], 1, limit_s=1)
    assert (number, result) == (0, ProcessFailure("it exceeded its limit of processor time"))


def _fine(_context: Context) -> list[str]:
    return ["fine"]


def _dies(_context: Context) -> list[str]:
    os._exit(9)


@pytest.mark.skipif(multiprocessing.get_start_method() != "fork", reason="the checks of this test are not imported")
def test_a_check_whose_process_dies_is_reported_as_failed_beside_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    need("image")
    checks = (Check("first", "fine", _fine), Check("second", "dies", _dies), Check("third", "fine", _fine))
    monkeypatch.setattr(run, "all_checks", lambda: checks)
    told: list[str] = []
    outcomes = run_checks(image_path(), "three_wheel", done=lambda outcome: told.append(outcome.name))
    assert [outcome.passed for outcome in outcomes] == [True, False, True]
    assert told == ["first", "second", "third"]
    assert "exit code 9" in outcomes[1].failure
    assert "exit code 9" in outcome_page(Path("x.elf"), "three_wheel", "ci", 1, outcomes)


def test_a_check_without_the_pcs_firmware_says_that_it_could_not_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def lacks(_context: Context) -> list[str]:
        raise FirmwareStartError("the firmware did not start")

    need("image")
    monkeypatch.setattr(run, "all_checks", lambda: (Check("loop", "compares", lacks),))
    outcome = run.run_one(image_path(), "three_wheel", "ci", 1, "loop")
    assert outcome.failure == f"{run.NOT_RUN}the firmware did not start"
