# SPDX-License-Identifier: MIT
"""Ripple that belongs to a wheel's turning: how much of a signal swings N times per turn, whatever the speed.

A roller that passes shakes the robot at a frequency that is proportional to the wheel's speed. So the signal is
transformed over the wheel's angle and not over time: X(N) = sum of h_k a_k exp(-j N angle_k). N is the *order*, in
swings per turn. What passes with a wheel's angle stands at its order at every speed. What swings at a frequency of its
own does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEADY = 0.15
"""A piece is steady if the wheel's speed stays within this share of its mean (standard deviation)."""
AROUND = 0.75
"""The orders around order N reach from N times this to N divided by this; those within OWN do not count."""
OWN = 0.1


@dataclass(frozen=True)
class Piece:
    """Rows of one log in which ``wheel`` turns steadily: ``pace`` [rad/s], ``angle`` (n,) [rad] of each row."""

    rows: slice
    wheel: int
    pace: float
    angle: Array


@dataclass(frozen=True)
class Peak:
    """The order that stands out most, and by what factor its density is above that of the orders around it."""

    order: float
    contrast: float


Part = tuple[Array, Sequence[Piece]]
"""A signal (n,) and the pieces of it that count."""


def pieces_of(speed: Array, period_s: float, length_s: float, least_rad_s: float) -> list[Piece]:
    """Return the steady pieces of wheel speeds (n, wheels) [rad/s], each by the speed of its fastest wheel.

    A piece has ``length_s``; they follow each other without a gap or an overlap. Slower ones than ``least_rad_s`` are
    left out.
    """
    rows = round(length_s / period_s)
    found = []
    for begin in range(0, len(speed) - rows + 1, rows):
        part = speed[begin : begin + rows]
        wheel = int(np.argmax(np.abs(part.mean(axis=0))))
        pace = float(abs(part[:, wheel].mean()))
        if pace >= least_rad_s and float(part[:, wheel].std()) <= STEADY * pace:
            angle = np.concatenate(([0.0], np.cumsum(np.abs(part[:-1, wheel])))) * period_s
            found.append(Piece(slice(begin, begin + rows), wheel, pace, angle))
    return found


def by_time(pieces: Sequence[Piece], period_s: float) -> list[Piece]:
    """Return the pieces as if the wheel turned once per second: an order is then a frequency in hertz."""
    turn = 2.0 * np.pi

    def timed(piece: Piece) -> Piece:
        return replace(piece, pace=turn, angle=turn * period_s * np.arange(len(piece.angle), dtype=np.float64))

    return [timed(piece) for piece in pieces]


def swift(signal: Array, period_s: float, over_s: float) -> Array:
    """Return what a mean over ``over_s`` leaves out of a signal (n,) or (n, k)."""
    width = round(over_s / period_s)
    columns = signal.reshape(len(signal), -1).T
    smooth = [np.convolve(column, np.full(width, 1.0 / width), mode="same") for column in columns]
    return np.asarray(signal - np.stack(smooth, axis=1).reshape(signal.shape))


def density(signal: Array, piece: Piece, orders: Array, period_s: float) -> Array:
    """Return the one-sided power density per hertz of a piece of ``signal`` (n,) at each of ``orders``.

    Orders above the highest that the rows can tell (half a swing per row) are NaN.
    """
    part = signal[piece.rows]
    window = np.hanning(len(part) + 2)[1:-1]
    mean = np.sum(window * part) / np.sum(window)
    turned = np.exp(-1j * np.outer(orders, piece.angle))
    power = np.abs(turned @ (window * (part - mean))) ** 2
    scaled = 2.0 * period_s * power / np.sum(window**2)
    return np.where(orders * piece.pace * period_s <= np.pi, scaled, np.nan)


def spectrum(parts: Sequence[Part], orders: Array, period_s: float) -> Array:
    """Return the mean density over all pieces of all signals; NaN where fewer than half of them reach."""
    found = [density(signal, piece, orders, period_s) for signal, pieces in parts for piece in pieces]
    if not found:
        return np.full(len(orders), np.nan)
    known = np.isfinite(found)
    counted = known.sum(axis=0)
    whole = np.where(known, found, 0.0).sum(axis=0)
    return np.where(2 * counted >= len(found), whole / np.maximum(counted, 1), np.nan)


def peak(power: Array, orders: Array) -> Peak:
    """Return the order whose density is farthest above the median of the orders around it.

    Only an order that has all orders around it can be that: of 4 to 32, those from 5.3 to 24.
    """
    known = np.isfinite(power)
    best = Peak(float("nan"), 0.0)
    if not known.any():
        return best
    first, last = orders[known][0], orders[known][-1]
    for order, here in zip(orders[known], power[known], strict=True):
        near = np.abs(orders / order - 1.0) <= OWN
        around = known & ~near & (orders >= AROUND * order) & (orders <= order / AROUND)
        if AROUND * order >= first and order / AROUND <= last:
            contrast = float(here / np.median(power[around]))
            best = max(best, Peak(float(order), contrast), key=lambda each: each.contrast)
    return best


def band_rms(parts: Sequence[Part], order: float, share: float, period_s: float) -> float:
    """Return the RMS of what swings within ``share`` of an order, over all pieces; NaN without a piece."""
    orders = np.linspace(order * (1.0 - share), order * (1.0 + share), 33)
    squares = []
    for signal, pieces in parts:
        for piece in pieces:
            power = np.nan_to_num(density(signal, piece, orders, period_s))
            area = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(orders))
            squares.append(float(area) * piece.pace / (2.0 * np.pi))
    return float(np.sqrt(np.mean(squares))) if squares else float("nan")


def total_rms(parts: Sequence[Part]) -> float:
    """Return the RMS of the signals about the mean of each piece, over all pieces; NaN without a piece."""
    squares = [float(np.var(signal[piece.rows])) for signal, pieces in parts for piece in pieces]
    return float(np.sqrt(np.mean(squares))) if squares else float("nan")
