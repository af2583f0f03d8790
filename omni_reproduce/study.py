# SPDX-License-Identifier: MIT
"""Runs experiments one after another and keeps what each left: rows, pictures, time, or why it failed."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

from omni_reproduce.experiment import Context, Result, Row
from omni_reproduce.registry import Experiment
from omniwheel.errors import OmniError


@dataclass(frozen=True)
class Outcome:
    """An experiment that was run; ``error`` says in one line why it could not be, ``hint`` what to do about it."""

    experiment: Experiment
    result: Result
    seconds: float
    error: str = ""
    hint: str = ""


Progress = Callable[[int, float], None]
"""Told the number of the experiment that runs, from 0, and the share of it that is done."""


def run_all(experiments: Sequence[Experiment], context: Context, progress: Progress) -> list[Outcome]:
    """Run the experiments in their order. What one of them refuses does not stop the others."""
    outcomes = []
    for number, experiment in enumerate(experiments):
        own = replace(context, progress=partial(progress, number))
        outcomes.append(_run(experiment, own))
        progress(number, 1.0)
    return outcomes


def _run(experiment: Experiment, context: Context) -> Outcome:
    start = time.perf_counter()
    try:
        result, error, hint = experiment.run(context), "", ""
    except OmniError as refused:
        result, error, hint = Result(()), str(refused), refused.hint
    except ModuleNotFoundError as missing:
        result = Result(())
        error = f"the Python package {missing.name} is not installed"
        hint = "pip install 'omniwheel[study]', or in a clone: make setup"
    return Outcome(experiment, result, time.perf_counter() - start, error, hint)


def row_dict(row: Row) -> dict[str, Any]:
    """Return a row as plain data for JSON."""
    return asdict(row)
