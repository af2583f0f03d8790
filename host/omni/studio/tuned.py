# SPDX-License-Identifier: MIT
"""Autotune on the page: the same as ``omni autotune``, as one of the experiments."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omni_schema import ParameterTable
from omniwheel.autotune.page import NAMES, PAGE, PICTURE, write_page
from omniwheel.autotune.procedure import Outcome, Settings, autotune
from omniwheel.experiments.outcome import Figure
from omniwheel.robot import Robot


@dataclass(frozen=True)
class Tuned:
    """What autotune found, as an experiment's outcome: figures, remarks, and files with a picture."""

    outcome: Outcome
    settings: Settings
    table: ParameterTable

    @property
    def figures(self) -> list[Figure]:
        """What was measured of motors, friction and inertia, with half of its 95 % interval."""
        estimate = self.outcome.design.fit.estimate
        return [
            Figure(name, NAMES[name][0], NAMES[name][1], float(estimate[name]), float(estimate.half_width(name)))
            for name in estimate.names
        ]

    def gains(self, present: Mapping[str, float]) -> dict[str, Any]:
        """Return the ``old`` and ``new`` values, and which of them the robot has: "old", "new" or "" for neither."""
        sets = {"old": self.outcome.old, "new": {**self.outcome.old, **self.outcome.new}}
        on_robot = next((name for name, values in sets.items() if _same(values, present)), "")
        return {**sets, "on_robot": on_robot}

    @property
    def remarks(self) -> list[str]:
        """Return what was changed, what came of it, and whether it was kept."""
        changes = [
            f"{name} {self.outcome.old[name]:.4g} → {value:.4g}."
            for name, value in self.outcome.new.items()
            if value != self.outcome.old[name]
        ]
        end = "The new values are kept" if self.outcome.kept else "The old values are restored"
        verdicts = (f"{verdict.sentence()}." for verdict in self.outcome.verdicts)
        return [*changes, *verdicts, f"{end}: {self.outcome.choice.why}.", f"{PAGE} has the details."]

    def write(self, folder: Path) -> Path:
        """Write page, picture and both parameter files; return the picture. Raises OutputFileError."""
        write_page(self.outcome, self.settings.required, self.table, folder)
        return folder / PICTURE


def _same(values: Mapping[str, float], present: Mapping[str, float]) -> bool:
    """Return whether the robot has these values, as the link carries them: in single precision."""
    return all(math.isclose(value, present.get(name, math.nan), rel_tol=1e-6) for name, value in values.items())


def tune(robot: Robot, room_m: float, rounds: int, tell: Callable[[str], None]) -> Tuned:
    """Measure the robot, choose its gains, try them, keep them or go back. Raises AutotuneError and what it raises."""
    tell(
        f"drives by itself for some minutes in a square of side {room_m:g} m around where it stands. First slowly, then"
        " at up to 70 % of its limits. It keeps the new gains if it drives better with them; afterwards you can choose"
        " otherwise"
    )
    settings = Settings(room_m, rounds=rounds)
    return Tuned(autotune(robot, settings, True, tell), settings, robot.table)
