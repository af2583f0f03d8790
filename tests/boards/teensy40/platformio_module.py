# SPDX-License-Identifier: MIT
"""Loads the modules beside PlatformIO's scripts, which are no package."""

from __future__ import annotations

import importlib.util
import sys
from types import ModuleType

from tests.native import ROOT

FOLDER = ROOT / "firmware" / "boards" / "teensy40" / "platformio"


def load(name: str) -> ModuleType:
    """Return the module of this name."""
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
