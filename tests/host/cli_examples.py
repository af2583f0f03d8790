# SPDX-License-Identifier: MIT
"""How each example of a help page is run: on a simulated robot, in a scratch folder, shortened where it takes minutes.

A line is run as it stands but for what its rule says. Options are left out, or replaced by a later one. What would need
a real thing (a Teensy, a radio, a camera system, a cluster, an emulated processor) has a stand-in.
"""

from __future__ import annotations

import os
import shlex
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import matplotlib.image as imageio
from typer.testing import CliRunner

import omniwheel.robot
from hil_sim.hil import run_hil
from hil_sim.loop_speed import loops
from hil_sim.scenario import load_scenario
from hil_sim.sitl import Sitl, start_sitl
from omni.cli import app
from omni.cli.common import record_history
from omniwheel import FirmwareProcess
from omniwheel.bringup import Assumed
from omniwheel.frames import Pose
from omniwheel.mocap.simulated import SimulatedSource
from omniwheel.signing import new_key_file
from tests.faults.commands import CASES, known_lens
from tests.host.logs import synthetic
from tests.host.mocap.rendered.lab import SMALL, scene, write_files
from tests.host.mocap.rendered.scene import View
from tests.host.mocap.test_latency import headings
from tests.host.pose_fit.files import files_of_examples
from tests.host.stepped import patched, robot
from tests.quick_scenario import QUICK

SIMULATOR = "from tests.hil_sim.tiny_world import TinyWorld\n\n\nclass MyWorld(TinyWorld):\n    fixes = False\n"
LINK = ("--link", "-l")
CHECKS = "python -m omni.checks "


@contextmanager
def real_time_robot() -> Iterator[None]:
    """A robot in real time, for what has a clock of its own."""
    with FirmwareProcess("three_wheel") as firmware, patch("omni.cli.mocap.link_url", lambda _: firmware.urls[0]):
        yield


@contextmanager
def turned_robot() -> Iterator[None]:
    """The robot is turned to and fro for 20 s in view of cameras."""
    with (
        FirmwareProcess("three_wheel") as firmware,
        patch("omni.cli.mocap_latency.link_url", lambda _: firmware.urls[0]),
        patch("omniwheel.mocap.latency.observe", lambda *_: headings()),
        patch("omniwheel.mocap.streams.open_source", lambda *_, **__: SimulatedSource()),
    ):
        yield


@contextmanager
def pressed_keys() -> Iterator[None]:
    """Three key presses; the last one ends the drive."""
    keys = iter("wqx")

    @contextmanager
    def raw_keys() -> Iterator[Callable[[], str]]:
        yield lambda: next(keys)

    with robot(), patch("omni.cli.drive.raw_keys", raw_keys):
        yield


@contextmanager
def no_radio() -> Iterator[None]:
    """Lines for the original robot go nowhere."""

    @contextmanager
    def link(*_: object) -> Iterator[Any]:
        yield SimpleNamespace(write=lambda data: None, read=lambda timeout_s: b"")

    with patch("omni.cli.host_control._radio_link", link):
        yield


@contextmanager
def person() -> Iterator[None]:
    """An operator who confirms everything and observes nothing, beside a robot on a stand."""
    with robot("stand"), patch("omni.cli.bringup.TerminalPerson", lambda *_, **__: Assumed()):
        yield


@contextmanager
def soon_over() -> Iterator[None]:
    """A simulated robot that would go on until Ctrl-C ends after a moment."""
    advance = Sitl.advance

    def once(running: Sitl) -> None:
        advance(running)
        raise KeyboardInterrupt

    def end(_: object) -> None:
        raise KeyboardInterrupt

    with patch.object(Sitl, "advance", once), patch("omni.cli.sitl.wait_for_end", end):
        yield


@contextmanager
def soon_unplugged() -> Iterator[None]:
    """A hub that would serve until Ctrl-C ends after a moment; the radio's port is not there."""

    def end(_: object) -> None:
        raise KeyboardInterrupt

    replaced = {"omni.hub.server.HubServer.serve": end, "omni.cli.link.link_url": lambda _: "nowhere"}
    with patched(replaced):
        yield


@contextmanager
def no_page() -> Iterator[None]:
    """Nobody opens the studio's page, which tests/studio do: its server ends at once."""
    with patch("uvicorn.Server.run", lambda *_, **__: None):
        yield


@contextmanager
def no_emulator() -> Iterator[None]:
    """The firmware as a process stands in for the emulated one."""

    @contextmanager
    def image(*_: Any, links: Any, **__: Any) -> Iterator[Any]:
        yield SimpleNamespace(urls=links)

    def in_process(*arguments: Any, **options: Any) -> Any:
        return start_sitl(*arguments, **{**options, "emulated": False})

    with (
        soon_over(),
        patched(
            {
                "hil_sim.sitl.start_sitl": in_process,
                "omniwheel.emulated_firmware.EmulatedFirmware": FirmwareProcess,
                "hil_sim.image_firmware.ImageFirmware": image,
            }
        ),
    ):
        yield


def _short(_name: str, _robot: str | None = None) -> Any:
    return replace(load_scenario("quick.toml"), compared={"quick.toml": "once more"})


@contextmanager
def short_runs() -> Iterator[None]:
    """Half a second of the demo, on the firmware as a process."""

    def run(*arguments: Any, **options: Any) -> Any:
        return run_hil(*arguments, **{**options, "emulated": False, "image": None})

    with patched({"hil_sim.scenario.load_scenario": _short, "hil_sim.hil.run_hil": run}):
        yield


@contextmanager
def one_loop() -> Iterator[None]:
    """The benchmark measures its first loop."""
    with patch("hil_sim.loop_speed.loops", lambda seconds: dict(list(loops(seconds).items())[:1])):
        yield


@contextmanager
def no_soak() -> Iterator[None]:
    """Minutes on an emulated processor are the matter of tests/soak."""
    result = SimpleNamespace(as_dict=dict, failures=())
    with patch("hil_sim.soak.run_soak", lambda *_: result):
        yield


@contextmanager
def no_build() -> Iterator[None]:
    """PlatformIO is not asked to build."""
    from omni.cli.flash import Program

    image = SimpleNamespace(path=Path("firmware.hex"), size=1, sha256="00", wiring_id=0)
    with patched({f"omni.cli.flash.{name}": partial(_program, Program, image) for name in ("_built", "_from_file")}):
        yield


def _program(kind: Any, image: Any, what: object, *_: Any, **__: Any) -> Any:
    return kind(image, str(what), "")


@contextmanager
def changed() -> Iterator[None]:
    """The robot of :func:`robot`, whose parameters were changed three times before."""
    with robot(), tempfile.TemporaryDirectory() as state, patch.dict(os.environ, {"OMNI_STATE_DIR": state}):
        with omniwheel.robot.connect("simulated") as before:
            for value in (5.0, 6.0, 7.0):
                record_history(before)
                before.parameters["ISMC_LAM_XY"] = value
        yield


@contextmanager
def tried() -> Iterator[None]:
    """The experiments have been done already."""
    with robot(), CASES["tune"].during():
        yield


@contextmanager
def tuned() -> Iterator[None]:
    """The robot has been tuned already."""
    with robot(), CASES["autotune"].during():
        yield


@contextmanager
def live() -> Iterator[None]:
    """The robot is excited for a moment, and what is found is the nominal robot."""
    with robot(), CASES["identify live"].during():
        yield


@dataclass(frozen=True)
class Rule:
    """How the examples that begin with ``head`` are run; the first rule that fits counts.

    ``leave`` are options without which it is run, with their values; ``more`` are words behind it, of which a later
    option takes the place of an earlier one. ``codes`` are the exit codes of a command that did its work: 1 where it
    judges what it found. ``new`` are files that must not be there yet, ``answers`` what a person types.
    """

    head: str
    more: str = ""
    leave: tuple[str, ...] = ()
    during: Callable[[], AbstractContextManager[Any]] = ExitStack
    codes: tuple[int, ...] = (0,)
    new: str = ""
    answers: str = ""


STUDY = "--runs 8 --workers 1 --batch 8 --duration 0.3"
STAND_IN = ("--link", "--source", "--pwm-min")
RULES = (
    Rule("drive keys", leave=LINK, during=pressed_keys),
    Rule("drive pose", leave=LINK, during=robot, codes=(0, 1)),
    Rule("drive trajectory", leave=LINK, during=partial(robot, end_s=300.0)),
    Rule("drive path", leave=LINK, during=partial(robot, end_s=300.0)),
    Rule("drive duty", leave=LINK, during=partial(robot, "stand")),
    Rule("monitor --once", leave=LINK, during=robot),
    Rule("monitor", leave=LINK, during=partial(robot, end_s=2.0)),
    Rule("mocap bridge --source recorded", "--duration 0.3", LINK, real_time_robot, codes=(0, 1)),
    Rule("mocap bridge --source camera", "--duration 0.3", LINK, real_time_robot, codes=(0, 1)),
    Rule("mocap bridge", "--source simulated --duration 0.3", LINK, real_time_robot, codes=(0, 1)),
    Rule("mocap latency", leave=LINK, during=turned_robot),
    Rule("mocap record", "--source simulated --duration 0.3", new="*.csv"),
    Rule("mocap markers tags --paper", "--sheets svg"),
    Rule("mocap markers", "--sheets svg", new="tags/camera.toml"),
    Rule("mocap calibrate", during=known_lens),
    Rule("mocap"),
    Rule("link", "--listen tcp:127.0.0.1:0", ("--listen",), soon_unplugged),
    Rule("radio --new-key", new="robot.key"),
    Rule("radio --show-key"),
    Rule("host-control motor", "--duration 0.1", during=no_radio),
    Rule("host-control", "--simulate --duration 20", STAND_IN, codes=(0, 1)),
    Rule("params save", leave=LINK, during=robot, new="mine.toml"),
    Rule("params diff", leave=LINK, during=robot, codes=(0, 1)),
    Rule("params list --presets"),
    Rule("params undo", leave=LINK, during=changed),
    Rule("tune --experiment trajectory", leave=LINK, during=tried),
    Rule("tune --set WS_P=1 -e", "--rounds 1", LINK, robot),
    Rule("tune --set ISMC_LAM_XY=3", "--rounds 1", LINK, robot),
    Rule("tune --set WS_P=2", "--rounds 2", LINK, robot),
    Rule("tune", leave=LINK, during=robot),
    Rule("autotune --name", "--legs 4 --rounds 2", LINK, partial(robot, end_s=900.0), new="mine.toml"),
    Rule("autotune", leave=LINK, during=tuned),
    Rule("experiment wheel-chirp --wheel 1", leave=LINK, during=partial(robot, "stand")),
    Rule("experiment", leave=LINK, during=robot),
    Rule(
        "identify geometry-live",
        "--simulated fast_three_wheel --robot fast_three_wheel --room 2",
        ("--source",),
        new="found.toml",
    ),
    Rule("identify geometry", during=files_of_examples, new="identified.toml *.npz"),
    Rule("identify logs", new="identified.toml"),
    Rule("identify telemetry", during=CASES["identify telemetry"].during, new="identified.toml mine.toml"),
    Rule("identify live --duration 20", leave=LINK, during=live, new="identified.toml drive.tlog"),
    Rule("identify live --on-stand", leave=LINK, during=partial(robot, "stand", 600.0), new="stand.tlog"),
    Rule("identify live", leave=LINK, during=live, new="identified.toml mine.toml drive.tlog stand.tlog"),
    Rule(
        "identify simulate", "--duration 4", during=CASES["identify simulate"].during, new="identified.toml found.toml"
    ),
    Rule("sitl", "--port 0", during=no_emulator),
    Rule("studio", "--no-browser --port 0", during=no_page),
    Rule("runs drive-pose-2 --delete", answers="y\n"),
    Rule("runs"),
    Rule("run", leave=LINK, during=short_runs),
    Rule("montecarlo", STUDY, ("--cluster",)),
    Rule("sweep", STUDY),
    Rule("optimize", f"--trials 2 {STUDY}", codes=(0, 1)),
    Rule(f"{CHECKS}autotune", "--robots 2 --rivals 0 --stops 0 --workers 1", during=CASES["checks autotune"].during),
    Rule(f"{CHECKS}soak", during=no_soak),
    Rule(f"{CHECKS}bench", "--duration 1 --repeat 1", during=one_loop),
    Rule(f"{CHECKS}image", during=CASES["checks image"].during),
    Rule("robots new mine --ask", answers="\n" * 40, new="mine.toml", codes=(0, 1, 2)),
    Rule("robots new", new="mine.toml"),
    Rule("robots"),
    Rule("flash", "--dry-run", during=no_build),
    # Nobody turns the wheels by hand, so Ctrl-C ends the wait for it.
    Rule("bringup encoders", during=person, codes=(130,)),
    Rule("bringup --r", leave=("--radio",), during=person, codes=(1, 130)),
    Rule("bringup", leave=("--radio",), during=person, codes=(0, 1)),
    Rule("doctor", codes=(0, 1)),
    Rule("record", "--duration 2", LINK, robot, new="run.tlog"),
    Rule("replay"),
    Rule("logs import", new="run1.npz"),
    Rule("logs"),
    Rule("plot"),
    Rule("reproduce", "diagrams --quick"),
    Rule("", leave=LINK, during=robot),
)
STAND_INS = {
    "~/": "",
    "/tmp/": "",
    "omni_reproduce/real_three_wheel/mapping.toml": "mapping.toml",
    "table2 fig13": "",
    "table7": "",
}


def rule_of(line: str) -> Rule:
    """Return how this example is run."""
    plain = line.removeprefix("omni ")
    return next(rule for rule in RULES if plain.startswith(rule.head))


def words_of(line: str, rule: Rule) -> list[str]:
    """Return the words behind the program."""
    command = line.removeprefix(CHECKS).removeprefix("omni ").split(" | ")[0].split("  #")[0]
    for real, stand_in in STAND_INS.items():
        command = command.replace(real, stand_in)
    words = [name for word in shlex.split(command) for name in expanded(word)]
    kept = [
        word for i, word in enumerate(words) if word not in rule.leave and (i == 0 or words[i - 1] not in rule.leave)
    ]
    return [*kept, *shlex.split(rule.more)]


def expanded(word: str) -> list[str]:
    """Return the files that a pattern stands for, as a shell does."""
    return sorted(map(str, Path().glob(word))) if set("?*") & set(word) else [word]


def make_camera(folder: Path) -> None:
    """Write the files of a webcam that is placed, and pictures in its stead: of the floor, and with a robot."""
    of = scene(View(SMALL, (0.05, -0.9, 1.8), (0.0, 0.0, 0.0)))
    (folder / "tags").mkdir()
    write_files(folder / "tags", of, '"../board"')
    (folder / "board").mkdir()
    empty, robot = of.picture(None), of.picture(Pose(0.1, 0.0, 0.5))
    for name, picture in (("empty_floor", empty), ("board/1", empty), ("floor1", robot), ("board/2", robot)):
        imageio.imsave(folder / f"{name}.png", picture, cmap="gray", vmin=0, vmax=255)


def make_files(folder: Path) -> None:
    """Write what the examples read: logs of a known robot, a finished run, robot and parameter files."""
    (folder / "quick.toml").write_text(QUICK, encoding="utf-8")
    (folder / "my_scenario.toml").write_text(QUICK, encoding="utf-8")
    (folder / "logged.toml").write_text(f"{QUICK}\n[parameters]\nSR1_WHEELS = 50.0\n", encoding="utf-8")
    (folder / "my_simulator.py").write_text(SIMULATOR, encoding="utf-8")
    for name in ("line", "loop"):
        (folder / f"{name}.csv").write_text("x,y\n0,0\n0.2,0.05\n0.3,0.2\n0.1,0.2\n", encoding="utf-8")
    (folder / "mapping.toml").write_text(synthetic.MAPPING, encoding="utf-8")
    for name in ("nominal", "identified", "mine", "my_robot"):
        (folder / f"{name}.toml").write_text(synthetic.ROBOT, encoding="utf-8")
    for name in (
        "firmware.elf",
        "firmware.hex",
        "omniwheel-0.1.0-three_wheel.hex",
        ".pio/build/three_wheel/firmware.elf",
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")
    new_key_file(folder / "robot.key")
    make_camera(folder)
    for seed, name in enumerate(("run1", "run2", "run3", "spin1", "motor1"), start=1):
        synthetic.write(folder, name, synthetic.Known(), seed)
        imported = f"logs import {name}.csv --mapping mapping.toml --truth truth_{name}.csv --out {name}.npz"
        assert CliRunner().invoke(app, imported.split()).exit_code == 0
    shutil.copy(folder / "truth_run1.csv", folder / "truth1.csv")
    for line in ("mocap record lap.csv --source simulated --duration 0.3", "run logged.toml --out made"):
        assert CliRunner().invoke(app, line.split()).exit_code in (0, 1)
    run = next((folder / "made").iterdir())
    for name in ("demo-seed1", "demo-seed1-2", "drive-pose", "drive-pose-2"):
        shutil.copytree(run, folder / "runs" / name)
    for name in ("flight", "drive", "other", "stand"):
        shutil.copy(run / "telemetry.tlog", folder / f"{name}.tlog")
