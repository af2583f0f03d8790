# SPDX-License-Identifier: MIT
"""The firmware's application in this process, on a board of fakes: every link, every moment, simulated time."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

from tests.firmware.client import GCS, mav
from tests.native import CAST_TRAPS, ROOT, app_archive, core_archive, generated_dir, kept_library

PORTS = 4
USB, RADIO = 0, 1
POWER_ON, WATCHDOG, SOFTWARE, CRASH, OVER_TEMPERATURE = range(5)
INIT, DISARMED, ARMED, FAILSAFE, ESTOP = range(5)
STATES = {0: INIT, 1: INIT, 3: DISARMED, 4: ARMED, 5: FAILSAFE, 6: ESTOP}
"""Safety state of HEARTBEAT.system_status."""
_OUT = 1 << 14
_FOREVER = ctypes.c_size_t(-1).value


@cache
def library(trapping: bool = False) -> ctypes.CDLL:
    """Build the shim over the firmware's program; ``trapping`` with a core that ends as the program does."""
    sources = [Path(__file__).parent / "robot_shim.cpp"]
    sources += [ROOT / "tests/fuzz" / name for name in ("chip.cpp", "check.cpp", "frames.cpp")]
    if trapping:
        sources += [*sorted((ROOT / "shared/core/src").rglob("*.c")), *(generated_dir() / "src").glob("*_gen.c")]
    built = kept_library(
        "trapping_robot" if trapping else "robot",
        sources,
        includes=[ROOT / "tests/fuzz"],
        flags=["-DMAVLINK_USE_MESSAGE_INFO", "-Wno-address-of-packed-member", *(CAST_TRAPS if trapping else ())],
        archives=[app_archive(), *(() if trapping else (core_archive(),))],
    )
    loaded = ctypes.CDLL(str(built))
    loaded.robot_new.restype = ctypes.c_void_p
    loaded.robot_storage.restype = ctypes.POINTER(ctypes.c_uint8)
    for name in ("robot_size", "robot_take", "robot_unread", "robot_storage_written"):
        getattr(loaded, name).restype = ctypes.c_size_t
    for name in ("robot_driven", "robot_enabled", "robot_has_duty", "robot_pins_high", "robot_reboot_wanted"):
        getattr(loaded, name).restype = ctypes.c_bool
    return loaded


class _Sink:
    """Where pymavlink's encoder writes."""

    def __init__(self) -> None:
        self.data = b""

    def write(self, data: bytes) -> None:
        self.data += data


STATION = 190
"""Component of a ground station."""


def frame(name: str, *fields: Any, system: int = GCS, component: int = STATION) -> bytes:
    """Return the bytes of a message as a ground station sends it."""
    sink = _Sink()
    getattr(mav.MAVLink(sink, srcSystem=system, srcComponent=component), f"{name}_send")(*fields)
    return sink.data


@cache
def command(number: int, *parameters: float, system: int = GCS, component: int = STATION) -> bytes:
    """Return the bytes of a COMMAND_LONG."""
    padding = [0.0] * (7 - len(parameters))
    return frame("command_long", 1, 1, number, 0, *parameters, *padding, system=system, component=component)


HEARTBEAT = frame("heartbeat", mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
ARM = command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
DISARM = command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
EMERGENCY = command(mav.MAV_CMD_OMNI_ESTOP, 1.0)
TERMINATE = command(mav.MAV_CMD_DO_FLIGHTTERMINATION, 1.0)
RELEASE = command(mav.MAV_CMD_OMNI_ESTOP, 0.0)
HIL_ON = command(mav.MAV_CMD_OMNI_HIL, 1.0)
HIL_OFF = command(mav.MAV_CMD_OMNI_HIL, 0.0)
REBOOT = command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0)


def velocity(vx: float, vy: float = 0.0, yaw_rate: float = 0.0) -> bytes:
    """Return a velocity set-point in the body's frame."""
    return frame(
        "set_position_target_local_ned", 0, 1, 1, 12, 0b0101_1100_0111, 0, 0, 0, vx, vy, 0, 0, 0, 0, 0, yaw_rate
    )


def duty(value: float) -> bytes:
    """Return open-loop duties."""
    return frame("omni_setpoint_duty", 1, 1, [value] * 4)


class FakeRobot:
    """A robot with a ground station on each of four links. What it says is kept per link."""

    def __init__(self, lockstep: bool = False, *, trapping: bool = False) -> None:
        self._c = library(trapping)
        self._robot = ctypes.c_void_p(self._c.robot_new(lockstep))
        self._parsers = [self._parser() for _ in range(PORTS)]
        self._buffer = (ctypes.c_uint8 * _OUT)()
        self.said: list[list[Any]] = [[] for _ in range(PORTS)]
        self.hil = False

    @staticmethod
    def _parser() -> Any:
        parser = mav.MAVLink(None)
        parser.robust_parsing = True
        return parser

    def close(self) -> None:
        """Free the memory."""
        self._c.robot_delete(self._robot)

    def keep(self) -> bytes:
        """Return this moment."""
        return ctypes.string_at(self._robot, self._c.robot_size())

    def go_back(self, moment: bytes) -> None:
        """Go back to a moment of this very robot."""
        ctypes.memmove(self._robot, moment, len(moment))
        for said in self.said:
            said.clear()

    def send(self, port: int, *frames: bytes) -> None:
        """Put bytes on a link; the next pass reads them."""
        data = b"".join(frames)
        self._c.robot_send(self._robot, port, data, len(data))

    def look(self) -> None:
        """Take what the robot has said."""
        for port in range(PORTS):
            count = self._c.robot_take(self._robot, port, self._buffer, _OUT)
            if count:
                self.said[port] += self._parsers[port].parse_buffer(bytes(self._buffer[:count])) or []

    def background(self) -> None:
        """Let the background run until all bytes are read."""
        self._c.robot_pass(self._robot)
        for _ in range(1000):
            if not any(self._c.robot_unread(self._robot, port) for port in range(PORTS)):
                return
            self._c.robot_pass(self._robot)

    def tick(self, count: int = 1) -> None:
        """Let the timer tick, and the background run after each."""
        for _ in range(count):
            self._c.robot_tick(self._robot)
            self.background()

    def counts_jump(self, counts: int) -> None:
        """Let every encoder tell as many counts at once."""
        self._c.robot_counts_jump(self._robot, counts)

    def pass_once(self) -> None:
        """Let the background run once, whatever is left to be read."""
        self._c.robot_pass(self._robot)

    def bare_tick(self) -> None:
        """Let the timer tick while the background is busy with something else."""
        self._c.robot_tick(self._robot)

    def hil_tick(self, port: int, count: int = 1, *, timer: bool = True) -> None:
        """Be the host in the loop for some ticks, in real time if ``timer``."""
        for _ in range(count):
            if timer:
                self._c.robot_tick(self._robot)
            self._c.robot_hil_sensors(self._robot, port)
            self.background()
            self._c.robot_hil_actuators(self._robot, port)
            self.look()

    def hil_restart(self) -> None:
        """Begin with another simulated robot."""
        self._c.robot_hil_restart(self._robot)

    def wait(self, seconds: float) -> None:
        """Let time pass without a tick."""
        self._c.robot_wait(self._robot, ctypes.c_uint64(round(seconds * 1e6)))

    def press(self, pressed: bool = True, *, hil: bool = False) -> None:
        """Press the stop button or let it go; the simulated robot's if ``hil``."""
        self._c.robot_press(self._robot, pressed, hil)

    def sensor_trouble(self, gyro: int = 0, flow: int = 0) -> None:
        """Let the chips of gyro and floor motion have a trouble; 0: none, 1: no chip answers."""
        self._c.robot_sensor_trouble(self._robot, gyro, flow)

    def driven(self, hil: bool = False) -> bool:
        """Return whether a motor gets voltage."""
        return bool(self._c.robot_driven(self._robot, hil))

    def enabled(self, hil: bool = False) -> bool:
        """Return whether the output-enable pin is on."""
        return bool(self._c.robot_enabled(self._robot, hil))

    def has_duty(self, hil: bool = False) -> bool:
        """Return whether the PWM chip holds a duty, let through or not."""
        return bool(self._c.robot_has_duty(self._robot, hil))

    @property
    def reboots(self) -> bool:
        """Whether the board is to reset the processor."""
        return bool(self._c.robot_reboot_wanted(self._robot))

    def reset(self, cause: int = POWER_ON, power: bool = True) -> None:
        """Start again, as after this cause."""
        self._c.robot_reset(self._robot, cause, power)
        for port in range(PORTS):
            self._parsers[port] = self._parser()
            self.said[port].clear()

    def port(self, number: int, *, piece: int = 16384, connection: int = 1) -> None:
        """Change how a link reads, or its connection (0: none)."""
        self._c.robot_port(self._robot, number, piece, connection)

    @property
    def storage(self) -> bytes:
        """The non-volatile memory."""
        return ctypes.string_at(self._c.robot_storage(self._robot), 2048)

    @storage.setter
    def storage(self, content: bytes) -> None:
        ctypes.memmove(self._c.robot_storage(self._robot), content, len(content))

    @property
    def written(self) -> int:
        """Bytes written to the non-volatile memory."""
        return int(self._c.robot_storage_written(self._robot))

    def storage_fate(self, writes_left: int | None = None, *, unreadable: bool = False) -> None:
        """Let the power fail after so many more bytes, or reading fail."""
        left = _FOREVER if writes_left is None else writes_left
        self._c.robot_storage_fate(self._robot, ctypes.c_size_t(left), unreadable)

    def crash_lines(self, *lines: bytes) -> None:
        """Decide what the board says of a crash, in two lines at most, from the next reset on."""
        first, second = [*(ctypes.c_char_p(line) for line in lines), None, None][:2]
        self._kept = first, second
        self._c.robot_crash_lines(self._robot, first, second)

    def bus_busy(self, polls: int = 0, refusals: int = 0) -> int:
        """Keep the bus busy; return how often it was to be freed before."""
        return int(self._c.robot_bus_busy(self._robot, polls, refusals))

    def pins(self, *, lost: bool = False) -> None:
        """Give the board motor pins from the next reset on; ``lost``: their timers lose their settings in each tick."""
        self._c.robot_pins(self._robot, lost)

    @property
    def pins_high(self) -> bool:
        """Whether a motor pin is high for a part of the period."""
        return bool(self._c.robot_pins_high(self._robot))

    def ask(self, port: int, request: bytes) -> int | None:
        """Send a command and return the result of its acknowledgement, without a tick."""
        acks = [m.result for m in self._answers(port, request) if m.get_type() == "COMMAND_ACK"]
        return acks[-1] if acks else None

    def asked(self, name: str, port: int = USB) -> Any:
        """Return a message that is asked for by its name, without a tick."""
        request = command(mav.MAV_CMD_REQUEST_MESSAGE, getattr(mav, f"MAVLINK_MSG_ID_{name}"))
        return [m for m in self._answers(port, request) if m.get_type() == name][-1]

    def _answers(self, port: int, request: bytes) -> list[Any]:
        self.look()
        self.said[port].clear()
        self.send(port, request)
        self.background()
        self.look()
        return self.said[port]

    def state(self, port: int = USB) -> int:
        """Return the safety state that the robot tells on this link."""
        self.send(port, command(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_OMNI_STATUS))
        self.background()
        self.look()
        return int([m.state for m in self.said[port] if m.get_type() == "OMNI_STATUS"][-1])

    def texts(self, port: int = USB) -> list[str]:
        """Return what was said in words."""
        self.look()
        return [m.text for m in self.said[port] if m.get_type() == "STATUSTEXT"]

    def ready(self) -> FakeRobot:
        """Start up with a ground station on each link."""
        for port in range(PORTS):
            self.send(port, HEARTBEAT)
        self.tick(30)
        return self

    def armed(self, port: int = USB) -> FakeRobot:
        """Arm over this link."""
        self.ready()
        assert self.ask(port, ARM) == mav.MAV_RESULT_ACCEPTED, self.texts(port)
        self.tick(5)
        assert self.state(port) == ARMED
        return self

    def driving(self, port: int = USB) -> FakeRobot:
        """Arm and turn on the spot."""
        self.armed(port)
        self.send(port, velocity(0.0, 0.0, 0.5))
        self.tick(20)
        assert self.driven()
        return self

    def in_loop(self, port: int, *, drive: bool = True) -> FakeRobot:
        """Enter host-in-the-loop over this link; the simulated robot drives if it is to."""
        self.ready()
        assert self.ask(port, HIL_ON) == mav.MAV_RESULT_ACCEPTED
        self.hil_restart()
        self.tick(3)
        self.hil_tick(port, 3)
        if drive:
            self.send(port, HEARTBEAT)
            self.hil_tick(port, 30)
            assert self.ask(port, ARM) == mav.MAV_RESULT_ACCEPTED, self.texts(port)
            self.hil_tick(port, 5)
            self.send(port, velocity(0.0, 0.0, 0.5))
            self.hil_tick(port, 20)
            assert self.driven(hil=True)
        return self
