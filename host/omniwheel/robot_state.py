# SPDX-License-Identifier: MIT
"""What a robot said last, as properties: the same for every face of the library."""

from __future__ import annotations

from omniwheel.frames import Pose, Twist
from omniwheel.status import RobotStatus
from omniwheel.telemetry import Battery, Odometry, Status, TelemetryT, Tracking, Wheels


class RobotState:
    """State of a robot; its class has :meth:`_latest` and :meth:`_newest_status`."""

    @property
    def pose(self) -> Pose:
        """Estimated world pose: x [m], y [m], theta [rad]. Waits for the first one."""
        return self._latest(Tracking).pose

    @property
    def twist(self) -> Twist:
        """Estimated velocity in the body's frame: vx [m/s], vy [m/s], wz [rad/s]. Waits for the first one."""
        return self._latest(Odometry).twist

    @property
    def wheels(self) -> Wheels:
        """Speeds [rad/s], duties, currents [A] of the wheels. Waits for the first ones."""
        return self._latest(Wheels)

    @property
    def battery_V(self) -> float:
        """Supply voltage [V]; NaN if the robot does not measure it. Waits for the first one."""
        return self._latest(Battery).voltage_V

    @property
    def state(self) -> str:
        """Safety state: init, disarmed, armed, failsafe, estop. Waits for the first one."""
        return self._latest(Status).state

    @property
    def armed(self) -> bool:
        """Whether the motors are powered."""
        return self._newest_status().armed

    def _latest(self, kind: type[TelemetryT]) -> TelemetryT:
        """Return what came last of a kind; wait for the first."""
        raise NotImplementedError

    def _newest_status(self) -> RobotStatus:
        """Return the latest of everything, with what has come by now."""
        raise NotImplementedError
