# SPDX-License-Identifier: MIT
"""Datasets from telemetry: OMNI_SAMPLE, whose sums of counts and volt seconds miss nothing between two messages.

OMNI_WHEELS will not do. Its speeds come from a filter that believes the motor model to be identified. And a duty
sampled at 50 Hz of a loop at 1 kHz says little of the mean voltage.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omniwheel.dialect import Message
from omniwheel.errors import DatasetError
from omniwheel.frames import flip
from omniwheel.identification.dataset import Dataset
from omniwheel.telemetry import Sample, decode
from omniwheel.tlog_reader import NO_LOG_HINT, PartReader, TlogReader, iterate_messages, iterate_part, longest_part

Array = NDArray[np.float64]
WRAP = 2.0**32
VOLT_SECONDS_PER_UNIT = 1e-6
MIN_SAMPLES = 3


def read_dataset(path: Path, parameters: Mapping[str, float], part: int | None = None) -> Dataset:
    """Return the dataset of a telemetry log; ``parameters`` of the robot: wheels, encoder and directions.

    Of a log with a restart in it that of this ``part``, else of its longest part, as the dataset's name says. Raises
    DatasetError.
    """
    messages, note = read_part(path, part)
    return from_messages(messages, f"{path} ({note})" if note else str(path), parameters)


def read_messages(path: Path) -> list[Message]:
    """Return the messages of a telemetry log in their order. Raises DatasetError."""
    return list(iterate_messages(TlogReader(path)))


def read_part(path: Path, part: int | None = None) -> tuple[list[Message], str]:
    """Return the messages of a log's ``part`` (None: the longest one), and what was left out. Raises DatasetError."""
    reader = TlogReader(path)
    if part is None:
        messages, note = longest_part(iterate_messages(reader))
    else:
        parts = PartReader(iterate_messages(reader))
        messages = list(iterate_part(parts, path, part))
        note = parts.note(part)
    return messages, "; ".join(said for said in (note, reader.note()) if said)


def from_messages(messages: Iterable[Message], name: str, parameters: Mapping[str, float]) -> Dataset:
    """Make a dataset of OMNI_SAMPLE and of pose fixes that carry the robot's time. Raises DatasetError."""
    samples: list[Sample] = []
    fixes: list[tuple[float, ...]] = []
    for message in messages:
        sample = decode(Sample, message)
        if sample is not None and (not samples or sample.time_s > samples[-1].time_s):
            samples.append(sample)
        elif message.get_type() == "VICON_POSITION_ESTIMATE" and message.usec * 1e-6 > (fixes[-1][0] if fixes else 0.0):
            fixes.append((message.usec * 1e-6, *flip(message.x, message.y, message.yaw)))
    if len(samples) < MIN_SAMPLES:
        raise DatasetError(f"{name} has {len(samples)} OMNI_SAMPLE messages: too few", hint=NO_LOG_HINT)
    return _dataset(samples, np.array(fixes).reshape(-1, 4), name, parameters)


def _dataset(samples: Sequence[Sample], fixes: Array, name: str, parameters: Mapping[str, float]) -> Dataset:
    wheels = int(parameters["WHEELS"])
    time_s = np.array([sample.time_s for sample in samples])
    direction = [parameters[f"W{wheel + 1}_ENC_DIR"] for wheel in range(wheels)]
    counts = _unwrapped(np.array([sample.counts for sample in samples], dtype=np.float64)[:, :wheels])
    still = np.ptp(counts, axis=0) == 0.0
    if still.any() and not still.all():
        hint = "check the encoder, and that --robot is the robot that was driven"
        raise DatasetError(
            f"{name}: wheel {int(np.argmax(still)) + 1} of {wheels} never turns, but others do", hint=hint
        )
    volt_seconds = np.array([sample.volt_seconds for sample in samples])[:, :wheels]
    volt_seconds = VOLT_SECONDS_PER_UNIT * _unwrapped(volt_seconds / VOLT_SECONDS_PER_UNIT)
    angle = counts * direction * (2.0 * np.pi / parameters["ENC_CPR"])
    voltage = np.diff(volt_seconds, axis=0) / np.diff(time_s)[:, None]
    return Dataset(
        name,
        time_s,
        np.gradient(angle, time_s, axis=0),
        np.vstack((voltage, voltage[-1:])),
        fixes[:, 0],
        fixes[:, 1:],
        wheel_angle_rad=angle,
        supply_V=np.array([sample.supply_V for sample in samples]),
    )


def _unwrapped(values: Array) -> Array:
    """Undo the wrap of 32-bit counters along the first axis, starting at zero."""
    steps = np.diff(values, axis=0)
    steps -= WRAP * np.round(steps / WRAP)
    return np.vstack((np.zeros(values.shape[1]), np.cumsum(steps, axis=0)))
