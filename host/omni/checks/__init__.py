# SPDX-License-Identifier: MIT
"""``python -m omni.checks``: the commands that measure and check this project itself."""

from __future__ import annotations

import typer

from omni.cli.command_table import Entry, by_name
from omni.cli.group import OmniGroup

MEASURE, CHECK = "Measure", "Check"
TABLE = (
    Entry("image", CHECK, "Run a firmware image on an emulated Teensy", "image", "check_image", "omni.checks"),
    Entry("soak", CHECK, "Soak-test the firmware on an emulated Cortex-M7", "soak", "soak", "omni.checks"),
    Entry("autotune", CHECK, "Test omni autotune on many random robots", "autotune", "autotune", "omni.checks"),
    Entry("bench", MEASURE, "Benchmark the simulations on this computer", "bench", "bench", "omni.checks"),
)
"""In the order of the help page."""


class ChecksGroup(OmniGroup):
    """The commands of the table here."""

    entries = by_name(TABLE)


app = typer.Typer(
    name="python -m omni.checks",
    cls=ChecksGroup,
    help="Measure and check Omniwheel itself: for those who change it.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_show_locals=False,
    add_completion=False,
)


@app.callback()
def _options() -> None:
    """Measure and check Omniwheel itself: for those who change it."""
