# SPDX-License-Identifier: MIT
"""A robot in a few lines of physics around Omniwheel's firmware: python circle.py HOST PORT omni.xml robot.params"""

import contextlib
import importlib
import math
import socket
import sys
import tempfile
import time
from pathlib import Path

from pymavlink.dialects.v20 import common
from pymavlink.generator import mavgen

HOST, PORT, XML, PARAMETERS = sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4]
START = (0.05, 0.0, 0.0)  # where the robot stands: x [m], y [m], theta [rad]


def compiled(xml):
    """Return omni.xml as a Python module that knows the standard messages, too."""
    folder = tempfile.mkdtemp()
    options = mavgen.Opts(str(Path(folder) / "omni_alone"), wire_protocol="2.0", language="Python3")
    with contextlib.redirect_stdout(None):
        mavgen.mavgen(options, [xml])
    sys.path.insert(0, folder)
    module = importlib.import_module("omni_alone")
    module.mavlink_map.update(common.mavlink_map)
    return module


class Chip:
    """The PWM chip PCA9685 at I2C address 0x40: registers, and what its 16 outputs do."""

    MODE1, LED0, ALL_LED, SLEEP, FULL = 0x00, 0x06, 0xFA, 0x10, 0x10

    def __init__(self):
        self.registers = bytearray(256)
        self.registers[self.MODE1] = 0x11  # asleep after power-up
        self.pointer = 0

    def transfer(self, i2c):
        """Run a tick's transactions; return the status for the next sensors, and the bytes that were read."""
        status, read, at = 0, b"", 0
        while at < len(i2c):
            address, written = i2c[at], i2c[at + 1]
            data, wanted = i2c[at + 2 : at + 2 + written], i2c[at + 2 + written]
            at += 3 + written
            if address != 0x40:
                status |= 1  # not acknowledged
                continue
            if data:
                self.pointer = data[0]
                for value in data[1:]:
                    self.write(self.pointer, value)
                    self.pointer += 1
            if wanted:
                read = bytes(self.registers[self.pointer : self.pointer + wanted])
        return status, read

    def write(self, register, value):
        if self.ALL_LED <= register < self.ALL_LED + 4:
            for channel in range(16):
                self.registers[self.LED0 + 4 * channel + register - self.ALL_LED] = value
        self.registers[register] = value

    def share(self, channel):
        """Return the share of the PWM period in which a channel is high."""
        on_low, on_high, off_low, off_high = self.registers[self.LED0 + 4 * channel :][:4]
        if self.registers[self.MODE1] & self.SLEEP or off_high & self.FULL:
            return 0.0
        if on_high & self.FULL:
            return 1.0
        return ((off_high * 256 + off_low) - (on_high * 256 + on_low)) % 4096 / 4096


class Plant:
    """Three wheels that follow their motors with a lag and roll without slip."""

    def __init__(self, p):
        self.p = p
        self.x, self.y, self.theta = START
        self.bearings = [math.radians(p[f"W{i}_ANGLE"]) for i in (1, 2, 3)]
        self.speeds, self.angles = [0.0] * 3, [0.0] * 3
        drag = p["MOT_B"] + p["MOT_K"] ** 2 / p["MOT_R"]
        self.rad_s_per_V = p["MOT_K"] / p["MOT_R"] / drag
        self.lag_s = 3 * p["MOT_J"] / drag

    def counts(self):
        per_rad = self.p["ENC_CPR"] / (2 * math.pi)
        return [int(self.p[f"W{i + 1}_ENC_DIR"]) * math.floor(a * per_rad) for i, a in enumerate(self.angles)] + [0]

    def step(self, duty):
        for i in range(3):
            wanted = self.rad_s_per_V * duty[i] * self.p["BAT_V_NOM"]
            self.speeds[i] += (wanted - self.speeds[i]) * 1e-3 / self.lag_s
            self.angles[i] += self.speeds[i] * 1e-3
        rims = [self.p["WHEEL_RADIUS"] * speed for speed in self.speeds]
        forward = 2 / 3 * sum(-math.sin(a) * rim for a, rim in zip(self.bearings, rims))
        left = 2 / 3 * sum(math.cos(a) * rim for a, rim in zip(self.bearings, rims))
        turn = sum(rims) / (3 * self.p["WHEEL_DIST"])
        heading = self.theta + 0.5e-3 * turn
        self.x += 1e-3 * (forward * math.cos(heading) - left * math.sin(heading))
        self.y += 1e-3 * (forward * math.sin(heading) + left * math.cos(heading))
        self.theta += 1e-3 * turn


def connected():
    """Return a connection to the firmware, which may have been started a moment ago."""
    for _ in range(100):
        with contextlib.suppress(ConnectionRefusedError):
            return socket.create_connection((HOST, PORT))
        time.sleep(0.1)
    raise SystemExit(f"nobody listens at {HOST}:{PORT}: start the firmware first")


class Lockstep:
    """The loop: time stands still until the robot has answered."""

    def __init__(self):
        lines = Path(PARAMETERS).read_text().split()
        self.p = {name: float(value) for name, value in (line.split("=") for line in lines)}
        self.omni = compiled(XML)
        self.wire = connected()
        self.wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.mav = self.omni.MAVLink(None, srcSystem=254, srcComponent=1)
        self.mav.robust_parsing = True
        self.chip, self.plant = Chip(), Plant(self.p)
        self.ticks, self.status, self.read = 0, 0, b""
        self.heard = []  # messages of the last tick
        self.robot = int(self.p["SYS_ID"]), 1

    def send(self, message):
        self.wire.sendall(message.pack(self.mav))

    def tick(self):
        """Send the sensors of now, wait for the answer, go on by 1 ms."""
        time_us = 1000 * self.ticks
        if self.ticks % 500 == 0:  # a robot that hears no ground station stops
            self.send(common.MAVLink_heartbeat_message(common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3))
        if self.ticks % 20 == 0:  # a fix goes before the sensors of its tick; North, East, Down: y and yaw change sign
            pose = self.plant.x, -self.plant.y, 0.0, 0.0, 0.0, -self.plant.theta
            self.send(common.MAVLink_vicon_position_estimate_message(time_us, *pose, [math.nan] * 21))
        read = list(self.read) + [0] * (8 - len(self.read))
        sensors = [self.p["BAT_V_NOM"], 0b111, self.status, len(self.read), read]
        self.send(self.omni.MAVLink_omni_hil_sensors_message(time_us, self.ticks, self.plant.counts(), *sensors))
        answer = self.answer()
        self.status, self.read = self.chip.transfer(bytes(answer.i2c[: answer.i2c_length]))
        self.plant.step(self.duty(answer.output_enable == 1))
        self.ticks += 1
        return answer

    def answer(self):
        self.heard = []
        while True:
            for message in self.mav.parse_buffer(self.wire.recv(4096)) or []:
                self.heard.append(message)
                if message.get_type() == "OMNI_HIL_ACTUATORS" and message.sequence == self.ticks:
                    return message

    def duty(self, enabled):
        """Return the duty per wheel, positive: counter-clockwise. Both inputs low would be coasting, here as 0."""
        duty = []
        for i in ("1", "2", "3"):
            in1, in2 = (self.chip.share(int(self.p[f"W{i}_IN{k}_CH"])) for k in (1, 2))
            duty.append((in1 - in2) * self.p[f"W{i}_MOT_DIR"] if enabled else 0.0)
        return duty

    def command(self, number, *values):
        """Send a command and run ticks until the robot has said yes."""
        values = [float(value) for value in values] + [0.0] * (7 - len(values))
        self.send(common.MAVLink_command_long_message(*self.robot, number, 0, *values))
        for _ in range(500):
            self.tick()
            for message in self.heard:
                if message.get_type() == "COMMAND_ACK" and message.command == number:
                    if message.result != common.MAV_RESULT_ACCEPTED:
                        raise SystemExit(f"command {number} refused: {message.result}")
                    return
        raise SystemExit(f"no answer to command {number}")


loop = Lockstep()
for _ in range(300):  # the chip wakes up, the first fix arrives
    loop.tick()
loop.command(loop.omni.MAV_CMD_OMNI_SET_POSE, *START)
loop.command(loop.omni.MAV_CMD_OMNI_TRAJECTORY_START, -1, -1, 0)  # as the TRJ_* parameters say
loop.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1)
squares, driven, phase = 0.0, 0, 0
while phase != 3 and loop.ticks < 120_000:
    x, y = loop.plant.x, loop.plant.y  # where the robot is in this tick
    answer = loop.tick()
    phase = answer.phase
    if phase == 2:  # on the path
        squares += (x - answer.reference[0]) ** 2 + (y - answer.reference[1]) ** 2
        driven += 1
loop.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 0)
print(f"path driven in {1e-3 * driven:.1f} s, position RMSE {1e3 * math.sqrt(squares / max(driven, 1)):.3f} mm")
