# SPDX-License-Identifier: MIT
"""Counters that a restart of the logger sets to zero while its clock goes on: that is not motion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from omni.cli import app
from omni.cli.log_options import shares_of
from omniwheel.errors import LogError
from omniwheel.logs.importer import ImportSummary, import_log
from omniwheel.logs.log import WheelLog
from omniwheel.logs.mapping import read_mapping

Array = NDArray[np.float64]
ROWS, PERIOD_S, PER_TURN = 2000, 0.01, 10_000
SPEED_RAD_S = np.array([3.0, -1.0, -2.0])
TIME_S: Array = np.asarray(PERIOD_S * np.arange(ROWS))
COUNTS: Array = np.round(np.outer(TIME_S, SPEED_RAD_S) * PER_TURN / (2.0 * np.pi))
MAPPING = """
[log]
name = "restarted"
period_s = 0.01
[log.time]
column = "t"
[wheels]
columns = ["a", "b", "c"]
quantity = "{quantity}"
unit = "{unit}"
counts_per_revolution = 10000
{more}"""


def written(
    folder: Path, counts: Array, *, quantity: str = "counts", unit: str = "counts", more: str = "", keep: Array = TIME_S
) -> tuple[Path, Path]:
    mapping, path = folder / "mapping.toml", folder / "log.csv"
    mapping.write_text(MAPPING.format(quantity=quantity, unit=unit, more=more), encoding="utf-8")
    table = np.column_stack((TIME_S, counts))[np.isin(TIME_S, keep)]
    np.savetxt(path, table, fmt="%.6f", delimiter=",", header="t,a,b,c", comments="")
    return path, mapping


def imported(folder: Path, counts: Array, **how: object) -> tuple[WheelLog, ImportSummary]:
    path, mapping = written(folder, counts, **how)  # type: ignore[arg-type]
    return import_log(path, read_mapping(mapping))


def restarted(row: int, at: Array = COUNTS) -> Array:
    """The counters as they are logged if they begin again at zero in a row."""
    return np.where(np.arange(len(at))[:, None] < row, at, at - at[row])


def turned(log: WheelLog) -> Array:
    return np.asarray(np.sum(log.counts, axis=0))


@pytest.mark.parametrize("row", [30, 300, 1000, 1998, 1999])
@pytest.mark.parametrize("start", [0.0, 2.0**16 - 100.0, -(2.0**31) + 5e5, 4e5])
def test_counters_that_restart_are_counted_on(tmp_path: Path, row: int, start: float) -> None:
    log, summary = imported(tmp_path, restarted(row, COUNTS + start) if start else restarted(row))
    assert turned(log) == pytest.approx(COUNTS[-1] - COUNTS[0], abs=60.0), "a row's motion is lost at most"
    if row > 30:
        assert summary.counter_restarts_s == pytest.approx((TIME_S[row],))


@pytest.mark.parametrize("moved", [0.0, 30.0, -30.0])
def test_what_the_wheels_turned_since_zero_is_counted(tmp_path: Path, moved: float) -> None:
    log, summary = imported(tmp_path, restarted(1000) + moved * (np.arange(ROWS)[:, None] >= 1000))
    assert log.counts[1000] == pytest.approx(np.full(3, moved))
    assert summary.counter_restarts_s == (10.0,)


def test_a_restart_of_a_log_in_turns_and_one_with_rows_missing(tmp_path: Path) -> None:
    log, summary = imported(tmp_path, restarted(1000) / PER_TURN, unit="turns")
    assert turned(log) == pytest.approx(COUNTS[-1], abs=60.0)
    assert len(summary.counter_restarts_s) == 1
    log, summary = imported(tmp_path, restarted(1000), keep=np.delete(TIME_S, np.arange(990, 1000)))
    assert turned(log) == pytest.approx(COUNTS[-1], abs=600.0), "the motion of the missing rows is lost"
    assert len(summary.counter_restarts_s) == 1


def test_two_restarts_and_one_of_a_single_wheel(tmp_path: Path) -> None:
    both = restarted(1500, restarted(700))
    log, summary = imported(tmp_path, both)
    assert summary.counter_restarts_s == (7.0, 15.0)
    assert turned(log) == pytest.approx(COUNTS[-1], abs=120.0)
    one = COUNTS.copy()
    one[:, 1] = restarted(1000)[:, 1]
    log, summary = imported(tmp_path, one)
    assert summary.counter_restarts_s == (10.0,)
    assert turned(log) == pytest.approx(COUNTS[-1], abs=60.0)


def test_a_wheel_that_turns_back_before_the_second_restart(tmp_path: Path) -> None:
    swing = np.round(np.outer(np.where(TIME_S < 5.0, TIME_S, np.maximum(15.0 - 2.0 * TIME_S, -15.0)), [900, 900, 900]))
    log, summary = imported(tmp_path, restarted(1600, restarted(500, swing)))
    assert len(summary.counter_restarts_s) == 2
    assert turned(log) == pytest.approx(swing[-1], abs=60.0)


def test_motion_is_no_restart(tmp_path: Path) -> None:
    there_and_back = np.round(3000.0 * np.sin(2.0 * np.pi * TIME_S / 4.0))[:, None] * np.ones(3)
    at_rest_but_nudged = np.zeros((ROWS, 3))
    at_rest_but_nudged[500:1000] = 9.0
    jerky = np.where(TIME_S < 5.0, 0.0, np.where(TIME_S < 5.05, 200.0, 0.0))[:, None] * np.ones(3)
    for counts in (COUNTS, there_and_back, at_rest_but_nudged, jerky - 100.0):
        log, summary = imported(tmp_path, counts)
        assert summary.counter_restarts_s == ()
        assert np.array_equal(log.counts, np.diff(counts, axis=0, prepend=counts[:1]))
    gone_and_back = np.where((TIME_S > 3.0) & (TIME_S < 6.0), 400.0 * (TIME_S - 3.0), 0.0)
    gone_and_back = np.where(TIME_S >= 6.0, np.maximum(1200.0 - 400.0 * (TIME_S - 6.0), 0.0), gone_and_back)
    log, summary = imported(
        tmp_path, np.round(gone_and_back)[:, None] * np.ones(3), keep=np.delete(TIME_S, np.arange(600, 900))
    )
    assert summary.counter_restarts_s == ()
    assert turned(log) == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize("rows", [1, 2, 40])
def test_a_counter_that_is_misread_as_zero_for_some_rows_has_not_restarted(tmp_path: Path, rows: int) -> None:
    counts = COUNTS.copy()
    counts[1000 : 1000 + rows, 0] = 0.0
    if rows > 3:
        with pytest.raises(LogError):
            imported(tmp_path, counts)
        return
    log, summary = imported(tmp_path, counts)
    assert summary.counter_restarts_s == ()
    assert turned(log) == pytest.approx(COUNTS[-1])


def test_counters_that_wrap_at_another_value_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="begin again at zero"):
        imported(tmp_path, np.mod(np.round(np.outer(TIME_S, [5000.0, 4000.0, 3000.0])), 4096.0))


@pytest.mark.parametrize("quantity", ["counts", "increment", "speed"])
def test_a_row_that_no_wheel_can_turn_is_refused_unless_the_mapping_rejects_it(tmp_path: Path, quantity: str) -> None:
    counts = np.where(np.arange(ROWS)[:, None] < 1000, COUNTS, COUNTS - 47_746.0)
    if quantity != "counts":
        counts = np.diff(counts, axis=0, prepend=counts[:1])
    unit = "counts"
    if quantity == "speed":
        counts, unit = counts * 2.0 * np.pi / PER_TURN / PERIOD_S, "rad/s"
    with pytest.raises(LogError, match=r"increases by -47\d+ counts at 10.000 s"):
        imported(tmp_path, counts, quantity=quantity, unit=unit)
    log, _ = imported(tmp_path, counts, quantity=quantity, unit=unit, more="[spikes]\nmax_rad_s = 100.0\n")
    assert list(np.flatnonzero(~log.good.all(axis=1))) == [1000]


def test_the_commands_say_restart_and_rows(tmp_path: Path) -> None:
    path, mapping = written(tmp_path, restarted(1000))
    words = ["logs", "import", str(path), "--mapping", str(mapping), "--out", str(tmp_path / "log.npz")]
    said = CliRunner().invoke(app, words)
    assert said.exit_code == 0, said.output
    assert "restarted at 10.00 s" in said.stdout
    assert json.loads(CliRunner().invoke(app, [*words, "--force", "--json"]).stdout)["counter_restarts_s"] == [10.0]


def test_a_small_share_is_said_in_rows() -> None:
    assert shares_of((0.0, 0.0005, 0.0234), 2000) == "0.0 %, 1 of 2000 rows, 2.3 %"
