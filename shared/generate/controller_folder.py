# SPDX-License-Identifier: MIT
"""A position controller outside the source tree: a folder with ``NAME.c``, ``NAME.h`` and ``parameters.toml``.

It becomes one more row of ``CTL_MODE``, as if it stood in the tree: the number after the largest one, its parameters
after all others. So numbers and order of what the tree has stay the same. docs/how-to-add/controller.md describes it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omni_schema import ParameterTable, SchemaError, parse_parameters
from omni_schema.toml_file import read_toml

PARAMETERS = "parameters.toml"
MODE = "CTL_MODE"
SOURCE = "controller_gen.c"
"""The generated source that includes the controller's. Without a controller it has no code."""

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_NOT_IN_AN_INCLUDE = ('"', "\\", "\n")
_GENERATED_NAMES = ("count", "rows")
"""OMNI_CTL_MODE_COUNT and OMNI_CTL_MODE_ROWS are no controllers."""


@dataclass(frozen=True)
class ControllerFolder:
    """What the folder has. ``rows``: its parameters as ``parameters.toml`` has them."""

    name: str
    source: Path
    header: Path | None
    rows: Mapping[str, Any]

    @property
    def parameters_path(self) -> Path:
        """The file of its parameters, which may be missing."""
        return self.source.parent / PARAMETERS


def load_controller(folder: Path, core_headers: Path) -> ControllerFolder:
    """Read the folder. Raises SchemaError that says what is missing or wrong; ``core_headers``: include/omni."""
    if not folder.is_dir():
        raise SchemaError(str(folder), "", "no such folder; a controller is a folder with NAME.c and NAME.h")
    folder = folder.resolve()
    if any(character in str(folder) for character in _NOT_IN_AN_INCLUDE):
        raise SchemaError(str(folder), "", "a controller's path must not have quotes or backslashes; move the folder")
    sources = sorted(folder.glob("*.c"))
    if len(sources) != 1:
        found = ", ".join(path.name for path in sources) or "none"
        raise SchemaError(str(folder), "", f"exactly one .c file is needed, found: {found}")
    (source,) = sources
    name = source.stem
    if not _NAME.fullmatch(name) or name in _GENERATED_NAMES:
        raise SchemaError(
            str(source), "", "its name is the controller's: a-z 0-9 _, not count or rows; rename the file"
        )
    if (core_headers / f"{name}.h").exists() or name.endswith("_gen"):
        raise SchemaError(str(source), "", f"the core has omni/{name}.h already; rename the controller")
    header = folder / f"{name}.h"
    parameters = folder / PARAMETERS
    rows = read_toml(parameters) if parameters.exists() else {}
    controller = ControllerFolder(name, source, header if header.is_file() else None, rows)
    _require_row(controller)
    return controller


def _require_row(controller: ControllerFolder) -> None:
    """Refuse a source without what the table of controllers refers to: the linker's message would be a riddle."""
    text = controller.source.read_text(encoding="utf-8", errors="replace")
    for what in (f"omni_configure_{controller.name}", f"omni_controller_row_{controller.name}"):
        if not re.search(rf"\b{what}\b", text):
            raise SchemaError(str(controller.source), "", f"defines no {what}", hint="docs/how-to-add/controller.md")


def with_controller(document: Mapping[str, Any], tree: ParameterTable, controller: ControllerFolder) -> dict[str, Any]:
    """Return params.toml's document with one more row of ``CTL_MODE`` and the controller's parameters at its end.

    ``tree``: the table of ``document``. Raises SchemaError where a name is taken.
    """
    source, mode = str(controller.parameters_path), document[MODE]
    if controller.name in {*mode["values"], *mode["modules"]}:
        raise SchemaError(str(controller.source), "", f"a controller {controller.name} is in params.toml already")
    own = parse_parameters({"schema_version": tree.schema_version, **controller.rows}, source)
    for name in own:
        if name in tree:
            raise SchemaError(source, name, "is a parameter of params.toml already; choose another name")
    number = max(mode["values"].values()) + 1
    row = {
        **mode,
        "values": {**mode["values"], controller.name: number},
        "modules": {**mode["modules"], **({controller.name: controller.name} if controller.header else {})},
        "doc": f"{mode['doc']}, {controller.name}",
    }
    return {**document, MODE: row, **controller.rows}


def write_controller(controller: ControllerFolder | None, notice: str, out: Path) -> None:
    """Write what compiles the controller: its source and header are included from where they are."""
    (out / "src").mkdir(parents=True, exist_ok=True)
    include = f'#include "{controller.source}"\n' if controller else '#include "omni/types.h"\n'
    (out / "src" / SOURCE).write_text(f"{notice}{include}", encoding="utf-8")
    if controller and controller.header:
        header = out / "include" / "omni" / f"{controller.name}.h"
        header.parent.mkdir(parents=True, exist_ok=True)
        header.write_text(f'{notice}#include "{controller.header}"\n', encoding="utf-8")


def write_schema(params_path: Path, document: Mapping[str, Any] | None, out: Path) -> None:
    """Write the params.toml that the host reads; ``document``: with a controller, None: the tree's own."""
    out.mkdir(parents=True, exist_ok=True)
    if document is None:
        text = params_path.read_text(encoding="utf-8")
    else:
        import tomli_w  # only where the host's package is built, not in PlatformIO's Python

        text = tomli_w.dumps(document)
    (out / "params.toml").write_text(text, encoding="utf-8")
