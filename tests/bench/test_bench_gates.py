# SPDX-License-Identifier: MIT
"""The gates fail when they should, and the model of the peers' download keeps its own rules."""

from __future__ import annotations

import pytest

from bench import ticks
from bench.__main__ import PAGE
from bench.gates import RATIOS, quotient, read_recorded, too_many, too_slow
from bench.peers.ardupilot_download import LIST_BYTES, VALUE_BYTES, Frames, download_s, frame
from hil_sim.speed import Measurement, Spread, alternate
from omniwheel.radio_model import RadioSettings


def test_instructions_that_grew_are_named() -> None:
    recorded = read_recorded()
    assert too_many(recorded, recorded) == []
    assert too_many({name: int(value * 1.09) for name, value in recorded.items()}, recorded) == []
    name = next(iter(recorded))
    assert [sentence.split(":")[0] for sentence in too_many({**recorded, name: recorded[name] * 2}, recorded)] == [name]
    assert "not the counts" in too_many({**recorded, "new": 1}, recorded)[0]


def test_the_page_has_the_counts_that_the_gates_hold() -> None:
    """Within 3 %: the page once had counts of ideal wheels, while the gates had gone on to real ones."""
    page = PAGE.read_text(encoding="utf-8")
    block = page.partition("<!-- bench-ticks -->")[2].partition("<!-- /bench-ticks -->")[0]
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in block.splitlines()]
    told = {row[0]: float(row[1]) for row in cells if len(row) > 2 and row[1].isdigit()}
    recorded = read_recorded()
    assert {ticks.WAYS[way]: told[ticks.WAYS[way]] for way in recorded} == {
        ticks.WAYS[way]: pytest.approx(count, rel=0.03) for way, count in recorded.items()
    }
    for way in ("in_process", "lanes"):
        assert 1.05 < told[ticks.WAYS[way]] / told[f"{ticks.WAYS[way]}, ideal wheels"] < 1.15


def test_a_lost_lead_is_named() -> None:
    usual = {ratio.fast: Spread((1.0,)) for ratio in RATIOS}
    assert all(ratio.limit < 0.7 * ratio.usual for ratio in RATIOS)
    for ratio in RATIOS:
        pair = {ratio.fast: usual[ratio.fast], ratio.slow: Spread((ratio.usual, 3.0 * ratio.usual))}
        assert quotient(ratio, pair) == ratio.usual
        assert too_slow(pair) == []
        pair[ratio.slow] = Spread((0.9 * ratio.limit, ratio.usual))
        assert len(too_slow(pair)) == 1
    assert too_slow({}) == []


def test_measurements_are_done_in_turn() -> None:
    order: list[str] = []

    def measurement(name: str, figures: list[float]) -> Measurement:
        def run() -> float:
            order.append(name)
            return figures.pop(0)

        return run

    spreads = alternate({"a": measurement("a", [3.0, 1.0, 2.0]), "b": measurement("b", [5.0, 4.0, 9.0])}, 3)
    assert order == ["a", "b"] * 3
    assert (spreads["a"].least, spreads["a"].median, spreads["b"].least) == (1.0, 2.0, 4.0)


def test_a_stream_takes_its_share_of_the_line() -> None:
    took_s = download_s(135, RadioSettings(baud=9600), True, 1)
    share_s = 135 * VALUE_BYTES / (0.3 * 960)
    assert share_s < took_s < share_s + 1.0


@pytest.mark.parametrize("streamed", [True, False])
def test_losses_cost_time_but_no_parameter(streamed: bool) -> None:
    clean = download_s(60, RadioSettings(baud=9600), streamed, 1)
    lossy = download_s(60, RadioSettings(baud=9600, loss=0.2, latency_s=0.2), streamed, 1)
    assert lossy > 1.2 * clean
    with pytest.raises(TimeoutError, match="missing"):
        download_s(5, RadioSettings(baud=9600, loss=1.0), streamed, 1)


def test_cut_frames_are_not_taken_for_whole_ones() -> None:
    whole = [frame(index, VALUE_BYTES) for index in range(200)]
    frames = Frames()
    assert frames.take(whole[0][:20]) == []
    assert frames.take(whole[0][20:] + frame(0xFFFF, LIST_BYTES)) == [0, 0xFFFF]
    joined = whole[7][:20] + whole[8][20:]
    assert frames.take(joined + whole[9] + whole[10]) == [9, 10]
