# SPDX-License-Identifier: MIT
"""What differs from run to run in a scenario's world: its ``[dispersion]`` table.

::

    [dispersion]
    mass_kg = { uniform = [-0.1, 0.1], relative = true }  # 90 % to 110 % of what it would be
    wheel_radius_m = { normal = 0.002, relative = true }  # standard deviation, each wheel by itself
    start_x_m = { normal = 0.005 }                        # metres: the robot does not stand where it is told

Normal deviations stay within three standard deviations: those beyond are drawn again. Every quantity has a random
stream of its own, named after it. So the world of a run is a pure function of scenario and seed, and another entry
changes none of the others. The firmware knows nothing of all this: its parameters stay what they are.

Times that differ (fix_rate_Hz, fix_delay_s, slip_time_s) cost a batch two thirds of its speed. Its runs then no longer
do the same at the same time, which running eight of them at once lives on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hil_sim.schema import WORLD
from omni_schema import SchemaError
from omni_schema.errors import did_you_mean
from omni_schema.toml_file import refuse_unknown_keys, take_number, take_table
from omniwheel._core import ffi, lib

WIDEST = 3.0
"""Normal deviations end after so many standard deviations."""

_CONFIG = "hil_world_config_t"
_VARYING = tuple(quantity for quantity in WORLD.numbers.values() if quantity.varies)
PER_WHEEL = tuple(quantity.name for quantity in _VARYING if quantity.per_wheel)
"""Quantities of which each wheel has its own; each is drawn by itself."""

_PLACES: dict[str, tuple[str, int]] = {
    name: (quantity.field, number)
    for quantity in _VARYING
    for number, name in enumerate(quantity.elements or (quantity.name,))
}
QUANTITIES: tuple[str, ...] = tuple(sorted(_PLACES))
"""What can differ: numbers of ``[world]``, the wheels' geometry, and where the robot really stands at the start."""


@dataclass(frozen=True)
class Dispersion:
    """How one quantity deviates: evenly between ``low`` and ``high``, or normally with deviation ``sd`` (not 0 then).

    ``relative``: the deviation is a share of the value, otherwise it is in the quantity's unit.
    """

    quantity: str
    low: float = 0.0
    high: float = 0.0
    sd: float = 0.0
    relative: bool = False

    def extremes(self) -> tuple[float, float]:
        """Return the smallest and the largest deviation."""
        return (-WIDEST * self.sd, WIDEST * self.sd) if self.sd > 0.0 else (self.low, self.high)

    def document(self) -> dict[str, Any]:
        """Return the entry as a scenario file has it."""
        spread: dict[str, Any] = {"normal": self.sd} if self.sd > 0.0 else {"uniform": [self.low, self.high]}
        return {**spread, **({"relative": True} if self.relative else {})}


def parse_dispersion(source: str, document: object) -> tuple[Dispersion, ...]:
    """Read a ``[dispersion]`` table. Raises SchemaError that names key, value and what is allowed."""
    return tuple(_entry(source, name, entry) for name, entry in take_table(source, "dispersion", document).items())


def _entry(source: str, name: str, value: object) -> Dispersion:
    key = f"dispersion.{name}"
    if name not in _PLACES:
        raise SchemaError(source, key, f"cannot differ{did_you_mean(name, QUANTITIES)}; {', '.join(QUANTITIES)} can")
    if not isinstance(value, dict):
        problem = f"is {value!r}; write {{ uniform = [low, high] }} or {{ normal = deviation }}"
        raise SchemaError(source, key, problem)
    refuse_unknown_keys(source, f"{key}.", value, ("uniform", "normal", "relative"))
    relative = value.get("relative", False)
    if not isinstance(relative, bool):
        raise SchemaError(source, f"{key}.relative", f"is {relative!r}; must be true or false")
    if ("uniform" in value) == ("normal" in value):
        raise SchemaError(source, key, "needs exactly one of uniform and normal")
    if "normal" in value:
        return Dispersion(name, sd=_deviation(source, f"{key}.normal", value["normal"]), relative=relative)
    low, high = _interval(source, f"{key}.uniform", value["uniform"])
    return Dispersion(name, low=low, high=high, relative=relative)


def _deviation(source: str, key: str, value: object) -> float:
    number = take_number(source, key, value)
    if not 0.0 < number < 1e6:
        raise SchemaError(source, key, f"is {number:g}; must be a standard deviation above 0")
    return number


def _interval(source: str, key: str, value: object) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise SchemaError(source, key, f"is {value!r}; a list of two numbers is needed: [low, high]")
    low, high = (take_number(source, f"{key}[{i + 1}]", item) for i, item in enumerate(value))
    if not low < high:
        raise SchemaError(source, key, f"is [{low:g}, {high:g}]; the first must be below the second")
    return low, high


def dispersion_table(entries: tuple[Dispersion, ...], wheels: int) -> Any:
    """Return the entries as ``hil_dispersion_t[]``."""
    table = ffi.new("hil_dispersion_t[]", len(entries))
    for slot, entry in zip(table, entries, strict=True):
        field, element = _PLACES[entry.quantity]
        slot.offset = ffi.offsetof(_CONFIG, field) + element * ffi.sizeof("double")
        slot.count = wheels if entry.quantity in PER_WHEEL else 1
        slot.stream = lib.hil_dispersion_stream(entry.quantity.encode())
        slot.relative = entry.relative
        normal = entry.sd > 0.0
        slot.kind = lib.HIL_DISPERSION_NORMAL if normal else lib.HIL_DISPERSION_UNIFORM
        slot.a, slot.b = (0.0, entry.sd) if normal else (entry.low, entry.high)
    return table


def check_extremes(source: str, entries: tuple[Dispersion, ...], config: Any) -> None:
    """Refuse a quantity whose smallest or largest value makes no world: SchemaError. ``config`` is the middle."""
    for entry in entries:
        for deviation in entry.extremes():
            _check_one(source, entry, deviation, config)


def _check_one(source: str, entry: Dispersion, deviation: float, config: Any) -> None:
    extreme = ffi.new(f"{_CONFIG} *", config[0])
    table = dispersion_table((Dispersion(entry.quantity, deviation, deviation, 0.0, entry.relative),), config.wheels)
    lib.hil_apply_dispersion(extreme, table, 1, 0)
    why = ffi.new("char[]", 160)
    if lib.hil_world_init(ffi.new("hil_world_t *"), extreme, why, len(why)) != lib.HIL_OK:
        raise SchemaError(source, f"dispersion.{entry.quantity}", f"goes too far: {ffi.string(why).decode()}")


def drawn_values(entries: tuple[Dispersion, ...], config: Any) -> dict[str, float | list[float]]:
    """Return the quantities that differ as they are in this world, a list where each wheel has its own."""
    values: dict[str, float | list[float]] = {}
    for entry in entries:
        field, element = _PLACES[entry.quantity]
        value = getattr(config, field)
        if entry.quantity in PER_WHEEL:
            values[entry.quantity] = list(value)[: config.wheels]
        else:
            values[entry.quantity] = value[element] if isinstance(value, ffi.CData) else value
    return values
