# SPDX-License-Identifier: MIT
"""Synthetic signals whose ripple is known: what passes with a wheel's angle is found, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from omni_reproduce import ripple
from omni_reproduce.experiment import read_spec

Array = NDArray[np.float64]
HEAD = read_spec("real_worlds")["experiment"]
T = 0.01
ORDERS = np.arange(4.0, 32.01, 0.25)
STANDS_OUT = HEAD["stands_out"]


def speeds(seed: int) -> Array:
    """Return 40 s of three wheels that turn at other speeds every 2 s, of 5 to 10 rad/s for the fastest."""
    generator = np.random.default_rng(seed)
    steps = generator.uniform(5.0, 10.0, 20)[:, None] * np.array([-0.5, 1.0, -0.5])
    return np.repeat(steps, 200, axis=0)


def noise(seed: int, count: int, red: float = 0.0) -> Array:
    """Return noise of standard deviation 1; with ``red`` each value keeps so much of the one before."""
    white = np.random.default_rng(seed).standard_normal(count)
    out = np.zeros(count)
    for k in range(count):
        out[k] = red * out[k - 1] + np.sqrt(1.0 - red**2) * white[k]
    return out


def found(signals: list[Array], speed: Array, *, by_time: bool = False) -> ripple.Peak:
    pieces = ripple.pieces_of(speed, T, HEAD["piece_s"], HEAD["least_rad_s"])
    assert len(pieces) >= 35
    if by_time:
        pieces = ripple.by_time(pieces, T)
    return ripple.peak(ripple.spectrum([(signal, pieces) for signal in signals], ORDERS, T), ORDERS)


def rollers(speed: Array, order: float, amplitude: float, seed: int = 0) -> Array:
    """Return a swing of ``order`` per turn of the second wheel, with a phase that nobody knows."""
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    return amplitude * np.sin(order * np.cumsum(speed[:, 1]) * T + phase)


@pytest.mark.full
@pytest.mark.parametrize("order", [8.0, 13.0, 18.0])
@pytest.mark.parametrize("red", [0.0, 0.8])
def test_a_ripple_that_is_there_is_found_at_its_order(order: float, red: float) -> None:
    speed = speeds(1)
    signal = noise(2, len(speed), red) + rollers(speed, order, 0.6)
    best = found([signal], speed)
    assert best.order == pytest.approx(order, abs=0.5), "a piece of 1 s tells orders apart by 0.6 to 1.3"
    assert best.contrast > STANDS_OUT


@pytest.mark.full
@pytest.mark.parametrize("red", [0.0, 0.8, 0.95])
def test_noise_without_a_line_has_no_order_that_stands_out(red: float) -> None:
    for seed in range(3):
        speed = speeds(seed)
        signals = [noise(100 * seed + axis, len(speed), red) for axis in (1, 2)]
        assert found(signals, speed).contrast < STANDS_OUT, seed


@pytest.mark.nightly
@pytest.mark.parametrize("red", [0.0, 0.8, 0.95])
def test_noise_without_a_line_stands_out_once_in_a_hundred_times(red: float) -> None:
    contrasts = []
    for seed in range(150):
        speed = speeds(seed)
        contrasts.append(found([noise(1000 * seed, len(speed), red)], speed).contrast)
    assert np.mean(np.array(contrasts) >= STANDS_OUT) <= 0.02


def test_what_swings_at_a_frequency_of_its_own_is_no_order() -> None:
    """A body that rings at 20 Hz at every speed: sharp by frequency, spread over the orders."""
    speed = speeds(3)
    signal = noise(4, len(speed)) + 1.0 * np.sin(2.0 * np.pi * 20.0 * T * np.arange(len(speed)))
    by_order, by_time = found([signal], speed), found([signal], speed, by_time=True)
    assert by_time.order == pytest.approx(20.0, abs=0.5)
    assert by_time.contrast > 3.0 * by_order.contrast
    wheel = noise(4, len(speed)) + rollers(speed, 14.0, 1.0)
    assert found([wheel], speed).contrast > 3.0 * found([wheel], speed, by_time=True).contrast


def test_the_band_has_the_power_of_its_line_and_the_whole_has_everything() -> None:
    speed = speeds(5)
    signal = rollers(speed, 18.0, 2.0)
    pieces = ripple.pieces_of(speed, T, HEAD["piece_s"], HEAD["least_rad_s"])
    parts = [(signal, pieces)]
    assert ripple.total_rms(parts) == pytest.approx(2.0 / np.sqrt(2.0), rel=0.01)
    assert ripple.band_rms(parts, 18.0, 0.15, T) == pytest.approx(2.0 / np.sqrt(2.0), rel=0.05)
    assert ripple.band_rms(parts, 9.0, 0.15, T) < 0.05


def test_white_noise_has_its_share_in_a_band() -> None:
    """As wide as the band is, of the 50 Hz that there are."""
    speed = speeds(6)
    pieces = ripple.pieces_of(speed, T, HEAD["piece_s"], HEAD["least_rad_s"])
    pace = np.mean([piece.pace for piece in pieces])
    share = 0.3 * 18.0 * pace / (2.0 * np.pi) / 50.0
    rms = ripple.band_rms([(noise(7, len(speed)), pieces)], 18.0, 0.15, T)
    assert rms == pytest.approx(np.sqrt(share), rel=0.1)


def test_pieces_are_steady_and_fast_enough() -> None:
    still, slow = np.zeros((100, 3)), np.full((100, 3), 3.0)
    rising = np.tile(np.linspace(0.0, 12.0, 100)[:, None], (1, 3))
    steady = np.tile([-5.0, 0.0, -8.0], (100, 1))
    pieces = ripple.pieces_of(np.concatenate((still, slow, rising, steady)), T, 1.0, 4.0)
    assert [(piece.rows, piece.wheel, piece.pace) for piece in pieces] == [(slice(300, 400), 2, 8.0)]
    assert pieces[0].angle[-1] == pytest.approx(8.0 * 0.99)
    assert ripple.pieces_of(steady[:50], T, 1.0, 4.0) == []


def test_without_a_piece_there_is_no_figure() -> None:
    nothing: list[ripple.Part] = [(np.zeros(100), [])]
    assert np.isnan(ripple.total_rms(nothing))
    assert np.isnan(ripple.band_rms(nothing, 18.0, 0.15, T))
    assert ripple.peak(ripple.spectrum(nothing, ORDERS, T), ORDERS).contrast == 0.0


def test_orders_that_the_rows_cannot_tell_are_unknown() -> None:
    piece = ripple.pieces_of(np.tile([0.0, 20.0, 0.0], (100, 1)), T, 1.0, 4.0)[0]
    power = ripple.density(np.ones(100), piece, np.array([10.0, 15.0, 16.0]), T)
    assert np.isfinite(power).tolist() == [True, True, False]
    assert power[0] == pytest.approx(0.0, abs=1e-12), "a constant has no ripple"


def test_ripple_is_what_a_mean_leaves_out() -> None:
    time = T * np.arange(400)
    slow, fast = np.sin(2.0 * np.pi * 0.2 * time), np.sin(2.0 * np.pi * 20.0 * time)
    left = ripple.swift(np.stack((slow, slow + fast), axis=1), T, 0.25)[50:-50]
    assert np.abs(left[:, 0]).max() < 0.02
    assert np.std(left[:, 1]) == pytest.approx(np.sqrt(0.5), rel=0.02)
