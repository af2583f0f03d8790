# SPDX-License-Identifier: MIT
"""A tuning is stopped at a random moment. The robot should be at rest then, with its old parameters."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import omniwheel.robot
from hil_sim.lockstep import SteppedLink
from hil_sim.runs import new_world
from hil_sim.studies.autotune_robot import TEXT
from hil_sim.studies.drawn_robots import draw_robot
from omniwheel.autotune.design import CHANGED
from omniwheel.autotune.procedure import Settings, autotune
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkLostError, OmniError
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.robot import Robot

STREAM = 15
LATEST_S = 400.0
"""Moments are drawn up to here. If a tuning is over sooner, one is drawn anew, up to its end."""
KINDS = ("interrupt", "estop", "link", "power")
REST_S = 0.5
"""How long the robot has to come to rest, besides SAFE_LINK_TO and what it takes from its top speed to standing."""
REST_M_S, REST_RAD_S = 1e-3, 1e-2
ROW = np.dtype(
    [
        ("seed", "<u8"),
        ("kind", "S16"),
        ("why", f"S{TEXT}"),
        ("moment_s", "<f8"),
        ("tuned_s", "<f8"),
        ("simulated_s", "<f8"),
        ("wall_s", "<f8"),
        *((name, "<f8") for name in ("stopped", "at_rest", "old_parameters")),
    ]
)


class StoppedLink(SteppedLink):
    """A link over which something happens at ``moment_s``."""

    kind = ""
    moment_s = math.inf
    happened = False

    def read(self, timeout_s: float) -> bytes:
        """Return what the robot sent, unless the moment has come."""
        data = super().read(timeout_s)
        if not self.happened and self.clock_s() >= self.moment_s:
            self.happened = True
            if self.kind == "interrupt":
                raise KeyboardInterrupt
            if self.kind == "estop":
                command = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_OMNI_ESTOP, 0, 1.0, *[0.0] * 6)
                self.write(command.pack(mavlink.MAVLink(None, 255, 0)))
        if self.happened and self.kind in ("link", "power"):
            raise LinkLostError("the cable is out")
        return data

    def write(self, data: bytes) -> None:
        """Send, unless the cable is out."""
        if self.happened and self.kind in ("link", "power"):
            raise LinkLostError("the cable is out")
        super().write(data)


def drawn_stop(seed: int, latest_s: float = LATEST_S, attempt: int = 0) -> tuple[str, float]:
    """Return in which of KINDS a seed's tuning is stopped, and when [s]."""
    draw = np.random.default_rng([STREAM, seed])
    kind = KINDS[int(draw.integers(len(KINDS)))]
    moments = draw.uniform(0.0, latest_s, attempt + 1)
    return kind, float(moments[attempt])


def rest_s(values: Mapping[str, float]) -> float:
    """Return after which time a robot must be at rest, by its own parameters, if the cable is pulled at top speed."""
    rim_m_s = values["LIM_V"] + values["LIM_W"] * values["WHEEL_DIST"]
    return values["SAFE_LINK_TO"] + rim_m_s / values["LIM_A"] + REST_S


def stop_row(seed: int, settings: Settings, latest_s: float = LATEST_S) -> NDArray[Any]:
    """Stop the tuning of a seed's robot at a random moment, in one of KINDS, and return its ROW.

    If it is over by then nothing was stopped. So another moment is drawn from the time that it took.
    """
    started = time.perf_counter()
    row = _stopped(seed, settings, *drawn_stop(seed, latest_s))
    if not row["stopped"][0]:
        row = _stopped(seed, settings, *drawn_stop(seed, float(row["tuned_s"][0]), attempt=1))
    row["wall_s"] = time.perf_counter() - started
    return row


def _stopped(seed: int, settings: Settings, kind: str, moment_s: float) -> NDArray[Any]:
    row = np.zeros(1, ROW)
    row["seed"], row["kind"], row["moment_s"] = seed, kind, moment_s
    scenario = draw_robot(seed).tuning_scenario()
    values = scenario.parameter_values()
    with TemporaryDirectory() as folder:
        storage = Path(folder) / "storage"
        world = new_world(scenario)
        with FirmwareProcess(parameters=values, links=["tcp:127.0.0.1:0"], lockstep=True, storage=storage) as firmware:
            link = StoppedLink(firmware.open_link(), world)
            link.end_s, link.kind = math.inf, kind
            robot = omniwheel.robot.connect(link, clock=link.clock_s)
            before = {name: robot.parameters[name] for name in CHANGED}
            begun_s = link.clock_s()
            link.moment_s = begun_s + moment_s
            row["why"] = _tuned(robot, settings).encode()[:TEXT]
            row["stopped"], row["tuned_s"] = link.happened, link.clock_s() - begun_s
            link.run(round(1e3 * rest_s(values)), link.drop_received)
            row["at_rest"] = bool(np.hypot(*world.twist[:2]) < REST_M_S and abs(world.twist[2]) < REST_RAD_S)
            row["simulated_s"] = link.clock_s()
            after = before if kind == "power" else _parameters(link)
            link.close()
        if kind == "power" and link.happened:
            after = _after_power_cycle(values, storage)
    row["old_parameters"] = after == before
    return row


def _tuned(robot: Robot, settings: Settings) -> str:
    try:
        autotune(robot, settings, False, lambda _: None)
    except KeyboardInterrupt:
        return "interrupted"
    except OmniError as error:
        return str(error)
    return ""


def _parameters(link: StoppedLink) -> dict[str, float]:
    """Return the robot's parameters, asked anew once its cable is in again."""
    link.kind = ""
    robot = omniwheel.robot.connect(link, clock=link.clock_s)
    robot.parameters.forget()
    return {name: robot.parameters[name] for name in CHANGED}


def _after_power_cycle(values: dict[str, float], storage: Path) -> dict[str, float]:
    with (
        FirmwareProcess(parameters=values, links=["tcp:127.0.0.1:0"], storage=storage) as firmware,
        omniwheel.robot.connect(firmware.urls[0]) as robot,
    ):
        return {name: robot.parameters[name] for name in CHANGED}
