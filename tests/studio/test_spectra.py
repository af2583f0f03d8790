# SPDX-License-Identifier: MIT
"""Spectra of signals beside sines whose frequency and amplitude are known, and the limits that plots show."""

from __future__ import annotations

import numpy as np
import pytest

from omni.studio.bounds import SIGNAL_LIMITS, limit_of
from omni.studio.samples import Trace
from omni.studio.signals import all_signals
from omni.studio.spectra import MOST_LINES, TooFewSamplesError, spectrum
from omniwheel.robots import parameter_table


def trace_of(time_s: np.ndarray, value: np.ndarray) -> Trace:
    return Trace("wheels.speed.1", time_s, value.astype(np.float32))


@pytest.mark.parametrize(("frequency_Hz", "amplitude"), [(3.0, 0.5), (12.4, 2.0), (44.0, 0.01)])
def test_a_sine_on_a_slope_is_found_with_its_height(frequency_Hz: float, amplitude: float) -> None:
    time_s = 100.0 + np.arange(0.0, 10.0, 0.01)
    value = 7.0 - 0.3 * time_s + amplitude * np.sin(2 * np.pi * frequency_Hz * time_s)
    found = spectrum(trace_of(time_s, value)).as_json()
    assert found["peak"]["Hz"] == pytest.approx(frequency_Hz, abs=0.1)
    # Between two lines a Hann window shows up to 15 % less.
    assert found["peak"]["amplitude"] == pytest.approx(amplitude, rel=0.16)
    assert found["resolution_Hz"] == pytest.approx(0.2, rel=0.01)


def test_missing_samples_and_a_shaking_clock_do_not_move_the_line() -> None:
    generator = np.random.default_rng(5)
    time_s = np.arange(0.0, 20.0, 0.01)
    time_s = time_s[generator.random(len(time_s)) > 0.05]
    value = np.sin(2 * np.pi * 5.0 * time_s)
    shaken = np.sort(time_s + generator.normal(0.0, 2e-4, len(time_s)))
    peak = spectrum(trace_of(shaken, value)).as_json()["peak"]
    assert peak["Hz"] == pytest.approx(5.0, abs=0.05)
    assert peak["amplitude"] == pytest.approx(1.0, rel=0.1)


def test_a_long_stretch_has_few_lines_and_keeps_its_peak() -> None:
    time_s = np.arange(0.0, 700.0, 0.005)
    found = spectrum(trace_of(time_s, np.sin(2 * np.pi * 31.25 * time_s)))
    assert len(found.frequency_Hz) == MOST_LINES
    assert found.as_json()["peak"] == {"Hz": pytest.approx(31.25, abs=0.01), "amplitude": pytest.approx(1.0, rel=0.16)}


def test_too_few_samples_are_refused_with_what_to_do() -> None:
    with pytest.raises(TooFewSamplesError, match="has 3 samples in this interval; 16") as caught:
        spectrum(trace_of(np.array([0.0, 0.1, 0.2, 0.2]), np.zeros(4)))
    assert "longer interval" in caught.value.hint


def test_a_gap_of_days_does_not_fill_the_memory() -> None:
    time_s = np.concatenate([np.arange(0.0, 1.0, 0.005), 1e6 + np.arange(0.0, 1.0, 0.005)])
    with pytest.raises(TooFewSamplesError, match="too few samples for 1000001 s"):
        spectrum(trace_of(time_s, np.zeros(len(time_s))))


def test_each_limit_is_a_parameter_in_the_unit_of_its_signals() -> None:
    table = parameter_table()
    signals = {signal.key: signal for signal in all_signals(4)}
    limited = [signal for signal in signals.values() if limit_of(signal.key)]
    for signal in limited:
        name = limit_of(signal.key)
        assert name is not None
        assert table[name].unit == signal.unit, signal.key
    prefixes = {signal.key for signal in limited} | {signal.key.rpartition(".")[0] for signal in limited}
    assert set(SIGNAL_LIMITS) <= prefixes, "no limit is for a signal that there is not"
