# SPDX-License-Identifier: MIT
"""Column mappings: a TOML file that says which column of a CSV log is what, in which unit and with which sign.

::

    [log]                       name, delimiter = ",", period_s,
                                header = ["time", ...]                    (only for files without a header line)
    [log.time]                  column, unit = "s" | "ms" | "us"
    [bag]                       wheels, truth = "", clock = "header" | "received": topics of a ROS bag, in place of
                                [log.time]; wheels.columns are names of joints         (only for ROS bags)
    [wheels]                    columns, quantity = "speed" | "increment" | "counts",
                                unit = "rad/s" | "rpm" | "counts" | "turns" | "rad" | "deg", sign = [1, 1, 1],
                                scale = [1.0, 1.0, 1.0], counts_per_revolution,
                                sample_s, noise_rad_s                     (optional)
    [duty]                      columns, full_scale, sign                     (optional)
    [heading]                   column, unit = "rad" | "deg", sign            (optional)
    [spikes]                    window_s, threshold, max_rad_s                (optional)
    [truth]                     time, x, y, theta = "", unit = "m" | "mm", time_unit, theta_unit,
                                in_log = false: true where these columns are in the log itself     (optional)
    [truth]                     format = "motive", body = "", up = "y" | "z": OptiTrack Motive's CSV export (optional)
"""

from __future__ import annotations

import math
from collections.abc import Collection
from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omni_schema.toml_file import read_toml
from omniwheel.errors import LogError
from omniwheel.logs.motive import UP_AXES, MotiveOptions
from omniwheel.logs.rosbag import CLOCKS, HEADER, BagTopics

MAPPING_HINT = "docs/guides/logs.md shows a column mapping"
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180.0}
LENGTH_UNITS = {"m": 1.0, "mm": 1e-3}
SPEED_UNITS = {"rad/s": 1.0, "rpm": 2.0 * math.pi / 60.0}
PER_TURN = {"turns": 1.0, "rad": 2.0 * math.pi, "deg": 360.0}
"""A revolution of the wheel in units of an angle."""
COUNTS = "counts"
"""Unit of an angle: counts_per_revolution of them are a revolution."""
QUANTITIES = ("speed", "increment", "counts")


SAMPLE_THRESHOLD = 4.0
"""Robust standard deviations beyond which a count is a spike by default, where counts do not add up (``sample_s``)."""


@dataclass(frozen=True)
class Spikes:
    """Hampel filter: half window [s], threshold in robust standard deviations; and the fastest wheel [rad/s].

    Counts that add up to an angle are kept by default (threshold infinite). A late or uneven row puts into one count
    what it takes from the next, so a dropped one is lost to the pose for good.
    """

    window_s: float = 0.25
    threshold: float = math.inf
    max_rad_s: float = math.inf


@dataclass(frozen=True)
class TruthColumns:
    """Columns of a truth file and what one unit of each is in s, m and rad; no ``theta`` column if it is "".

    ``in_log``: the log itself has these columns, and its clock is theirs.
    """

    time: str
    x: str
    y: str
    theta: str
    time_unit: float
    unit: float
    theta_unit: float
    in_log: bool = False


@dataclass(frozen=True)
class Mapping:
    """One robot's log format; ``source`` is the file, units are factors to SI, signs are +1 or -1.

    ``sample_s`` [s]: a count is the difference of the angle over this time before its row; 0: since the row before.
    ``noise_rad_s``: standard deviation of a wheel's speed from one count, white; 0: not known.
    ``wheel_scale``: factors on the wheels' columns, all above 0, as for a gear.
    ``header``: names of the columns of a log without a header line; empty where it has one.
    ``bag``: topics of a ROS bag, where ``wheels`` are joints. ``motive``: options for a truth that Motive exported.
    """

    source: str
    name: str
    delimiter: str
    header: tuple[str, ...]
    period_s: float
    time: str
    time_unit: float
    wheels: tuple[str, ...]
    quantity: str
    wheel_unit: float
    wheel_sign: tuple[int, ...]
    wheel_scale: tuple[float, ...]
    counts_per_revolution: int
    sample_s: float
    noise_rad_s: float
    duty: tuple[str, ...]
    duty_full_scale: float
    duty_sign: tuple[int, ...]
    heading: str
    heading_unit: float
    heading_sign: int
    spikes: Spikes
    truth: TruthColumns | None
    motive: MotiveOptions
    bag: BagTopics | None


class _Section:
    """Takes keys out of a table; errors name file and key."""

    def __init__(self, source: str, name: str, table: object) -> None:
        if not isinstance(table, dict):
            raise LogError(f"{source}: [{name}] is missing", hint=MAPPING_HINT)
        self.source, self.name, self.left = source, name, dict(table)

    def error(self, key: str, problem: str) -> LogError:
        return LogError(f"{self.source}: {self.name}.{key} {problem}", hint=MAPPING_HINT)

    def take(self, key: str, default: Any = None) -> Any:
        if key not in self.left and default is None:
            raise self.error(key, "is missing")
        return self.left.pop(key, default)

    def text(self, key: str, default: str | None = None) -> str:
        value = self.take(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"is {value!r}; must be a string")
        return value

    def sign(self, key: str, default: str) -> str:
        value = self.text(key, default)
        if len(value) != 1 or value in '\r\n"':
            raise self.error(key, f"is {value!r}; must be one character, as , ; or a tabulator")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        if default is not None and key not in self.left:
            return default
        value = self.take(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
            raise self.error(key, f"is {value!r}; must be a finite number above 0")
        return float(value)

    def whole(self, key: str) -> int:
        value = self.number(key)
        if round(value) < 1:
            raise self.error(key, f"is {value!r}; must be a whole number above 0")
        return round(value)

    def unit(self, key: str, units: AnyMapping[str, float], default: str | None = None) -> float:
        value = self.text(key, default)
        if value not in units:
            raise self.error(key, f"is {value!r}; must be one of {', '.join(units)}")
        return units[value]

    def columns(self, key: str) -> tuple[str, ...]:
        value = self.take(key)
        texts = isinstance(value, list) and all(isinstance(item, str) for item in value)
        if not texts or len(value) not in (3, 4) or len(set(value)) != len(value):
            raise self.error(key, f"is {value!r}; must be 3 or 4 different column names, one per wheel")
        return tuple(value)

    def header(self, key: str) -> tuple[str, ...]:
        value = self.take(key, [])
        if not isinstance(value, list) or not all(isinstance(item, str) and item for item in value):
            raise self.error(key, f"is {value!r}; must be a list of column names")
        if len(set(value)) != len(value) or len(value) == 1:
            raise self.error(key, f"is {value!r}; must be two or more different names")
        return tuple(value)

    def flag(self, key: str) -> bool:
        value = self.take(key, False)
        if not isinstance(value, bool):
            raise self.error(key, f"is {value!r}; must be true or false")
        return value

    def signs(self, key: str, length: int) -> tuple[int, ...]:
        value = self.take(key, [1] * length)
        if not isinstance(value, list) or len(value) != length or any(item not in (-1, 1) for item in value):
            raise self.error(key, f"is {value!r}; must be {length} numbers, each 1 or -1")
        return tuple(int(item) for item in value)

    def scales(self, key: str, length: int) -> tuple[float, ...]:
        value = self.take(key, [1.0] * length)
        numbers = isinstance(value, list) and all(
            isinstance(v, (int, float)) and not isinstance(v, bool) for v in value
        )
        if not numbers or len(value) != length or not all(0.0 < item < math.inf for item in value):
            raise self.error(key, f"is {value!r}; must be {length} finite numbers above 0; sign is a key of its own")
        return tuple(float(item) for item in value)

    def choice(self, key: str, choices: Collection[str], default: str) -> str:
        value = self.text(key, default)
        if value not in choices:
            raise self.error(key, f"is {value!r}; must be one of {', '.join(choices)}")
        return value

    def done(self) -> None:
        if self.left:
            raise self.error(next(iter(self.left)), "is an unknown key")


def read_mapping(path: Path) -> Mapping:
    """Read and check a column mapping. Raises LogError, or SchemaError where the file is no TOML."""
    if not path.is_file():
        raise LogError(f"no column mapping {path}", hint="docs/guides/logs.md shows one")
    document = dict(read_toml(path))
    source = str(path)
    log = _Section(source, "log", document.pop("log", None))
    bag = _bag(source, document.pop("bag", None))
    if bag is not None and "time" in log.left:
        raise log.error("time", "must not be used with [bag]: bag.clock chooses the time")
    time = _Section(source, "log.time", {"column": ""} if bag is not None else log.take("time"))
    wheels = _Section(source, "wheels", document.pop("wheels", None))
    columns = wheels.columns("columns")
    quantity = wheels.text("quantity")
    if quantity not in QUANTITIES:
        raise wheels.error("quantity", f"is {quantity!r}; must be one of {', '.join(QUANTITIES)}")
    counts_per_revolution = wheels.whole("counts_per_revolution")
    per_angle = {COUNTS: 1.0} | {unit: counts_per_revolution / turn for unit, turn in PER_TURN.items()}
    wheel_unit = wheels.unit("unit", SPEED_UNITS if quantity == "speed" else per_angle)
    period_s = log.number("period_s")
    sample_s = _sample_s(wheels, quantity, period_s)
    duty, duty_full_scale, duty_sign = _duty(source, document.pop("duty", None), len(columns))
    heading, heading_unit, heading_sign = _heading(source, document.pop("heading", None))
    truth, motive = _truth(source, document.pop("truth", None))
    if bag is not None:
        _require_bag_keys(wheels, quantity, bool(duty or heading), truth)
    mapping = Mapping(
        source=source,
        name=log.text("name"),
        delimiter=log.sign("delimiter", ","),
        header=log.header("header"),
        period_s=period_s,
        time=time.text("column"),
        time_unit=time.unit("unit", TIME_UNITS, "s"),
        wheels=columns,
        quantity=quantity,
        wheel_unit=wheel_unit,
        wheel_sign=wheels.signs("sign", len(columns)),
        wheel_scale=wheels.scales("scale", len(columns)),
        counts_per_revolution=counts_per_revolution,
        sample_s=sample_s,
        noise_rad_s=wheels.number("noise_rad_s", 0.0),
        duty=duty,
        duty_full_scale=duty_full_scale,
        duty_sign=duty_sign,
        heading=heading,
        heading_unit=heading_unit,
        heading_sign=heading_sign,
        spikes=_spikes(source, document.pop("spikes", {}), sample_s),
        truth=truth,
        motive=motive,
        bag=bag,
    )
    for section in (log, time, wheels):
        section.done()
    if document:
        raise LogError(f"{source}: [{next(iter(document))}] is an unknown key", hint=MAPPING_HINT)
    return mapping


def _sample_s(wheels: _Section, quantity: str, period_s: float) -> float:
    """Time over which a count was taken [s]; 0 where counts add up."""
    sample_s = wheels.number("sample_s", 0.0)
    if sample_s > 0.0 and quantity == "counts":
        raise wheels.error("sample_s", "must not be used: a running count adds up whatever lies between its rows")
    if sample_s > period_s:
        raise wheels.error("sample_s", f"is {sample_s:g} s, longer than log.period_s, {period_s:g} s")
    return sample_s


def _duty(source: str, table: object, wheels: int) -> tuple[tuple[str, ...], float, tuple[int, ...]]:
    if table is None:
        return (), 1.0, (1,) * wheels
    section = _Section(source, "duty", table)
    columns = section.columns("columns")
    if len(columns) != wheels:
        raise section.error("columns", f"has {len(columns)} names beside {wheels} wheels")
    found = columns, section.number("full_scale", 1.0), section.signs("sign", wheels)
    section.done()
    return found


def _heading(source: str, table: object) -> tuple[str, float, int]:
    if table is None:
        return "", 1.0, 1
    section = _Section(source, "heading", table)
    sign = section.take("sign", 1)
    if sign not in (-1, 1):
        raise section.error("sign", f"is {sign!r}; must be 1 or -1")
    found = section.text("column"), section.unit("unit", ANGLE_UNITS, "rad"), int(sign)
    section.done()
    return found


def _spikes(source: str, table: object, sample_s: float) -> Spikes:
    section = _Section(source, "spikes", table)
    usual = Spikes(threshold=SAMPLE_THRESHOLD) if sample_s > 0.0 else Spikes()
    found = Spikes(
        window_s=section.number("window_s", usual.window_s),
        threshold=section.number("threshold", usual.threshold),
        max_rad_s=section.number("max_rad_s", usual.max_rad_s),
    )
    section.done()
    return found


def _bag(source: str, table: object) -> BagTopics | None:
    if table is None:
        return None
    section = _Section(source, "bag", table)
    found = BagTopics(section.text("wheels"), section.text("truth", ""), section.choice("clock", CLOCKS, HEADER))
    section.done()
    return found


def _require_bag_keys(wheels: _Section, quantity: str, has_other_columns: bool, truth: TruthColumns | None) -> None:
    """Raise LogError for keys that name columns, which a ROS bag does not have."""
    if quantity == "increment":
        raise wheels.error("quantity", "is increment; joint states have positions (counts) or velocities (speed)")
    if has_other_columns:
        raise wheels.error("columns", "are joints of a ROS bag: [duty] and [heading] must not be used with [bag]")
    if truth is not None and truth.in_log:
        raise wheels.error("columns", "are joints of a ROS bag: name the topic of the truth in bag.truth")


def _truth(source: str, table: object) -> tuple[TruthColumns | None, MotiveOptions]:
    if table is None:
        return None, MotiveOptions()
    section = _Section(source, "truth", table)
    if section.choice("format", ("columns", "motive"), "columns") == "motive":
        motive = MotiveOptions(section.text("body", ""), section.choice("up", UP_AXES, "y"))
        section.done()
        return None, motive
    found = TruthColumns(
        time=section.text("time"),
        x=section.text("x"),
        y=section.text("y"),
        theta=section.text("theta", ""),
        time_unit=section.unit("time_unit", TIME_UNITS, "s"),
        unit=section.unit("unit", LENGTH_UNITS, "m"),
        theta_unit=section.unit("theta_unit", ANGLE_UNITS, "rad"),
        in_log=section.flag("in_log"),
    )
    section.done()
    return found, MotiveOptions()
