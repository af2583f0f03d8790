# SPDX-License-Identifier: MIT
"""The link itself: heartbeats, versions, the robot behind it, latency, how it has fared since it started."""

from __future__ import annotations

from omni_schema import Robot as RobotFile
from omniwheel import __version__
from omniwheel.bringup.bench import health_of
from omniwheel.bringup.other_stops import safety_of
from omniwheel.bringup.radio import RadioProbe
from omniwheel.bringup.result import Findings, Result
from omniwheel.dialect import Message
from omniwheel.robot import Robot
from omniwheel.telemetry import Heartbeat, decode

LISTEN_S = 3.2
MIN_HEARTBEATS = 2
LATENCY_LIMIT_S = 0.05
PINGS_S = 1.0
_BAUD_USB = 1_000_000
_SHOWN = 6


def check_link(robot: Robot, file: RobotFile | None = None, radio: Robot | None = None) -> Result:
    """Look at a connected robot; ``file`` is the robot it should be, ``radio`` the same robot over its other link."""
    findings = Findings("link")
    _judge_heartbeats(findings, robot, "USB" if radio is not None else "heartbeat")
    if radio is not None:
        _judge_heartbeats(findings, radio, "radio")
        same = radio.connection.target_system == robot.connection.target_system
        findings.judge(
            "same robot",
            same,
            f"system ids {robot.connection.target_system} and {radio.connection.target_system}",
            "the two links lead to two robots: check the radio's PAN id, or SYS_ID",
        )
    _judge_version(findings, robot)
    if file is not None:
        _judge_file(findings, robot, file)
    _judge_latency(findings, robot)
    _judge_health(findings, robot)
    return findings.result()


def _judge_heartbeats(findings: Findings, robot: Robot, name: str) -> None:
    count = 0

    def take(message: Message) -> None:
        nonlocal count
        count += decode(Heartbeat, message) is not None

    remove = robot.connection.add_listener(take)
    try:
        robot.pump(LISTEN_S)
    finally:
        remove()
    findings.judge(
        name,
        count >= MIN_HEARTBEATS,
        f"{count} heartbeats in {LISTEN_S:g} s over {robot.url}",
        "heartbeats are lost: use another cable or port, with one program only",
    )


def _judge_version(findings: Findings, robot: Robot) -> None:
    version = robot.version
    findings.measured |= {"firmware": version.firmware, "git": version.git_hash, "changed": version.dirty}
    findings.judge(
        "firmware",
        version.firmware == __version__,
        f"{version} on the robot, {__version__} here",
        "flash the firmware of this version: make flash",
    )
    findings.judge(
        "parameter table",
        version.schema_crc == robot.table.crc,
        "equal on robot and host" if version.schema_crc == robot.table.crc else "the robot's table differs",
        "flash the firmware that belongs to this omniwheel: make flash",
    )


def _judge_file(findings: Findings, robot: Robot, file: RobotFile) -> None:
    wanted = file.parameter_values()
    keyed = [p.name for p in robot.table.parameters if p.robot_key is not None and (p.wheel or 0) < file.wheels]
    wrong = {name: (robot.parameters[name], wanted[name]) for name in keyed if not _same(robot, name, wanted[name])}
    shown = ", ".join(f"{name} is {have:g}, not {want:g}" for name, (have, want) in list(wrong.items())[:_SHOWN])
    more = f" and {len(wrong) - _SHOWN} more" if len(wrong) > _SHOWN else ""
    findings.measured["differences"] = sorted(wrong)
    findings.judge(
        "robot",
        not wrong,
        f"{shown}{more}" if wrong else f"it is {file.name}: {file.wheels} wheels, {file.description}",
        f"flash the firmware built for {file.name}, or make {file.source} describe this robot; values stored on the "
        "robot are cleared by: omni params reset",
    )


def _same(robot: Robot, name: str, wanted: float) -> bool:
    have = robot.parameters[name]
    return abs(have - wanted) <= 1e-6 * max(abs(wanted), 1.0)


def _judge_latency(findings: Findings, robot: Robot) -> None:
    probe = RadioProbe(robot, _BAUD_USB)
    try:
        window = probe.measure(PINGS_S)
    finally:
        probe.close()
    findings.measured["round_trip_median_s"] = window.percentile_s(0.5)
    findings.judge(
        "latency",
        window.answered > 0 and window.percentile_s(0.5) <= LATENCY_LIMIT_S,
        f"median round trip {1e3 * window.percentile_s(0.5):.1f} ms, {window.answered} of {window.sent} answered",
        "slow for USB: if this is the radio, use `omni bringup radio`; else avoid USB hubs and load on the computer",
    )


def _judge_health(findings: Findings, robot: Robot) -> None:
    health, status = health_of(robot), safety_of(robot)
    findings.measured |= {"reset_cause": health.reset_cause, "overruns": status.overruns, "state": status.state}
    findings.judge(
        "restart",
        health.reset_cause in ("power", "software"),
        f"started by {health.reset_cause}",
        "cool the processor: it was above 90 °C"
        if health.reset_cause == "over-temperature"
        else "the firmware hung or crashed before: `omni record` the status texts after a restart and report them",
    )
    findings.judge(
        "tick",
        status.overruns == 0,
        f"{status.overruns} overruns",
        "ticks were late: check that this is no debug build",
    )
    findings.judge(
        "state",
        status.state == "disarmed",
        f"{status.state}{': ' + ', '.join(status.faults) if status.faults else ''}",
        "disarm (omni drive does at its end) or release the e-stop; the faults name the cause",
    )
