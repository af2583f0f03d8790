# SPDX-License-Identifier: MIT
"""OpenCV (the extra ``vision``), loaded when something needs it."""

from __future__ import annotations

import importlib
from typing import Any

import numpy.typing as npt

from omniwheel.errors import MocapLibraryError

Array = npt.NDArray[Any]
_HINT = "pip install 'omniwheel[vision]'"


def load_cv2() -> Any:
    """Return OpenCV; MocapLibraryError if it is missing, does not load, or is older than its tag detector."""
    try:
        cv2 = importlib.import_module("cv2")
    except ImportError as error:
        raise MocapLibraryError(f"OpenCV is not usable here: {error}", hint=_HINT) from error
    if not hasattr(getattr(cv2, "aruco", None), "CharucoDetector"):
        version = getattr(cv2, "__version__", "unknown")
        raise MocapLibraryError(f"OpenCV {version} has no tag detector; 4.8 or newer is needed", hint=_HINT)
    return cv2
