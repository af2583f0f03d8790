# SPDX-License-Identifier: MIT
"""Stops behind noise: how many act, and how late.

    python -m tests.radio.noise [--seed 1] [--count 200]

A robot drives; its station streams setpoints and heartbeats. Something damaged comes just before an emergency stop: a
noise byte, or a frame that was cut. Counted are robot ticks from the stop's last byte until no motor has a duty.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from omniwheel.dialect import mavlink
from tests.radio.memory_robot import RADIO, USB, MemoryRobot
from tests.radio.station import ARM, Station

ESTOP = mavlink.MAV_CMD_OMNI_ESTOP
LOST_TICKS = 1000
SET_POINT_TICKS = 20
HEARTBEAT_TICKS = 1000
V1, V2 = 0xFE, 0xFD
Damage = Callable[[random.Random], bytes]


def bare_codec(sequence: int, key: bytes | None = None, time: int = 0) -> mavlink.MAVLink:
    """Return a codec that packs frames for a robot."""
    codec = mavlink.MAVLink(None, 255, 190)
    codec.seq = sequence % 256
    if key is not None:
        codec.signing.secret_key = key
        codec.signing.sign_outgoing = True
        codec.signing.timestamp = time
    return codec


def cut(frame: bytes, draw: random.Random) -> bytes:
    """Return the beginning of a frame, at least its header."""
    return frame[: draw.randrange(10, len(frame))]


def cut_unspoken(draw: random.Random) -> bytes:
    """Half a message that the robot does not speak."""
    data = [draw.randrange(256) for _ in range(180)]
    message = mavlink.MAVLink_gps_rtcm_data_message(0, 180, data)
    return cut(bytes(message.pack(bare_codec(draw.randrange(256)))), draw)


def cut_private(draw: random.Random) -> bytes:
    """Half a frame with a number that no standard has."""
    data = bytes(draw.randrange(256) for _ in range(200))
    return cut(bytes([V2, 200, 0, 0, draw.randrange(256), 9, 9, 0x77, 0x77, 0x77]) + data, draw)


def cut_spoken(draw: random.Random) -> bytes:
    """Half a message that the robot speaks."""
    data = [draw.randrange(256) for _ in range(251)]
    message = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, data)
    return cut(bytes(message.pack(bare_codec(draw.randrange(256)))), draw)


DAMAGE: dict[str, Damage] = {
    "nothing": lambda _: b"",
    "byte 0xFE": lambda _: bytes([V1]),
    "byte 0xFD": lambda _: bytes([V2]),
    "a cut frame of a message the robot speaks": cut_spoken,
    "a cut frame of another standard message": cut_unspoken,
    "a cut frame of a private message": cut_private,
}


@contextmanager
def driving_robot(port: int) -> Iterator[tuple[MemoryRobot, Station]]:
    """A robot that drives by duties from a station on this port."""
    with MemoryRobot() as robot:
        robot.run(100)
        station = Station(robot, port)
        for name in (b"SAFE_STALL_T", b"SAFE_STALL_V"):
            Station(robot, USB).mav.param_set_send(1, 1, name, 60.0, mavlink.MAV_PARAM_TYPE_REAL32)
        station.run(10)
        assert station.command(ARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        yield robot, station


def traffic(station: Station, tick: int) -> None:
    """What a station streams at this tick."""
    if tick % SET_POINT_TICKS == 0:
        station.mav.omni_setpoint_duty_send(1, 1, [0.2, 0.2, 0.2, 0.0])
    if tick % HEARTBEAT_TICKS == 0:
        station.heartbeat()


def estop_frame(station: Station, draw: random.Random) -> bytes:
    """An emergency stop, packed but not sent."""
    message = mavlink.MAVLink_command_long_message(1, 1, ESTOP, 0, 1, 0, 0, 0, 0, 0, 0)
    return bytes(message.pack(station.mav, force_mavlink1=draw.random() < 0.25))


def ticks_to_zero(damage: Damage, draw: random.Random, *, port: int, bytewise: bool) -> int | None:
    """Drive, damage, stop; return the ticks from the stop's last byte to zero duty, None if the stop was lost."""
    with driving_robot(port) as (robot, station):
        station.mav.seq = draw.randrange(256)
        for tick in range(draw.randrange(100, 200)):
            traffic(station, tick)
            robot.run(1)
        assert robot.driven
        waiting = damage(draw) + estop_frame(station, draw)
        while waiting:
            count = 1 if bytewise else len(waiting)
            robot.write(port, waiting[:count])
            waiting = waiting[count:]
            robot.background()
        for tick in range(1, LOST_TICKS):
            traffic(station, tick)
            robot.run(1)
            if not robot.driven:
                return tick
    return None


def study(damage: Damage, count: int, seed: int) -> list[int | None]:
    """Repeat on USB and radio, in one piece and byte by byte."""
    draw = random.Random(seed)
    return [ticks_to_zero(damage, draw, port=(USB, RADIO)[n % 2], bytewise=n % 4 < 2) for n in range(count)]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200, help="stops of each kind")
    options = parser.parse_args()
    sys.stdout.write("| In front of the stop | Lost | Median [ticks] | Latest [ticks] |\n|---|---|---|---|\n")
    for name, damage in DAMAGE.items():
        late = study(damage, options.count, options.seed)
        acted = sorted(ticks for ticks in late if ticks is not None)
        lost = 100.0 * (len(late) - len(acted)) / len(late)
        sys.stdout.write(f"| {name} | {lost:.1f} % | {acted[len(acted) // 2]} | {acted[-1]} |\n")


if __name__ == "__main__":
    main()
