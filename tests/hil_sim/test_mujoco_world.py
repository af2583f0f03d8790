# SPDX-License-Identifier: MIT
"""MuJoCo around the real firmware: the model is the robot file's, its physics are right, and the firmware drives it."""

from __future__ import annotations

import math
import os
import re
from ctypes.util import find_library
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from bench.figures.mujoco_speed import table
from bench.figures.rollers import SHOWN, row, yaw_ripple
from hil_sim.external import ExternalWorldError, ExternalWorldInputError, load_world
from hil_sim.hil import run_hil
from hil_sim.models.parts import PartsError
from hil_sim.mujoco_settings import Film, Floor, Patch, Settings, read_settings
from hil_sim.mujoco_world import MujocoWorld
from hil_sim.patches import FloorPatch
from hil_sim.scenario import Event, Scenario, load_scenario
from hil_sim.sitl import start_sitl
from hil_sim.summary import summarize
from hil_sim.world import GRAVITY_M_S2, WorldError
from omni.cli import app
from omniwheel.errors import OmniError
from tests.native import ROOT
from tests.needs import refuse

if "DISPLAY" not in os.environ and find_library("OSMesa"):
    os.environ.setdefault("MUJOCO_GL", "osmesa")  # before the package is imported
pytest.importorskip("mujoco", reason="needs pip install 'omniwheel[mujoco]'")

ROBOTS = ("three_wheel", "fast_three_wheel", "four_wheel")


def standing(robot: str = "fast_three_wheel", seed: int = 1) -> Scenario:
    return load_scenario("sitl", robot).with_seed(seed)


def driven(world: MujocoWorld, duty: tuple[float, ...], ticks: int, coast: float = 0.0) -> list[tuple[float, ...]]:
    """Drive open loop; return the pose after each tick."""
    poses = []
    for _ in range(ticks):
        world.apply(duty, (coast,) * len(duty))
        world.step()
        poses.append(world.sense().pose)
    return [tuple(pose) for pose in poses]


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_model_has_the_files_mass_inertia_and_rollers(robot: str) -> None:
    world = MujocoWorld(standing(robot))
    file = world.parts
    simulation = standing(robot).robot.simulation
    mass_kg = simulation["mass_kg"]
    assert isinstance(mass_kg, float)
    assert world.model.body_mass.sum() == pytest.approx(mass_kg, rel=1e-8)
    rollers = [world.model.body(number).name for number in range(world.model.nbody)]
    wheels = len(file.wheels)
    assert sum(name.startswith("roller_") for name in rollers) == 18 * wheels
    assert world.model.nv == 6 + wheels + 18 * wheels
    spin, torque = np.zeros(world.model.nv), np.zeros(world.model.nv)
    spin[5] = 1.0
    world._mujoco.mj_mulM(world.model, world.data, torque, spin)
    assert torque[5] == pytest.approx(simulation["inertia_kg_m2"], rel=0.01)
    assert sum(world.wheel_load_N) == pytest.approx(mass_kg * GRAVITY_M_S2, rel=0.01)


def test_rollers_touch_the_floor_and_never_each_other() -> None:
    world = MujocoWorld(standing())
    floor = world.model.geom("floor").id
    for _ in range(50):
        driven(world, (0.4, -0.1, 0.2), 10)
        assert all(floor in contact.geom for contact in world.data.contact)


def test_positive_duty_turns_the_body_and_the_encoders_counter_clockwise() -> None:
    world = MujocoWorld(standing())
    before = world.sense().counts
    assert driven(world, (0.3, 0.3, 0.3), 400)[-1][2] > 0.3
    assert all(now > then for now, then in zip(world.sense().counts, before, strict=True))


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_spin_is_as_fast_as_motor_data_and_radius_say(robot: str) -> None:
    """Steady: the motor's torque is its friction's. The rows' lever arms are in the mean the file's."""
    world = MujocoWorld(standing(robot))
    wheels = len(world.parts.wheels)
    motor = standing(robot).robot.motor
    simulation = standing(robot).robot.simulation
    k, r, b = (motor[key] for key in ("constant_N_m_A", "resistance_ohm", "viscous_friction_N_m_s"))
    driven(world, (0.5,) * wheels, 800)
    seconds = 1.5
    start = np.array(world.sense().counts)
    angle = world.pose[2]
    driven(world, (0.5,) * wheels, round(1e3 * seconds))
    counts = standing(robot).robot.encoder["counts_per_revolution"]
    speed = float(np.mean(np.array(world.sense().counts) - start)) / counts * 2.0 * math.pi / seconds
    volts = world.sense().supply_V * 0.5
    expected = (k * volts / r - simulation["coulomb_friction_N_m"]) / (k * k / r + b)
    assert speed == pytest.approx(expected, rel=0.03)
    part = world.parts.wheels[0]
    turned = (world.pose[2] - angle) / seconds
    assert turned == pytest.approx(speed * part.radius_m / part.distance_m, rel=0.02)


def test_the_lever_arm_alternates_between_the_rows() -> None:
    """On one wheel's contacts: 8.5 mm within and beyond the middle, as the rows of rollers are."""
    world = MujocoWorld(standing())
    apart = 0.5 * 0.354 * 0.048
    seen = set()
    for _ in range(300):
        driven(world, (0.3, 0.3, 0.3), 1)
        middle = np.array(world.data.qpos[0:2])
        for contact in world.data.contact:
            seen.add(round(float(np.hypot(*(contact.pos[0:2] - middle))), 3))
    assert min(seen) == pytest.approx(0.16 - apart, abs=2e-3)
    assert max(seen) == pytest.approx(0.16 + apart, abs=2e-3)
    assert not any(abs(radius - 0.16) < 0.5 * apart for radius in seen)


def test_a_coasting_robot_takes_no_current_and_a_shorted_one_brakes() -> None:
    rests = []
    for coast in (1.0, 0.0):
        world = MujocoWorld(standing())
        driven(world, (0.5, 0.5, 0.5), 500)
        turned = world.pose[2]
        driven(world, (0.0, 0.0, 0.0), 300, coast)
        assert coast == 0.0 or world.sense().current_A == [0.0, 0.0, 0.0]
        rests.append(world.pose[2] - turned)
    assert rests[0] > 1.5 * rests[1]


def test_a_slope_pulls_downhill_and_ice_lets_it() -> None:
    steep = Floor(slope_deg=10.0, uphill_deg=90.0)
    held = MujocoWorld(standing("three_wheel"), Settings(steep))
    icy = Settings(replace(steep, patches=(Patch((-1.0, 1.0), (-1.0, 1.0), 0.05),)))
    slid = MujocoWorld(standing("three_wheel"), icy)
    moved = [driven(world, (0.0, 0.0, 0.0), 500)[-1][1] for world in (held, slid)]
    assert moved[1] < -0.05 < moved[0]
    assert held.accelerometer_m_s2[1] == pytest.approx(GRAVITY_M_S2 * math.sin(math.radians(10.0)), abs=0.3)


def test_the_scenario_s_patches_and_each_wheel_s_friction_reach_the_rollers() -> None:
    """The second wheel stands at 120 degrees, so at x below 0 and y above."""
    patch = FloorPatch((-1.0, 0.0), (0.0, 1.0), 0.5)
    worn = {"wheel_friction": (1.0, 1.0, 0.3), "wheel_drag": (1.0, 1.0, 4.0)}
    world = MujocoWorld(replace(standing("three_wheel"), patches=(patch,), wheel_numbers=worn))
    driven(world, (0.0, 0.0, 0.0), 2)
    seen = [float(world.model.geom_friction[world._rollers[wheel][0], 0]) for wheel in range(3)]
    assert seen == pytest.approx([0.6, 0.3, 0.18])
    rubbing = [max(world.model.dof_frictionloss[world._pins[wheel]]) for wheel in range(3)]
    assert rubbing == pytest.approx(np.array([1.0, 1.0, 4.0]) * world.parts.roller_dry_N_m)


def test_gears_with_play_are_refused_with_a_sentence(tmp_path: Path) -> None:
    scenario = standing("three_wheel").with_world({"backlash_rad": 0.02})
    with pytest.raises(ExternalWorldInputError, match=r"backlash_rad is 0.02: the MuJoCo model has no backlash"):
        MujocoWorld(scenario)
    path = tmp_path / "play.toml"
    head = '[scenario]\nname = "play"\nextends = "no_slip"\n[world]\nbacklash_rad = 0.02\n'
    path.write_text(head, encoding="utf-8")
    result = CliRunner().invoke(app, ["run", str(path), "--world", "mujoco", "--out", str(tmp_path / "run")])
    assert result.exit_code == 2
    assert "no backlash" in " ".join(result.output.split())


def test_bumps_shake_the_body_and_the_same_seed_is_the_same_floor() -> None:
    bumpy = Settings(Floor(bumps_m=0.003, bumps_size_m=2.0))
    seen = []
    for settings in (bumpy, bumpy, Settings()):
        world = MujocoWorld(standing(), settings)
        tilts = []
        for _ in range(30):
            driven(world, (-0.3, 0.3, 0.0), 10)
            tilts.append(world.gyro_rad_s[0])
        seen.append(tilts)
    assert seen[0] == seen[1]
    assert np.std(seen[0]) > 1.3 * np.std(seen[2])


def test_the_same_seed_is_the_same_run_and_another_meets_other_rollers() -> None:
    runs = [driven(MujocoWorld(standing(seed=seed)), (0.2, -0.4, 0.1), 200)[-1] for seed in (1, 1, 2)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def circle() -> Scenario:
    scenario = load_scenario("fast").with_parameters(
        {"TRJ_TYPE": 3.0, "TRJ_SIZE": 0.1, "TRJ_PERIOD": 2.0, "TRJ_LAPS": 1.0}
    )
    return replace(scenario, start_pose=(0.1, 0.0, 0.0), events=tuple(e for e in scenario.events if e.command))


@pytest.mark.full
def test_the_firmware_drives_it_and_the_log_says_which_world() -> None:
    scenario = circle()
    run = run_hil(scenario, world=MujocoWorld(scenario))
    summary = summarize(run)
    assert run.done
    assert 0.0002 < summary["rmse"]["position_m"] < 0.01
    assert summary["world"]["external"] == "hil_sim.mujoco_world:MujocoWorld"


def test_an_open_loop_event_and_a_dead_motor_act() -> None:
    scenario = replace(standing(), events=(Event(at_s=0.3, command="arm"), Event(at_s=0.4, duty=(0.3, 0.3, 0.3))))
    scenario = replace(scenario, duration_s=1.0)
    record = run_hil(scenario, world=MujocoWorld(scenario)).record
    assert np.all(record["wheel_rad_s"][-1][:3] > 1.0)


def test_sitl_goes_on_with_it_and_offers_only_the_faults_that_it_has() -> None:
    scenario = load_scenario("sitl")
    with start_sitl(scenario, ["tcp:127.0.0.1:0"], realtime_factor=0.0, world=MujocoWorld(scenario)) as running:
        running.advance(100)
        names = {fault["name"] for fault in running.live.catalogue()["faults"]}
        assert running.link.ticks >= 100
    assert "motor_dead" in names
    assert not names & {"ice", "battery_sag", "motor_stalled", "wheel_turned", "tick_late"}


def test_a_short_name_takes_a_file_and_a_wrong_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "ice.toml").write_text(
        "[floor]\nslope_deg = 1.0\n[[patch]]\nx_m = [0, 1]\ny_m = [0, 1]\nfriction = 0.1\n"
    )
    world: Any = load_world(f"mujoco:{tmp_path / 'ice.toml'}", standing())
    assert world.floor == Floor(slope_deg=1.0, patches=(Patch((0.0, 1.0), (0.0, 1.0), 0.1),))
    for text, said in (
        ("[floor]\nslope = 1", "floor.slope"),
        ("[floor]\nslope_deg = 80", "a number from 0 to 30"),
        ("[[patch]]\nx_m = [1, 0]\ny_m = [0, 1]\nfriction = 1", "the first must be smaller"),
        ("[floor]\nseed = 1.5", "a whole number"),
    ):
        (tmp_path / "wrong.toml").write_text(text)
        result = CliRunner().invoke(app, ["run", "stand", "--world", f"mujoco:{tmp_path / 'wrong.toml'}"])
        assert result.exit_code == 2
        assert said in " ".join(result.output.split())


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("rollers_per_row", 2.5, "simulation.rollers_per_row is 2.5; must be a whole number from"),
        ("wheel_mass_kg", 0.001, "its rollers alone are"),
        ("wheel_mass_kg", 2.0, "simulation.mass_kg leaves"),
        ("roller_radius_m", 0.03, "must be less than half of a wheel's"),
    ],
)
def test_wheels_that_cannot_be_are_told_by_their_key(key: str, value: float, said: str) -> None:
    scenario = standing()
    robot = replace(scenario.robot, simulation={**scenario.robot.simulation, key: value})
    with pytest.raises((PartsError, WorldError), match=said):
        MujocoWorld(replace(scenario, robot=robot))


@pytest.mark.full
def test_a_film_is_written(tmp_path: Path) -> None:
    try:
        world = MujocoWorld(standing(), Settings(film=Film(every_s=0.1, width=64, height=48)))
    except ExternalWorldError:
        refuse("opengl")
    driven(world, (0.3, 0.3, 0.3), 300)
    world.finish(tmp_path)
    assert (tmp_path / "world.gif").read_bytes()[:4] == b"GIF8"


def test_without_the_package_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(OmniError) as caught:
        load_world("mujoco", standing())
    assert "omniwheel[mujoco]" in caught.value.hint


def numbers_of(line: str) -> list[float]:
    """Return the numbers of a row of the page's table, without its first cell."""
    return [float(number) for number in re.findall(r"[\d.]+(?=[ |])", line.split("|", 2)[2])]


@pytest.mark.nightly
@pytest.mark.parametrize("name", SHOWN)
def test_the_page_says_what_the_figures_command_says(name: str) -> None:
    page = (ROOT / "docs" / "guides" / "mujoco.md").read_text(encoding="utf-8")
    told = next(line for line in page.splitlines() if line.startswith(f"| `{name}`"))
    found = row(name)
    assert numbers_of(told) == pytest.approx(numbers_of(found), rel=0.1, abs=0.1), found


def test_the_rows_make_yaw_swing_as_the_page_says() -> None:
    page = (ROOT / "docs" / "guides" / "mujoco.md").read_text(encoding="utf-8")
    told = re.search(r"swings by ([\d.]+) to ([\d.]+) %", page)
    assert told is not None
    assert float(told[1]) - 0.2 < yaw_ripple("fast_three_wheel") < float(told[2]) + 0.2


def test_the_page_s_python_and_its_file_work(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "guides" / "mujoco.md").read_text(encoding="utf-8")
    code, file = (re.search(rf"```{kind}\n(.*?)```", page, re.DOTALL) for kind in ("python", "toml"))
    assert code is not None
    assert file is not None
    exec(compile(code[1], "mujoco.md", "exec"), {})
    (tmp_path / "steep.toml").write_text(file[1], encoding="utf-8")
    assert read_settings(tmp_path / "steep.toml").floor.slope_deg == 2.0


def test_the_scenario_s_numbers_of_wheels_and_floor_hold_here_too() -> None:
    numbers = {"floor_slope_rad": 0.1, "floor_uphill_rad": 1.0, "rollers_per_row": 8, "row_distance_m": 0.02}
    world = MujocoWorld(standing().with_world({**numbers, "wheel_rows": 2, "roller_dip_m": 1e-4}))
    assert world.floor.slope_deg == pytest.approx(math.degrees(0.1))
    assert world.floor.uphill_deg == pytest.approx(math.degrees(1.0))
    assert len(world.parts.rollers) == 16
    assert max(roller.along_m for roller in world.parts.rollers) == pytest.approx(0.01)
    assert any("roller_dip_m" in note for note in world.notes)


def test_the_page_s_table_of_times_has_the_robots_that_are_measured() -> None:
    """Times depend on the machine, degrees of freedom do not."""
    page = (ROOT / "docs" / "guides" / "mujoco.md").read_text(encoding="utf-8")
    for line in table(rounds=1):
        if line.startswith("| ") and "µs" not in line:
            assert "|".join(line.split("|")[:3]) in page


def test_a_step_in_two_halves_is_mujoco_s_own_step() -> None:
    """With the same controls, friction and contacts, bit for bit."""
    halves, whole = MujocoWorld(standing()), MujocoWorld(standing())
    for world in (halves, whole):
        driven(world, (0.3, -0.2, 0.4), 50)
    for _ in range(30):
        halves.ahead()
        halves.step()
        whole._lower()
        whole.data.ctrl[:] = halves.data.ctrl
        whole._mujoco.mj_step(whole.model, whole.data)
        whole._look()
        for name in ("qpos", "qvel", "act"):
            assert getattr(halves.data, name).tobytes() == getattr(whole.data, name).tobytes()
