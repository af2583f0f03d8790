# SPDX-License-Identifier: MIT
"""Runs the Octave peer of the filter study."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench.filter_model import Array, FilterModel, FilterRun, rms

SCRIPT = Path(__file__).with_name("peers") / "filter_study.m"
OCTAVE = "octave-cli"
TIMEOUT_S = 600


def installed() -> bool:
    """Return whether GNU Octave is there."""
    return shutil.which(OCTAVE) is not None


def run(model: FilterModel, steps: int, normals: Array | None = None) -> tuple[FilterRun, float]:
    """Run ``steps`` steps and return what came of them and how much CPU time the loop took [s].

    ``normals`` (steps, NORMALS): the noise; without it Octave draws its own.
    """
    with TemporaryDirectory(prefix="omni-octave-") as name:
        folder = Path(name)
        (folder / "model.m").write_text(_variables(model, steps))
        if normals is not None:
            np.savetxt(folder / "normals.txt", normals)
        command = [OCTAVE, "--norc", "--quiet", str(SCRIPT), str(folder)]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=TIMEOUT_S)
        truth = np.loadtxt(folder / "truth.txt").T
        estimates = np.loadtxt(folder / "estimates.txt").T.reshape(steps, 4, 3)
    return FilterRun(rms(truth, estimates), truth, estimates), float(done.stdout)


def _variables(model: FilterModel, steps: int) -> str:
    """Return the model as an Octave script; vectors become columns, tables one column per step."""
    values = {
        "steps": steps,
        "step_s": model.step_s,
        "motor_a": model.motor_a,
        "motor_b": model.motor_b,
        "motor_sd": model.motor_sd,
        "measured_sd": model.measured_sd,
        "pose_sd": model.pose_sd,
        "fix_sd": model.fix_sd,
        "kf_q": model.kf_q,
        "ekf_q": model.ekf_q.T,
        "to_body": model.to_body,
        "to_wheels": model.to_wheels,
        "lambda": model.ismc_lambda,
        "gain": model.ismc_k,
        "drive_true": model.drive_true,
        "raw_measured": model.raw_measured,
        "stale": model.stale,
        "poses": model.poses[: steps + 1].T,
        "rates": model.rates[:steps].T,
    }
    return "".join(f"{name} = {_literal(np.asarray(value, dtype=float))};\n" for name, value in values.items())


def _literal(value: Array) -> str:
    rows = np.atleast_2d(value if value.ndim == 2 else value.reshape(-1, 1))
    return "[" + "; ".join(", ".join(repr(float(entry)) for entry in row) for row in rows) + "]"
