# SPDX-License-Identifier: MIT
"""docs/how-to-add/sensor.md, followed word by word, gives a spin sensor: in a process, by link, in lanes, on a chip."""

from __future__ import annotations

import ctypes
import json
import math
from typing import Any

from omniwheel.robots import parameter_table
from tests.native import ROOT, build_library
from tests.recipes.drive import OWN_PACKAGES, run_program, scenario
from tests.recipes.recipe import Scratch

SCENARIO = scenario('TRJ_TYPE = "circle"\nTRJ_PERIOD = 8.0', more="[world]\nspin_sd_rad_s = SPIN_SD\nslip_max = 0.1")
"""A circle with slipping wheels and no pose fixes: the heading comes from wheels and gyro alone."""

_RUNS = (
    OWN_PACKAGES
    + """
import numpy as np
from hil_sim import core
from hil_sim.hil import run_hil
from hil_sim.runs import faults_seen, new_world, run_in_process
from hil_sim.scenario import load_scenario
from omniwheel._core import ffi, lib
def scenario(sd):
    path = Path(sys.argv[2])
    path.write_text(sys.argv[3].replace("SPIN_SD", str(sd)), encoding="utf-8")
    return load_scenario(str(path))
def look(way, sd):
    run = (run_hil if way == "link" else run_in_process)(scenario(sd))
    wrong = run.record["estimate"][:, 2] - run.record["truth"][:, 2]
    wrong = np.unwrap(wrong) - wrong[0]
    return {"heading_rad": float(np.abs(wrong).max()), "per_tick_rad": float(np.diff(wrong).std()),
            "faults": faults_seen(run)[0], "done": run.done}
def eight(lanes):
    plan = scenario(0.5)
    config = core.robot_config(plan.parameter_values(), plan.robot.table, 0)
    runs, why = ffi.new("hil_run_t[8]"), ffi.new("char[]", 160)
    each = ffi.new("hil_run_t *[8]", [ffi.addressof(runs, i) for i in range(8)])
    for seed, run in enumerate(each):
        world = new_world(plan.with_seed(seed)).c
        assert lib.hil_run_init(run, ffi.addressof(world, "config"), config, why, len(why)) == lib.HIL_OK
    assert not lanes or lib.hil_lanes_advance(each, 100) == 100
    for run in each:
        lib.hil_run_advance(run, 0 if lanes else 100)
    return [[run.inputs.spin_rad_s, run.inputs.spin_valid, run.robot.estimator.pose_ekf.pose.theta] for run in each]
found = {f"{way} {sd}": look(way, sd) for way in ("process", "link") for sd in (0.0, 0.01, 0.5)}
print(json.dumps(found | {"lanes": eight(True), "alone": eight(False)}))
"""
)

_CONVERTER = """
#include <Arduino.h>
#include "app/base/board.h"
volatile uint32_t ADC2_HC0 = 0x1F, ADC2_HS, ADC2_R0;
extern "C" const uint8_t pin_to_channel[28] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
                                               7, 8, 12, 11, 6, 5, 15, 0, 13, 14, 1, 2, 128 + 3, 128 + 4};
void analogReadResolution(unsigned) {}
int analogRead(uint8_t) { return 0; }
static omni::Board board;
extern "C" void begin() { board.use_teensy40(); }
extern "C" uint32_t converting() { return ADC2_HC0; }
extern "C" void converted(uint32_t steps) { ADC2_R0 = steps; ADC2_HS = ADC_HS_COCO0; ADC2_HC0 = 0x1F; }
extern "C" void taken() { ADC2_HS = 0; }
extern "C" unsigned read_spin(float *rad_s) { return board.spin(rad_s); }
"""

PERIOD_S, SPIN_SD = 1e-3, 0.01
Q_THETA = parameter_table()["EKF_Q_TH"].default ** 2 * PERIOD_S
"""The tick, the noise that the page's measurement expects, and the filter's own of the heading in a tick."""


def check(copy: Scratch) -> None:
    """It helps where wheels slip, its noise arrives, and the chip's voltage becomes a turn rate."""
    runs = _runs(copy)
    gain = Q_THETA / (Q_THETA + (SPIN_SD * PERIOD_S) ** 2)
    for way in ("process", "link"):
        without, precise, noisy = (runs[f"{way} {sd}"] for sd in (0.0, 0.01, 0.5))
        assert not without["faults"] + precise["faults"] + noisy["faults"]
        assert without["heading_rad"] > 0.02
        assert precise["heading_rad"] < 0.2 * without["heading_rad"]
        assert math.isclose(noisy["per_tick_rad"], gain * 0.5 * PERIOD_S, rel_tol=0.1)
    assert runs["lanes"] == runs["alone"]
    readings = [rad_s for rad_s, valid, _ in runs["lanes"] if valid]
    assert len(set(readings)) == 8
    assert 0.1 < max(map(abs, readings)) < 2.5
    _look_at_the_driver(copy)


def _runs(copy: Scratch) -> dict[str, Any]:
    path = copy.root / "build" / "spin.toml"
    found: dict[str, Any] = json.loads(run_program(copy, _RUNS, str(path), SCENARIO))
    return found


def _look_at_the_driver(copy: Scratch) -> None:
    converter = copy.root / "build" / "converter.cpp"
    converter.write_text(_CONVERTER, encoding="utf-8")
    generated = copy.root / "build" / "recipe" / "generated" / "include"
    folders = [ROOT / "tests" / "boards" / "teensy40" / "fakes_system", copy.root / "firmware", generated]
    board = copy.root / "firmware" / "boards" / "teensy40"
    drivers = [path for path in (board / "spin.cpp", board / "whirl.cpp") if path.exists()]
    chip = ctypes.CDLL(str(build_library(converter.parent, "spin", [*drivers, converter], folders)))
    chip.begin()
    rad_s = ctypes.c_float(9.0)
    assert chip.converting() == 3
    assert (chip.read_spin(ctypes.byref(rad_s)), rad_s.value) == (0, 9.0)
    chip.converted(4095)
    assert chip.read_spin(ctypes.byref(rad_s)) == 1
    assert math.isclose(rad_s.value, (3.3 - 1.65) * 5.0, rel_tol=1e-5)
    assert chip.converting() == 3
    chip.taken()
    assert chip.read_spin(ctypes.byref(rad_s)) == 0
