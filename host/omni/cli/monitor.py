# SPDX-License-Identifier: MIT
"""``omni monitor``: what the robot says, live."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Group, RenderableType
from rich.live import Live
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table

from omni.cli.common import (
    WARNING_SEVERITY,
    JsonOption,
    LinkOption,
    TimeoutOption,
    console,
    examples,
    open_robot,
    print_json,
)
from omniwheel.limits import DEFAULT_TIMEOUT_S

if TYPE_CHECKING:
    from collections.abc import Sequence

    from omniwheel.pose_quality import PoseQuality
    from omniwheel.robot import Robot
    from omniwheel.sensor_quality import Sensor
    from omniwheel.status import RobotStatus

EXAMPLES = examples(
    "omni monitor --link tcp:127.0.0.1:5760",
    "omni monitor --once --json",
    "omni monitor --message OMNI_CONTROL --json",
)
_REFRESH_S = 0.1
_SILENT_S = 2.5
_STATE_STYLES = {"armed": "bold green", "disarmed": "cyan", "failsafe": "bold red", "estop": "bold red"}
_QUALITY_STYLES = {"good": "green", "contradicted": "bold red"}
_SHOWN_TEXTS = 4


def monitor(
    once: Annotated[bool, typer.Option("--once", help="Print the state once and exit.")] = False,
    message: Annotated[
        list[str] | None,
        typer.Option(
            "--message", "-m", metavar="NAME", help="Print the fields of this MAVLink message instead. Repeatable."
        ),
    ] = None,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Show state, pose, wheels, sensors and faults of a robot until Ctrl-C. --json implies --once."""
    from omni.cli.monitor_messages import known_names, show_messages
    from omniwheel.drive_log import is_slow
    from omniwheel.sensor_messages import RADIO_RATE_HZ, RATE_HZ, sensor_advice

    names = known_names(message or ())
    with open_robot(link, timeout_s=timeout, texts=False) as robot:
        if names:
            show_messages(robot, names, once=once, as_json=as_json)
            return
        wheels = int(robot.parameters["WHEELS"])
        with sensor_advice(robot, RADIO_RATE_HZ if is_slow(robot.url) else RATE_HZ) as sensors:
            if once or as_json:
                status = _heard(robot, sensors, timeout)
                if as_json:
                    print_json(status_as_dict(status))
                else:
                    console.print(view(robot, wheels, sensors))
                return
            with Live(view(robot, wheels, sensors), console=console, screen=False, auto_refresh=False) as live:
                try:
                    while True:
                        robot.pump(_REFRESH_S)
                        live.update(view(robot, wheels, sensors), refresh=True)
                except KeyboardInterrupt:
                    return


def _heard(robot: Robot, sensors: Sequence[Sensor], timeout_s: float) -> RobotStatus:
    """Return a status that has everything; of a sensor that the robot does not tell of in time, nothing."""
    status = robot.wait_until(_is_filled, timeout_s, "completely received (heartbeat, pose, wheels, status)")
    if len(status.sensors) < len(sensors):
        robot.connection.wait(lambda _: len(robot.status.sensors) >= len(sensors), timeout_s)
    return robot.status


def _is_filled(status: RobotStatus) -> bool:
    parts = (status.heartbeat, status.tracking, status.wheels, status.safety)
    return all(part is not None for part in parts)


def status_as_dict(status: RobotStatus) -> dict[str, Any]:
    """Return a snapshot as plain values for JSON."""
    named = {"pose": status.tracking.pose._asdict()} if status.tracking is not None else {}
    head = {"state": status.state, "armed": status.armed, "mode": status.mode, "faults": status.faults}
    quality = {"quality": status.quality.as_dict()} if status.quality is not None else {}
    return {**head, **named, **asdict(status), **quality}


def view(robot: Robot, wheels: int, sensors: Sequence[Sensor] = ()) -> RenderableType:
    """Return the live view of a robot that has these ``sensors``."""
    status = robot.status
    return Panel(
        Group(
            _head(status),
            _pose_table(status),
            _quality(status.quality),
            *_sensor_lines(status, sensors),
            _wheel_table(status, wheels),
            _loop_line(status),
            _texts(robot),
        ),
        title=f"[bold]omni monitor[/]  {escape(robot.url)}",
        title_align="left",
        border_style="dim",
    )


def _head(status: RobotStatus) -> str:
    style = _STATE_STYLES.get(status.state, "yellow")
    silent = status.heartbeat_age_s > _SILENT_S
    link = f"[bold red]silent for {status.heartbeat_age_s:.0f} s[/]" if silent else "[green]receiving[/]"
    state = f"[bold red]not known[/] [dim](it was {status.state})[/]" if silent else f"[{style}]{status.state}[/]"
    hil = "  [magenta]host-in-the-loop[/]" if status.heartbeat is not None and status.heartbeat.hil else ""
    faults = ", ".join(status.faults)
    shown = f"[bold red]{faults}[/]" if faults else "[dim]no faults[/]"
    volts = status.battery.voltage_V if status.battery is not None else math.nan
    supply = "" if math.isnan(volts) else f"  {volts:.1f} V"
    return f"{state}  mode {status.mode}{hil}  {link}{supply}  {shown}"


def _table(*titles: str) -> Table:
    table = Table(box=None, header_style="bold dim", pad_edge=False, padding=(0, 2))
    for column, title in enumerate(titles):
        table.add_column(escape(title), justify="left" if column == 0 else "right")
    return table


def _pose_table(status: RobotStatus) -> RenderableType:
    tracking = status.tracking
    if tracking is None:
        return "[dim]no pose yet[/]"
    table = _table("pose", "x [m]", "y [m]", "theta [rad]", "")
    path = "no path" if tracking.phase == "none" else f"path: {tracking.phase}, {tracking.path_time_s:.1f} s"
    table.add_row("estimate", *(f"{value:.4f}" for value in tracking.pose), "")
    table.add_row("reference", *(f"{value:.4f}" for value in tracking.reference), path)
    table.add_row("estimate's sd", *(f"{value:.4f}" for value in tracking.pose_sd), "")
    return table


def _quality(quality: PoseQuality | None) -> str:
    if quality is None:
        return ""
    style = _QUALITY_STYLES.get(quality.verdict.value, "yellow")
    advice = f"\n[dim]{escape(quality.advice)}[/]" if quality.advice else ""
    return f"[{style}]{escape(quality.text)}[/]{advice}"


def _sensor_lines(status: RobotStatus, sensors: Sequence[Sensor]) -> list[str]:
    from omniwheel.sensor_quality import shown

    lines = []
    for one in shown(sensors, status.sensors):
        style = "green" if one.good else "yellow"
        advice = f"\n[dim]{escape(one.advice)}[/]" if one.advice else ""
        lines.append(f"[{style}]{one.name}  {escape(one.text)}[/]{advice}")
    return lines


def _wheel_table(status: RobotStatus, count: int) -> RenderableType:
    wheels = status.wheels
    if wheels is None:
        return "[dim]no wheels yet[/]"
    table = _table("wheel", *(str(n) for n in range(1, count + 1)))
    rows: tuple[tuple[str, tuple[float, ...]], ...] = (
        ("speed [rad/s]", wheels.speed_rad_s),
        ("wanted [rad/s]", wheels.reference_rad_s),
        ("duty", wheels.duty),
        ("current [A]", wheels.current_A),
        ("slip [m/s]", wheels.slip_m_s),
    )
    if any(wheels.heat):
        rows += (("heat, 1 stops", wheels.heat),)
    for title, values in rows:
        table.add_row(escape(title), *(f"{value:.3f}" for value in values[:count]))
    return table


def _loop_line(status: RobotStatus) -> str:
    loop = status.safety
    if loop is None:
        return "[dim]no loop statistics yet[/]"
    return (
        f"[dim]control tick {loop.tick_us_mean:.1f} µs (longest {loop.tick_us_max:.1f}), missed: {loop.overruns}\n"
        f"motor driver's bus errors since the start: {loop.i2c_errors}\n"
        f"invalid bytes and frames received: {loop.rx_errors}\n"
        f"telemetry messages dropped, as the link was full: {loop.tx_dropped}[/]"
    )


def _texts(robot: Robot) -> str:
    lines = []
    for text in robot.texts.all[-_SHOWN_TEXTS:]:
        style = "yellow" if text.severity <= WARNING_SEVERITY else "dim"
        lines.append(f"[{style}]{escape(text.text)}[/]")
    return "\n".join(lines)
