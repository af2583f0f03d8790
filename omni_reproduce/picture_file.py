# SPDX-License-Identifier: MIT
"""Figures that become files: what the pictures of an experiment have in common."""

from __future__ import annotations

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from omniwheel.files import save_picture

DPI = 120


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return a figure of this size in inches that lays itself out and needs no screen."""
    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: Path) -> Path:
    """Write it and return its path. Raises OutputFileError."""
    save_picture(figure, path)
    return path
