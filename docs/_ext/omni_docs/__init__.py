# SPDX-License-Identifier: MIT
"""Sphinx extension of this documentation: writes the generated reference pages before Sphinx reads the sources.

Each page comes from the one place that decides: the parameter table, the MAVLink definitions, the parsers of the
command line, the readers of robot files and scenarios, the headers of the control core.
"""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

from omni_docs import c_api, command_line, files, messages, parameters, state_diagram

ROOT = Path(__file__).resolve().parents[3]
FOLDER = Path("reference", "generated")


def write_pages(app: Sphinx) -> None:
    """Write every generated page that has changed, and remove those that nobody makes any more."""
    pages = {
        **parameters.pages(ROOT),
        **messages.pages(ROOT),
        **command_line.pages(),
        **files.pages(ROOT),
        **c_api.pages(ROOT),
    }
    folder = Path(app.srcdir) / FOLDER
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    for path in folder.rglob("*.md"):
        if path.relative_to(folder).as_posix() not in pages:
            path.unlink()


def setup(app: Sphinx) -> ExtensionMetadata:
    """Register with Sphinx."""
    app.connect("builder-inited", write_pages)
    app.add_directive("mermaid", state_diagram.StateDiagram)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
