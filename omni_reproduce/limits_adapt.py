# SPDX-License-Identifier: MIT
"""What noise levels that follow the innovations do to the estimate: python -m omni_reproduce.limits_adapt [SETTING]...

The columns are the preset ``fixed_noise`` and values of EKF_ADAPT, with the same seeds. A cell is the error of the
robot's estimate, position in mm / heading in mrad, and in brackets the same over the posterior bound. That is for ideal
wheels, also beside real ones. Settings are those of ``limits.toml``, and some without such a bound; all by default.
Seeds count from that of ``limits.toml``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hil_sim.faults import Fault
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.world import IDEAL_WHEELS
from omni_reproduce import limits
from omni_reproduce.experiment import read_spec
from omni_reproduce.limits_table import print_table
from omni_reproduce.posterior_bound import Array
from omniwheel.presets import read_preset
from omniwheel.robots import parameter_table

RATES = (0.0, 0.05, 0.2)
PRESET = "fixed_noise"
PATHS = 2
"""Along so many paths the bound is computed; it differs little between them."""
FAULTS = {
    "outliers": tuple(Fault("pose_jump", 6.0 + 1.5 * i, 6.05 + 1.5 * i, value=0.3) for i in range(16)),
    "late": (Fault("pose_delay", 6.0, value=0.06),),
}
"""Settings of the demo with faults. Outliers: two or three fixes in a row, every 1.5 s from 6 s on."""
UNBOUNDED = {"no_fixes": "no fixes", "outliers": "outliers of 0.3 m", "late": "fixes 60 ms late, unsaid"}
"""Settings that ``limits.toml`` does not have, and their titles."""


def columns() -> dict[str, Mapping[str, float]]:
    """Return the parameters of each column, by its heading."""
    preset = read_preset(PRESET, parameter_table()).parameters
    return {f"preset `{PRESET}`": preset, **{f"EKF_ADAPT = {rate:g}": {"EKF_ADAPT": rate} for rate in RATES}}


def scenario_of(key: str, wheels: str) -> Scenario:
    """Return the scenario of a setting on ideal or real wheels."""
    if key in FAULTS:
        return replace(limits.scenario_of(read_spec(limits.NAME), "demo", wheels), faults=FAULTS[key])
    if key in UNBOUNDED:
        return load_scenario(key).with_world(IDEAL_WHEELS if limits.WHEELS[wheels] else {})
    return limits.scenario_of(read_spec(limits.NAME), key, wheels)


def errors_of(key: str, parameters: Mapping[str, float], seeds: int, wheels: str = "ideal") -> Array:
    """Return the root mean squares over seeds, (position [mm], heading [mrad]), with these parameters."""
    scenario = scenario_of(key, wheels).with_parameters(parameters)
    errors = limits.reached_by_robot(scenario, read_spec(limits.NAME)["experiment"]["seed"], seeds, 1)
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0)))


def line(key: str, seeds: int, wheels: str) -> str:
    """Return a setting's row of the table."""
    spec = read_spec(limits.NAME)
    bound = None if key in UNBOUNDED else limits.bound_and_informed_filter(spec, key, PATHS)[0]
    cells = [UNBOUNDED.get(key) or spec["setting"][key]["title"]]
    for parameters in columns().values():
        error = errors_of(key, parameters, seeds, wheels)
        over = "" if bound is None else f" ({error[0] / bound[0]:.2f} / {error[1] / bound[1]:.2f})"
        cells.append(f"{error[0]:.2f} / {error[1]:.2f}{over}")
    return f"| {' | '.join(cells)} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    known = [*read_spec(limits.NAME)["setting"], *UNBOUNDED]
    print_table(
        ("python -m omni_reproduce.limits_adapt", __doc__),
        known,
        list(columns()),
        line,
        arguments,
        list(limits.WHEELS),
    )


if __name__ == "__main__":
    main()
