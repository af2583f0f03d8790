# SPDX-License-Identifier: MIT
"""What a robot file cannot hold: wheels that roll differently forward and backward, and the motors' curves.

A calibration is a TOML file beside the robot file, ``ROBOT.calibration.toml``, written by ``omni identify logs``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from omni_schema.toml_file import read_toml
from omniwheel import files
from omniwheel.errors import LogError
from omniwheel.logs.log import Array

SUFFIX = ".calibration.toml"
_TURNS = ("turn_scale", "turn_reverse_scale")
_HINT = "let omni identify logs write it"


@dataclass(frozen=True)
class MotorCurve:
    """Steady wheel speed over duty, per wheel and direction, and its lag. Arrays have one entry per wheel.

    speed = (|duty| - deadband) / duty_per_rad_s in the duty's direction, 0 inside the deadband [rad/s];
    ``time_constant_s`` [s].
    """

    forward_duty_per_rad_s: Array
    reverse_duty_per_rad_s: Array
    forward_deadband: Array
    reverse_deadband: Array
    time_constant_s: Array

    def speed(self, duty: Array) -> Array:
        """Steady wheel speeds [rad/s] for duties (n, wheels)."""
        forward = np.maximum(duty - self.forward_deadband, 0.0) / self.forward_duty_per_rad_s
        reverse = np.maximum(-duty - self.reverse_deadband, 0.0) / self.reverse_duty_per_rad_s
        return np.asarray(forward - reverse)


@dataclass(frozen=True)
class Calibration:
    """``forward_scale``, ``reverse_scale`` (wheels,): effective radius over the robot file's; the motors' curve.

    ``turn_scale``, ``turn_reverse_scale`` (wheels,) are the same for the heading where none was measured, forward and
    backward. Without the latter the former holds for both; without both, the two above hold. Radii by direction take
    in a camera's perspective, so the heading needs numbers of its own.
    """

    forward_scale: Array
    reverse_scale: Array
    curve: MotorCurve
    turn_scale: Array | None = None
    turn_reverse_scale: Array | None = None

    def for_turning(self) -> Calibration | None:
        """Return the calibration that the heading follows from; None if this one has nothing of its own for it."""
        if self.turn_scale is None:
            return None
        reverse = self.turn_scale if self.turn_reverse_scale is None else self.turn_reverse_scale
        return replace(
            self, forward_scale=self.turn_scale, reverse_scale=reverse, turn_scale=None, turn_reverse_scale=None
        )

    def rolled(self, turned_rad: Array) -> Array:
        """Wheel angles that would have moved the robot file's wheels as far as ``turned_rad`` moved the real ones."""
        return np.asarray(turned_rad * np.where(turned_rad >= 0.0, self.forward_scale, self.reverse_scale))


def calibration_path(robot_file: Path) -> Path:
    """Return where the calibration of a robot file lies."""
    return robot_file.with_name(robot_file.stem + SUFFIX)


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration. Raises OutputFileError."""
    curve = calibration.curve
    scales = {name: getattr(calibration, name) for name in ("forward_scale", "reverse_scale", *_TURNS)}
    document = {
        "odometry": {name: _rounded(values) for name, values in scales.items() if values is not None},
        "motor_curve": {name: _rounded(getattr(curve, name)) for name in MotorCurve.__dataclass_fields__},
    }
    files.write_text(path, tomli_w.dumps(document))


def load_calibration(path: Path, wheels: int) -> Calibration:
    """Read a calibration for a robot with so many wheels. Raises LogError, or SchemaError where the file is no TOML."""
    document = read_toml(path)
    odometry, curve = (_section(path, document, name) for name in ("odometry", "motor_curve"))
    return Calibration(
        forward_scale=_numbers(path, odometry, "forward_scale", wheels),
        reverse_scale=_numbers(path, odometry, "reverse_scale", wheels),
        **{name: _numbers(path, odometry, name, wheels) for name in _TURNS if name in odometry},
        curve=MotorCurve(
            **{
                name: _numbers(path, curve, name, wheels, zero=name.endswith("deadband"))
                for name in MotorCurve.__dataclass_fields__
            }
        ),
    )


def _rounded(values: Array) -> list[float]:
    return [float(f"{value:.6g}") for value in values]


def _section(path: Path, document: Mapping[str, Any], name: str) -> dict[str, Any]:
    section = document.get(name)
    if not isinstance(section, dict):
        raise LogError(f"{path}: [{name}] is missing", hint=_HINT)
    return section


def _numbers(path: Path, section: Mapping[str, Any], key: str, wheels: int, *, zero: bool = False) -> Array:
    values = section.get(key)
    numbers = isinstance(values, list) and all(
        type(value) in (int, float) and math.isfinite(value) and (value > 0.0 or (zero and value == 0.0))
        for value in values
    )
    if not numbers or not isinstance(values, list) or len(values) != wheels:
        problem = f"{path}: {key} is {values!r}; {wheels} positive numbers are needed, one per wheel"
        raise LogError(problem, hint=_HINT)
    return np.array(values, dtype=np.float64)
