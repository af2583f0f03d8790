# SPDX-License-Identifier: MIT
"""The checks of the stop button and of what restarts leave alone: they can fail."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.image_file import read_image
from hil_sim.scenario import load_scenario
from image_check import latched_stops
from image_check.bench import Bench, CheckError, Context
from omniwheel.robots import find_robot_file

ROBOT = "three_wheel"
ERASED = 0xFF


def context(image: Path, robot: str = ROBOT, depth: str = "short") -> Context:
    return Context(read_image(image), load_scenario("stand", robot), depth=depth)


def test_a_robot_without_a_button_says_so(image: Path) -> None:
    assert latched_stops.stop_button(context(image)) == ["this robot has no stop button"]


def test_an_image_that_does_not_look_at_the_button_is_found(image: Path, tmp_path: Path) -> None:
    text = find_robot_file(ROBOT).read_text(encoding="utf-8")
    file = tmp_path / "three_wheel.toml"
    file.write_text(
        text.replace("output_enable_pin = 9", "output_enable_pin = 9\nstop_button_pin = 10"), encoding="utf-8"
    )
    with pytest.raises(CheckError, match="the motors have power 2 ms after the button opened"):
        latched_stops.stop_button(context(image, str(file)))


def test_a_stop_that_a_restart_lifts_is_found(image: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def forget(bench: Bench) -> None:
        bench.machine.storage = bytes([ERASED]) * len(bench.machine.storage)
        latched_stops.RESTARTS["watchdog"](bench)

    monkeypatch.setitem(latched_stops.RESTARTS, "power", forget)
    with pytest.raises(CheckError, match="in state disarmed after an emergency stop and a restart"):
        latched_stops.stop_outlives(context(image))


def test_a_robot_that_drives_on_after_a_restart_is_found(image: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(latched_stops.RESTARTS, "power", lambda bench: None)
    with pytest.raises(CheckError, match="a bridge has power after a restart"):
        latched_stops.never_arms(context(image))
