# SPDX-License-Identifier: MIT
"""The camera file: which camera it is, where tags lie on the floor, and where they are on the robot.

A person writes it; ``omni mocap markers`` makes the first one. Lens and place are files of their own beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omni_schema import SchemaError
from omni_schema.toml_file import number_within, read_toml, refuse_unknown_keys, take_table, take_text
from omniwheel.errors import MocapSourceError
from omniwheel.limits import TAG_FAMILIES

_HINT = "omni mocap markers writes a template"
_CAMERA = ("device", "width", "height", "rate_Hz", "latency_s", "exposure", "lens", "place")
_FLOOR = ("id", "size_m", "x_m", "y_m", "heading_deg")
_ROBOT = (*_FLOOR, "height_m")


@dataclass(frozen=True)
class PlacedTag:
    """A tag that lies flat: its centre (x, y) at ``height_m``, the bearing of its right-hand side, its black side.

    On the floor these are in the world, on the robot they are in the body frame.
    """

    id: int
    size_m: float
    x_m: float
    y_m: float
    heading_rad: float
    height_m: float = 0.0


@dataclass(frozen=True)
class CameraSetup:
    """What a camera file says. ``device`` is a camera's number, or a path: a device, a video, a folder of pictures.

    ``latency_s`` is how old a picture is already when its time is taken. ``exposure`` is what the camera's driver calls
    it; None leaves that to the camera.
    """

    path: Path
    device: int | str
    width: int
    height: int
    rate_Hz: float
    latency_s: float
    exposure: float | None
    lens_path: Path
    place_path: Path
    family: str
    floor: tuple[PlacedTag, ...]
    robot: tuple[PlacedTag, ...]


def load_setup(path: Path) -> CameraSetup:
    """Read and check a camera file. Raises MocapSourceError that names file, key and what is allowed."""
    try:
        return _checked(path, read_toml(path))
    except SchemaError as error:
        raise MocapSourceError(str(error), hint=_HINT) from error


def _checked(path: Path, document: dict[str, Any]) -> CameraSetup:
    source = str(path)
    refuse_unknown_keys(source, "", document, ("camera", "tags", "floor", "robot"))
    camera = take_table(source, "camera", document.get("camera"))
    refuse_unknown_keys(source, "camera.", camera, _CAMERA)
    family = _family(source, document)
    floor, robot = (_tags(source, document, name, family) for name in ("floor", "robot"))
    numbers = [tag.id for tag in (*floor, *robot)]
    twice = sorted({number for number in numbers if numbers.count(number) > 1})
    if twice:
        raise SchemaError(source, "id", f"{twice[0]} is used by two tags; each needs a unique number")

    def number(key: str, default: float | None, low: float, high: float) -> float:
        return number_within(source, f"camera.{key}", camera.get(key, default), low, high)

    return CameraSetup(
        path=path,
        device=_device(source, path, camera.get("device")),
        width=int(number("width", None, 16, 16384)),
        height=int(number("height", None, 16, 16384)),
        rate_Hz=number("rate_Hz", 30.0, 0.1, 1000.0),
        latency_s=number("latency_s", 0.0, 0.0, 1.0),
        exposure=number("exposure", None, -1e6, 1e6) if "exposure" in camera else None,
        lens_path=path.parent / take_text(source, "camera.lens", camera.get("lens", "lens.toml")),
        place_path=path.parent / take_text(source, "camera.place", camera.get("place", "place.toml")),
        family=family,
        floor=floor,
        robot=robot,
    )


def _device(source: str, path: Path, value: object) -> int | str:
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    if isinstance(value, str) and value:
        return value if "://" in value else str(path.parent / value)
    raise SchemaError(source, "camera.device", f"is {value!r}; must be a camera's number or a path")


def _family(source: str, document: dict[str, Any]) -> str:
    table = take_table(source, "tags", document.get("tags", {}))
    refuse_unknown_keys(source, "tags.", table, ("family",))
    family = take_text(source, "tags.family", table.get("family", next(iter(TAG_FAMILIES))))
    if family not in TAG_FAMILIES:
        raise SchemaError(source, "tags.family", f"is {family!r}; must be one of {', '.join(TAG_FAMILIES)}")
    return family


def _tags(source: str, document: dict[str, Any], name: str, family: str) -> tuple[PlacedTag, ...]:
    tables = document.get(name, [])
    if not isinstance(tables, list) or not tables:
        raise SchemaError(source, name, f"is missing; at least one table [[{name}]] is needed here")
    found = []
    for at, table in enumerate(tables):
        key = f"{name}[{at}]"
        table = take_table(source, key, table)
        refuse_unknown_keys(source, f"{key}.", table, _ROBOT if name == "robot" else _FLOOR)
        found.append(_tag(_numbers(source, key, table), robot=name == "robot", most_id=TAG_FAMILIES[family] - 1))
    return tuple(found)


def _numbers(source: str, key: str, table: dict[str, Any]) -> Callable[..., float]:
    def number(name: str, low: float, high: float, default: float | None = None) -> float:
        return number_within(source, f"{key}.{name}", table.get(name, default), low, high)

    return number


def _tag(number: Callable[..., float], *, robot: bool, most_id: int) -> PlacedTag:
    reach_m = 5.0 if robot else 1000.0
    return PlacedTag(
        id=int(number("id", 0, most_id)),
        size_m=number("size_m", 0.005, 5.0),
        x_m=number("x_m", -reach_m, reach_m, 0.0 if robot else None),
        y_m=number("y_m", -reach_m, reach_m, 0.0 if robot else None),
        heading_rad=math.radians(number("heading_deg", -360.0, 360.0, 0.0)),
        height_m=number("height_m", 0.0, 5.0) if robot else 0.0,
    )
