# SPDX-License-Identifier: MIT
"""One run in C: the figures it sums up tick by tick are those that metrics.py computes from its record."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil_sim import metrics
from hil_sim.core import robot_config
from hil_sim.record import Record
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omniwheel._core import ffi, lib

SECONDS = {"comparison": 33, "four_wheel": 8, "fault_i2c_nack": 8, "fault_pose_jump": 14, "original_law": 5}


class CRun:
    """A run of a scenario's robot and world, driven by hand."""

    def __init__(self, name: str) -> None:
        scenario = replace(load_scenario(name), seed=7)
        self.wheels = scenario.robot.wheels
        config = robot_config(scenario.parameter_values(), scenario.robot.table, 0)
        self.c = ffi.new("hil_run_t *")
        world = new_world(scenario)
        assert lib.hil_run_init(self.c, ffi.addressof(world.c, "config"), config, ffi.NULL, 0) == lib.HIL_OK

    def start(self) -> None:
        """Drive the trajectory from the next tick on."""
        lib.hil_run_advance(self.c, 1)
        self.c.inputs.pose.x, self.c.inputs.pose.y, self.c.inputs.pose.theta = list(self.c.world.pose)
        self.c.inputs.events = lib.OMNI_EVENT_SET_POSE
        lib.hil_run_advance(self.c, 499)
        assert lib.hil_run_start_trajectory(self.c) == lib.OMNI_OK
        self.c.inputs.events |= lib.OMNI_EVENT_ARM

    def figures(self) -> Any:
        """Return what has been measured."""
        figures = ffi.new("hil_figures_t *")
        lib.hil_figures_from_metrics(figures, ffi.addressof(self.c, "metrics"), self.wheels)
        return figures


def state(run: CRun) -> list[bytes]:
    return [bytes(ffi.buffer(ffi.addressof(run.c, part))) for part in ("world", "outputs", "metrics")]


@pytest.mark.parametrize("name", SECONDS)
def test_figures_are_those_of_the_record(name: str) -> None:
    run, record = CRun(name), Record(40_000)
    run.c.record = record.c
    run.start()
    lib.hil_run_advance(run.c, SECONDS[name] * 1000)
    rows, found = record.samples, run.figures()
    tracking, estimate = metrics.tracking_rmse(rows), metrics.estimator_rmse(rows)
    effort = metrics.effort(rows, run.wheels)
    path = rows[metrics.on_path(rows)]
    distance = np.hypot(*(path["truth"] - path["reference"])[:, :2].T)
    expected = {
        **metrics.as_dict(tracking),
        **{f"estimate_{key}": value for key, value in metrics.as_dict(estimate).items()},
        **metrics.as_dict(effort),
        "max_position_m": distance.max(),
        "max_theta_rad": np.abs(metrics.pose_error(path)[:, 2]).max(),
        "completed": float(np.any(rows["phase"] == metrics.PHASE_DONE)),
    }
    last = rows[(rows["state"] == metrics.STATE_ARMED) & (rows["phase"] >= metrics.PHASE_PATH)][-1:]
    expected["final_position_m"] = float(np.hypot(*(last["truth"] - last["reference"])[0, :2]))
    expected["final_theta_rad"] = float(np.abs(metrics.pose_error(last)[0, 2]))
    for key, value in expected.items():
        assert getattr(found, key) == pytest.approx(value, rel=1e-12, abs=1e-15), key
    armed = np.flatnonzero(rows["state"] == metrics.STATE_ARMED)[0]
    assert found.faults == np.bitwise_or.reduce(rows["faults"][armed:])
    assert run.c.metrics.path_ticks == len(path)
    assert run.c.metrics.milestones.path_start_us == round(path["time_s"][0] * 1e6)


def test_the_fixes_of_a_good_filter_have_the_nis_of_their_dimension() -> None:
    run = CRun("demo")
    run.start()
    lib.hil_run_advance(run.c, 20_000)
    assert run.c.metrics.fixes == pytest.approx(run.c.metrics.path_ticks / 20, rel=0.01)
    assert run.figures().nis == pytest.approx(3.0, rel=0.2)


def test_a_run_that_never_drives_has_no_numbers_but_its_faults() -> None:
    run = CRun("fault_battery_sag")
    lib.hil_run_advance(run.c, 12_000)
    found = run.figures()
    names = [name for name, field in ffi.typeof("hil_figures_t").fields if field.type.cname == "double"]
    assert all(np.isnan(getattr(found, name)) for name in names if name != "completed")
    assert found.completed == 0.0
    assert found.faults & lib.OMNI_FAULT_BATTERY


def test_measuring_changes_nothing() -> None:
    run = CRun("comparison")
    run.start()
    world, robot = ffi.new("hil_world_t *", run.c.world), ffi.new("omni_robot_t *", run.c.robot)
    inputs, outputs = ffi.new("omni_inputs_t *", run.c.inputs), ffi.new("omni_outputs_t *", run.c.outputs)
    lib.hil_run_in_process(world, robot, inputs, outputs, 900, ffi.NULL)
    lib.hil_run_advance(run.c, 900)
    assert bytes(ffi.buffer(world)) == state(run)[0]
    assert bytes(ffi.buffer(outputs)) == state(run)[1]
