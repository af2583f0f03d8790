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
    """An experiment: its name, what the report calls its results, and the module whose ``run`` makes them.

    ``about`` says in a sentence what is compared. ``headline`` is a regular expression: the rows of the summary are
    those whose "setting|quantity" it finds. ``logs``: it reads measured logs from a folder.
    """

    name: str
    title: str
    module: str
    targets: tuple[str, ...] = ()
    about: str = ""
    headline: str = ""
    logs: bool = False

    def run(self, context: Context) -> Result:
        """Run it. The module is loaded only now, because some need the ``study`` extra."""
        run: Callable[[Context], Result] = import_module(f"omni_reproduce.{self.module}").run
        return run(context)


EXPERIMENTS: tuple[Experiment, ...] = (
    Experiment(
        "models",
        "The report's models of the robot, side by side",
        "models",
        about="All plants get the same random voltages from rest; distances are from the plant `full`.",
        headline="distance from full",
    ),
    Experiment(
        "direct_torque",
        "Direct torque control, figures 5 to 8",
        "direct_torque",
        ("fig5", "fig6", "fig7", "fig8"),
        about="The report's gains beside ours at 50 Hz: time to reach random points, and a rose on floors "
        "of less and less friction.",
        headline=r"^points.*\|settled to 2 %, mean|^rose.*: (ours|report's gains)\|position RMSE",
    ),
    Experiment(
        "table1",
        "Table 1: stabilisation by P, PD and PID",
        "table1",
        about="60 starts per controller, 1 to 3 m from the target, with and without compensation of the "
        "motors' deadband.",
        headline="final position error",
    ),
    Experiment(
        "table2",
        "Table 2 and figure 10: integral sliding mode on kinematics",
        "table2",
        ("fig10",),
        about="A rose of 8 petals at 50 Hz with slip of ±0.1 m/s per wheel.",
        headline="^(as published|corrected law).*RMSE",
    ),
    Experiment(
        "table3",
        "Table 3 and figure 11: integral sliding mode over motor loops",
        "table3",
        ("fig11",),
        about="A rose of 4 petals, faster than 12 V allow, and the same path slowed down.",
        headline="^(as published|ours, same path, position|ours, path slowed).*RMSE",
    ),
    Experiment(
        "table7",
        "Tables 5 and 7, figures 13 to 16: the filters",
        "table7",
        ("table5", "fig13", "fig14", "fig15", "fig16"),
        about="Runs of 600 s. *As the report's code had it* repeats the published set-up, in which a "
        "filter's estimate drives the truth; *honest B* does not.",
        headline=r"^(as the report's code had it|honest B)\|x RMSE",
    ),
    Experiment(
        "consistency",
        "Whether the pose filter knows how good it is",
        "consistency",
        about="Normalised innovation squared (NIS) and normalised estimation error squared (NEES) of 1000 "
        "runs; both are 3 for a consistent filter.",
        headline=r"^(honest B|as the report's code had it)[^|]*\|(mean NIS|NEES)",
    ),
    Experiment(
        "limits",
        "The best that a causal filter could do",
        "limits",
        about="The robot's pose error on real wheels beside the Bayesian Cramér-Rao bound of an estimate "
        "from the same sensors.",
        headline=r"real wheels\|position, robot",
    ),
    Experiment(
        "table9",
        "Tables 8 and 9: model identification",
        "identification",
        ("table8",),
        about="Table 9 computed from the published Table 8 through equations (84) to (88).",
        headline="^Table 8",
    ),
    Experiment(
        "real_logs",
        "Logs of a real robot",
        "real_logs",
        about="Dead reckoning of logs with motion-capture truth; settings are identified on the other runs only.",
        headline="median of the runs|^identified on all",
        logs=True,
    ),
    Experiment(
        "optiodom",
        "Geometry from poses of two real robots",
        "geometry_logs",
        about="Dead reckoning of runs that had no part in the fit. *Published* is in-sample: of the runs fitted to.",
        headline=r"\|largest position error",
        logs=True,
    ),
    Experiment(
        "real_worlds",
        "Both worlds beside the real logs",
        "real_worlds",
        about="*Published* are the figures of the logs, *ours* those of a world that got the logs' duties open loop.",
        headline=r"\|accelerometer, (ripple|at order 18)|\|dead reckoning",
        logs=True,
    ),
    Experiment(
        "diagrams",
        "Figures 9 and 12: block diagrams",
        "diagrams",
        ("fig9", "fig12"),
        about="The modules that do what the report's block diagrams show.",
    ),
    Experiment(
        "controllers",
        "Every controller on every path",
        "controllers",
        about="Means over the paths, default gains, unmeasured slip of up to 5 %, pose fixes at 50 Hz with "
        "2 mm and 2 mrad of noise.",
        headline=r", three_wheel\|position RMSE",
    ),
    Experiment(
        "original_law",
        "The original law of the three-wheel robot",
        "original_law",
        about="The original firmware's control law, with and without its errors.",
        headline="truth",
    ),
    Experiment(
        "physics",
        "Two physics engines on one robot file",
        "physics",
        about="60 cases per robot in our world and in MuJoCo: how often both agree.",
        headline="(fixes|the end|in the air): cases within|in the air, MuJoCo",
    ),
    Experiment(
        "odometry",
        "Benchmarks of dead reckoning",
        "odometry",
        about="UMBmark squares (Borenstein and Feng, 1996) with a right and a wrong robot file, with and "
        "without a gyro, and those of real robots. E_max,syst is the larger distance of the centres "
        "of gravity from the start.",
        headline=r", turning.*E_max,syst|^real",
    ),
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
