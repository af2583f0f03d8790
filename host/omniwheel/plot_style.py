# SPDX-License-Identifier: MIT
"""How our pictures look: colours and Matplotlib's settings, for every package that draws.

It imports nothing, Matplotlib included, so that any module may use it.
"""

from __future__ import annotations

from typing import Any

# Okabe and Ito's colours: told apart with every kind of colour vision.
INK, GREY = "#222222", "#8a8a8a"
WHEEL_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7")
TRUTH, WANTED, HEADING, MARK = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SETS = (WANTED, TRUTH, HEADING, MARK, "#CC79A7")  # parameter sets that are compared; the present one first

STYLE: Any = {
    "font.size": 10.0,
    "axes.titlesize": 11.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.8,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
}
"""For ``matplotlib.rc_context``."""
