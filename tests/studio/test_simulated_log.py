# SPDX-License-Identifier: MIT
"""Simulated runs are plotted beside drives: the same names where a robot reports the same, and the world's truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil_sim.record import sample_dtype
from omni.studio import reading
from omni.studio.simulated_log import SimulatedLog
from omni.studio.spectra import TooFewSamplesError
from omniwheel.errors import LogError
from omniwheel.logs.run_folder import RECORD_FILE, SUMMARY_FILE
from tests.studio.parts import Opener, studio, until

RATE_HZ, HUM_HZ = 100.0, 7.0
SUMMARY: dict[str, Any] = {
    "parameters": {"WHEELS": 3, "LIM_WHEEL": 25.0, "LIM_DUTY": 0.9},
    "events": [{"time_s": 0.5, "what": "arm"}],
}


def write_simulated(folder: Path, seconds: float = 10.0, path_s: float = 1.0) -> Path:
    samples = np.zeros(round(seconds * RATE_HZ), dtype=sample_dtype())
    time_s = np.arange(len(samples)) / RATE_HZ
    samples["time_s"] = time_s
    samples["truth"][:, 0] = 0.1 * time_s
    samples["estimate"][:, 0] = 0.1 * time_s + 0.001
    samples["wheel_reference"][:, 1] = 3.0 * np.sin(2 * np.pi * HUM_HZ * time_s)
    samples["supply_V"] = 12.0
    samples["phase"][time_s >= path_s - 0.5] = 1
    samples["phase"][time_s >= path_s] = 2
    folder.mkdir(parents=True)
    np.savez_compressed(folder / RECORD_FILE, samples=samples)
    (folder / SUMMARY_FILE).write_text(json.dumps(SUMMARY))
    return folder


def test_signals_have_the_names_that_a_robots_have(tmp_path: Path) -> None:
    about = reading.opened(reading.run_log(tmp_path, write_simulated(tmp_path / "sim").name))
    signals = {signal["key"]: signal for signal in about["signals"] if not signal["absent"]}
    assert (signals["tracking.pose.x"]["label"], signals["tracking.pose.x"]["unit"]) == ("pose x", "m")
    assert (signals["truth.pose.x"]["label"], signals["truth.pose.x"]["unit"]) == ("true pose x", "m")
    assert "wheels.duty.3" in signals
    assert "wheels.duty.4" not in signals
    assert signals["wheels.reference.2"]["limit"] == "LIM_WHEEL"
    assert about["limits"] == {"LIM_WHEEL": 25.0, "LIM_DUTY": 0.9}
    assert about["duration_s"] == pytest.approx(9.99)
    assert about["path_s"] == pytest.approx(1.0)
    assert [(mark["time_s"], mark["text"]) for mark in about["marks"]] == [(0.5, "arm")]


def test_a_window_and_a_spectrum_are_of_the_record(tmp_path: Path) -> None:
    path = write_simulated(tmp_path / "sim") / RECORD_FILE
    log = SimulatedLog(path)
    (trace,) = log.window(["truth.pose.x", "no.such.thing"][:1], 2.0, 3.0, 1000)
    assert trace.time_s[0] == pytest.approx(2.0)
    assert len(trace.time_s) == pytest.approx(100, abs=1)
    assert trace.value[-1] == pytest.approx(0.3, abs=2e-3)
    assert log.window(["no.such.thing"], 0.0, 1.0, 100) == []
    (found,) = reading.spectra(path, ["wheels.reference.2"], 0.0, 10.0)
    assert found["peak"]["Hz"] == pytest.approx(HUM_HZ, abs=0.1)
    assert found["peak"]["amplitude"] == pytest.approx(3.0, rel=0.05)
    with pytest.raises(TooFewSamplesError):
        reading.spectra(path, ["wheels.reference.2"], 2.0, 2.05)


@pytest.mark.parametrize("damage", ["summary", "record", "parameters", "fields"])
def test_a_damaged_run_is_said(tmp_path: Path, damage: str) -> None:
    folder = write_simulated(tmp_path / "sim")
    if damage == "summary":
        (folder / SUMMARY_FILE).write_text("{")
    elif damage == "record":
        (folder / RECORD_FILE).write_bytes(b"PK nothing")
    elif damage == "parameters":
        (folder / SUMMARY_FILE).write_text('{"parameters": {}}')
    else:
        np.savez_compressed(folder / RECORD_FILE, samples=np.zeros(3, dtype=[("time_s", "<f8")]))
    with pytest.raises(LogError):
        reading.opened(folder / RECORD_FILE)


def test_simulated_runs_are_plotted_compared_and_analysed_on_the_page(tmp_path: Path, open_page: Opener) -> None:
    for name, path_s in (("before", 1.0), ("after", 3.0)):
        write_simulated(tmp_path / name, path_s=path_s)
    with studio("--out", str(tmp_path)) as program:
        page = open_page(program.url)
        page.get_by_label("Open before").click()
        until(page, "studio.runs.plots.samples_of('0|tracking.pose.x').time.length > 100")
        assert page.evaluate("studio.runs.plots.limit('LIM_DUTY')") == 0.9
        page.get_by_label("Compare after").click()
        until(page, "studio.runs.plots.samples_of('1|tracking.pose.x').time.length > 100")
        beginning = "studio.runs.plots.samples_of('1|tracking.pose.x').time[0]"
        assert page.evaluate(beginning) == pytest.approx(-2.0)  # both from their path's start
        page.uncheck("#run-align")
        until(page, f"Math.abs({beginning}) < 1e-6")
        page.check("#run-align")
        until(page, f"Math.abs({beginning} + 2) < 1e-6")
        page.get_by_label("Signals of run plot 2").click()
        page.uncheck("input[value='wheels.reference.1']")
        page.check("input[value='wheels.reference.2']")
        page.click("#close-signals")
        page.get_by_label("Spectrum of run plot 2").click()
        until(page, "document.querySelectorAll('#spectrum-list li').length === 2")
        first, second = page.locator("#spectrum-list li").all_text_contents()
        assert first.startswith("A: reference 2: largest at 7")
        assert second.startswith("B: reference 2: largest at 7")
