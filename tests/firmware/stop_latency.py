# SPDX-License-Identifier: MIT
"""How long a stop takes, in every situation that can be listed; as a module it says so, with ``--write`` in the docs.

The firmware runs in this process on simulated time (:mod:`tests.firmware.fake_robot`). A case is a stop over a link,
out of a moment (what the robot is doing), behind other frames (what waits in the queues). The tick under way while the
command's last byte comes has looked at its flags already, so it counts as the first: a stop that the next one does took
two ticks.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    ARM,
    DISARM,
    EMERGENCY,
    HEARTBEAT,
    PORTS,
    RADIO,
    RELEASE,
    TERMINATE,
    USB,
    FakeRobot,
    command,
    duty,
    frame,
    velocity,
)
from tests.native import ROOT

PAGE = ROOT / "docs/reference/safety.md"
BEGIN = "<!-- stop latency: python -m tests.firmware.stop_latency --write -->"
END = "<!-- end of stop latency -->"
LIMIT_TICKS = 2
FILLS = (0, 1, 2, 3, 7, 8, 9, 10, 15, 16, 31, 32, 33, 63, 64, 96)
"""Frames in front of the stop: around the sizes of all queues that a request passes or once passed."""
HOST = RADIO
"""The link of the host in the loop."""
AFTER = 40
"""Ticks for which the motors must stay off."""
PIN = "output enable"
BUTTON = "stop button"
"""It comes over no link: the frames before it do."""
TEST_PIN = command(mav.MAV_CMD_OMNI_OE_TEST, 0.5, 0.0)
STOPS = {"emergency stop": EMERGENCY, "termination": TERMINATE, "disarm": DISARM}


BURST = command(mav.MAV_CMD_OMNI_BURST, 0.02, 1.0)
"""It is recorded in that many ticks, and is complete before the motors have stayed off long enough."""
EXCITE = command(mav.MAV_CMD_OMNI_EXCITE, 1.0, 1.0, 1.0, 60.0)
"""A minute of a wheel's wanted speed."""
LOG_DATA = frame("log_request_data", 1, 1, 0, 0, 0xFFFFFFFF)


def _pose(number: int) -> bytes:
    return frame("vicon_position_estimate", 0, 1e-6 * (number + 1), 0, 0, 0, 0, 0)


def _target(number: int) -> bytes:
    return frame(
        "set_position_target_local_ned", 0, 1, 1, 1, 0b1001_1111_1000, 0.1, 0.001 * number, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )


BEFORE: dict[str, Callable[[int], bytes]] = {
    "pose fixes": _pose,
    "velocities": lambda number: velocity(0.01, 0.001 * number),
    "pose set-points": _target,
    "duties": lambda number: duty(0.05 + 0.001 * (number % 9)),
    "sticks": lambda number: frame("manual_control", 1, 100, number, 0, 0, 0),
    "heartbeats": lambda _: HEARTBEAT,
    "arm commands": lambda _: ARM,
    "releases": lambda _: RELEASE,
    "trajectory starts": lambda number: (
        command(mav.MAV_CMD_OMNI_TRAJECTORY_START, -1.0, -1.0) if number < 4 else HEARTBEAT
    ),
    "trajectory stops": lambda _: command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP),
    "gains": lambda number: frame("param_set", 1, 1, b"ISMC_LAM_XY", 5.0 + number % 7, 9),
    "parameter lists": lambda _: frame("param_request_list", 1, 1),
    "unknown commands": lambda _: command(31000),
    "bursts": lambda number: BURST if number % 2 == 0 else LOG_DATA,
    "excitations": lambda number: command(mav.MAV_CMD_OMNI_EXCITE, 1.0 + number % 3, 1.0, 0.1, 60.0, number),
    "refused commands": lambda _: command(mav.MAV_CMD_OMNI_SET_POSE, 1e9),
    "noise": lambda number: bytes([0xFE, 0xFD, number % 256, 0x00, 0x55]),
}


def _drive(setpoint: bytes | None) -> Callable[[FakeRobot], None]:
    def act(robot: FakeRobot) -> None:
        robot.armed()
        if setpoint is not None:
            robot.send(USB, setpoint)
        robot.tick(30)

    return act


def _trajectory(robot: FakeRobot) -> None:
    robot.armed()
    robot.send(USB, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, -1.0, -1.0))
    robot.tick(300)


def _just_arming(robot: FakeRobot) -> None:
    robot.ready()
    robot.send(USB, ARM, velocity(0.1))


def _commanded_by_radio(robot: FakeRobot) -> None:
    robot.driving(RADIO)


def _recording(robot: FakeRobot) -> None:
    robot.driving()
    assert robot.ask(USB, command(mav.MAV_CMD_OMNI_BURST, 0.06, 2.0)) == mav.MAV_RESULT_ACCEPTED
    robot.tick()


def _sending_a_log(robot: FakeRobot) -> None:
    robot.driving()
    assert robot.ask(USB, BURST) == mav.MAV_RESULT_ACCEPTED
    robot.tick(40)
    for port in range(PORTS):
        robot.send(port, LOG_DATA)
    robot.pass_once()
    robot.look()
    assert all(any(message.get_type() == "LOG_DATA" for message in said) for said in robot.said)


def _excited(robot: FakeRobot, setpoint: bytes | None, excitation: bytes) -> None:
    _drive(setpoint)(robot)
    assert robot.ask(USB, excitation) == mav.MAV_RESULT_ACCEPTED
    robot.tick(2)


MOMENTS: dict[str, Callable[[FakeRobot], None]] = {
    "holding": _drive(None),
    "velocity": _drive(velocity(0.1)),
    "pose": _drive(_target(1)),
    "duty": _drive(duty(0.2)),
    "sticks": _drive(frame("manual_control", 1, 300, 0, 0, 200, 0)),
    "trajectory": _trajectory,
    "arming in the same tick": _just_arming,
    "the radio in command": _commanded_by_radio,
    "recording": _recording,
    "sending a log": _sending_a_log,
    "excited wheel": lambda robot: _excited(robot, velocity(0.0), EXCITE),
    "pushed wheel": lambda robot: _excited(
        robot, velocity(0.0), command(mav.MAV_CMD_OMNI_EXCITE, 2.0, 1.0, 2.0, 60.0, 0.0, 1.0, 50.0)
    ),
    "excited pose": lambda robot: _excited(robot, None, command(mav.MAV_CMD_OMNI_EXCITE, 3.0, 0.0, 0.002, 60.0)),
}


def _in_loop(robot: FakeRobot) -> None:
    robot.in_loop(HOST)


MOMENTS_IN_LOOP: dict[str, Callable[[FakeRobot], None]] = {"in the loop": _in_loop}
"""The motors are the simulated ones, the tick is the host's."""


@dataclass(frozen=True)
class Case:
    """One stop."""

    stop: str
    moment: str
    link: int
    before: str
    fill: int

    def __str__(self) -> str:
        return f"{self.stop} over link {self.link + 1}, {self.moment}, behind {self.fill} {self.before}"


def stop_ticks(robot: FakeRobot, case: Case, request: bytes) -> int:
    """Return the ticks from the request's last byte to motors off for good, LIMIT_TICKS + 1 if it takes longer."""
    robot.send(case.link, b"".join(BEFORE[case.before](number) for number in range(case.fill)), request)
    robot.background()
    if case.stop == BUTTON:
        robot.press(hil=case.moment in MOMENTS_IN_LOOP)
    for tick in range(1, LIMIT_TICKS):
        _go_on(robot, case)
        if is_off(robot, case):
            return tick + 1 if all(_stays_off(robot, case) for _ in range(AFTER)) else LIMIT_TICKS + 1
    return LIMIT_TICKS + 1


def _go_on(robot: FakeRobot, case: Case) -> None:
    if case.moment in MOMENTS_IN_LOOP:
        robot.hil_tick(HOST)
    else:
        robot.tick()


def is_off(robot: FakeRobot, case: Case) -> bool:
    """Return whether the pin is off, and the duties are zero unless it is the pin alone that stops."""
    hil = case.moment in MOMENTS_IN_LOOP
    return not robot.enabled(hil) and (case.stop == PIN or not robot.has_duty(hil))


def _stays_off(robot: FakeRobot, case: Case) -> bool:
    _go_on(robot, case)
    return is_off(robot, case)


def cases(moment: str) -> Iterator[Case]:
    """Yield every case that begins in a moment."""
    stops = [*STOPS, BUTTON, *([PIN] if moment == "duty" else [])]
    for stop in stops:
        for link in range(PORTS):
            for before in BEFORE:
                for fill in (
                    FILLS[::3] if moment in MOMENTS_IN_LOOP else FILLS if before != "trajectory starts" else FILLS[:6]
                ):
                    yield Case(stop, moment, link, before, fill)


def check_it_would_go_on(robot: FakeRobot, moment: str) -> None:
    """See that without a stop the motors stay on, or come on."""
    case = Case("", moment, USB, "", 0)
    robot.background()
    for _ in range(AFTER):
        _go_on(robot, case)
    assert robot.enabled(moment in MOMENTS_IN_LOOP), moment


def measure(*, every: int = 1) -> tuple[dict[str, Counter[int]], list[Case]]:
    """Return the distribution of ticks per stop over every n-th case, and the cases beyond the limit."""
    requests = {**STOPS, PIN: TEST_PIN, BUTTON: b""}
    ticks: dict[str, Counter[int]] = {stop: Counter() for stop in requests}
    late = []
    robot = FakeRobot()
    fresh = robot.keep()
    for name, act in {**MOMENTS, **MOMENTS_IN_LOOP}.items():
        robot.go_back(fresh)
        act(robot)
        moment = robot.keep()
        check_it_would_go_on(robot, name)
        for number, case in enumerate(cases(name)):
            if number % every:
                continue
            robot.go_back(moment)
            took = stop_ticks(robot, case, requests[case.stop])
            ticks[case.stop][took] += 1
            if took > LIMIT_TICKS:
                late.append(case)
    robot.close()
    return ticks, late


def table(ticks: dict[str, Counter[int]]) -> str:
    """Return the distribution as the page shows it."""
    lines = ["| Stop | Cases | Off after 2 ticks | Later, or on again |", "|---|---|---|---|"]
    for stop, counted in ticks.items():
        late = sum(count for took, count in counted.items() if took > LIMIT_TICKS)
        lines.append(f"| {stop} | {sum(counted.values())} | {sum(counted.values()) - late} | {late} |")
    return "\n".join(lines)


def page_content() -> tuple[str, list[str]]:
    """Measure everything; return both tables, and the cases beyond the limit."""
    from tests.firmware import stop_loads  # which needs what is above

    ticks, late = measure()
    loaded, late_loaded = stop_loads.measure()
    return f"{table(ticks)}\n\n{stop_loads.table(loaded)}", [*map(str, late), *late_loaded]


def in_page(text: str, content: str) -> str:
    """Return the page with this content between its marks."""
    pattern = re.compile(re.escape(BEGIN) + ".*?" + re.escape(END), re.DOTALL)
    if not pattern.search(text):
        raise ValueError(f"{PAGE.name} has no {BEGIN}")
    return pattern.sub(lambda _: f"{BEGIN}\n{content}\n{END}", text)


def main() -> int:
    """Measure, and print the table or write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    write = parser.parse_args().write
    begin = time.process_time()
    content, late = page_content()
    sys.stdout.write(f"{content}\n{time.process_time() - begin:.0f} s of processor time\n")
    for case in late[:20]:
        sys.stderr.write(f"late: {case}\n")
    if write:
        path = Path(PAGE)
        path.write_text(in_page(path.read_text(encoding="utf-8"), content), encoding="utf-8")
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
