# SPDX-License-Identifier: MIT
"""The four-wheel robot and its cameras, simulated: a stream of poses and a radio for PWM lines in one.

Time is simulated: it advances while a caller waits in :meth:`SimulatedRobot.read`, so equal runs give equal numbers.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from hil_sim.faults import Fault
from hil_sim.world import PoseSensor, World, world_config
from omni_schema import Robot
from omniwheel.byte_budget import BITS_PER_BYTE
from omniwheel.frames import Pose
from omniwheel.host_control.pwm_line import DEFAULT_BAUD, END, FULL_PWM, MAX_LINE_BYTES, STOP, PwmLine, parse_line
from omniwheel.mocap.simulated import Cameras
from omniwheel.mocap.source import MocapPose

ORIGIN = Pose(0.0, 0.0, 0.0)
DEFAULT_CAMERAS = Cameras()


class SimulatedArduino:
    """The robot's microcontroller: collects bytes up to ``*`` and sets the PWM if the line is one.

    As the original does, it keeps the last PWM for ever; with ``silence_s`` it stops after that long without a line.
    """

    def __init__(self, silence_s: float | None = None) -> None:
        self.pwm: PwmLine = STOP
        self.lines = 0
        self.bad_lines = 0
        self._silence_s = silence_s
        self._line = b""
        self._last_s = 0.0

    def take(self, byte: bytes, time_s: float) -> None:
        """Take one byte that has arrived."""
        self._line = (self._line + byte)[-2 * MAX_LINE_BYTES :]
        if byte != END:
            return
        line, self._line = self._line, b""
        try:
            self.pwm = parse_line(line)
        except ValueError:
            self.bad_lines += 1
            return
        self.lines += 1
        self._last_s = time_s

    def watch(self, time_s: float) -> None:
        """Stop the motors if the link has been silent too long."""
        if self._silence_s is not None and time_s - self._last_s > self._silence_s:
            self.pwm = STOP


class SimulatedRobot:
    """The robot in the simulated world: a :class:`~omniwheel.mocap.source.MocapSource` and a Link.

    PWM is taken as the duty of a drive-brake bridge. ``deadband_pwm`` is the PWM up to which the wheels stand
    (by Coulomb friction). ``radio_delay_s`` is what the radio adds to the time that the bytes take at ``baud``.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        start_pose: Pose = ORIGIN,
        seed: int = 1,
        cameras: Cameras = DEFAULT_CAMERAS,
        baud: float = DEFAULT_BAUD,
        radio_delay_s: float = 0.008,
        deadband_pwm: float = 0.0,
        slip_max: float = 0.0,
        silence_s: float | None = None,
        faults: Sequence[Fault] = (),
    ) -> None:
        self.name = self.url = "simulated robot"
        self.arduino = SimulatedArduino(silence_s)
        sensor = PoseSensor(
            cameras.rate_Hz, cameras.sd_xy_m, cameras.sd_theta_rad, cameras.latency_s, cameras.drop_probability
        )
        config = world_config(
            robot, seed=seed, slip_max=slip_max, pose_sensor=sensor, start_pose=start_pose, faults=faults
        )
        if deadband_pwm > 0.0:
            stall_N_m = config.battery_V * config.motor_constant_N_m_A / config.motor_resistance_ohm
            config.motor_coulomb_N_m = stall_N_m * deadband_pwm / FULL_PWM
        self.world = World(config)
        self._byte_s = BITS_PER_BYTE / baud
        self._radio_delay_s = radio_delay_s
        self._wire: deque[tuple[float, bytes]] = deque()
        self._wire_free_s = 0.0
        self._frame = 0

    # ---- the cameras

    def clock(self) -> float:
        """Return the simulated time [s]."""
        return self.world.time_s

    @property
    def ended(self) -> bool:
        """Never."""
        return False

    def read(self, timeout_s: float) -> MocapPose | None:
        """Return the next pose, letting the world go on until it comes."""
        end_us = int(self.world.c.time_us) + math.ceil(timeout_s * 1e6)
        while True:
            sensors = self.world.sense()
            if sensors.has_fix:
                return self._seen(sensors.fix)
            if int(self.world.c.time_us) >= end_us:
                return None
            self._tick()

    def _seen(self, fix: object) -> MocapPose:
        self._frame += 1
        taken_us, arrives_us, pose = fix.taken_us, fix.arrives_us, fix.pose  # type: ignore[attr-defined]
        return MocapPose(Pose(*pose), taken_us * 1e-6, arrives_us * 1e-6, self._frame)

    def _tick(self) -> None:
        now_s = self.world.time_s
        while self._wire and self._wire[0][0] <= now_s:
            arrived_s, byte = self._wire.popleft()
            self.arduino.take(byte, arrived_s)
        self.arduino.watch(now_s)
        self.world.set_duty([pwm / FULL_PWM for pwm in self.arduino.pwm])
        self.world.step()

    # ---- the radio

    @property
    def waiting_bytes(self) -> int:
        """Bytes that have been written and not arrived."""
        return len(self._wire)

    def write(self, data: bytes) -> None:
        """Send bytes; each takes its time on the wire."""
        for value in data:
            self._wire_free_s = max(self._wire_free_s, self.world.time_s) + self._byte_s
            self._wire.append((self._wire_free_s + self._radio_delay_s, bytes([value])))

    def close(self) -> None:
        """Nothing to close."""


class SimulatedLink:
    """The robot's radio as a :class:`~omniwheel.link.Link`; the robot itself says nothing."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.url = robot.url
        self._robot = robot

    def read(self, timeout_s: float) -> bytes:
        """Nothing ever comes."""
        return b""

    def write(self, data: bytes) -> None:
        """Send bytes to the robot."""
        self._robot.write(data)

    def close(self) -> None:
        """Nothing to close."""
