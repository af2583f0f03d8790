# SPDX-License-Identifier: MIT
"""Logs whose clock or counters begin again at their end, and logs of which much would be left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from omni_schema import Robot
from omniwheel.errors import LogError
from omniwheel.logs.importer import import_log
from omniwheel.logs.log import WheelLog
from omniwheel.logs.mapping import Mapping, read_mapping
from omniwheel.replay import replay
from tests.host.logs import synthetic

Array = NDArray[np.float64]
ROWS, PERIOD_S = 4000, 0.01
STEPS: Array = np.random.default_rng(3).integers(-60, 90, (ROWS, 3)).astype(float)
STEPS[0] = 0.0
TIME_S: Array = np.asarray(PERIOD_S * np.arange(ROWS), dtype=np.float64)


def imported(folder: Path, time: Array, wheels: Array, unit: str, quantity: str) -> WheelLog:
    """Import a log of these columns; nothing of it may be left out or come back as another number."""
    text = synthetic.MAPPING.split("[duty]", maxsplit=1)[0].replace('column = "t"', f'column = "t"\nunit = "{unit}"')
    text = text.replace('"speed"', f'"{quantity}"').replace('"rad/s"', '"counts"')
    text += "sign = [1, -1, 1]\n"
    (folder / "mapping.toml").write_text(text, encoding="utf-8")
    np.savetxt(
        folder / "log.csv", np.column_stack((time, wheels)), fmt="%.3f", delimiter=",", header="t,w1,w2,w3", comments=""
    )
    log, summary = import_log(folder / "log.csv", read_mapping(folder / "mapping.toml"))
    assert (summary.dropped_rows, summary.rows, summary.missing_rows) == (0, len(time), 0)
    return log


@pytest.mark.parametrize(
    ("unit", "per_s", "bits"), [("us", 1e6, 32), ("ms", 1e3, 32), ("ms", 1e3, 16), ("us", 1e6, 16), ("ms", 1e3, None)]
)
def test_a_clock_that_wraps_loses_no_row(tmp_path: Path, unit: str, per_s: float, bits: int | None) -> None:
    """Without bits: microseconds of 32 bits that the logger has divided by 1000."""
    span = 2.0**32 / 1e3 if bits is None else 2.0**bits
    time = np.mod(span - per_s * 20.0 + per_s * TIME_S, span)
    log = imported(tmp_path, time, np.cumsum(STEPS, axis=0), unit, "counts")
    assert log.time_s - log.time_s[0] == pytest.approx(TIME_S, abs=1e-5)


@pytest.mark.parametrize("bits", [16, 32])
@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("quantity", ["counts", "increment"])
def test_a_counter_that_wraps_counts_on(tmp_path: Path, bits: int, signed: bool, quantity: str) -> None:
    running = np.cumsum(STEPS, axis=0) + 2.0 ** (bits - signed) - 900.0 if quantity == "counts" else STEPS
    low = -(2.0 ** (bits - 1)) if signed else 0.0
    wrapped: Array = np.asarray(np.mod(running - low, 2.0**bits) + low, dtype=np.float64)
    log = imported(tmp_path, 1e3 * TIME_S, wrapped, "ms", quantity)
    assert np.array_equal(log.counts, STEPS * np.array([1.0, -1.0, 1.0]))


def test_a_log_of_which_much_would_be_left_out_is_refused(tmp_path: Path) -> None:
    restarted = 1e3 * np.where(TIME_S < 20.0, TIME_S, TIME_S - 20.0)
    with pytest.raises(LogError, match=r"2000 of 4000 rows.* row 2001 "):
        imported(tmp_path, restarted, np.cumsum(STEPS, axis=0), "ms", "counts")


def test_rows_of_the_truth_that_are_left_out_are_counted_and_many_are_refused(
    tmp_path: Path, files: Path, mapping: Mapping
) -> None:
    heading, *lines = (files / "truth_run1.csv").read_text(encoding="utf-8").splitlines()
    path = tmp_path / "truth.csv"
    path.write_text("\n".join([heading, *lines[:20], lines[19], *lines[20:]]), encoding="utf-8")
    assert import_log(files / "run1.csv", mapping, path)[1].truth_dropped_rows == 1
    path.write_text("\n".join([heading, *lines, *lines]), encoding="utf-8")
    with pytest.raises(LogError, match=f"{len(lines)} of {2 * len(lines)} rows"):
        import_log(files / "run1.csv", mapping, path)


def test_counts_that_no_wheel_counts_are_refused_and_those_that_are_no_good_may_be_any(
    runs: list[WheelLog], robot: Robot
) -> None:
    counts, good = runs[0].counts.copy(), runs[0].good.copy()
    counts[50, 1], good[50, 1] = 2.0**32, False
    assert np.all(np.isfinite(replay(replace(runs[0], counts=counts, good=good), robot).pose))
    good[50, 1] = True
    with pytest.raises(LogError, match="a wheel counts more than"):
        replay(replace(runs[0], counts=counts, good=good), robot)
