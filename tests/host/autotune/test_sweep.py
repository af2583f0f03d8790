# SPDX-License-Identifier: MIT
"""Autotune's own sweep: what it shows of a robot whose true loop is known, and when it shows nothing."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from hil_sim.studies.autotune_robot import waiting_robot
from hil_sim.studies.drawn_robots import draw_robot
from omniwheel import Robot
from omniwheel.autotune import sweep as sweep_module
from omniwheel.autotune.sweep import ENOUGH, MOST_SWEEPS, sweep
from omniwheel.experiments.response import INTERVAL, Response
from omniwheel.tuning import ExperimentError
from omniwheel.wheel_loop import loaded, loop_of, motor_of


@pytest.mark.full
def test_a_sweep_shows_the_margins_that_the_true_robot_has() -> None:
    """The robot file is wrong by up to 30 %. Robot 26 hardly slips, so that its true motor tells the loop."""
    drawn = draw_robot(26)
    truth = drawn.truth.parameter_values()
    turning = truth["MOT_J"] + truth["INERTIA"] * (truth["WHEEL_RADIUS"] / truth["WHEEL_DIST"]) ** 2 / truth["WHEELS"]
    with waiting_robot(drawn) as (robot, _):
        values = dict(robot.parameters.items())
        swept = sweep(robot, 2.0, lambda _: None)
        assert not robot.status.armed
    true = loop_of(values, loaded(motor_of(truth), turning)).margins(values["WS_P"], values["WS_I"])
    assert swept.margins is not None, swept.why
    assert swept.margins.distance == pytest.approx(true.distance, rel=0.1)
    assert swept.margins.phase_rad == pytest.approx(true.phase_rad, rel=0.1)


def a_robot(state: str = "disarmed", url: str = "/dev/ttyACM0,115200") -> Robot:
    return cast(Robot, SimpleNamespace(url=url, parameters={"WHEELS": 3.0}, status=SimpleNamespace(state=state)))


def test_a_slow_radio_carries_no_sweep() -> None:
    assert "too slow" in sweep(a_robot(url="/dev/ttyUSB0,9600"), 1.0, lambda _: None).why


@pytest.mark.parametrize("state", ["disarmed", "failsafe", "estop"])
def test_a_sweep_that_fails_shows_nothing_but_a_stop_is_never_hidden(
    state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise ExperimentError("the wheels slip at 0.1 m/s")

    monkeypatch.setattr(sweep_module, "wheel_chirp", fails)
    if state == "disarmed":
        assert sweep(a_robot(state), 1.0, lambda _: None).why == "the wheels slip at 0.1 m/s"
        return
    with pytest.raises(ExperimentError):
        sweep(a_robot(state), 1.0, lambda _: None)


@pytest.mark.parametrize(("doubt", "sweeps", "shown"), [(0.05, 1, True), (0.15, 4, True), (0.3, 4, False)])
def test_sweeps_are_repeated_while_the_loop_is_not_known_well_enough(
    doubt: float, sweeps: int, shown: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[int] = []
    frequency = np.geomspace(1.0, 100.0, 200)
    loop = np.asarray(10.0 / (1j * frequency), dtype=np.complex128)
    spread = np.full(200, doubt / INTERVAL)

    def chirp(*_: object) -> SimpleNamespace:
        done.append(1)
        return SimpleNamespace(settings={}, burst=None)

    monkeypatch.setattr(sweep_module, "wheel_chirp", chirp)
    monkeypatch.setattr(sweep_module, "signals_of", lambda _: None)
    monkeypatch.setattr(sweep_module, "WheelSetup", lambda *_: None)
    monkeypatch.setattr(sweep_module, "_opened", lambda *_: Response(frequency, loop, np.ones(200), spread))
    found = sweep(a_robot(), 1.0, lambda _: None)
    assert len(done) == sweeps <= MOST_SWEEPS
    assert (found.margins is not None) is shown
    if found.margins is not None:
        assert found.margins.phase_rad == pytest.approx(math.pi / 2)
    else:
        assert "30%" in found.why
    assert ENOUGH < 0.15
