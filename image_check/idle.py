# SPDX-License-Identifier: MIT
"""A robot that rests leaves its flash memory alone: only the signing clock is stored, now and then."""

from __future__ import annotations

from emulated_teensy.machine import Options
from image_check.bench import CheckError, Context, boot
from image_check.check import CI, NIGHTLY, Check
from omniwheel.dialect import mavlink
from omniwheel.robot import Robot

QUICK = 20
"""Time of an instruction [ns]: a tick still ends within its millisecond."""
PASS_ns = 900_000
"""Time of a pass of the main loop, which then costs few instructions, too."""
KEY = bytes(range(32))
SETTLE_S = 0.5
LOOKS, LOOK_S = 6, 0.25
REST_S = LOOKS * LOOK_S
SAVES = 1
"""docs/concepts/teensy.md: about one a minute with a key, and none without."""


def resting(context: Context) -> list[str]:
    """Saves in some seconds at rest, first without a signing key, then with one."""
    options = Options(instruction_ns=QUICK, pause_ns=PASS_ns, seed=context.seed)
    with context.bench(options=options) as bench:
        boot(bench)
        robot = bench.connect()
        figures = []
        for what, allowed in (("no signing key", 0), ("a signing key", SAVES)):
            if allowed:
                _set_key(robot)
            robot.pump(SETTLE_S)
            saves = 0
            for _ in range(LOOKS):
                before = bench.machine.storage
                robot.pump(LOOK_S)
                saves += bench.machine.storage != before
            if saves > allowed:
                raise CheckError(f"a resting robot with {what} writes flash memory {saves} times in {REST_S:g} s")
            figures.append(f"{what}: {saves} saves in {REST_S:g} s of rest")
    return figures


def _set_key(robot: Robot) -> None:
    target = (robot.connection.target_system, robot.connection.target_component)
    robot.send(mavlink.MAVLink_setup_signing_message(*target, KEY, 1))
    robot.pump(SETTLE_S)
    texts = [text.text for text in robot.texts.all]
    if not any(text.startswith("signing key") and text.endswith("set") for text in texts):
        raise CheckError(f"a signing key that is sent over USB is not set; the robot says {texts}")


CHECKS = (Check("rest", "a robot that rests leaves its flash memory alone", resting, (CI, NIGHTLY)),)
