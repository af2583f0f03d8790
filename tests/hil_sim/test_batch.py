# SPDX-License-Identifier: MIT
"""Many runs per call are the single runs, whatever the batches."""

from __future__ import annotations

import pickle
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

from hil_sim import metrics
from hil_sim.batch import (
    BLOCK,
    FIGURES,
    BatchCancelledError,
    BatchSpec,
    Cancel,
    Figure,
    row_dtype,
    run_batch,
    run_batches,
    statistics_of,
)
from hil_sim.limits import MAX_SEED
from hil_sim.runs import run_in_process
from hil_sim.scenario import Event, Scenario, load_scenario
from hil_sim.statistics import Statistics, merged
from omni_schema import SchemaError
from omniwheel.errors import CoreError

QUICK = {"TRJ_SIZE": 0.02, "TRJ_PERIOD": 2.0, "TRJ_PETALS": 2.0, "TRJ_ROT": 0.0}


def quick(name: str = "demo") -> Scenario:
    """A scenario whose path takes two seconds, with an event in the middle of it."""
    return replace(load_scenario(name).with_parameters(QUICK), start_pose=(0.02, 0.0, 0.0))


def test_rows_are_those_of_single_runs() -> None:
    scenario = quick()
    rows = run_batch(scenario, 5, 11).rows
    assert rows["seed"].tolist() == list(range(5, 16))
    for row in rows[[0, 7, 10]]:
        run = run_in_process(scenario, int(row["seed"]))
        tracking, effort = metrics.tracking_rmse(run.record), metrics.effort(run.record, 3)
        assert (row["ticks"], row["completed"], row["status"]) == (run.ticks, 1.0, 0)
        assert row["position_m"] == pytest.approx(tracking.position_m, rel=1e-12)
        assert row["chatter"] == pytest.approx(effort.chatter, rel=1e-12)
        last = run.record[(run.record["phase"] == metrics.PHASE_DONE) & (run.record["state"] == metrics.STATE_ARMED)][
            -1
        ]
        # No sums: these come out the same to the bit.
        assert row["final_position_m"] == np.hypot(*(last["truth"] - last["reference"])[:2])
        assert row["peak_wheel_rad_s"] == effort.peak_wheel_rad_s


@pytest.mark.full
@pytest.mark.parametrize("name", ["demo", "tolerances", "four_wheel", "fault_pose_jump"])
def test_how_seeds_are_cut_into_batches_changes_no_bit(name: str) -> None:
    half = Event(at_progress=0.5, settings={"WS_P": 6.0})
    scenario = quick(name)
    scenario = replace(scenario, events=(*scenario.events, half))
    whole = run_batch(scenario, 1, 19).rows
    parts = [run_batch(scenario, first, count).rows for first, count in ((1, 1), (2, 3), (5, 3), (8, 9), (17, 3))]
    assert np.concatenate(parts).tobytes() == whole.tobytes()


def test_threads_change_no_bit() -> None:
    scenario = replace(quick(), duration_s=1.5)
    expected = run_batch(scenario, 1, 8).rows.tobytes()
    found: list[bytes] = []
    threads = [
        threading.Thread(target=lambda: found.append(run_batch(scenario, 1, 8).rows.tobytes())) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [expected] * 4


def test_parameters_of_the_spec_replace_the_scenario_s() -> None:
    spec = BatchSpec(quick(), {"WS_P": 2.0, "ISMC_LAM_XY": 5.0})
    again = pickle.loads(pickle.dumps(spec))
    rows = run_batch(again, 3, 2).rows
    assert rows.tobytes() == run_batch(spec.applied(), 3, 2).rows.tobytes()
    assert rows["position_m"][0] != run_batch(quick(), 3, 1).rows["position_m"][0]
    assert run_in_process(spec.applied(), 3).ticks == rows["ticks"][0]


def test_a_run_that_may_not_arm_is_counted_and_named() -> None:
    sag = replace(load_scenario("fault_battery_sag").faults[0], start_s=0.0)
    result = run_batch(replace(quick(), faults=(sag,)), 1, 9)
    found = result.statistics
    assert found.statuses == {"arming refused": 9}
    assert found["completed"].mean == 0.0
    assert found["position_m"].missing == 9
    assert np.isnan(found.mean("position_m"))
    assert list(found.faults.values()) == [9]


@pytest.mark.full
def test_a_run_that_stops_on_the_way_is_not_completed() -> None:
    result = run_batch(load_scenario("fault_encoder_stuck"), 1, 2)
    assert result.rows["completed"].tolist() == [0.0, 0.0]
    assert result.statistics.statuses == {"ok": 2}
    assert np.all(result.rows["position_m"] > 0.0)


def test_a_change_that_the_core_refuses_is_counted_and_named() -> None:
    scenario = quick()
    bad = Event(at_s=0.7, settings={"W1_ENC_DIR": 0.0})
    result = run_batch(replace(scenario, events=(*scenario.events, bad)), 1, 2)
    assert result.statistics.statuses == {"parameters refused": 2}


def test_what_no_run_could_start_with_is_an_error() -> None:
    with pytest.raises(CoreError, match="W1_ENC_DIR"):
        run_batch(BatchSpec(quick(), {"W1_ENC_DIR": 0.0}), 1, 1)
    with pytest.raises(SchemaError, match="the last seed may be"):
        run_batch(quick(), MAX_SEED, 2)
    with pytest.raises(ValueError, match="count is 0"):
        run_batch(quick(), 1, 0)


def test_a_batch_can_be_cancelled() -> None:
    cancel = Cancel()
    errors: list[Exception] = []

    def work() -> None:
        try:
            run_batch(load_scenario("demo"), 1, 100_000, cancel)
        except BatchCancelledError as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    cancel.set()
    thread.join(60.0)
    assert not thread.is_alive()
    assert cancel.is_set
    assert "of 100000 runs" in str(errors[0])


@pytest.mark.full
def test_batches_on_several_threads_come_in_order_and_stop_when_nobody_takes_them() -> None:
    scenario = replace(quick(), duration_s=1.5)
    rows = np.concatenate([part.rows for part in run_batches(scenario, 1, 19, workers=3)])
    assert rows.tobytes() == run_batch(scenario, 1, 19).rows.tobytes()
    many = run_batches(scenario, 1, 1_000_000, workers=2)
    assert len(next(many).rows) == 8 * BLOCK
    many.close()


MEMORY = """
import resource
from dataclasses import replace
from hil_sim.batch import run_batches
from hil_sim.scenario import load_scenario
from hil_sim.statistics import merged

tiny = replace(load_scenario("tolerances"), duration_s=0.1)
for runs in (64, {runs}):
    merged(part.statistics for part in run_batches(tiny, 1, runs, workers=2))
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.full
@pytest.mark.skipif(sys.platform != "linux", reason="counts kilobytes as Linux does")
def test_memory_does_not_grow_with_the_number_of_runs() -> None:
    script = MEMORY.format(runs=2000)
    told = subprocess.run([sys.executable, "-c", script], check=True, stdout=subprocess.PIPE, text=True, timeout=120)
    few_kB, many_kB = map(int, told.stdout.split())
    assert many_kB < 1.05 * few_kB


def test_every_column_but_those_that_name_the_run_is_a_figure() -> None:
    names = row_dtype().names or ()
    assert names[4:] == tuple(figure.name for figure in FIGURES)
    assert names[:4] == ("seed", "ticks", "status", "faults")
    assert all(isinstance(figure, Figure) and figure.name.endswith(figure.unit.replace("/", "_")) for figure in FIGURES)


def test_statistics_of_parts_are_those_of_the_whole() -> None:
    rows = run_batch(replace(quick(), duration_s=1.5), 1, 40).rows
    whole = statistics_of(rows)
    for cuts in ((7,), (1, 2, 3, 39), (8, 16, 24, 32)):
        part = merged(statistics_of(piece) for piece in np.split(rows, cuts))
        assert (part.runs, part.ticks, part.statuses, part.faults) == (40, whole.ticks, whole.statuses, whole.faults)
        for figure in FIGURES:
            one, other = part[figure.name], whole[figure.name]
            assert (one.count, one.missing, one.buckets) == (other.count, other.missing, other.buckets)
            np.testing.assert_allclose([one.mean, one.sd], [other.mean, other.sd], rtol=1e-12, atol=1e-15)
    assert Statistics.from_dict(whole.to_dict()) == whole
