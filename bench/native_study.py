# SPDX-License-Identifier: MIT
"""Builds and runs the native peers of the filter study: plain C, and a program for vector instructions."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench import build
from bench.filter_model import NORMALS, Array, FilterModel

_CONTRACT = "-ffp-contract=fast"
"""Fused multiply-add is allowed: no peer owes anyone its bits."""
_NATIVE = ("-march=native", _CONTRACT)


@dataclass(frozen=True)
class Native:
    """A peer: its name, its source in bench/peers, and the compiler's flags."""

    name: str
    source: str
    flags: tuple[str, ...]
    needs: tuple[str, ...] = ()
    """What the processor must have, as /proc/cpuinfo calls it."""

    def missing(self) -> str:
        """Return why this computer cannot run it, or nothing."""
        if self.needs and platform.machine() != "x86_64":
            return "not an x86-64 processor"
        lacks = [word for word in self.needs if word not in _processor_words()]
        return f"this processor has no {', '.join(lacks)}" if lacks else ""

    def program(self) -> Path:
        """Build it if need be. Raises BenchError with the compiler's words."""
        sources = [build.PEERS / self.source, build.PEERS / "filter_study_program.c"]
        return build.build(f"filter-study-{self.name}", sources, self.flags)


PLAIN = Native("plain", "filter_study_plain.c", _NATIVE)
SIMD = Native("simd", "filter_study_simd.c", _NATIVE)
SINGLE = Native("simd-single", "filter_study_simd.c", (*_NATIVE, "-DSTUDY_SINGLE"))
_AVX512 = ("avx512f", "avx512dq", "avx512vl")
WIDTHS = (
    Native("simd-2", "filter_study_simd.c", (_CONTRACT, "-DSTUDY_BYTES=16")),
    Native("simd-4", "filter_study_simd.c", ("-mavx2", "-mfma", _CONTRACT), ("avx2", "fma")),
    Native("simd-8", "filter_study_simd.c", (*(f"-m{word}" for word in _AVX512), _CONTRACT), _AVX512),
)
"""The program for vectors, for two, four and eight doubles at once, whatever this processor is."""


@cache
def built(native: Native) -> Path:
    """Return a peer's program, built at the first call."""
    return native.program()


@dataclass(frozen=True)
class NativeRuns:
    """What came of a peer's runs."""

    rmse: Array
    """(runs, 4, 3): RMS errors of each run [m, m, rad]."""
    seconds: float
    """CPU time of all runs."""
    runs_at_once: int
    number_bytes: int


def run(program: Path, model: FilterModel, runs: int, seed: int, normals: Array | None = None) -> NativeRuns:
    """Do runs with the program's own noise, or with these standard normals (runs, steps, NORMALS).

    Raises ValueError if the normals have another shape, BenchError with the program's words if it fails.
    """
    with TemporaryDirectory(prefix="omni-study-") as name:
        folder = Path(name)
        words = _words(program, folder, model, runs, seed)
        if normals is None:
            output = build.call([*words, "own"])
        else:
            if normals.shape != (runs, model.steps, NORMALS):
                raise ValueError(f"normals are {normals.shape}, not {(runs, model.steps, NORMALS)}")
            np.ascontiguousarray(normals, dtype=np.float64).tofile(folder / "normals")
            output = build.call([*words, "given", str(folder / "normals")])
    told = build.numbers(output)
    square = np.array([told[f"run{number}"] for number in range(runs)]).reshape(runs, 4, 3)
    at_once, number_bytes = (int(value) for value in told["width"])
    return NativeRuns(np.sqrt(square / model.steps), told["seconds"][0], at_once, number_bytes)


def drawn(program: Path, model: FilterModel, runs: int, seed: int) -> Array:
    """Return the standard normals (runs, steps, NORMALS) that a program draws; the last two of each row are 0."""
    with TemporaryDirectory(prefix="omni-study-") as name:
        folder = Path(name)
        build.call([*_words(program, folder, model, runs, seed), "draw", str(folder / "normals")])
        return np.fromfile(folder / "normals").reshape(runs, model.steps, NORMALS)


def _words(program: Path, folder: Path, model: FilterModel, runs: int, seed: int) -> list[str]:
    """Write the model, as study_numbers_t and the arrays behind it, and return the command so far."""
    parts = (
        model.steps,
        model.step_s,
        model.motor_a,
        model.motor_b,
        model.motor_sd,
        model.measured_sd,
        model.pose_sd,
        model.fix_sd,
        model.kf_q,
        model.ekf_q,
        model.to_body,
        model.to_wheels,
        model.ismc_lambda,
        model.ismc_k,
        model.drive_true,
        model.raw_measured,
        model.stale,
        model.poses[: model.steps + 1],
        model.rates,
    )
    np.concatenate([np.ravel(np.asarray(part, dtype=np.float64)) for part in parts]).tofile(folder / "model")
    return [str(program), str(folder / "model"), str(runs), str(seed)]


def _processor_words() -> set[str]:
    """Return what Linux says that the processor has; elsewhere nothing."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return set()
    return {word for line in lines if line.startswith("flags") for word in line.split(":", 1)[1].split()}
