# SPDX-License-Identifier: MIT
"""Files of the robot of ``robots.THREE``: robot file, column mapping, logs without a header line, truth beside them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omniwheel.logs.importer import import_log
from omniwheel.logs.log import WheelLog, save_log
from omniwheel.logs.mapping import read_mapping
from tests.host.pose_fit.robots import COUNTS, PERIOD_S, THREE, drive, true_values

ROBOT = """
[robot]
name = "known"
description = "A robot of the tests"

[geometry]
wheels = 3
wheel_radius_m = 0.05
wheel_distance_m = 0.2
wheel_angle_deg = [300.0, 60.0, 180.0]

[encoder]
counts_per_revolution = 10000
direction = [1, 1, 1]

[motor]
supply_V = 12.0
direction = [1, 1, 1]

[wiring]
in1_channel = [0, 2, 4]
in2_channel = [1, 3, 5]
"""
MAPPING = f"""
[log]
name = "known"
period_s = {PERIOD_S}
header = ["t", "x", "y", "heading", "n1", "n2", "n3"]
[log.time]
column = "t"
[wheels]
columns = ["n1", "n2", "n3"]
quantity = "increment"
unit = "UNIT"
counts_per_revolution = {COUNTS}
[truth]
time = "t"
x = "x"
y = "y"
theta = "heading"
in_log = true
"""


def table(log: WheelLog, wheels: NDArray[np.float64]) -> str:
    """Return a log as text without a header line: time, pose, wheels."""
    truth = log.require_truth()
    rows = np.column_stack((log.time_s, truth.xy, np.angle(np.exp(1j * truth.theta)), wheels))
    return "\n".join(",".join(f"{cell:.9g}" for cell in row) for row in rows) + "\n"


@contextmanager
def files_of_examples() -> Iterator[None]:
    """Write what the examples of the help page read into the present folder."""
    Path("mine.toml").write_text(ROBOT, encoding="utf-8")
    Path("mapping.toml").write_text(MAPPING.replace("UNIT", "counts"), encoding="utf-8")
    mapping = read_mapping(Path("mapping.toml"))
    for number in range(1, 5):
        log = drive(THREE, true_values(THREE, 5), number, duration_s=20.0)
        text = table(log, log.counts)
        day = Path(f"day{1 + number % 2}")
        day.mkdir(exist_ok=True)
        for path in (day / f"run{number}.csv", Path(f"run{number}.csv")):
            path.write_text(text, encoding="utf-8")
        Path(f"t{number}.csv").write_text(f"t,x,y,heading,n1,n2,n3\n{text}", encoding="utf-8")
        save_log(import_log(Path(f"run{number}.csv"), mapping)[0], Path(f"run{number}.npz"))
    yield
