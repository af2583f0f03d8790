# SPDX-License-Identifier: MIT
"""The experiments by name, and the report's tables and figures by the experiment that makes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module

from omni_reproduce.experiment import Context, Result
from omni_schema.errors import did_you_mean
from omniwheel.errors import OmniError

DIAGRAMS = {
    "fig1": "block diagram of the four-wheel robot: docs/report/host-control.md",
    "fig2": "photograph of the four-wheel robot",
    "fig3": "frames of the slip-space model: docs/concepts/derivations/slip_space.md",
    "fig4": "angles of a Swedish wheel: kinematics.h",
}
"""Figures of the report that show no data, and where this project has the same thing."""


class UnknownTargetError(OmniError):
    """Nothing of that name can be reproduced."""

    exit_code = 2


@dataclass(frozen=True)
class Experiment:
    """An experiment: its name, what the report calls its results, and the module whose ``run`` makes them."""

    name: str
    title: str
    module: str
    targets: tuple[str, ...] = ()

    def run(self, context: Context) -> Result:
        """Run it. The module is loaded only now, because some need the ``study`` extra."""
        run: Callable[[Context], Result] = import_module(f"omni_reproduce.{self.module}").run
        return run(context)


EXPERIMENTS: tuple[Experiment, ...] = (
    Experiment("models", "The report's models of the robot, side by side", "models"),
    Experiment(
        "direct_torque", "Direct torque control, figures 5 to 8", "direct_torque", ("fig5", "fig6", "fig7", "fig8")
    ),
    Experiment("table1", "Table 1: stabilisation by P, PD and PID", "table1"),
    Experiment("table2", "Table 2 and figure 10: integral sliding mode on kinematics", "table2", ("fig10",)),
    Experiment("table3", "Table 3 and figure 11: integral sliding mode over motor loops", "table3", ("fig11",)),
    Experiment(
        "table7",
        "Tables 5 and 7, figures 13 to 16: the filters",
        "table7",
        ("table5", "fig13", "fig14", "fig15", "fig16"),
    ),
    Experiment("consistency", "Whether the pose filter knows how good it is", "consistency"),
    Experiment("limits", "The best that a causal filter could do", "limits"),
    Experiment("table9", "Tables 8 and 9: model identification", "identification", ("table8",)),
    Experiment("real_logs", "Logs of a real robot", "real_logs"),
    Experiment("optiodom", "Geometry from poses of two real robots", "geometry_logs"),
    Experiment("real_worlds", "Both worlds beside the real logs", "real_worlds"),
    Experiment("diagrams", "Figures 9 and 12: block diagrams", "diagrams", ("fig9", "fig12")),
    Experiment("controllers", "Every controller on every path", "controllers"),
    Experiment("original_law", "The original law of the three-wheel robot", "original_law"),
    Experiment("physics", "Two physics engines on one robot file", "physics"),
    Experiment("odometry", "Benchmarks of dead reckoning", "odometry"),
)


def targets() -> list[str]:
    """Return every name that can be asked for."""
    return [name for experiment in EXPERIMENTS for name in (experiment.name, *experiment.targets)]


def select(names: Sequence[str]) -> list[Experiment]:
    """Return the experiments that make these tables and figures, each once, in the report's order; all without names.

    Raises UnknownTargetError for a name that nothing makes.
    """
    for name in names:
        if name in DIAGRAMS:
            raise UnknownTargetError(f"{name} shows no data: it is the {DIAGRAMS[name]}")
        if name not in targets():
            hint = f"one of: {', '.join(targets())}"
            raise UnknownTargetError(f"nothing is called {name!r}{did_you_mean(name, targets())}", hint=hint)
    return [entry for entry in EXPERIMENTS if not names or {entry.name, *entry.targets} & set(names)]
