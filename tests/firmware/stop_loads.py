# SPDX-License-Identifier: MIT
"""Stops of a robot whose background is busy, and of one that rests: more cases of :mod:`tests.firmware.stop_latency`.

A busy background gets requests on all other links, again and again, and one pass per tick: whatever they ask for, the
pass that reads the stop's last byte sees it. A robot that rests has no duty to lose. There a stop must leave the motors
off and end in its own state, whatever came before it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

from tests.firmware import stop_latency
from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    DISARMED,
    EMERGENCY,
    ESTOP,
    FAILSAFE,
    INIT,
    PORTS,
    USB,
    FakeRobot,
    command,
    frame,
    velocity,
)
from tests.firmware.stop_latency import (
    AFTER,
    BEFORE,
    BUTTON,
    FILLS,
    HOST,
    LIMIT_TICKS,
    MOMENTS,
    MOMENTS_IN_LOOP,
    PIN,
    STOPS,
    Case,
)

SAVE = command(mav.MAV_CMD_PREFLIGHT_STORAGE, 1.0)
LIST = frame("param_request_list", 1, 1)
MISSIONS_AND_LOGS = b"".join(
    (
        frame("mission_request_list", 1, 1),
        frame("mission_count", 1, 1, 9),
        frame("log_request_list", 1, 1, 0, 0xFFFF),
        frame("log_request_data", 1, 1, 0, 0, 90),
        frame("log_erase", 1, 1),
        frame("file_transfer_protocol", 0, 1, 1, [0] * 251),
    )
)
_EVERYTHING_OFTEN = b"".join(
    command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, message, 1000.0)
    for message in (mav.MAVLINK_MSG_ID_OMNI_STATUS, mav.MAVLINK_MSG_ID_ODOMETRY, mav.MAVLINK_MSG_ID_OMNI_WHEELS)
)
LOADS: dict[str, bytes] = {
    "saves": SAVE * 8,
    "parameter lists": LIST * 8,
    "missions and logs": MISSIONS_AND_LOGS * 4,
    "bursts and their download": (stop_latency.BURST + stop_latency.LOG_DATA) * 4,
    "all of it, telemetry at 1 kHz": _EVERYTHING_OFTEN + LIST + SAVE + MISSIONS_AND_LOGS * 2,
}
"""What is asked for on each of the other links."""
AGAIN = 3
"""Ticks in which it is asked for once more."""
BUSY_BEFORE = {"pose fixes": (0, 3), "noise": (3,), "arm commands": (1,)}
"""Frames in front of the stop on its own link: what one pass reads."""
BUSY, RESTING = "driving, busy", "at rest"


def _booting(_: FakeRobot) -> None:
    pass


def _disarmed(robot: FakeRobot) -> None:
    robot.ready()


def _failsafe(robot: FakeRobot) -> None:
    robot.armed()
    robot.send(USB, velocity(0.1))
    robot.tick(600)  # SAFE_CMD_TO is 0.4 s


def _stopped(robot: FakeRobot) -> None:
    robot.ready()
    robot.send(USB, EMERGENCY)
    robot.tick(5)


def _in_loop(robot: FakeRobot) -> None:
    robot.in_loop(HOST, drive=False)


REST: dict[str, tuple[Callable[[FakeRobot], None], int]] = {
    "starting up": (_booting, INIT),
    "disarmed": (_disarmed, DISARMED),
    "failsafe": (_failsafe, FAILSAFE),
    "stopped": (_stopped, ESTOP),
    "in the loop, disarmed": (_in_loop, DISARMED),
}
"""How a robot comes to rest, and the state it is in then."""


def busy_cases(moment: str) -> Iterator[tuple[Case, str]]:
    """Yield every case out of a moment with every load."""
    for stop in [*STOPS, BUTTON, *([PIN] if moment == "duty" else [])]:
        for link in range(PORTS):
            for before, fills in BUSY_BEFORE.items():
                for fill in fills:
                    yield from ((Case(stop, moment, link, before, fill), load) for load in LOADS)


def rest_cases(moment: str) -> Iterator[Case]:
    """Yield every case of a robot that rests like this."""
    for stop in [*STOPS, BUTTON]:
        for link in range(PORTS):
            for before in BEFORE:
                yield from (Case(stop, moment, link, before, fill) for fill in FILLS[::3])


def _ask(robot: FakeRobot, case: Case, load: str) -> None:
    for link in range(PORTS):
        if link != case.link:
            robot.send(link, LOADS[load])


def busy_ticks(robot: FakeRobot, case: Case, load: str, request: bytes) -> int:
    """Return the ticks to motors off for good, with one pass of the background per tick."""
    _ask(robot, case, load)
    robot.send(case.link, b"".join(BEFORE[case.before](number) for number in range(case.fill)), request)
    robot.pass_once()
    if case.stop == BUTTON:
        robot.press(hil=case.moment in MOMENTS_IN_LOOP)
    for tick in range(AFTER):
        if tick < AGAIN:
            _ask(robot, case, load)
        if case.moment in MOMENTS_IN_LOOP:
            robot.hil_tick(HOST)
        else:
            robot.bare_tick()
            robot.pass_once()
        if not stop_latency.is_off(robot, case):
            return LIMIT_TICKS + 1
    return LIMIT_TICKS


def state_after(case: Case) -> int:
    """Return the state that this stop must end in."""
    released = case.before == "releases" and case.fill > 0
    return ESTOP if case.stop != "disarm" or (case.moment == "stopped" and not released) else DISARMED


def rest_ticks(robot: FakeRobot, case: Case, request: bytes) -> int:
    """Return LIMIT_TICKS if the motors never came on and the state is right in the end."""
    robot.send(case.link, b"".join(BEFORE[case.before](number) for number in range(case.fill)), request)
    robot.background()
    in_loop = case.moment.startswith("in the loop")
    if case.stop == BUTTON:
        robot.press(hil=in_loop)
    for _ in range(AFTER):
        if in_loop:
            robot.hil_tick(HOST)
        else:
            robot.tick()
        if robot.enabled(in_loop) or robot.has_duty(in_loop):
            return LIMIT_TICKS + 1
    return LIMIT_TICKS if robot.state() == state_after(case) else LIMIT_TICKS + 1


def measure(*, every: int = 1) -> tuple[dict[tuple[str, str], Counter[int]], list[str]]:
    """Return the distribution of ticks by stop and situation over every n-th case, and the cases beyond the limit."""
    ticks: dict[tuple[str, str], Counter[int]] = {}
    late: list[str] = []
    requests = {**STOPS, PIN: stop_latency.TEST_PIN, BUTTON: b""}

    def note(stop: str, situation: str, took: int, what: str) -> None:
        ticks.setdefault((stop, situation), Counter())[took] += 1
        if took > LIMIT_TICKS:
            late.append(what)

    robot = FakeRobot()
    fresh = robot.keep()
    for name, act in {**MOMENTS, **MOMENTS_IN_LOOP}.items():
        robot.go_back(fresh)
        act(robot)
        moment = robot.keep()
        for load in LOADS:
            robot.go_back(moment)
            assert busy_ticks(robot, Case("", name, USB, "pose fixes", 0), load, b"") > LIMIT_TICKS, "it would drive on"
        for case, load in list(busy_cases(name))[::every]:
            robot.go_back(moment)
            note(case.stop, BUSY, busy_ticks(robot, case, load, requests[case.stop]), f"{case}, busy with {load}")
    for name, (come_to_rest, state) in REST.items():
        robot.go_back(fresh)
        come_to_rest(robot)
        moment = robot.keep()
        assert robot.state() == state, name
        for case in list(rest_cases(name))[::every]:
            robot.go_back(moment)
            note(case.stop, RESTING, rest_ticks(robot, case, requests[case.stop]), str(case))
    robot.close()
    return ticks, late


def arms_if_nobody_stops() -> bool:
    """See that the arm commands which stand in front of some stops do arm a robot that rests."""
    robot = FakeRobot().ready()
    robot.send(USB, BEFORE["arm commands"](0))
    robot.tick(AFTER)
    came_on = robot.enabled()
    robot.close()
    return came_on


def table(ticks: dict[tuple[str, str], Counter[int]]) -> str:
    """Return the distribution as the page shows it."""
    lines = ["| Stop | Robot | Cases | Off after 2 ticks | Later, or on again |", "|---|---|---|---|---|"]
    for (stop, situation), counted in ticks.items():
        late = sum(count for took, count in counted.items() if took > LIMIT_TICKS)
        lines.append(f"| {stop} | {situation} | {sum(counted.values())} | {sum(counted.values()) - late} | {late} |")
    return "\n".join(lines)
