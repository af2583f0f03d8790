# SPDX-License-Identifier: MIT
"""Another simulator around the real firmware: it drives, our own one wrapped is the same, and mistakes are told."""

from __future__ import annotations

import json
import math
import socket
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import omniwheel.robot
from hil_sim.c_scenario import scenario_world
from hil_sim.external import ExternalWorldError, ExternalWorldInputError, Fix, Sensed, load_world
from hil_sim.faults import Fault
from hil_sim.hil import run_hil
from hil_sim.patches import FloorPatch
from hil_sim.scenario import Event, Scenario, load_scenario
from hil_sim.sitl import start_sitl
from hil_sim.summary import TLOG_FILE, summarize
from hil_sim.world import World
from omni.cli import app
from omniwheel import FirmwareProcess
from tests.firmware.client import Client
from tests.hil_sim.tiny_world import TinyWorld

CIRCLE = """
[scenario]
name = "circle"
description = "a circle without a pose sensor of ours"
robot = "three_wheel"
duration_s = "until_done"
[parameters]
TRJ_TYPE = "circle"
TRJ_SIZE = 0.05
TRJ_PERIOD = 8.0
TRJ_LAPS = 1.0
[world]
start_pose = [0.05, 0.0, 0.0]
[[event]]
at_s = 0.3
command = "trajectory_start"
[[event]]
at_s = 0.3
command = "arm"
"""
PLACE = "tests.hil_sim.tiny_world:TinyWorld"


@pytest.fixture
def circle(tmp_path: Path) -> Scenario:
    path = tmp_path / "circle.toml"
    path.write_text(CIRCLE, encoding="utf-8")
    return load_scenario(str(path))


class Wrapped:
    """Our own world behind the protocol."""

    def __init__(self, scenario: Scenario, fixes: bool) -> None:
        self.world = World(scenario_world(scenario))
        self.fixes = fixes

    def sense(self) -> Sensed:
        world, wheels = self.world.c, self.world.wheels
        sensors = self.world.sense()
        fix = sensors.fix
        return Sensed(
            counts=[int(world.encoder_edges[i]) for i in range(wheels)],
            supply_V=sensors.battery_V,
            pose=list(world.pose),
            fix=Fix(fix.taken_us * 1e-6, *fix.pose) if self.fixes and sensors.has_fix else None,
            wheel_rad_s=list(world.wheel_rad_s)[:wheels],
            current_A=list(world.current_A)[:wheels],
        )

    def apply(self, duty: tuple[float, ...], coast: tuple[float, ...]) -> None:
        for i, (share, opened) in enumerate(zip(duty, coast, strict=True)):
            bridge = self.world.c.bridge[i]
            bridge.drive, bridge.coast = share * self.world.c.config.motor_direction[i], opened

    def step(self) -> None:
        self.world.step()


@pytest.mark.full
def test_an_independent_world_drives_the_circle(circle: Scenario) -> None:
    world = TinyWorld(circle)
    run = run_hil(circle, world=world)
    rmse = summarize(run)["rmse"]
    assert run.done
    assert rmse["position_m"] < 0.005
    assert rmse["theta_rad"] < 0.03
    path = run.record["truth"][run.record["phase"] == 2]
    assert np.ptp(path[:, 0]) == pytest.approx(0.1, abs=0.01)
    assert np.ptp(path[:, 1]) == pytest.approx(0.1, abs=0.01)
    assert summarize(run)["world"]["external"] == "tests.hil_sim.tiny_world:TinyWorld"
    assert world.calls[:5] == ["sense", "apply", "step", "sense", "apply"]
    assert world.ticks >= run.ticks


@pytest.mark.full
def test_wheels_that_turn_the_wrong_way_are_noticed(circle: Scenario) -> None:
    class Crossed(TinyWorld):
        def apply(self, duty: tuple[float, ...], coast: tuple[float, ...]) -> None:
            super().apply((-duty[0], *duty[1:]), coast)

    assert run_hil(replace(circle, duration_s=6.0), world=Crossed(circle)).record["state"][-1] != 2


@pytest.mark.full
@pytest.mark.parametrize("own_fixes", [True, False])
def test_our_own_world_behind_the_protocol_is_the_same_byte_for_byte(tmp_path: Path, own_fixes: bool) -> None:
    demo = replace(load_scenario("demo"), duration_s=3.0)
    faults = [Fault("encoder_noisy", 1.5, 1.8, wheel=1, value=3.0), Fault("i2c_nack", 2.9)]
    if not own_fixes:
        faults += [Fault("pose_jump", 2.0, 2.1, value=0.2), Fault("pose_freeze", 2.2, 2.5)]
    demo = replace(demo, faults=tuple(faults))
    for name in ("plain", "wrapped"):
        (tmp_path / name).mkdir()
    plain = run_hil(demo, out_dir=tmp_path / "plain")
    outer = demo.with_world({"fix_rate_Hz": 0.0}) if own_fixes else demo
    wrapped = run_hil(outer, out_dir=tmp_path / "wrapped", world=Wrapped(replace(demo, faults=()), own_fixes))
    logs = [(tmp_path / name / TLOG_FILE).read_bytes() for name in ("plain", "wrapped")]
    assert len(logs[0]) > 20_000
    assert logs[0] == logs[1]
    for field in ("truth", "estimate", "duty", "wheel_rad_s", "current_A", "supply_V"):
        assert np.array_equal(plain.record[field], wrapped.record[field]), field


def spoiled(method: str, after: int, result: Callable[[Any], Any]) -> type[TinyWorld]:
    """Return a world whose method ends in ``result`` from its call number ``after`` on."""

    class Spoiled(TinyWorld):
        pass

    def called(self: TinyWorld, *given: Any) -> Any:
        before = getattr(TinyWorld, method)(self, *given)
        return result(before) if self.ticks >= after else before

    setattr(Spoiled, method, called)
    return Spoiled


def raises(_: Any) -> None:
    raise ZeroDivisionError("no floor")


WRONG = {
    "nan": (lambda s: replace(s, pose=(0.0, math.nan, 0.0)), "pose 0.0, nan, 0.0; all numbers must be finite"),
    "no volts": (lambda s: replace(s, supply_V=math.inf), "supply_V inf"),
    "negative volts": (lambda s: replace(s, supply_V=-1.0), "supply_V -1.0"),
    "two counts": (lambda s: replace(s, counts=[1, 2]), "gave 2 counts; the robot has 3 wheels"),
    "broken counts": (lambda s: replace(s, counts=[1.5, 2, 3]), "must be of type int"),
    "two numbers": (lambda s: replace(s, pose=(0.0, 0.0)), "gave 2 numbers as pose; 3 are needed"),
    "no number": (lambda s: replace(s, pose=("a", 0.0, 0.0)), "failed at 0.400 s: ValueError"),
    "a fix of tomorrow": (lambda s: replace(s, fix=Fix(9.0, 0.0, 0.0, 0.0)), "must be 0 to now, 0.4 s"),
    "another thing": (lambda s: (1, 2, 3), "gave tuple"),
    "an error": (raises, "sense failed at 0.400 s: ZeroDivisionError: no floor"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_is_told_with_its_time_and_the_motors_coast(circle: Scenario, case: str) -> None:
    result, said = WRONG[case]
    world = spoiled("sense", 400, result)(circle)
    last: list[Any] = []
    world.apply = lambda *given: last.append(given)  # type: ignore[method-assign]
    with pytest.raises(ExternalWorldError) as caught:
        run_hil(circle, world=world)
    assert said in str(caught.value)
    assert caught.value.exit_code == 1
    assert last[-1] == ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


@pytest.mark.parametrize("method", ["apply", "step"])
def test_a_world_that_raises_ends_the_run(circle: Scenario, method: str) -> None:
    with pytest.raises(ExternalWorldError, match=rf"Spoiled.{method} failed at 0\.\d+ s: ZeroDivisionError") as caught:
        run_hil(circle, world=spoiled(method, 50, raises)(circle))
    assert "test_external_world.py, line" in caught.value.hint


class Early(TinyWorld):
    """A world that may do something while the robot computes; it fails there at a tick."""

    fails_at = -1

    def ahead(self) -> None:
        """Note that it is called."""
        self.calls.append("ahead")
        if self.ticks == self.fails_at:
            raise ZeroDivisionError("no floor ahead")


def test_a_world_may_work_while_the_robot_does(circle: Scenario) -> None:
    short = circle.with_duration(1.0)
    early, plain = Early(short), TinyWorld(short)
    runs = [run_hil(short, world=world).record for world in (early, plain)]
    assert runs[0].tobytes() == runs[1].tobytes()
    assert early.calls[:6] == ["sense", "ahead", "apply", "step", "sense", "ahead"]


@pytest.mark.parametrize("method", ["step", "ahead"])
def test_a_robot_behind_a_link_is_disarmed_and_given_back_when_its_world_raises(circle: Scenario, method: str) -> None:
    world = Early(circle) if method == "ahead" else spoiled("step", 800, raises)(circle)
    if isinstance(world, Early):
        world.fails_at = 800
    with FirmwareProcess("three_wheel") as firmware:
        before = "ISMC_LAM_XY", 7.0
        with omniwheel.robot.connect(firmware.urls[0]) as robot:
            robot.parameters[before[0]] = before[1]
        with pytest.raises(ExternalWorldError, match="no floor"):
            run_hil(circle, firmware.urls[0], world=world)
        with omniwheel.robot.connect(firmware.urls[0]) as robot:
            beat = robot.status.heartbeat
            assert beat is not None
            assert (beat.armed, beat.hil) == (False, False)
            assert robot.parameters[before[0]] == before[1]


def test_two_pose_sensors_are_one_too_many(circle: Scenario) -> None:
    with pytest.raises(ExternalWorldError, match="the scenario has a pose sensor, too"):
        run_hil(circle.with_world({"fix_rate_Hz": 50.0}), world=TinyWorld(circle))


def test_the_pose_sensor_of_the_scenario_sees_the_world(circle: Scenario) -> None:
    class Blind(TinyWorld):
        fixes = False

    seen = replace(circle.with_world({"fix_rate_Hz": 50.0}), duration_s=2.0)
    jumped = replace(seen, faults=(Fault("pose_jump", 1.0, value=0.02),))
    plain, jump = (run_hil(scenario, world=Blind(scenario)).record["truth"][-1, 0] for scenario in (seen, jumped))
    assert plain - jump > 0.01


def driven(circle: Scenario, *faults: Fault) -> Any:
    """Return the sample of 1 s, where all motors have been driven for 0.4 s."""
    open_loop = (Event(at_s=0.5, command="arm"), Event(at_s=0.6, duty=(0.3, 0.3, 0.3)))
    scenario = replace(circle, events=open_loop, duration_s=1.2, faults=faults)
    record = run_hil(scenario, world=TinyWorld(scenario)).record
    return record[np.searchsorted(record["time_s"], 1.0)]


def test_faults_of_the_electronics_act(circle: Scenario) -> None:
    good = driven(circle)
    assert np.all(good["duty"][:3] > 0.25)
    dead = driven(circle, Fault("motor_dead", 0.0, wheel=1))
    assert dead["wheel_rad_s"][1] == 0.0 < dead["wheel_rad_s"][0]
    powerless = driven(circle, Fault("chip_power", 0.9))
    assert powerless["duty"][0] == 0.0
    assert powerless["wheel_rad_s"][0] < 0.5 * good["wheel_rad_s"][0]


@pytest.mark.parametrize("fault", ["battery_sag", "motor_stalled", "tick_late", "wheel_turned"])
def test_faults_of_what_is_not_ours_are_refused_by_name(circle: Scenario, fault: str) -> None:
    scenario = replace(circle, faults=(Fault(fault, 1.0, value=0.01),))
    with pytest.raises(ExternalWorldInputError, match=f"fault {fault}") as caught:
        run_hil(scenario, world=TinyWorld(scenario))
    assert caught.value.exit_code == 2


def test_a_plant_and_deviations_of_the_floor_are_refused_by_name(circle: Scenario) -> None:
    tolerances = load_scenario("tolerances")
    with pytest.raises(ExternalWorldInputError, match="plant slip"):
        run_hil(circle.with_plant("slip"), world=TinyWorld(circle))
    with pytest.raises(ExternalWorldInputError, match=r"\[\[patch\]\]"):
        run_hil(replace(circle, patches=(FloorPatch((0.0, 1.0), (0.0, 1.0), 0.5),)), world=TinyWorld(circle))
    with pytest.raises(ExternalWorldInputError, match="dispersion of "):
        run_hil(tolerances, world=TinyWorld(tolerances))


FILES = {
    "fine.py": "from tests.hil_sim.tiny_world import TinyWorld\n",
    "half.py": "class Half:\n    def sense(self): ...\n    def apply(self, duty, coast): ...\n",
    "broken.py": "import no_such_package_here\n",
    "typo.py": "def (:\n",
    "picky.py": "from tests.hil_sim.tiny_world import TinyWorld\n\n\nclass Picky(TinyWorld):\n"
    "    def __init__(self, scenario):\n        raise ValueError('only on Sundays')\n",
    "quits.py": "import sys\n\nfrom tests.hil_sim.tiny_world import TinyWorld\n\n\nclass Quits(TinyWorld):\n"
    "    def __init__(self, scenario):\n        sys.exit(0)\n\n\nclass Stops(TinyWorld):\n"
    "    def step(self):\n        sys.exit('no more')\n",
    "mute.py": "from tests.hil_sim.tiny_world import TinyWorld\n\n\nclass Mute(TinyWorld):\n    notes = None\n\n\n"
    "class Wordy(TinyWorld):\n    notes = 'one'\n",
    "other.py": "from tests.hil_sim.tiny_world import TinyWorld\n\n\nclass Other(TinyWorld):\n"
    "    def __init__(self): ...\n\n\nclass Fewer(TinyWorld):\n    def apply(self, duty): ...\n",
    "film.py": "from tests.hil_sim.tiny_world import TinyWorld\n\n\nclass Film(TinyWorld):\n"
    "    def finish(self, folder):\n        raise ValueError('no film')\n",
    "far.py": "from hil_sim.external import Sensed\nfrom tests.hil_sim.tiny_world import TinyWorld\n\n\n"
    "class Far(TinyWorld):\n    def sense(self):\n        return Sensed([0, 0, 0], 12.0, (1e300, 0.0, 0.0))\n",
    "late.py": "from tests.hil_sim.tiny_world import TinyWorld\n\n\nclass Late(TinyWorld):\n"
    "    def step(self):\n        super().step()\n        assert self.ticks < 700, 'out of floor'\n",
}


@pytest.fixture
def folder(tmp_path: Path, circle: Scenario, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("fine", "write MODULE:CLASS"),
        ("nowhere:World", "unknown module nowhere"),
        ("fine:TinyWord", "did you mean TinyWorld"),
        ("half:Half", "has no method step"),
        ("broken:World", "No module named 'no_such_package_here'"),
        ("typo:World", "SyntaxError"),
        ("picky:Picky", "only on Sundays"),
        ("nowhere:x", "--world nowhere:x: unknown module"),  # and no emoji in place of :x:
        ("quits:Quits", "Quits(scenario) failed: SystemExit: 0"),
        ("mute:Mute", "Mute.notes is None; must be a list of sentences"),
        ("mute:Wordy", "Wordy.notes is 'one'"),
        ("other:Other", "other.py, line 5"),
        ("typo:World", "typo.py, line 1"),
        ("mujoco:", "after the colon is missing"),
    ],
)
def test_a_world_that_is_not_there_is_told_before_anything_runs(folder: Path, place: str, said: str) -> None:
    result = CliRunner().invoke(app, ["run", "circle.toml", "--world", place])
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())
    assert not (folder / "runs").exists()


@pytest.mark.full
def test_the_command_runs_it_and_keeps_the_folder_of_one_that_failed(folder: Path) -> None:
    assert load_world(PLACE, load_scenario("circle.toml")).step is not None
    good = CliRunner().invoke(app, ["run", "circle.toml", "--world", "fine:TinyWorld", "--json"])
    assert good.exit_code == 0, good.output
    summary = json.loads(good.stdout)
    assert summary["completed"]
    assert {path.name for path in Path(summary["folder"]).iterdir()} >= {"summary.json", "run.png", TLOG_FILE}
    bad = CliRunner().invoke(app, ["run", "circle.toml", "--world", "late:Late", "--out", "bad"])
    assert bad.exit_code == 1
    assert "late:Late.step failed at 0.699 s: AssertionError: out of floor" in " ".join(bad.output.split())
    assert (folder / "bad" / "circle-seed1" / TLOG_FILE).stat().st_size > 1000


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("quits:Stops", "quits:Stops.step failed at 0.000 s: SystemExit: no more"),
        ("other:Fewer", "other.py, line 9"),
        ("far:Far", "must be at most 1e+06"),
    ],
)
def test_a_world_that_ends_the_program_or_takes_something_else_is_told_with_its_name(
    folder: Path, place: str, said: str
) -> None:
    result = CliRunner().invoke(app, ["run", "circle.toml", "--world", place])
    assert result.exit_code == 1
    assert said in " ".join(result.output.split())
    assert "hil_sim/external.py" not in result.output


@pytest.mark.full
def test_a_world_that_cannot_finish_has_its_run_stored_and_shown_all_the_same(folder: Path) -> None:
    result = CliRunner().invoke(app, ["run", "circle.toml", "--world", "film:Film"])
    assert result.exit_code == 1
    assert "film:Film.finish failed: ValueError: no film" in " ".join(result.output.split())
    kept = folder / "runs" / "circle-seed1"
    assert {path.name for path in kept.iterdir()} >= {"summary.json", "run.png", TLOG_FILE}


def test_a_run_that_is_refused_leaves_no_folder(folder: Path) -> None:
    result = CliRunner().invoke(app, ["run", "circle.toml", "--plant", "slip", "--world", "fine:TinyWorld"])
    assert result.exit_code == 2, result.output
    assert not (folder / "runs").exists()


@pytest.mark.full
def test_the_table_says_which_world_it_was(folder: Path) -> None:
    result = CliRunner().invoke(app, ["run", "circle.toml", "--world", "fine:TinyWorld", "--duration", "1.5"])
    assert "(world tests.hil_sim.tiny_world:TinyWorld)" in " ".join(result.output.split())


@pytest.mark.full
def test_sitl_without_a_world_waits_for_the_sensors_of_another_simulator() -> None:
    command = [sys.executable, "-m", "omni", "sitl", "--no-world", "--lockstep", "--port", "0", "--json"]
    command.append("--end-with-stdin")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        host, port = json.loads(process.stdout.readline())["links"][0].removeprefix("tcp:").split(":")
        with socket.create_connection((host, int(port))) as wire:
            client = Client(wire)
            client.heartbeat()
            assert [tick.actuators.sequence for tick in client.ticks(30)] == list(range(1, 31))
        process.communicate(timeout=60)
    assert process.returncode == 0


def test_sitl_without_a_world_refuses_what_needs_one() -> None:
    for words in (["--world", PLACE], ["--commands"], ["--world-robot", "four_wheel"], ["--radio", "9600"]):
        refused = CliRunner().invoke(app, ["sitl", "--no-world", "--port", "0", *words])
        assert refused.exit_code == 2
        assert "--no-world runs the firmware alone" in " ".join(refused.output.replace("│", " ").split())


def test_sitl_runs_a_world_of_ones_own_and_tells_its_mistake(circle: Scenario) -> None:
    world = TinyWorld(circle)
    with start_sitl(circle, ["tcp:127.0.0.1:0"], realtime_factor=0.0, world=world) as running:
        running.advance(100)
    assert world.ticks >= 100
    assert world.duty == (0.0, 0.0, 0.0)
    broken = spoiled("step", 50, raises)(circle)
    with (
        pytest.raises(ExternalWorldError, match="no floor"),
        start_sitl(circle, ["tcp:127.0.0.1:0"], realtime_factor=0.0, world=broken) as running,
    ):
        running.advance(100)
