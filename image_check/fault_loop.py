# SPDX-License-Identifier: MIT
"""The fault cases with the image in a host's loop, which can show what no wire can: all as in the PC program."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import omniwheel.robot
from hil_sim.fault_bench import FaultResult, RunningFirmware, run_case
from hil_sim.fault_cases import CASES
from hil_sim.hil import AT_REST
from hil_sim.image_firmware import ImageFirmware
from image_check.bench import CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.faults import NOT_AT_THE_PINS
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.link import FileLink

CASES_ROBOT = "three_wheel"
"""The robot of the fault cases."""


@dataclass(frozen=True)
class _InTheLoop:
    link: FileLink

    def open_link(self, number: int = 0) -> FileLink:
        """Return the link over which it is in the loop; it has no other."""
        return self.link


def flashed(image: Path) -> Callable[..., AbstractContextManager[RunningFirmware]]:
    """Return a firmware for :func:`run_case`: the image on an emulated Teensy, over its USB port."""

    @contextmanager
    def start(*, parameters: dict[str, float], lockstep: bool) -> Iterator[RunningFirmware]:
        with ImageFirmware(image, CASES_ROBOT, lockstep=lockstep, scenario=AT_REST) as running:
            link = running.open_link()
            robot = omniwheel.robot.connect(link)
            before = dict(robot.parameters)
            wanted = {**parameters, "SYS_ID": before["SYS_ID"]}
            robot.parameters.set_many({name: value for name, value in wanted.items() if before.get(name) != value})
            robot.enter_hil()
            yield _InTheLoop(link)

    return start


def faults_in_the_loop(context: Context) -> list[str]:
    """Each case as on the PC: the same time to zero volts, the same words, the same way back."""
    if context.scenario.robot.name != CASES_ROBOT:
        return [f"not tried: the cases are for the robot {CASES_ROBOT}"]
    cases = [case for case in CASES if context.depth == NIGHTLY or case.name in NOT_AT_THE_PINS]
    figures = []
    for case in cases:
        image, pc = run_case(case, flashed(context.image.path)), run_case(case, FirmwareProcess)
        compare(image, pc)
        if case.name in NOT_AT_THE_PINS:
            figures.append(f"{case.what}: {_time(image.latency_s)}")
    return [*figures, f"{len(cases)} cases: times, texts, faults and the way back equal to the PC program's"]


def compare(image: FaultResult, pc: FaultResult) -> None:
    """Raise CheckError for what differs."""
    for name in ("latency_s", "texts", "faults", "warnings", "stayed_armed", "moved_after"):
        ours, theirs = getattr(image, name), getattr(pc, name)
        if ours != theirs:
            raise CheckError(f"{pc.case.name}: {name} is {ours}, the PC program's is {theirs}")


def _time(latency_s: float | None) -> str:
    return "drives on" if latency_s is None else f"zero volts after {1e3 * latency_s:.0f} ms"


CHECKS = (
    Check("faults-in-the-loop", "faults that no wire shows, host-in-the-loop", faults_in_the_loop, (CI, NIGHTLY)),
)
