# SPDX-License-Identifier: MIT
"""Benchmark: the filter study of the report's Tables 5 and 7, ours beside scripts."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from bench import native_study, octave
from bench.filter_model import FilterModel, draw_normals, filter_model
from bench.options import Options
from bench.peers import filter_study_batched, filter_study_filterpy, filter_study_numpy
from bench.tables import Cell, Row, Table, with_ratios
from hil_sim.speed import Measurement, Spread
from omni_reproduce.experiment import read_spec
from omni_reproduce.filters import Setting, SettingError, Study, read_setting, shortened

SETTING = "published"
FULL_STEPS = 30_000_000
"""1000 runs of 600 s at 50 Hz."""
SCALAR = "ours, run after run"
LANES = "ours, sixteen runs at once (eight without AVX-512)"
EIGHT = "ours, eight runs at once, with AVX2"
BASELINE = "ours, eight runs at once, without AVX2"
FILTERPY = "Python and FilterPy"
NUMPY = "Python and NumPy, step by step"
BATCHED = "NumPy, all runs at once"
PLAIN = "plain C, run after run"
SIMD = "SIMD program, double precision"
SINGLE = "SIMD program, single precision"
NATIVES = {PLAIN: native_study.PLAIN, SIMD: native_study.SIMD, SINGLE: native_study.SINGLE}
OCTAVE = "GNU Octave, growing arrays"
LANE_RUNS = 16
SIMD_RUNS = 64
"""Blocks of the widest vectors are full with it."""
PER_STEP = "µs per step"
MEDIAN = "median"
RATIO = "× ours"
FULL = "1000 runs of 600 s"


def measure(options: Options) -> list[Table]:
    """Return the table."""
    setting = read_setting(read_spec("table7"), SETTING)
    steps = options.pick(300, 1500)
    runs = options.pick(200, 1000)
    spreads = options.measure(measurements(setting, steps, runs, options.seed))
    rows = [Row(name, _cells(spread)) for name, spread in spreads.items()]
    if not octave.installed():
        rows.append(Row(OCTAVE, {PER_STEP: "not installed"}))
    note = (
        "CPU time of one thread. A step is one step of one run with all four combinations. "
        f"Ours and native peers: {setting.steps} steps a run; scripts: {steps}; batched: {runs} runs. "
        f"{lead(spreads)} Setting “{setting.title}”, seed {options.seed}; {options.how}."
    )
    columns = (PER_STEP, MEDIAN, RATIO, FULL)
    ratios = with_ratios(rows, PER_STEP, LANES, RATIO)
    return [Table("filter-study", "filter study", columns, ratios, note)]


def measurements(setting: Setting, steps: int, runs: int, seed: int) -> dict[str, Measurement]:
    """Return what is there to be measured, each in seconds per step."""
    short = shortened(setting, steps * setting.step_s)
    model = filter_model(short)
    batch_steps = max(steps // 30, 10)
    study = Study(setting)
    seeds = range(seed, seed + LANE_RUNS)
    our_steps = LANE_RUNS * setting.steps
    found = {
        LANES: _timed(lambda: study.results(seeds), our_steps),
        **({EIGHT: _timed(lambda: study.results(seeds, "avx2"), our_steps)} if has_path(study, "avx2") else {}),
        BASELINE: _timed(lambda: study.results(seeds, "baseline"), our_steps),
        SCALAR: _timed(lambda: study.results(seeds, "single"), our_steps),
        FILTERPY: _timed(lambda: filter_study_filterpy.run(model, draw_normals(seed, steps)), steps),
        NUMPY: _timed(lambda: filter_study_numpy.run(model, draw_normals(seed, steps)), steps),
        BATCHED: _timed(lambda: filter_study_batched.run(model, runs, batch_steps, seed), runs * batch_steps),
    }
    whole = filter_model(setting)
    found |= {name: _native(name, whole, seed) for name in NATIVES}
    if octave.installed():
        found[OCTAVE] = lambda: octave.run(model, steps)[1] / steps
    return found


def has_path(study: Study, path: str) -> bool:
    """Return whether this processor can go a path of PATHS."""
    try:
        study.results([1], path)
    except SettingError:
        return False
    return True


def lead(spreads: Mapping[str, Spread]) -> str:
    """Return sentences that compare ours, many runs at once, with the native peers."""
    ours = spreads[LANES].least
    double, single = (ours / spreads[name].least for name in (SIMD, SINGLE))
    return (
        f"Ours takes {double:.1f} times as long as the SIMD program in double precision, {single:.1f} times as long as "
        f"it in single precision. Plain C takes {spreads[PLAIN].least / ours:.1f} times as long as ours."
    )


def _native(name: str, model: FilterModel, seed: int) -> Measurement:
    runs = LANE_RUNS if name == PLAIN else SIMD_RUNS

    def run() -> float:
        return native_study.run(native_study.built(NATIVES[name]), model, runs, seed).seconds / (runs * model.steps)

    return run


def _timed(work: Callable[[], object], steps: int) -> Measurement:
    def run() -> float:
        start = time.process_time()
        work()
        return (time.process_time() - start) / steps

    return run


def _cells(spread: Spread) -> dict[str, Cell]:
    return {
        PER_STEP: spread.least * 1e6,
        MEDIAN: spread.median * 1e6,
        FULL: duration(spread.least * FULL_STEPS),
    }


def duration(seconds: float) -> str:
    """Return a time in the unit that suits it."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"
