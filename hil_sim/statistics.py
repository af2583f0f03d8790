# SPDX-License-Identifier: MIT
"""What the figures of many runs come to, in memory that does not grow with their number; parts can be merged.

Mean and deviation are Welford's, merged as Chan et al. do. Equal parts merged in the same order give the same bits on
every machine. Counts, extremes and quantiles are the same for any parts in any order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel._core import ffi, lib

_SHIFT = 43
"""Bits of a double that a bucket leaves out: what stays is sign, exponent and nine bits of the significand."""
_SMALLEST = float(np.finfo(np.float64).tiny)
RELATIVE_ERROR = 2.0**-10
"""Quantiles are off by at most this share of their value."""

_SPREAD = ("count", "missing", "mean", "m2", "min", "max")


def bucket_codes(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the bucket of each finite value: whole numbers in the values' order, 0 for zero and what is denormal.

    Each power of two has 512 buckets of equal width. Only bits are moved, so that every machine agrees.
    """
    size = np.abs(np.ascontiguousarray(values, dtype=np.float64))
    codes: NDArray[np.int64] = np.where(size < _SMALLEST, 0, size.view(np.int64) >> _SHIFT)
    return np.where(values < 0.0, -codes, codes)


def bucket_value(code: int) -> float:
    """Return the number that stands for a bucket: none in it is further away than RELATIVE_ERROR of its size."""
    edges = (np.array([abs(code), abs(code) + 1], dtype=np.int64) << _SHIFT).view(np.float64)
    middle = float(edges[0] + 0.5 * (edges[1] - edges[0])) if code else 0.0
    return math.copysign(middle, code)


@dataclass(frozen=True)
class Spread:
    """One figure over many runs. ``missing`` runs have no such figure (NaN); all else is about the ``count`` others.

    Without any of those, mean, sd, min, max and quantiles are NaN.
    """

    count: int = 0
    missing: int = 0
    m2: float = 0.0
    _mean: float = 0.0
    _min: float = 0.0
    _max: float = 0.0
    buckets: Mapping[int, int] = field(default_factory=dict)

    @classmethod
    def of(cls, values: NDArray[np.float64]) -> Spread:
        """Return the spread of these values, taken in their order."""
        column = np.ascontiguousarray(values, dtype=np.float64)
        c = ffi.new("hil_spread_t *")
        lib.hil_spread_add(c, ffi.from_buffer("double[]", column), column.itemsize, len(column))
        codes, counts = np.unique(bucket_codes(column[np.isfinite(column)]), return_counts=True)
        return cls._from_c(c, dict(zip(codes.tolist(), counts.tolist(), strict=True)))

    def merge(self, later: Spread) -> Spread:
        """Return the spread of these values and then those of ``later``."""
        c, other = self._to_c(), later._to_c()
        lib.hil_spread_merge(c, other)
        buckets = dict(self.buckets)
        for code, count in later.buckets.items():
            buckets[code] = buckets.get(code, 0) + count
        return self._from_c(c, buckets)

    @property
    def mean(self) -> float:
        """The mean."""
        return self._mean if self.count else math.nan

    @property
    def sd(self) -> float:
        """The standard deviation of the sample; 0 for a single value."""
        if self.count < 2:
            return 0.0 if self.count else math.nan
        return math.sqrt(self.m2 / (self.count - 1))

    @property
    def min(self) -> float:
        """The smallest value."""
        return self._min if self.count else math.nan

    @property
    def max(self) -> float:
        """The largest value."""
        return self._max if self.count else math.nan

    def quantile(self, q: float) -> float:
        """Return the value of rank floor(q (count - 1)), the smallest being number 0, to RELATIVE_ERROR; ends exactly.

        Raises ValueError unless 0 <= q <= 1.
        """
        if not 0.0 <= q <= 1.0:
            raise ValueError(f"q is {q}; must be 0 to 1")
        if not self.count:
            return math.nan
        rank = math.floor(q * (self.count - 1))
        if rank in (0, self.count - 1):
            return self._min if rank == 0 else self._max
        codes, below = self._ranks
        value = bucket_value(int(codes[np.searchsorted(below, rank, side="right")]))
        return min(max(value, self._min), self._max)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; ``from_dict`` gives back the same bits."""
        numbers = {"count": self.count, "missing": self.missing, "mean": self._mean, "m2": self.m2}
        extremes = {"min": self._min, "max": self._max}
        return {**numbers, **extremes, "buckets": [[code, n] for code, n in sorted(self.buckets.items())]}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Spread:
        """Return the spread that ``to_dict`` was asked of."""
        m2, mean, low, high = (float(data[name]) for name in ("m2", "mean", "min", "max"))
        buckets = {int(code): int(n) for code, n in data["buckets"]}
        return cls(int(data["count"]), int(data["missing"]), m2, mean, low, high, buckets)

    @cached_property
    def _ranks(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Buckets in order, and how many values lie in each and those before it."""
        codes = np.array(sorted(self.buckets), dtype=np.int64)
        return codes, np.cumsum([self.buckets[code] for code in codes.tolist()])

    @classmethod
    def _from_c(cls, c: Any, buckets: Mapping[int, int]) -> Spread:
        return cls(int(c.count), int(c.missing), c.m2, c.mean, c.min, c.max, buckets)

    def _to_c(self) -> Any:
        numbers = (self.count, self.missing, self._mean, self.m2, self._min, self._max)
        return ffi.new("hil_spread_t *", dict(zip(_SPREAD, numbers, strict=True)))


@dataclass(frozen=True)
class Statistics:
    """All figures over many runs: ``spreads`` by a figure's name.

    ``statuses`` says how many runs came out how, by the names of batch.STATUSES; ``faults`` in how many runs which
    fault bit was seen.
    """

    runs: int = 0
    ticks: int = 0
    statuses: Mapping[str, int] = field(default_factory=dict)
    faults: Mapping[int, int] = field(default_factory=dict)
    spreads: Mapping[str, Spread] = field(default_factory=dict)

    def __getitem__(self, figure: str) -> Spread:
        return self.spreads[figure]

    def mean(self, figure: str) -> float:
        """Return a figure's mean."""
        return self.spreads[figure].mean

    def sd(self, figure: str) -> float:
        """Return a figure's standard deviation of the sample."""
        return self.spreads[figure].sd

    def quantile(self, figure: str, q: float) -> float:
        """Return a figure's quantile, 0 <= q <= 1."""
        return self.spreads[figure].quantile(q)

    def merge(self, later: Statistics) -> Statistics:
        """Return the statistics of these runs and then those of ``later``; merge batches in their order."""
        if not self.runs or not later.runs:
            return self if self.runs else later
        return Statistics(
            self.runs + later.runs,
            self.ticks + later.ticks,
            _sum(self.statuses, later.statuses),
            _sum(self.faults, later.faults),
            {name: spread.merge(later.spreads[name]) for name, spread in self.spreads.items()},
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; ``from_dict`` gives back the same bits."""
        return {
            "runs": self.runs,
            "ticks": self.ticks,
            "statuses": dict(self.statuses),
            "faults": [[bit, n] for bit, n in sorted(self.faults.items())],
            "figures": {name: spread.to_dict() for name, spread in self.spreads.items()},
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Statistics:
        """Return the statistics that ``to_dict`` was asked of."""
        return cls(
            int(data["runs"]),
            int(data["ticks"]),
            {str(name): int(n) for name, n in data["statuses"].items()},
            {int(bit): int(n) for bit, n in data["faults"]},
            {name: Spread.from_dict(entry) for name, entry in data["figures"].items()},
        )


def merged(parts: Iterable[Statistics]) -> Statistics:
    """Return the statistics of all parts, in their order."""
    whole = Statistics()
    for part in parts:
        whole = whole.merge(part)
    return whole


def _sum(one: Mapping[Any, int], other: Mapping[Any, int]) -> dict[Any, int]:
    return {key: one.get(key, 0) + other.get(key, 0) for key in {**one, **other}}
