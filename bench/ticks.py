# SPDX-License-Identifier: MIT
"""Counts the x86 instructions of a simulated tick: world, core and what is around them, without Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bench import build
from hil_sim import core
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omniwheel._core import ffi
from tests.native import generated_dir

WAYS = {
    "in_process": "in process",
    "run": "batch engine, run after run",
    "lanes": "batch engine, eight runs at once",
}
PARTS = {"omni_robot_tick": "the core", "hil_world_step": "the plant"}
CPU_INFO = Path("/proc/cpuinfo")
COUNTED_TICKS = 2000
SCENARIO, IDEAL = "demo", "ideal"
"""The demo on real wheels, and the same on ideal ones."""


def ways() -> list[str]:
    """Return the ways to run that can be compared: eight at once where the processor has the recorded instructions."""
    return [way for way in WAYS if way != "lanes" or _has_avx2()]


def _has_avx2() -> bool:
    try:
        return " avx2 " in CPU_INFO.read_text()
    except OSError:
        return False


def program() -> Path:
    """Build the program."""
    built = generated_dir().parent
    archives = [built / "hil_sim" / "libhil_sim.a", *sorted((built / "shared" / "link").glob("*.a"))]
    return build.build("ticks", [build.PROGRAMS / "ticks.c"], archives=archives)


def write_inputs(folder: Path, seed: int, name: str = SCENARIO) -> list[str]:
    """Leave world and robot of a scenario in the folder, as the program reads them; return their paths."""
    scenario = replace(load_scenario(name), seed=seed)
    world = new_world(scenario)
    config = core.robot_config(scenario.parameter_values(), scenario.robot.table, 0)
    paths = [folder / "world.bin", folder / "config.bin"]
    paths[0].write_bytes(bytes(ffi.buffer(ffi.addressof(world.c, "config"))))
    paths[1].write_bytes(bytes(ffi.buffer(config)))
    return [str(path) for path in paths]


def instructions(way: str, seed: int, ticks: int = COUNTED_TICKS, scenario: str = SCENARIO) -> dict[str, float]:
    """Return instructions per tick of one run: "all", and the parts that the way lets be told apart."""
    built = program()
    words = [way, *write_inputs(built.parent, seed, scenario), str(ticks)]
    parts = () if way == "lanes" else tuple(PARTS)
    counted = build.count(built, words, "counted", parts)
    done = build.numbers(build.call([str(built), *words]))["ticks"][0]
    return {"all": counted.total / done, **{PARTS[name]: counted.of[name] / done for name in parts}}
