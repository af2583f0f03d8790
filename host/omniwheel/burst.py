# SPDX-License-Identifier: MIT
"""A burst: signals of the robot's control tick as it recorded them in its own memory, a thousand a second.

The file's bytes are described in docs/reference/burst.md. It says itself which signals it holds, and in which unit.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel import files
from omniwheel.errors import LogError
from omniwheel.npz_file import NotAnArchiveError, read_npz

Array = NDArray[np.float64]

SIGNALS = {
    "wheel_reference": 1,
    "wheel_speed": 2,
    "duty": 4,
    "voltage": 8,
    "wheel_angle": 16,
    "pose": 32,
    "pose_reference": 64,
    "supply": 128,
    "tick_time": 256,
}
"""What can be recorded, and its bit in MAV_CMD_OMNI_BURST. The time is always there."""
TICK_S = 1e-3
_MAGIC, _VERSION = b"OMNB", 1
_HEADER = struct.Struct("<4sHHQIHHHHHHBB6x")
_COLUMN = struct.Struct("<16s8sfBB2x")
_TYPES = {0: np.dtype("<f4"), 1: np.dtype("<i4"), 2: np.dtype("<u4")}
_CRC_BYTES = 4


@dataclass(frozen=True)
class Burst:
    """A recorded burst.

    ``time_s``: time of each sample from the first one. ``signals``: by name, shape (samples,) or (samples, entries);
    ``units`` by name, one per entry; ``wheels``: which wheels the entries of a wheel's signal are. ``start_s`` on the
    robot's clock. ``period_s`` from sample to sample. ``config_sequence``: number of the parameter set, at the first
    and at the last sample. ``complete``: it was not ended early.
    """

    time_s: Array
    signals: dict[str, Array]
    units: dict[str, tuple[str, ...]]
    wheels: tuple[int, ...]
    start_s: float
    period_s: float
    number: int
    config_sequence: tuple[int, int]
    complete: bool

    def __getitem__(self, name: str) -> Array:
        """Return a signal; LogError if it was not recorded."""
        if name not in self.signals:
            raise LogError(f"the burst has no signal {name}", hint=f"it has {', '.join(self.signals)}")
        return self.signals[name]

    def wheel(self, name: str, wheel: int) -> Array:
        """Return the samples of one wheel's signal."""
        if wheel not in self.wheels:
            raise LogError(f"the burst has no samples of wheel {wheel}")
        return np.asarray(self[name][:, self.wheels.index(wheel)], dtype=np.float64)

    def save(self, path: Path) -> None:
        """Write a NumPy archive: an array per signal, ``time_s``, and what else is known of it.

        Raises OutputFileError.
        """
        more: dict[str, Any] = {
            "wheels": np.array(self.wheels, dtype=np.int64),
            "start_s": np.array(self.start_s),
            "period_s": np.array(self.period_s),
            "number": np.array(self.number),
            "config_sequence": np.array(self.config_sequence),
            "complete": np.array(self.complete),
        }
        more |= {f"unit_{name}": np.array(words) for name, words in self.units.items()}
        with files.replaced(path) as file:
            np.savez_compressed(file, **{"time_s": self.time_s, **self.signals, **more})


def load_burst(path: Path) -> Burst:
    """Read what :meth:`Burst.save` wrote. Raises LogError."""
    try:
        stored = read_npz(path)
        names = [name.removeprefix("unit_") for name in stored if name.startswith("unit_")]
        first, last = (int(value) for value in stored["config_sequence"])
        return Burst(
            time_s=stored["time_s"],
            signals={name: stored[name] for name in names},
            units={name: tuple(str(word) for word in stored[f"unit_{name}"]) for name in names},
            wheels=tuple(int(wheel) for wheel in stored["wheels"]),
            start_s=float(stored["start_s"]),
            period_s=float(stored["period_s"]),
            number=int(stored["number"]),
            config_sequence=(first, last),
            complete=bool(stored["complete"]),
        )
    except (OSError, NotAnArchiveError, KeyError, ValueError, TypeError) as error:
        raise LogError(f"{path} is not a burst ({error})", hint="give a burst.npz of `omni experiment`") from error


@dataclass(frozen=True)
class _Column:
    name: str
    unit: str
    scale: float
    kind: int
    index: int


def parse_burst(data: bytes) -> Burst:
    """Read the bytes that the robot sends. Raises LogError for anything but a whole burst."""
    if len(data) < _HEADER.size + _CRC_BYTES or data[:4] != _MAGIC:
        raise LogError("the robot's data is not a burst", hint="check that its firmware has this version")
    if zlib.crc32(data[:-_CRC_BYTES]) != struct.unpack("<I", data[-_CRC_BYTES:])[0]:
        raise LogError("the burst is damaged: its CRC is wrong", hint="record it again")
    _, version, size, start_us, samples, width, every, tick_us, number, first, last, columns, end = _HEADER.unpack_from(
        data
    )
    known = version == _VERSION and size == _HEADER.size + columns * _COLUMN.size and width == 4 * columns
    if not known or len(data) != size + samples * width + _CRC_BYTES:
        raise LogError(
            f"the burst has format {version}, not {_VERSION}", hint="install omniwheel in the robot's version"
        )
    table = [_column(data, _HEADER.size + i * _COLUMN.size) for i in range(columns)]
    words = np.frombuffer(data, "<u4", samples * columns, size).reshape(samples, columns)
    signals, units, wheels = _signals(table, words)
    times = signals.pop("time")
    units.pop("time")
    ticks = np.cumsum(np.concatenate([[0.0], np.diff(times) % (2.0**32 * 1e-6)])) if samples else np.zeros(0)
    return Burst(
        time_s=np.round(ticks, 6),
        signals=signals,
        units=units,
        wheels=wheels,
        start_s=start_us * 1e-6,
        period_s=every * tick_us * 1e-6,
        number=number,
        config_sequence=(first, last),
        complete=end == 0,
    )


def _column(data: bytes, at: int) -> _Column:
    name, unit, scale, kind, index = _COLUMN.unpack_from(data, at)
    if kind not in _TYPES:
        raise LogError(
            f"the burst has numbers of an unknown type {kind}", hint="install omniwheel in the robot's version"
        )
    return _Column(_text(name), _text(unit), _decimal(scale), kind, index)


def _text(data: bytes) -> str:
    return data.partition(b"\0")[0].decode("ascii", "replace")


def _decimal(scale: float) -> float:
    """Return the scale as it was meant: a millionth as a float has an error of a part in ten million."""
    return float(f"{scale:.7g}")


def _signals(
    table: Sequence[_Column], words: NDArray[np.uint32]
) -> tuple[dict[str, Array], dict[str, tuple[str, ...]], tuple[int, ...]]:
    signals: dict[str, Array] = {}
    units: dict[str, tuple[str, ...]] = {}
    wheels: tuple[int, ...] = ()
    for name in dict.fromkeys(column.name for column in table):
        places = [i for i, column in enumerate(table) if column.name == name]
        values = [_values(table[i], words[:, i]) for i in places]
        units[name] = tuple(table[i].unit for i in places)
        per_wheel = name.startswith("wheel") or name in ("duty", "voltage")
        if per_wheel:
            wheels = tuple(table[i].index for i in places)
        signals[name] = np.column_stack(values) if per_wheel or len(places) > 1 else values[0]
    return signals, units, wheels


def _values(column: _Column, words: NDArray[np.uint32]) -> Array:
    values = words.astype("<u4").view(_TYPES[column.kind])
    if column.kind == 1:  # counters wrap
        values = np.concatenate([[0], np.cumsum(np.diff(values).astype(np.int64))]) if len(values) else values
    return np.asarray(values, dtype=np.float64) * column.scale
