# SPDX-License-Identifier: MIT
"""``omni mocap latency``: the latency of a pose source that its time stamps do not report, measured with the robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omni.cli.common import JsonOption, LinkOption, TimeoutOption, console, examples, link_url, note, print_json
from omni.cli.options import OwnSeedOption, SourceOption, measure_option
from omniwheel.default_system import default_system
from omniwheel.limits import DEFAULT_TIMEOUT_S, MOCAP_MAX_AGE_S

if TYPE_CHECKING:
    from omniwheel.mocap.latency import PoseLatency

EXAMPLES = {
    "latency": examples(
        "omni mocap latency --source camera:tags/camera.toml --link /dev/ttyACM0",
        "omni mocap latency --source natnet:192.168.1.10/robot --link /dev/ttyACM0 --duration 30",
    )
}
CAMERA = "camera:"
TOO_LATE = f"too old: the mocap bridge drops poses older than {MOCAP_MAX_AGE_S:g} s. Reduce the source's latency"
WORST_SCALE = 0.1
"""Largest relative difference of a turn's angle by poses and by wheels. Slip causes some of it."""


def latency(
    source: SourceOption,
    duration: Annotated[float, measure_option(10.0)] = 20.0,
    seed: OwnSeedOption = 1,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Measure the source's unreported latency while you turn the robot to and fro by hand. The robot is not armed."""
    from omniwheel.hub.shared_link import open_shared
    from omniwheel.mocap.latency import observe, pose_latency
    from omniwheel.mocap.streams import open_source
    from omniwheel.robot import connect

    if source.startswith("recorded:") or source == "simulated":
        raise typer.BadParameter(f"{source} gives no poses of the robot; give a vicon:, natnet: or camera: stream")
    url = link_url(link)
    stream = open_source(source, seed=seed, timeout_s=timeout)
    try:
        shared = open_shared(url, timeout_s=timeout)
        with connect(shared, timeout_s=timeout, heartbeat=False, system_id=default_system()) as robot:
            note(
                "Turn the robot to the left and back on the floor, by a quarter turn, about once a second, but not "
                f"evenly, for {duration:g} s. Turning it by hand is fine.",
                quiet=as_json,
            )
            headings = observe(stream, robot, duration, timeout)
    finally:
        stream.close()
    found = pose_latency(headings)
    if as_json:
        print_json(found.as_dict())
        return
    for line in _lines(found, source):
        console.print(line)


def _lines(found: PoseLatency, source: str) -> list[str]:
    """What was found, and what to do about it."""
    lines = [
        f"{found.poses} poses; the robot turned by {found.turned_rad:.1f} rad to and fro, and by its poses "
        f"{found.scale:.3f} times as far",
        f"the poses' unreported latency is {1e3 * found.latency_s:.1f} ms, ± {1e3 * found.limit_s:.1f} ms (95 %); "
        f"on top of that the robot's clock, ± {1e3 * found.clock_error_s:.0f} ms at most",
    ]
    if abs(found.scale - 1.0) > WORST_SCALE:
        lines.append("wheels and poses disagree by more than 10 %: identify the robot, or look at its wheels' slip")
    if abs(found.latency_s) <= found.limit_s + found.clock_error_s:
        return [*lines, "the latency is within its uncertainty: nothing to set"]
    if source.startswith(CAMERA):
        return [*lines, _for_camera(found.latency_s, Path(source[len(CAMERA) :]))]
    if found.latency_s < 0.0:
        return [*lines, "the source's time stamps are too early: correct its own settings"]
    if found.latency_s >= MOCAP_MAX_AGE_S:
        return [*lines, TOO_LATE]
    return [*lines, f"give `omni mocap bridge` the option --older-by {found.latency_s:.4f}"]


def _for_camera(latency_s: float, path: Path) -> str:
    from omniwheel.mocap.camera.setup import load_setup

    wanted_s = load_setup(path).latency_s + latency_s
    if wanted_s >= MOCAP_MAX_AGE_S:
        return TOO_LATE
    if wanted_s < 0.0:
        return f"set latency_s = 0 in {path}; its driver's times are too early by {-1e3 * wanted_s:.1f} ms"
    return f"set latency_s = {wanted_s:.4f} in {path}"
