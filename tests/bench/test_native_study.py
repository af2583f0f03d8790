# SPDX-License-Identifier: MIT
"""The native peers of the filter study compute what the scripts compute, and draw noise that is normal."""

from __future__ import annotations

import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bench import build, native_study
from bench.filter_model import NORMALS, Array, FilterModel, filter_model
from bench.native_study import PLAIN, SIMD, SINGLE, WIDTHS, Native, built
from bench.peers import filter_study_numpy
from omni_reproduce.experiment import read_spec
from omni_reproduce.filters import Setting, read_setting, run_seeds, shortened

pytestmark = pytest.mark.reference

SEED = 3
STEPS = 250
SETTINGS = ("published", "honest_a", "honest_b")
DRAWN = 18
"""Normals of a row that are used."""
DOUBLE = [PLAIN, SIMD, *WIDTHS]
ALL = [PLAIN, SIMD, SINGLE]


def setting(name: str, steps: int = STEPS) -> Setting:
    case = read_setting(read_spec("table7"), name)
    return shortened(case, steps * case.step_s)


@cache
def model(name: str, steps: int = STEPS) -> FilterModel:
    return filter_model(setting(name, steps))


@cache
def noise(runs: int, steps: int = STEPS) -> Array:
    return np.random.default_rng(SEED).standard_normal((runs, steps, NORMALS))


@cache
def by_numpy(name: str, runs: int) -> Array:
    """Return the RMS errors (runs, 4, 3) of the script."""
    return np.stack([filter_study_numpy.run(model(name), normals).rmse for normals in noise(runs)])


def named(native: Native) -> str:
    return native.name


def ready(native: Native) -> Path:
    if missing := native.missing():
        pytest.skip(missing)
    return built(native)


@pytest.mark.full
@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("native", DOUBLE, ids=named)
def test_a_peer_with_given_noise_errs_as_the_script_does(native: Native, name: str) -> None:
    """Five runs: so vectors of two, four or eight are filled up, and a second one may be needed."""
    runs = 5
    found = native_study.run(ready(native), model(name), runs, SEED, noise(runs))
    assert found.number_bytes == 8
    np.testing.assert_allclose(found.rmse, by_numpy(name, runs), rtol=1e-9)


@pytest.mark.full
def test_single_precision_errs_as_the_script_does() -> None:
    found = native_study.run(ready(SINGLE), model("published"), 5, SEED, noise(5))
    assert found.number_bytes == 4
    np.testing.assert_allclose(found.rmse, by_numpy("published", 5), rtol=2e-3)


@pytest.mark.full
@pytest.mark.parametrize(("native", "lanes"), list(zip(WIDTHS, (4, 8, 16), strict=True)), ids=str)
def test_vectors_of_every_width_draw_and_compute_the_same(native: Native, lanes: int) -> None:
    """A run has its words from its own seed; products and sums may be rounded together on one processor only."""
    runs, case = 37, model("published")
    found = native_study.run(ready(native), case, runs, SEED)
    assert found.runs_at_once == lanes
    narrow = native_study.run(ready(WIDTHS[0]), case, runs, SEED)
    np.testing.assert_allclose(found.rmse, narrow.rmse, rtol=1e-4)


@pytest.mark.full
@pytest.mark.parametrize("name", ["published", "honest_b"])
@pytest.mark.parametrize("native", ALL, ids=named)
def test_runs_of_a_peer_have_our_rms_errors_on_average(native: Native, name: str) -> None:
    case, runs, our_runs = setting(name, 400), 2000, 2000
    ours = run_seeds(case, range(1, our_runs + 1), 2, lambda _: None)["rmse"] ** 2
    theirs = native_study.run(ready(native), filter_model(case), runs, SEED).rmse ** 2
    error = np.sqrt(ours.var(axis=0) / our_runs + theirs.var(axis=0) / runs)
    assert np.all(np.abs(theirs.mean(axis=0) - ours.mean(axis=0)) < 4.5 * error)
    np.testing.assert_allclose(theirs.std(axis=0), ours.std(axis=0), rtol=0.2)


@pytest.mark.full
@pytest.mark.parametrize("native", [PLAIN, SIMD], ids=named)
def test_the_noise_of_a_peer_is_normal_and_its_runs_share_none(native: Native) -> None:
    runs = 32
    rows = native_study.drawn(ready(native), model("published", 4000), runs, SEED)
    assert np.all(rows[..., DRAWN:] == 0.0)
    used = rows[..., :DRAWN]
    count = used.size
    assert abs(used.mean()) < 4.5 / np.sqrt(count)
    assert abs(used.var() - 1.0) < 4.5 * np.sqrt(2.0 / count)
    assert abs((used**3).mean()) < 4.5 * np.sqrt(15.0 / count)
    assert abs((used**4).mean() - 3.0) < 4.5 * np.sqrt(96.0 / count)
    inside = [(np.abs(used) < bound).mean() for bound in (0.1, 1.0, 2.0, 3.0, 4.0)]
    np.testing.assert_allclose(inside, [0.0796557, 0.6826895, 0.9544997, 0.9973002, 0.9999367], atol=1.6e-3)
    assert 4.7 < np.abs(used).max() < 7.0
    for columns in (used.reshape(runs, -1), used.reshape(-1, DRAWN).T, (used**2).reshape(-1, DRAWN).T):
        correlation = np.corrcoef(columns) - np.eye(len(columns))
        assert np.abs(correlation).max() < 5.0 / np.sqrt(columns.shape[1])
    ahead = np.corrcoef(used[:, 1:].ravel(), used[:, :-1].ravel())[0, 1]
    assert abs(ahead) < 4.5 / np.sqrt(count)


@pytest.mark.full
@pytest.mark.parametrize("native", ALL, ids=named)
def test_a_peer_runs_with_the_noise_that_it_draws(native: Native) -> None:
    program, case, runs = ready(native), model("published"), 5
    own = native_study.run(program, case, runs, SEED)
    given = native_study.run(program, case, runs, SEED, native_study.drawn(program, case, runs, SEED))
    np.testing.assert_array_equal(given.rmse, own.rmse)
    fewer = native_study.run(program, case, 2, SEED)
    np.testing.assert_array_equal(fewer.rmse, own.rmse[:2])
    other = native_study.run(program, case, runs, SEED + 1)
    assert np.all(other.rmse[:, :2] != own.rmse[:, :2])


def test_noise_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"normals are \(2, 250, 20\), not \(3, 250, 20\)"):
        native_study.run(built(PLAIN), model("published"), 3, SEED, noise(2))


def test_a_program_says_what_it_cannot_do() -> None:
    program = built(PLAIN)
    with pytest.raises(build.BenchError, match="usage"):
        build.call([str(program), "nothing"])
    with pytest.raises(build.BenchError, match="no model"):
        build.call([str(program), "/nowhere/model", "1", "1", "own"])
    with pytest.raises(build.BenchError, match="too few or many runs: 0"):
        native_study.run(program, model("published"), 0, SEED)


NEON = {
    "gcc": ("aarch64-linux-gnu-gcc",),
    "clang": ("clang", "--target=aarch64-linux-gnu"),
}
HEADERS = {
    "stdlib.h": "void *malloc(size_t);\nvoid free(void *);\nvoid abort(void);\n",
    "string.h": "void *memcpy(void *, const void *, size_t);\nvoid *memset(void *, int, size_t);\n",
}
"""What the program takes from a C library, which a compiler for another processor may not have."""


@pytest.mark.full
@pytest.mark.parametrize("precision", [(), ("-DSTUDY_SINGLE",)], ids=("double", "single"))
@pytest.mark.parametrize("compiler", NEON)
def test_it_compiles_for_neon(compiler: str, precision: tuple[str, ...], tmp_path: Path) -> None:
    words = NEON[compiler]
    if shutil.which(words[0]) is None:
        pytest.skip(f"{words[0]} is not installed")
    for name, text in HEADERS.items():
        (tmp_path / name).write_text(f"#include <stddef.h>\n{text}")
    target = tmp_path / "neon.s"
    source = build.PEERS / "filter_study_simd.c"
    flags = ("-std=gnu11", "-ffreestanding", "-O3", "-ffp-contract=fast", "-Wall", "-Wextra", "-Werror")
    command = [*words, *flags, *precision, f"-I{tmp_path}", "-S", str(source), "-o", str(target)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "No available targets" in done.stderr or "unable to create target" in done.stderr:
        pytest.skip("this clang has no aarch64")
    assert done.returncode == 0, done.stderr
    form = "4s" if precision else "2d"
    lines = [line.split() for line in target.read_text().splitlines()]
    for instruction, of in (("fmla", form), ("fsqrt", "4s"), ("fdiv", form)):
        assert any(line[0] == instruction and f".{of}" in line[1] for line in lines if len(line) > 1), instruction
