# SPDX-License-Identifier: MIT
"""A robot file with what its logs told, as a copy of the nominal one, and the calibration beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomli_w

from omni_schema.toml_file import read_toml
from omniwheel.errors import LogError
from omniwheel.identification.odometry_calibration import Odometry
from omniwheel.logs.calibration import calibration_path, save_calibration
from omniwheel.robots import read_robot

_FILTER = ("KF_MODE", "KF_Q_W", "KF_Q_I", "KF_R_W")
_HEAD = (
    "# SPDX-License-Identifier: MIT\n# Written by omni identify logs from {source}; its calibration lies beside it.\n\n"
)


def write_robot_file(found: Odometry, nominal: Path, target: Path) -> tuple[Path, Path]:
    """Write robot file and calibration and return their paths; the robot file has been read back. Raises LogError."""
    if target.suffix != ".toml" or target.resolve() == nominal.resolve():
        raise LogError(f"{target} cannot be the new robot file", hint="give another name that ends in .toml")
    document: dict[str, Any] = dict(read_toml(nominal))
    values, before = found.robot.parameter_values(), read_robot(nominal).parameter_values()
    for parameter in found.robot.table.parameters:
        changed = values[parameter.name] != before[parameter.name]
        if parameter.robot_key is None or not changed or parameter.wheel is not None:
            continue
        section, _, key = parameter.robot_key.partition(".")
        document.setdefault(section, {})[key] = _short(values[parameter.name])
    document["robot"]["description"] = f"{found.robot.description} (identified from logs)".lstrip()
    scales = [_short(values[f"W{wheel + 1}_RSCALE"]) for wheel in range(found.robot.wheels)]
    document["geometry"]["wheel_radius_scale"] = scales
    document.setdefault("parameters", {}).update({name: _short(values[name]) for name in _FILTER})
    calibration = calibration_path(target)
    try:
        target.write_text(_HEAD.format(source=nominal.name) + tomli_w.dumps(document), encoding="utf-8")
    except OSError as error:
        raise LogError(f"cannot write {target}: {error.strerror}", hint="check folder and permissions") from error
    save_calibration(found.calibration, calibration)
    read_robot(target)
    return target, calibration


def _short(value: float) -> float:
    return float(f"{value:.6g}")
