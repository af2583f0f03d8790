# SPDX-License-Identifier: MIT
"""Presets: named sets of gains that come with the package, the report's next to ours."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from omni_schema import ParameterTable, SchemaError
from omni_schema.errors import did_you_mean
from omni_schema.toml_file import read_toml, refuse_unknown_keys, take_table, take_text
from omniwheel import parameter_file
from omniwheel.errors import ParameterFileError
from omniwheel.paths import presets_dir

_KEYS = ("name", "description", "source")


@dataclass(frozen=True)
class Preset:
    """A preset: its parameters by name, and where they come from (``source``: equations and tables of the report)."""

    file: Path
    name: str
    description: str
    source: str
    parameters: dict[str, float]


def preset_names() -> list[str]:
    """Return the names of the presets that come with the package."""
    return sorted(path.stem for path in presets_dir().glob("*.toml"))


def find_parameter_file(name_or_path: str | Path) -> Path:
    """Return the parameter file of that path, or of the preset of that name. Raises ParameterFileError."""
    path = Path(name_or_path)
    if path.is_file():
        return path
    names = preset_names()
    text = str(name_or_path)
    if text in names:
        return presets_dir() / f"{text}.toml"
    hint = f"the presets are {', '.join(names)}; `omni params save FILE` writes a file"
    raise ParameterFileError(f"unknown file or preset {text}{did_you_mean(text, names)}", hint=hint)


def read_preset(name_or_path: str | Path, table: ParameterTable) -> Preset:
    """Read and check a preset, or any parameter file (it then describes itself by its path)."""
    path = find_parameter_file(name_or_path)
    parameters = parameter_file.read(path, table)
    try:
        head = take_table(str(path), "preset", read_toml(path).get("preset", {}))
        refuse_unknown_keys(str(path), "preset.", head, _KEYS)
        texts = {key: take_text(str(path), f"preset.{key}", head.get(key, "")) for key in _KEYS}
    except SchemaError as error:
        raise ParameterFileError(str(error), hint="correct the table [preset] of the file") from error
    return Preset(path, texts["name"] or path.stem, texts["description"], texts["source"], parameters)
