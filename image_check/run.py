# SPDX-License-Identifier: MIT
"""Runs the checks of an image and says what they found."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from emulated_teensy.image_file import read_image
from emulated_teensy.machine import not_modelled, unicorn_library
from hil_sim.scenario import load_scenario
from image_check.bench import Context
from image_check.check import CI, Check
from image_check.worker_processes import ProcessFailure, call_in_processes
from omniwheel.errors import FirmwareStartError, OmniError

WORLD = "stand"
PAGE_BEGINS = "# Check of"
"""How the page with the outcomes begins."""
"""The scenario whose world the checks use unless they say otherwise: the robot on a stand."""


NO_CHIP = "not tried: this robot has no PWM chip"
NOT_RUN = "the check could not run: "
"""A failure that begins so says nothing about the image."""

MODULES = (
    "start",
    "enable",
    "bus",
    "chip",
    "drive",
    "latch",
    "stops",
    "latched_stops",
    "faults",
    "unplug",
    "edges",
    "fault_loop",
    "line",
    "backlog",
    "clock",
    "interrupts",
    "gyro",
    "flow",
    "storage",
    "power",
    "ring",
    "wear",
    "restarts",
    "hangs",
    "signing",
    "idle",
    "heat",
)
"""Where checks are, in the order of the report: each module has CHECKS."""


@dataclass(frozen=True)
class Outcome:
    """What a check showed. ``failure`` is "" if it passed.

    ``wall_s`` is the time it took on this computer, ``cpu_s`` what its process used of a processor.
    """

    name: str
    what: str
    figures: tuple[str, ...]
    failure: str
    wall_s: float
    cpu_s: float = 0.0

    @property
    def passed(self) -> bool:
        """Whether it did."""
        return not self.failure

    def as_dict(self) -> dict[str, Any]:
        """Return all of it for JSON."""
        return {**asdict(self), "passed": self.passed}


def all_checks() -> tuple[Check, ...]:
    """Return every check, in the order in which they are reported."""
    modules = (import_module(f"image_check.{name}") for name in MODULES)
    return tuple(check for module in modules for check in module.CHECKS)


def run_one(image: Path, robot: str, depth: str, seed: int, name: str) -> Outcome:
    """Run a check by name, in whatever process."""
    check = next(check for check in all_checks() if check.name == name)
    begin_s, cpu_begin_s = time.perf_counter(), time.process_time()
    figures: list[str] = []
    failure = ""
    try:
        context = Context(read_image(image), load_scenario(WORLD, robot), seed=seed, depth=depth)
        applies = not (check.chip and context.scenario.robot.board.motor_pins)
        figures = check.run(context) if applies else [NO_CHIP]
    except FirmwareStartError as error:  # the PC's firmware, which some checks compare with: nothing about the image
        failure = f"{NOT_RUN}{error}"
    except OmniError as error:
        failure = str(error)
    except Exception as error:  # a check that breaks has not shown anything
        failure = f"the check itself failed: {type(error).__name__}: {error}"
    wall_s, cpu_s = time.perf_counter() - begin_s, time.process_time() - cpu_begin_s
    return Outcome(check.name, check.what, tuple(figures), failure, wall_s, cpu_s)


def run_checks(
    image: Path,
    robot: str,
    *,
    depth: str = CI,
    seed: int = 1,
    only: Sequence[str] = (),
    workers: int = 2,
    done: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Outcome]:
    """Run the checks of this depth side by side; ``done`` is called with each outcome, in the order of the list.

    Raises FirmwareImageError, RobotFileError, MissingPackageError, and ValueError for a name that is none.
    """
    checks = _chosen(depth, only)
    read_image(image)
    load_scenario(WORLD, robot)
    unicorn_library()
    outcomes: dict[int, Outcome] = {}
    told = 0
    for number, outcome in call_in_processes(
        run_one, [(image, robot, depth, seed, check.name) for check in checks], workers
    ):
        outcomes[number] = _failed(checks[number], outcome) if isinstance(outcome, ProcessFailure) else outcome
        while told in outcomes:
            done(outcomes[told])
            told += 1
    return [outcomes[number] for number in range(len(checks))]


def _failed(check: Check, died: ProcessFailure) -> Outcome:
    """Return what becomes of a check whose process gave no result: it has not shown anything."""
    return Outcome(check.name, check.what, (), f"the check itself failed: {died.why}", 0.0)


def _chosen(depth: str, only: Sequence[str]) -> list[Check]:
    known = {check.name: check for check in all_checks()}
    unknown = [name for name in only if name not in known]
    if unknown:
        raise ValueError(f"unknown check {unknown[0]}; known are {', '.join(known)}")
    return [check for name, check in known.items() if (name in only if only else depth in check.depths)]


def outcome_page(image: Path, robot: str, depth: str, seed: int, outcomes: Iterable[Outcome]) -> str:
    """Return a page of what was checked, what it showed, and what no model of a chip can show."""
    outcomes = list(outcomes)
    failed = sum(not outcome.passed for outcome in outcomes)
    verdict = "all passed" if failed == 0 else f"**{failed} failed**"
    lines = [
        f"{PAGE_BEGINS} {image.name} for {robot}",
        "",
        f"{len(outcomes)} checks ({depth}, seed {seed}) on the emulated i.MX RT1062: {verdict}.",
        "",
        "| Check | What | Result |",
        "|---|---|---|",
    ]
    for outcome in outcomes:
        result = "; ".join(outcome.figures) if outcome.passed else f"**failed**: {outcome.failure}"
        lines.append(f"| {outcome.name} | {outcome.what} | {result} |")
    lines += ["", "This is a model of the chip. No silicon was tested. Not modelled:", ""]
    lines += [f"- {sentence}" for sentence in not_modelled()]
    return "\n".join(lines) + "\n"
