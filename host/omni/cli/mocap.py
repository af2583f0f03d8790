# SPDX-License-Identifier: MIT
"""``omni mocap``: motion-capture poses to a robot, or into a file. ``mocap_camera`` has the commands for a webcam."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from omni.cli import mocap_camera, mocap_latency
from omni.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    console,
    examples,
    link_url,
    new_path,
    note,
    print_json,
)
from omni.cli.options import ForceOption, OwnSeedOption, SourceOption
from omniwheel.default_system import default_system
from omniwheel.limits import (
    DEFAULT_TIMEOUT_S,
    MOCAP_BUDGET_BYTES_S,
    MOCAP_MAX_AGE_S,
    MOCAP_MESSAGES,
    MOCAP_RATE_HZ,
)

if TYPE_CHECKING:
    from omniwheel.mocap.bridge import BridgeCounts
    from omniwheel.mocap.recorded import RecordingWriter
    from omniwheel.mocap.source import MocapSource

app = typer.Typer(help="Send motion-capture poses to a robot, or record them.", no_args_is_help=True)
_SLICE_S = 0.25

DurationOption = Annotated[
    float,
    typer.Option(
        "--duration", "-d", "--for", min=0.0, metavar="S", help="Default: until Ctrl-C or the end.", show_default=False
    ),
]


@app.command(
    "bridge",
    epilog=examples(
        "omni mocap bridge --source vicon:192.168.1.10/robot --link /dev/ttyUSB0,9600",
        "omni mocap bridge --source recorded:lap.csv --as vicon --rate 50 --budget 100000 --link /dev/ttyACM0",
        "omni mocap bridge --source camera:tags/camera.toml --link /dev/ttyACM0 --budget 100000",
        "omni mocap bridge --source simulated --link tcp:127.0.0.1:5760 --duration 10",
    ),
)
def bridge(
    source: SourceOption,
    message: Annotated[
        str, typer.Option("--as", metavar="KIND", help=f"MAVLink message to send: {' or '.join(MOCAP_MESSAGES)}.")
    ] = MOCAP_MESSAGES[0],
    rate: Annotated[float, typer.Option("--rate", help="Maximum fixes per second.")] = MOCAP_RATE_HZ,
    budget: Annotated[
        float, typer.Option("--budget", help="Maximum bytes/s of the bridge. Default: half of 9600 baud.")
    ] = MOCAP_BUDGET_BYTES_S,
    max_age: Annotated[
        float, typer.Option("--max-age", help="Maximum age of a pose; older ones are dropped \\[s].")
    ] = MOCAP_MAX_AGE_S,
    latency: Annotated[
        float,
        typer.Option(
            "--older-by",
            metavar="S",
            help="Unreported latency of the source, subtracted from its time stamps; see omni mocap latency.",
        ),
    ] = 0.0,
    duration: DurationOption = math.inf,
    seed: OwnSeedOption = 1,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Send poses to a robot as pose fixes, time-stamped by the robot's clock, within the radio's bandwidth.

    Exit code 1: the robot used no pose.
    """
    from omniwheel.mocap.bridge import Bridge, BridgeSettings
    from omniwheel.mocap.streams import open_source

    settings = BridgeSettings(message, rate, budget, max_age, latency)
    url = link_url(link)
    stream = open_source(source, seed=seed, timeout_s=timeout)
    try:
        with Bridge(stream, url, settings, timeout_s=timeout, system_id=default_system()) as running:
            is_camera = source.startswith("camera:")
            possible_Hz = settings.possible_rate_sd_Hz if is_camera else settings.possible_rate_Hz
            if possible_Hz < rate:
                note(f"{budget:g} B/s carry {possible_Hz:.1f} of {rate:g} fixes/s", quiet=as_json)
            note(f"{escape(stream.name)} → {escape(url)}; Ctrl-C ends", quiet=as_json)
            said = _Said(quiet=as_json)
            try:
                running.run(duration, said.progress)
            except KeyboardInterrupt:
                note("", quiet=as_json)
            running.ask_used()
            statistics = running.report()
            said.reasons(statistics)
    finally:
        stream.close()
    if as_json:
        print_json(statistics.as_dict())
    else:
        console.print(_line(statistics))
    if statistics.in_vain:
        note("the robot used no pose" if statistics.received else "no pose was received", quiet=as_json)
        raise typer.Exit(1)


class _Said:
    """Prints statistics once per second, and each reason of a refusal once."""

    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        self._known: set[str] = set()

    def progress(self, statistics: BridgeCounts) -> None:
        note(_line(statistics), quiet=self._quiet)
        self.reasons(statistics)

    def reasons(self, statistics: BridgeCounts) -> None:
        for reason in statistics.reasons:
            if reason not in self._known:
                self._known.add(reason)
                note(f"refused: {escape(reason)}", quiet=self._quiet)


def _line(s: BridgeCounts) -> str:
    """The statistics in one line."""
    rate = s.sent / s.duration_s if s.duration_s > 0.0 else 0.0
    load = s.bytes_sent / s.duration_s if s.duration_s > 0.0 else 0.0
    used = "" if s.used is None else f", {s.used} used by the robot"
    latency = "–" if math.isnan(s.latency_mean_s) else f"{1e3 * s.latency_mean_s:.0f} ms"
    return (
        f"{s.received} poses, {s.sent} sent ({rate:.1f}/s, {load:.0f} B/s), {s.overtaken} overtaken, {s.stale} stale, "
        f"{s.refused} rejected{used}; latency {latency}; robot's clock {s.offset_s:+.3f} s "
        f"± {1e3 * s.offset_error_s:.0f} ms, round trip {1e3 * s.round_trip_s:.0f} ms"
    )


@app.command(
    "record",
    epilog=examples(
        "omni mocap record lap.csv --source vicon:192.168.1.10/robot",
        "omni mocap record test.csv --source simulated --duration 10",
    ),
)
def record(
    out: Annotated[Path, typer.Argument(metavar="OUT.csv", help="One pose per line.")],
    source: SourceOption,
    duration: DurationOption = math.inf,
    force: ForceOption = False,
    seed: OwnSeedOption = 1,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Record a stream of poses; --source recorded:FILE replays it."""
    from omniwheel.mocap.recorded import RecordingWriter
    from omniwheel.mocap.streams import open_source

    new_path(out, "record", force=force)
    stream = open_source(source, seed=seed, timeout_s=timeout)
    try:
        with RecordingWriter(out) as writer:
            note(f"recording {escape(stream.name)} to {escape(str(out))}; Ctrl-C ends", quiet=as_json)
            try:
                _copy(stream, writer, duration)
            except KeyboardInterrupt:
                note("", quiet=as_json)
    finally:
        stream.close()
    note(f"{writer.poses} poses in {escape(str(out))}", quiet=as_json)
    if as_json:
        print_json({"file": str(out), "poses": writer.poses})


def _copy(stream: MocapSource, writer: RecordingWriter, duration_s: float) -> None:
    end_s = stream.clock() + duration_s
    while (left_s := end_s - stream.clock()) > 0.0 and not stream.ended:
        measured = stream.read(min(left_s, _SLICE_S))
        if measured is not None:
            writer.write(measured)
        writer.flush_if_due()


for _commands in (mocap_camera, mocap_latency):
    for _name, _examples in _commands.EXAMPLES.items():
        app.command(_name, epilog=_examples)(getattr(_commands, _name))
