# SPDX-License-Identifier: MIT
"""A robot's emulated Teensy: the chip of :mod:`emulated_teensy` with the robot's wiring, in a simulated world.

::

    image = read_image(".pio/build/three_wheel/firmware.elf")
    with Teensy(image, wiring=wiring_of(robot), world=World(world_config(robot))) as machine:
        machine.power_on()
        machine.run(1.0)
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import Any

from emulated_teensy.image_file import Image
from emulated_teensy.machine import DEFAULT_OPTIONS, Machine, Options, Wiring
from hil_sim.world import World
from omni_schema import FlowWiring, Robot
from omni_schema.flow import AXES
from omniwheel._core import ffi, lib


@dataclass(frozen=True)
class RobotWiring(Wiring):
    """The wires that a robot file asks for, with its chips on I2C."""

    gyro_address: int = 0
    """Of a chip on the second I2C bus, 7 bit; 0: none."""
    gyro_chip: int = 0
    """Its number in the table of gyro chips."""
    flow: FlowWiring | None = None
    """A floor odometry sensor on the third I2C bus."""


NO_ROBOT = RobotWiring()


def wiring_of(robot: Robot) -> RobotWiring:
    """Return the wires that a robot file asks for."""
    board = robot.board
    return RobotWiring(
        encoder_pins=board.encoder_pins,
        output_enable_pin=board.output_enable_pin,
        stop_button_pin=board.stop_button_pin,
        battery_pin=board.battery_pin,
        battery_divider=board.battery_divider,
        pwm_pins=tuple(chain.from_iterable(board.motor_pins)),
        gyro_address=board.gyro.address if board.gyro is not None else 0,
        gyro_chip=board.gyro.chip.number if board.gyro is not None else 0,
        flow=board.flow,
    )


class RobotCircuit:
    """A world's robot around the chip (``hil_sim/teensy_circuit.h``)."""

    def __init__(self, world: World, wiring: Wiring) -> None:
        self.world = world
        self._c = ffi.new("hil_teensy_circuit_t *")
        self._c.world = world.c
        if isinstance(wiring, RobotWiring):
            self._wire(wiring)

    def _wire(self, wiring: RobotWiring) -> None:
        self._c.gyro_address, self._c.gyro_kind = wiring.gyro_address, wiring.gyro_chip
        if wiring.flow is not None:
            flow, wheels = wiring.flow, self._c.flow.wheels
            self._c.flow_address, self._c.flow_kind = flow.chip.address, flow.chip.number
            wheels.steps_per_mm = flow.steps_per_mm
            wheels.x_wheel_mm, wheels.y_wheel_mm = flow.x_wheel_mm, flow.y_wheel_mm
            wheels.reversed = [axis in flow.reversed for axis in AXES]

    def attach(self, machine_c: Any) -> None:
        """Connect it to a machine."""
        lib.hil_teensy_attach(machine_c, self._c)


class Teensy(Machine):
    """An emulated Teensy wired as ``wiring`` says; ``world`` goes on by itself while it runs.

    Raises FirmwareImageError and MissingPackageError.
    """

    def __init__(
        self,
        image: Image,
        *,
        wiring: RobotWiring = NO_ROBOT,
        world: World | None = None,
        options: Options = DEFAULT_OPTIONS,
    ) -> None:
        self.world = world
        circuit = RobotCircuit(world, wiring) if world is not None else None
        super().__init__(image, wiring=wiring, circuit=circuit, options=options)
