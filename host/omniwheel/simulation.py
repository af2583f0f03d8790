# SPDX-License-Identifier: MIT
"""The one door from the library to the simulator, which is imported when it is used."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omni_schema import Robot as RobotFile
from omniwheel.connection import Connection
from omniwheel.errors import SetpointError
from omniwheel.link import open_link
from omniwheel.robot import Robot, await_and_serve
from omniwheel.robots import find_robot_file, parameter_table
from omniwheel.run import Run

if TYPE_CHECKING:
    from hil_sim.simulated_robot import Simulation as Simulation

DEFAULT_ROBOT = "fast_three_wheel"
REAL_TIME, MAX = "real time", "max"
SPEEDS = (REAL_TIME, MAX)


class SimulatedRobot(Robot):
    """A robot whose world is simulated: everything of :class:`omniwheel.Robot`, and :attr:`simulation`."""

    simulation: Simulation
    """The world: ``true_pose``, ``fault("encoder_stuck", wheel=1)``, ``mend()``, ``urls`` for other programs."""
    _world: ExitStack

    @property
    def run(self) -> Run:
        """Everything since the connection, so far, with the true poses. Raises LogError if it is not recorded."""
        run = super().run
        rows = self.simulation.truth.rows
        run.truth_time_s, run.truth = rows[:, 0], rows[:, 1:]
        return run

    def close(self) -> None:
        """Disarm, close the link and end the simulation."""
        self.__exit__(None, None, None)

    def __exit__(self, *exception: Any) -> None:
        end = ExitStack()
        end.push(self._world)  # it knows better than the link why the firmware is gone
        end.callback(super().close)
        end.__exit__(*exception)


def simulate(
    robot: str | Path | RobotFile = DEFAULT_ROBOT,
    *,
    world: Any = None,
    scenario: Any = None,
    seed: int | None = 0,
    speed: str = REAL_TIME,
    record: bool = True,
    background: bool = True,
) -> SimulatedRobot:
    """Start the real firmware in a simulated world and connect to it; ``robot.close()`` or ``with`` ends all of it.

    ``robot``: a packaged name, a robot file, or a description (:class:`omni_schema.Robot`). ``scenario``: name, file or
    object of a scenario, whose world, faults and parameters count, its events not; None: a floor with slip and pose
    fixes. ``world``: in the place of the simulated one, as "mujoco", "module:Class", or an
    :class:`hil_sim.external.ExternalWorld`. ``seed`` of the world's random numbers; None: the scenario's.

    ``speed`` "real time": time is the clock's. "max": time passes only while a method of the robot waits
    (``robot.sleep``, not ``time.sleep``), as fast as the computer can. The same program and seed then give the same
    bytes. ``background`` counts in real time only. Raises SchemaError, RobotFileError, FirmwareError.
    """
    if speed not in SPEEDS:
        raise SetpointError(f"speed is {speed!r}; allowed are {' and '.join(map(repr, SPEEDS))}")
    from hil_sim.simulated_robot import simulated

    real_time = speed == REAL_TIME
    with ExitStack() as stack:
        simulation = stack.enter_context(
            simulated(robot, world=world, scenario=scenario, seed=seed, real_time=real_time)
        )
        link = open_link(simulation.link) if isinstance(simulation.link, str) else simulation.link
        connection = Connection(link, clock=simulation.clock or time.monotonic)
        made = SimulatedRobot(connection, table=parameter_table())
        made.simulation = simulation
        made.robot_file = b"" if isinstance(robot, RobotFile) else find_robot_file(robot).read_bytes()
        await_and_serve(made, record=record, background=background and real_time)
        made._world = stack.pop_all()
        return made
