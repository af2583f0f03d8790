# SPDX-License-Identifier: MIT
"""What is wired to what on a robot, from its robot file: a table and a drawing (``omni robots wiring``).

:func:`plan_wiring` reads the robot file, :func:`connections` lists the wires, :func:`draw_wiring` draws them as SVG.
"""

from __future__ import annotations

from omniwheel.wiring.connections import HEADING, Connection, connections
from omniwheel.wiring.diagram import draw_wiring, write_wiring
from omniwheel.wiring.plan import WheelWiring, WiringPlan, plan_wiring

__all__ = [
    "HEADING",
    "Connection",
    "WheelWiring",
    "WiringPlan",
    "connections",
    "draw_wiring",
    "plan_wiring",
    "write_wiring",
]
