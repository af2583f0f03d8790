# SPDX-License-Identifier: MIT
"""Which noise parameters keep the pose filter from its bound: python -m omni_reproduce.limits_noise [SETTING]...

Each parameter is multiplied by each factor, one at a time, with the same seeds. A cell is the error over the posterior
bound of ideal wheels, position / heading, with the factor that has the least sum of both. Settings are those of
``limits.toml``; all by default. This tunes nothing: the best factor of one setting is worse in another.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omni_reproduce import limits
from omni_reproduce.experiment import read_spec
from omni_reproduce.limits_table import print_table
from omni_reproduce.posterior_bound import Array

PARAMETERS = ("EKF_Q_XY", "EKF_Q_TH", "EKF_Q_SLIP", "EKF_P_SLIP")
FACTORS = (0.25, 0.5, 2.0, 4.0)
PATHS = 2
"""Along so many paths the bound is computed; it differs little between them."""


def over_bound(key: str, changes: dict[str, float], bound: Array, seeds: int, wheels: str = "ideal") -> Array:
    """Return the robot's error over the bound, (position, heading), with parameters multiplied by ``changes``."""
    spec = read_spec(limits.NAME)
    scenario = limits.scenario_of(spec, key, wheels)
    values = scenario.parameter_values()
    changed = scenario.with_parameters({name: values[name] * factor for name, factor in changes.items()})
    errors = limits.reached_by_robot(changed, spec["experiment"]["seed"], seeds, 1)
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0)) / bound)


def best(
    key: str, parameter: str, bound: Array, seeds: int, as_shipped: Array, wheels: str = "ideal"
) -> tuple[float, Array]:
    """Return the factor of one parameter with the least sum of both errors over the bound, and these.

    Of equal ones it is 1, as shipped.
    """
    tried = {1.0: as_shipped}
    tried |= {factor: over_bound(key, {parameter: factor}, bound, seeds, wheels) for factor in FACTORS}
    factor = min(tried, key=lambda factor: float(tried[factor].sum()))
    return factor, tried[factor]


def line(key: str, seeds: int, wheels: str) -> str:
    """Return a setting's row of the table."""
    spec = read_spec(limits.NAME)
    bound, _ = limits.bound_and_informed_filter(spec, key, PATHS)
    as_shipped = over_bound(key, {}, bound, seeds, wheels)
    cells = [spec["setting"][key]["title"], f"{as_shipped[0]:.2f} / {as_shipped[1]:.2f}"]
    for parameter in PARAMETERS:
        factor, ratio = best(key, parameter, bound, seeds, as_shipped, wheels)
        cells.append(f"{ratio[0]:.2f} / {ratio[1]:.2f} (x {factor:g})")
    return f"| {' | '.join(cells)} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    known = list(read_spec(limits.NAME)["setting"])
    program = ("python -m omni_reproduce.limits_noise", __doc__)
    print_table(program, known, ["as shipped", *PARAMETERS], line, arguments, list(limits.WHEELS))


if __name__ == "__main__":
    main()
