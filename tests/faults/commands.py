# SPDX-License-Identifier: MIT
"""The commands that write files, each as a case for :mod:`tests.faults.drive`; and the commands that write none.

What takes minutes and is no writing (driving, identifying, checking an image) is replaced by something short.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import matplotlib.image as imageio
import numpy as np
import typer

from hil_sim.studies.autotune_robot import ROW
from hil_sim.studies.autotune_study import PARTS, Part
from omniwheel import FirmwareProcess
from omniwheel.autotune.choice import Choice
from omniwheel.autotune.gains import WheelGains
from omniwheel.autotune.sweep import Swept
from omniwheel.burst import Burst
from omniwheel.experiments.outcome import Figure, Line, Outcome, Panel
from omniwheel.experiments.repeated import Try
from omniwheel.experiments.session import Claims
from omniwheel.identification.estimate import Estimate
from omniwheel.identification.geometry_drive import DrivenGeometry
from omniwheel.identification.model import FLOOR
from omniwheel.identification.pose_fit.scores import Score
from omniwheel.identification.pose_fit.study import identify_geometry
from omniwheel.identification.robot_file import write_robot_file
from omniwheel.mocap.camera.geometry import Eye
from omniwheel.mocap.camera.lens import Lens, save_lens
from omniwheel.mocap.camera.place import Placement
from omniwheel.tuning import Figures, Trace
from omniwheel.wheel_loop import Margins
from tests.host.logs import synthetic
from tests.host.pose_fit.robots import THREE, drive, runs, true_values
from tests.quick_scenario import QUICK


@dataclass(frozen=True)
class Case:
    """A command line; {disk} is the folder whose calls fail, {inputs} what :func:`make_inputs` made.

    ``links``: it needs a robot, whose link takes the place of {link}. ``again``: after a failure the same command goes
    on in the same folder. ``during`` is a context for its run. ``step``: every so many calls one fails, for slow ones.
    ``tells``: what is said whatever fails, because it took the robot minutes; only if ``driven`` was said.
    """

    line: str
    links: bool = False
    again: bool = False
    step: int = 1
    tells: str = ""
    driven: str = ""
    during: Callable[[], Any] = field(default=ExitStack)

    @property
    def words(self) -> tuple[str, ...]:
        """The command line's words."""
        return tuple(self.line.split())


def make_inputs(folder: Path) -> None:
    """Write what the commands read."""
    (folder / "quick.toml").write_text(QUICK, encoding="utf-8")
    (folder / "mapping.toml").write_text(synthetic.MAPPING, encoding="utf-8")
    (folder / "robot.toml").write_text(synthetic.ROBOT, encoding="utf-8")
    for seed in (1, 2):
        synthetic.write(folder, f"run{seed}", synthetic.Known(), seed)


@contextmanager
def _patched(**replacements: Any) -> Iterator[None]:
    with ExitStack() as stack:
        for name, value in replacements.items():
            stack.enter_context(patch(name.replace("__", "."), value))
        yield


def _identified(*_: Any, **__: Any) -> Any:
    """Write the nominal robot's file instead of an identified one's: by the same way, in a moment."""
    with patch("omniwheel.identification.robot_file.changes", lambda _: {}):
        return write_robot_file(None, *_[1:])  # type: ignore[arg-type]


def _telemetry() -> Any:
    fit = SimpleNamespace(fit=1.0, rmse_rad_s=0.0)
    found = SimpleNamespace(motors=None, diagnostics=fit, validation=1.0, remarks=())
    return _patched(
        omniwheel__identification__pipeline__identify_robot=lambda *_, **__: found,
        omniwheel__identification__robot_file__write_robot_file=_identified,
        omni__cli__identify___table=lambda *_: "",
        omni__cli__identify___as_dict=lambda *_: {},
        omniwheel__identification__sources__read_dataset=lambda path, *_: SimpleNamespace(name=str(path)),
    )


@cache
def _geometry(*_: Any) -> Any:
    """Identify a robot that is known once for all calls that fail."""
    return identify_geometry(runs(THREE, true_values(THREE, 5), count=2), THREE)


def _known_geometry() -> Any:
    return _patched(omniwheel__identification__pose_fit__study__identify_geometry=lambda *_: _geometry())


def _driven_geometry() -> Any:
    run = Score("check", "check", 0.1, 0.1, 0.1, 0.1, 1.0)
    logs = (drive(THREE, true_values(THREE, 5), 1, duration_s=2.0),)
    return _patched(
        omni__cli__identify_geometry_live___robot=lambda *_: nullcontext(),
        omni__cli__identify_geometry_live___truth=lambda *_, **__: nullcontext(),
        omniwheel__identification__geometry_drive__drive_geometry=lambda *_, save, **__: save(logs[0]) or logs,
        omniwheel__identification__geometry_drive__fit_driven=lambda *_: DrivenGeometry(
            _geometry(), logs, run, replace(run, rms_m=0.01)
        ),
    )


@contextmanager
def _live() -> Iterator[None]:
    def excite(robot: Any, *_: Any) -> None:
        robot.pump(0.3)

    with _telemetry(), _patched(omniwheel__identification__live__excite=excite):
        yield


DRIVEN = "the robot has driven"


def _rounds(_robot: Any, _sets: Any, _rounds: Any, run: Any, *_: Any) -> Any:
    """Return tries as if the robot had driven for minutes."""
    typer.echo(DRIVEN, err=True)
    names = [experiment.name for experiment in run.__self__.experiments]
    return [[_tried(*names)] * 2] * 2


def _tried(*names: str) -> Try:
    trace = Trace(np.arange(3.0), np.zeros((3, 3)), np.zeros((3, 3)))
    return Try(dict.fromkeys(names, trace), Figures(0.012, 0.0).as_dict())


def _tuned(*_: Any) -> Any:
    """Return what autotune says of a robot that it left as it was."""
    values = dict.fromkeys(("WS_P", "WS_I"), 1.0)
    gains = WheelGains(1.0, 1.0, Margins(3.0, 1.0, 0.6), 0.1, 5.0)
    fit = SimpleNamespace(estimate=Estimate(FLOOR[:-1], np.ones(5), np.eye(5), 50.0), fit=0.9)
    design = SimpleNamespace(fit=fit, values=values, before=gains, after=gains)
    for name in ("lifted_before", "lifted_after", "position_before", "position_after"):
        setattr(design, name, gains.margins)
    traces = {"before": [_tried("step").seen["step"]], "after": [_tried("step").seen["step"]]}
    return SimpleNamespace(
        old=values,
        new=values,
        design=design,
        verdicts=[],
        traces=traces,
        kept=False,
        choice=Choice(False, "nothing moved"),
        in_steps=False,
        compared=SimpleNamespace(share=0.7),
        swept=Swept(None, "nothing moved"),
    )


def robot_row(seed: int, _: Any) -> Any:
    """Return what a study keeps of a robot that autotune refused."""
    row = np.zeros(1, ROW)
    row["seed"], row["outcome"] = seed, "refused"
    return row


def _no_tuning() -> Any:
    return _patched(hil_sim__studies__autotune_study__PARTS=(Part("robots", ROW, robot_row), *PARTS[1:]))


def _shown(*_: Any) -> Outcome:
    """Return what an experiment says of a robot that did nothing."""
    burst = Burst(np.zeros(2), {"duty": np.zeros((2, 1))}, {"duty": ("",)}, (0,), 0.0, 1e-3, 1, (1, 1), True)
    line = Line("nothing", np.zeros(2), np.zeros(2))
    panel = Panel("duty", "time [s]", "", [line])
    return Outcome("wheel-step", Claims(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), {}, [Figure("a", "a", "", 1.0)], [panel], burst)


def _short_experiment() -> Any:
    return _patched(omniwheel__experiments__wheel_step=_shown)


def _no_checks() -> Any:
    return _patched(image_check__run__run_checks=lambda *_, **__: [], image_check__run__outcome_page=_page)


def _page(*_: Any) -> str:
    return "# Report\n"


def _no_bring_up() -> Any:
    return _patched(omniwheel__bringup__sequence__bring_up=lambda *_, **__: iter(()))


INPUTS: list[Path] = []

_CAMERA = """\
[camera]
device = 0
width = 640
height = 360
lens = {lens!r}
place = {place!r}
[[floor]]
id = 1
size_m = 0.15
x_m = 0.0
y_m = 0.0
[[robot]]
id = 10
size_m = 0.12
height_m = 0.12
"""


def known_lens() -> Any:
    """Calibrate without a board: tests/host/mocap does it with one."""
    lens = Lens(640, 360, (540.0, 540.0), (320.0, 180.0), (0.0,) * 5, 0.1, 15)
    return _patched(omniwheel__mocap__camera__calibrate__find_lens=lambda _: lens)


@contextmanager
def _camera() -> Iterator[None]:
    """A camera whose pictures are empty, and what they are said to show. What is written goes to the failing disk."""
    inputs = INPUTS[0].resolve()
    disk = inputs.parent / "disk"
    lens = Lens(640, 360, (540.0, 540.0), (320.0, 180.0), (0.0,) * 5, 0.1, 15)
    save_lens(lens, inputs / "lens.toml")
    for name, path in (("calibrate", disk / "lens.toml"), ("place", inputs / "lens.toml")):
        text = _CAMERA.format(lens=str(path), place=str(disk / "place.toml"))
        (inputs / f"{name}.toml").write_text(text, encoding="utf-8")
    imageio.imsave(inputs / "empty.png", np.zeros((360, 640)), cmap="gray")
    eye = Eye(lens, np.array([np.pi, 0.0, 0.0]), np.array([0.0, 0.0, 2.0]), 1e-6 * np.eye(6))
    place = Placement(eye, 0.1, {1: 0.001}, 0.001)
    with (
        known_lens(),
        _patched(
            omni__cli__mocap_camera___mean_corners=lambda *_: {},
            omniwheel__mocap__camera__place__find_place=lambda *_: place,
        ),
    ):
        yield


CASES = {
    "run": Case("run {inputs}/quick.toml --out {disk}/runs"),
    "montecarlo": Case(
        "montecarlo {inputs}/quick.toml --runs 24 --worst 1 --workers 1 --batch 8 --duration 0.3 --out {disk}/mc",
        again=True,
        step=2,
    ),
    "sweep": Case(
        "sweep {inputs}/quick.toml --param WS_P=1:3:2 --runs 8 --workers 1 --batch 8 --duration 0.3 --out {disk}/sw",
        again=True,
        step=2,
    ),
    "optimize": Case(
        "optimize {inputs}/quick.toml --param WS_P=1:3 --trials 2 --runs 8 --workers 1 --batch "
        "8 --duration 0.3 --minimise position_m --constraint completed.mean>=0 --out {disk}/op",
        again=True,
        step=2,
    ),
    "tune": Case(
        "tune --set WS_P=6 -e step --rounds 2 --size 0.02 --duration 0.2 --keep --out {disk} --link {link}",
        links=True,
        tells="12.00",
        driven=DRIVEN,
        step=8,
        during=lambda: _patched(omniwheel__tuning_rounds__run_rounds=_rounds),
    ),
    "autotune": Case(
        "autotune --out {disk} --link {link}",
        links=True,
        tells="WS_P 1 → 1",
        during=lambda: _patched(omniwheel__autotune__procedure__autotune=_tuned),
    ),
    "checks autotune": Case(
        "checks autotune --robots 2 --workers 1 --out {disk}/st", during=_no_tuning, again=True, step=2
    ),
    "plot": Case("plot {inputs}/run --out {disk}/plot.png"),
    "reproduce": Case("reproduce diagrams --out {disk}", step=4),
    "record": Case("record {disk}/r.tlog --duration 0.3 --link {link}", links=True),
    "replay": Case("replay {inputs}/run1.npz --robot {inputs}/robot.toml --csv {disk}/r.csv --plot {disk}/r.png"),
    "checks image": Case("checks image {inputs}/none.elf --out {disk}/page.md", during=_no_checks),
    "robots export": Case("robots export three_wheel {disk}/robot.urdf"),
    "params save": Case("params save {disk}/p.toml --link {link}", links=True),
    "drive velocity": Case("drive velocity 0 0 0 --duration 0.1 --out {disk} --link {link}", links=True, step=5),
    "host-control pose": Case(
        "host-control pose 0.1 0 0 --simulate --for 0.5 --tolerance 0 --plot {disk}/l.png",
    ),
    "mocap record": Case("mocap record {disk}/m.csv --source simulated --for 0.3"),
    "mocap markers": Case("mocap markers {disk}/tags --floor 1 --sheets svg", step=6),
    "mocap calibrate": Case("mocap calibrate {inputs}/calibrate.toml {inputs}/empty.png", during=_camera),
    "mocap place": Case("mocap place {inputs}/place.toml {inputs}/empty.png", during=_camera),
    "radio": Case("radio --new-key {disk}/robot.key"),
    "logs import": Case("logs import {inputs}/run1.csv --mapping {inputs}/mapping.toml --out {disk}/l.npz"),
    "robots new": Case(
        "robots new mine --motor pololu_37d_30 --wheel-diameter 96mm --wheel-distance 160mm --mass 4 --out {disk}"
    ),
    "robots check": Case("robots check three_wheel --plot {disk}/s.png"),
    "robots wiring": Case("robots wiring three_wheel --out {disk}/w.svg"),
    "bringup": Case("bringup --yes --out {disk} --link {link}", links=True, during=_no_bring_up),
    "experiment": Case(
        "experiment wheel-step --out {disk} --link {link}",
        links=True,
        step=10,
        during=_short_experiment,
    ),
    "identify logs": Case(
        "identify logs {inputs}/run1.npz {inputs}/run2.npz --turn {inputs}/run2.npz --lifted "
        "{inputs}/run2.npz --robot {inputs}/robot.toml --out {disk}/i.toml --page {disk}",
        step=3,
    ),
    "identify geometry": Case(
        "identify geometry {inputs}/run1.npz {inputs}/run2.npz --robot {inputs}/robot.toml --out {disk}/g.toml "
        "--plot {disk}/g.png",
        during=_known_geometry,
    ),
    "identify geometry-live": Case(
        "identify geometry-live --simulated three_wheel --robot {inputs}/robot.toml --out {disk}/g.toml "
        "--logs {disk}/runs",
        during=_driven_geometry,
    ),
    "identify telemetry": Case("identify telemetry {inputs}/quick.toml --name found --out {disk}", during=_telemetry),
    "identify live": Case(
        "identify live --name found --out {disk} --log {disk}/i.tlog --link {link}",
        links=True,
        during=_live,
    ),
    "identify simulate": Case(
        "identify simulate three_wheel --duration 4 --name found --out {disk}",
        during=_telemetry,
    ),
}

STORED_BY_FIRMWARE = ("sitl",)
"""Commands whose ``--storage`` a firmware writes: tests/firmware/test_storage_file.py."""

WRITE_NOTHING = (
    "checks soak", "checks bench", "monitor", "studio", "flash", "doctor",
    "params list", "params set", "params load",
    "params diff", "params reset", "params undo",
    "runs",
    "host-control motor", "mocap bridge", "mocap look", "mocap latency",
    "logs show", "logs align", "robots show",
    "stop", "link",
)  # fmt: skip
"""Commands that write no file of the user's (``flash`` has PlatformIO write its build folder)."""

SAME_AS = {
    "host-control trajectory": "host-control pose",
    **dict.fromkeys(("drive pose", "drive trajectory", "drive path", "drive duty", "drive keys"), "drive velocity"),
    **{f"drive {name}": name for name in ("host-control pose", "host-control trajectory", "host-control motor")},
}
"""Commands that write by the very code of another one."""


def firmware() -> FirmwareProcess:
    """Return a robot in real time for the commands that need one."""
    return FirmwareProcess("three_wheel")
