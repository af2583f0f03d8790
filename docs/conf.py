# SPDX-License-Identifier: MIT
"""How Sphinx builds the documentation: ``make docs``."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent / "_ext"))

from omniwheel import __version__

project = "Omniwheel"
author = "Omniwheel contributors"
copyright = "Omniwheel contributors, MIT licence"  # noqa: A001
release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "omni_docs"]
exclude_patterns = ["_ext"]
myst_enable_extensions = ["fieldlist"]
myst_heading_anchors = 4
myst_fence_as_directive = ["mermaid"]

# What is named must exist. Types of other packages have no pages here.
nitpicky = True
nitpick_ignore_regex = [
    ("c:identifier", r"(?!omni_).*"),
    ("py:.*", r"(?!omniwheel\.).*"),
    # Inner parts, and pymavlink's.
    ("py:.*", r"omniwheel\.(capability|dialect|connection|drawn_path|growing_file|link)\b.*"),
    ("py:.*", r"omniwheel\.(robot|simulation|sync|telemetry_record)\b.*"),
    ("py:class", r"omniwheel\.telemetry(_parts)?\.TelemetryT"),  # a type variable
]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True, "undoc-members": False}

html_theme = "furo"
html_title = "Omniwheel"
html_static_path = ["_static"]
html_css_files = ["omni.css"]
html_copy_source = False
html_show_sourcelink = False
