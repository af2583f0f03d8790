# SPDX-License-Identifier: MIT
"""Message signing on the radio: pymavlink on one side, the firmware's own C++ on the other."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest

from omniwheel import signing
from omniwheel.dialect import mavlink
from tests.radio.memory_robot import ERASED, RADIO, USB, MemoryRobot
from tests.radio.station import ARM, KEY, OTHER_KEY, START, YEAR, Station, state_of, usb

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
MINUTE = 6_000_000


@pytest.fixture
def robot() -> Iterator[MemoryRobot]:
    """A robot whose key is set and which is ready to be armed."""
    with MemoryRobot() as robot:
        robot.run(100)
        assert any("set" in text for text in usb(robot).give_key(KEY))
        robot.run(2000)
        robot.read(RADIO)  # what was on the line before
        yield robot


def refused(robot: MemoryRobot) -> tuple[int, int, int]:
    status = usb(robot).signing_status()
    return status.refused_unsigned, status.refused_wrong, status.refused_replayed


def test_without_a_key_the_radio_is_open() -> None:
    with MemoryRobot() as robot:
        robot.run(100)
        assert Station(robot).command(ARM, 1) == ACCEPTED
        assert state_of(robot) == "armed"


def test_a_signed_station_arms_and_drives_and_the_answers_are_signed(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY)
    assert station.command(ARM, 1) == ACCEPTED
    assert state_of(robot) == "armed"
    station.mav.param_set_send(1, 1, b"ISMC_LAM_XY", 7.0, mavlink.MAV_PARAM_TYPE_REAL32)
    answers = [m for m in station.run(300) if m.get_type() == "PARAM_VALUE"]
    assert answers[-1].param_value == 7.0
    assert all(m.get_signed() for m in answers)
    assert station.mav.signing.badsig_count == 0
    assert station.mav.signing.goodsig_count > 0
    assert refused(robot) == (0, 0, 0)


def test_an_unsigned_or_wrongly_signed_arm_command_is_refused_counted_and_said(robot: MemoryRobot) -> None:
    assert Station(robot).command(ARM, 1) is None
    assert Station(robot, key=OTHER_KEY).command(ARM, 1) is None
    assert state_of(robot) == "disarmed"
    assert refused(robot) == (1, 1, 0)
    robot.run(10_000)
    assert "radio refused: 1 unsigned, 1 wrong, 0 old" in [
        m.text for m in usb(robot).run(1) if m.get_type() == "STATUSTEXT"
    ]


def test_mavlink_1_cannot_be_signed_and_is_refused(robot: MemoryRobot) -> None:
    station = Station(robot)
    message = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    station.write(message.pack(station.mav, force_mavlink1=True))
    station.run()
    assert state_of(robot) == "disarmed"
    assert refused(robot) == (1, 0, 0)


def test_a_recording_played_again_does_nothing(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY)
    assert station.command(ARM, 1) == ACCEPTED
    assert station.command(ARM, 0) == ACCEPTED
    recording = list(station.frames)
    for frame in recording:
        robot.write(station.port, frame)
        robot.run(100)
        assert state_of(robot) == "disarmed"
    assert refused(robot) == (0, 0, len(recording))


@pytest.mark.full
def test_any_flipped_bit_makes_a_signed_command_worthless(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY, time=START + 2 * MINUTE)
    message = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    frame = bytes(message.pack(station.mav))
    for bit in range(8 * len(frame)):
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        robot.write(station.port, bytes(damaged))
        robot.run(250)  # long enough to end a frame that seems to go on
        if bit % 8 == 7:
            assert state_of(robot) == "disarmed", f"bit {bit}"
    robot.write(station.port, frame)
    robot.run(100)
    assert state_of(robot) == "armed"


def test_an_unsigned_heartbeat_does_not_keep_the_robot_alive_a_signed_one_does(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY)
    assert station.command(ARM, 1) == ACCEPTED
    for _ in range(6):
        station.heartbeat()
        robot.run(1000)
    assert state_of(robot) == "armed"
    before = refused(robot)
    stranger = Station(robot)
    for _ in range(6):
        stranger.heartbeat()
        robot.run(1000)
    assert state_of(robot) == "failsafe"
    assert refused(robot) == before  # other stations' heartbeats are no attack


def test_a_stream_that_begins_more_than_a_minute_ago_is_refused(robot: MemoryRobot) -> None:
    assert Station(robot, key=KEY, time=START - MINUTE - 1000, link_id=1).command(ARM, 1) is None
    assert Station(robot, key=KEY, time=START - MINUTE + 1_000_000, link_id=2).command(ARM, 1) == ACCEPTED


def test_programs_with_different_link_ids_do_not_disturb_each_other(robot: MemoryRobot) -> None:
    ahead = Station(robot, key=KEY, time=START + MINUTE // 2, link_id=1)
    behind = Station(robot, key=KEY, time=START, link_id=2)
    for _ in range(3):
        ahead.command(ARM, 1)
        assert state_of(robot) == "armed"
        behind.command(ARM, 0)
        assert state_of(robot) == "disarmed"
    assert refused(robot) == (0, 0, 0)


def test_keys_come_in_over_usb_only(robot: MemoryRobot) -> None:
    signed = Station(robot, key=KEY)
    signed.mav.setup_signing_send(1, 1, list(OTHER_KEY), START)
    texts = [m.text for m in signed.run(300) if m.get_type() == "STATUSTEXT"]
    assert "signing key refused: set it over USB or a cable" in texts
    status = usb(robot).signing_status()
    assert status.refused_keys == 1
    assert f"{status.fingerprint:08x}" == signing.fingerprint(KEY)
    with MemoryRobot() as fresh:
        fresh.run(100)
        Station(fresh).give_key(KEY)
        assert usb(fresh).signing_status().state == 0


def test_no_key_comes_in_while_armed(robot: MemoryRobot) -> None:
    station = usb(robot)
    assert station.command(ARM, 1) == ACCEPTED
    assert any("disarm first" in text for text in station.give_key(OTHER_KEY))
    assert f"{station.signing_status().fingerprint:08x}" == signing.fingerprint(KEY)


def test_usb_takes_unsigned_commands_and_answers_unsigned(robot: MemoryRobot) -> None:
    station = usb(robot)
    assert station.command(ARM, 1) == ACCEPTED
    assert not any(m.get_signed() for m in station.run(1000))


def test_a_key_of_zeros_opens_the_radio_again_for_good(robot: MemoryRobot) -> None:
    assert "signing key removed: the radio is open" in usb(robot).give_key(bytes(32), 0)
    robot.reboot()
    robot.run(100)
    assert Station(robot).command(ARM, 1) == ACCEPTED


@pytest.mark.full
def test_the_key_survives_a_reboot_and_so_does_the_clock(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY)
    assert station.command(ARM, 1) == ACCEPTED
    assert station.command(ARM, 0) == ACCEPTED
    recording = list(station.frames)
    for _ in range(130):
        station.heartbeat()
        station.run(1000)  # listening, pymavlink takes its clock from the robot's frames
    robot.reboot()
    robot.run(100)
    for frame in recording:
        robot.write(station.port, frame)
        robot.run(100)
        assert state_of(robot) == "disarmed"
    assert Station(robot).command(ARM, 1) is None
    assert station.command(ARM, 1) == ACCEPTED


@pytest.mark.full
def test_while_disarmed_the_stored_clock_is_never_a_minute_behind(robot: MemoryRobot) -> None:
    for _ in range(4):
        robot.run(61_000)
        now = usb(robot).signing_status().time
        image, _, _ = robot.storage()
        with MemoryRobot(image) as copy:
            copy.run(10)
            assert 0 <= now - usb(copy).signing_status().time < 60e6


@pytest.mark.full
def test_nothing_is_written_while_armed_and_the_clock_at_once_after(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY)
    assert station.command(ARM, 1) == ACCEPTED
    writes = robot.storage()[2]
    for _ in range(150):
        station.heartbeat()
        robot.run(1000)
    assert state_of(robot) == "armed"
    assert robot.storage()[2] == writes
    assert station.command(ARM, 0) == ACCEPTED
    assert robot.storage()[2] == writes + 1


@pytest.mark.full
def test_a_simulated_clock_does_not_move_the_signing_clock(robot: MemoryRobot) -> None:
    """Host-in-the-loop brings a clock of its own; entering, a far jump of it, and leaving must not age all stations."""
    robot.run(60_000)
    station = usb(robot)
    before = station.signing_status().time
    assert station.command(mavlink.MAV_CMD_OMNI_HIL, 1) == ACCEPTED
    for sequence, time_us in enumerate((1_000, 10**13, 10**13 + 1_000)):
        station.mav.omni_hil_sensors_send(time_us, sequence, [0] * 4, 12.0, 15, 0, 0, [0] * 8)
        robot.run(1)
    assert station.command(mavlink.MAV_CMD_OMNI_HIL, 0) == ACCEPTED
    robot.run(2_000)
    assert 0 <= station.signing_status().time - before < 30e6
    assert Station(robot, key=KEY, time=START + MINUTE + 1000).command(ARM, 0) == ACCEPTED


def test_a_clock_in_a_station_ahead_pulls_the_robots_along(robot: MemoryRobot) -> None:
    assert Station(robot, key=KEY, time=START + 100 * MINUTE, link_id=1).command(ARM, 0) == ACCEPTED
    assert usb(robot).signing_status().time >= (START + 100 * MINUTE) * 10
    assert Station(robot, key=KEY, time=START, link_id=2).command(ARM, 0) is None


@pytest.mark.parametrize("ahead", [YEAR, 10 * YEAR, (1 << 48) - 1 - START])
def test_one_frame_from_a_wrong_calendar_does_not_shut_out_the_right_ones(robot: MemoryRobot, ahead: int) -> None:
    usb(robot).run(1)
    assert Station(robot, key=KEY, time=START + ahead - 10, link_id=1).command(ARM, 0) is None
    texts = [m.text for m in usb(robot).run(1) if m.get_type() == "STATUSTEXT"]
    assert "radio refused: clock far ahead; set the key again" in texts
    assert refused(robot) == (0, 0, 1)
    assert Station(robot, key=KEY, time=START, link_id=2).command(ARM, 1) == ACCEPTED


LOCKED_AHEAD = YEAR // 3


def lock_out(robot: MemoryRobot) -> None:
    """Pull the clock ahead, as far as a frame can, so that a station of the right time is too old."""
    assert Station(robot, key=KEY, time=START + LOCKED_AHEAD, link_id=1).command(ARM, 0) == ACCEPTED
    assert Station(robot, key=KEY, time=START + MINUTE, link_id=2).command(ARM, 0) is None


@pytest.mark.parametrize("restart", [False, True])
@pytest.mark.parametrize(
    "way",
    [
        lambda station: station.give_key(KEY, START + MINUTE),
        lambda station: station.give_key(OTHER_KEY, START + MINUTE) + station.give_key(KEY, START + MINUTE),
        lambda station: station.give_key(bytes(32), 0) + station.give_key(KEY, START + MINUTE),
    ],
    ids=["the same key", "a new key and back", "key removed and set"],
)
def test_a_key_over_usb_sets_the_clock_exactly_and_brings_a_locked_robot_back(
    robot: MemoryRobot, way: Callable[[Station], object], restart: bool
) -> None:
    lock_out(robot)
    way(usb(robot))
    if restart:
        robot.run(100)
        robot.reboot()
        robot.run(100)
    assert abs(usb(robot).signing_status().time - (START + MINUTE) * 10) < 60e6
    robot.run(3000)
    robot.read(RADIO)  # what was signed before
    right = Station(robot, key=KEY, time=START + 2 * MINUTE, link_id=1)  # the very stream that was ahead
    assert right.command(ARM, 1) == ACCEPTED
    assert right.mav.signing.badsig_count == 0


def test_a_recording_from_before_the_clock_went_back_is_still_refused_if_its_stream_has_gone_on(
    robot: MemoryRobot,
) -> None:
    station = Station(robot, key=KEY, time=START)
    assert station.command(ARM, 0) == ACCEPTED
    usb(robot).give_key(KEY, START + MINUTE // 6)
    robot.write(station.port, station.frames[0])
    robot.run(100)
    assert refused(robot) == (0, 0, 1)


@pytest.mark.parametrize("time", [1 << 48, (1 << 48) - YEAR + 1, (1 << 64) - 1])
def test_a_time_beyond_48_bits_is_refused_and_changes_nothing(robot: MemoryRobot, time: int) -> None:
    before = usb(robot).signing_status()
    assert "signing key refused: its time is beyond 2103" in usb(robot).give_key(OTHER_KEY, time)
    after = usb(robot).signing_status()
    assert after.fingerprint == before.fingerprint
    assert 0 <= after.time - before.time < 10e6


def test_the_latest_time_that_is_taken_still_counts_on(robot: MemoryRobot) -> None:
    latest = (1 << 48) - YEAR
    usb(robot).give_key(KEY, latest)
    station = Station(robot, key=KEY, time=latest)
    heard = station.run(5000)
    stamps = [int.from_bytes(m.get_msgbuf()[-12:-6], "little") for m in heard if m.get_signed()]
    assert len(stamps) > 3
    assert all(later > earlier >= latest for earlier, later in pairwise(stamps))
    assert station.command(ARM, 1) == ACCEPTED


def test_a_stored_clock_beyond_the_limit_is_brought_back(robot: MemoryRobot) -> None:
    image = bytearray(robot.storage()[0])
    begin = len(image) - 192 + 44
    content = image[begin : begin + 4] + (1 << 63).to_bytes(8, "little")
    image[begin : begin + 16] = content + zlib.crc32(content).to_bytes(4, "little")
    with MemoryRobot(bytes(image)) as copy:
        copy.run(100)
        assert usb(copy).signing_status().time <= (1 << 48) * 10
        usb(copy).give_key(KEY, START)
        copy.run(3000)
        copy.read(RADIO)
        assert Station(copy, key=KEY, time=START).command(ARM, 1) == ACCEPTED


@pytest.mark.full
def test_after_a_power_loss_while_armed_no_recording_of_that_drive_is_taken(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY)
    assert station.command(ARM, 1) == ACCEPTED
    for _ in range(90):
        station.heartbeat()
        robot.run(1000)
        station.mav.signing.timestamp += 100_000
    late = Station(robot, key=KEY, time=station.mav.signing.timestamp, link_id=3)
    assert late.command(ARM, 1) == ACCEPTED
    recording = station.frames + late.frames
    robot.reboot()
    robot.run(100)
    for frame in recording:
        robot.write(RADIO, frame)
        robot.run(20)
        assert state_of(robot) == "disarmed"
    assert refused(robot)[2] == len(recording)


def test_after_a_power_loss_while_armed_a_station_that_hears_the_robot_goes_on(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY)
    assert station.command(ARM, 1) == ACCEPTED
    robot.reboot()
    station.run(3000)  # the robot's heartbeat takes the station's clock along, as in every MAVLink signer
    assert station.command(ARM, 1) == ACCEPTED
    assert station.command(ARM, 0) == ACCEPTED
    robot.run(100)
    image, _, _ = robot.storage()
    with MemoryRobot(image) as copy:  # after an ordinary end the time is the time again
        copy.run(10)
        assert usb(copy).signing_status().time - usb(robot).signing_status().time < 60e6


def test_an_arm_command_that_came_to_nothing_leaves_no_time_ahead(robot: MemoryRobot) -> None:
    station = usb(robot)
    assert station.command(ARM, 1) == ACCEPTED
    assert station.command(ARM, 0) == ACCEPTED
    robot.run(100)
    robot.reboot()
    robot.run(100)
    assert usb(robot).signing_status().time < (START + MINUTE) * 10


def test_a_key_that_cannot_be_read_closes_the_radio_until_it_is_set_again(robot: MemoryRobot) -> None:
    image = bytearray(robot.storage()[0])
    image[len(image) - 192 + 20] ^= 1
    with MemoryRobot(bytes(image)) as damaged:
        damaged.run(100)
        texts = [m.text for m in usb(damaged).run(1) if m.get_type() == "STATUSTEXT"]
        assert "signing key unreadable, radio closed: set it again" in texts
        for station in (Station(damaged), Station(damaged, key=KEY), Station(damaged, key=bytes(32))):
            assert station.command(ARM, 1) is None
        assert usb(damaged).signing_status().state == 2
        usb(damaged).give_key(KEY)
        assert Station(damaged, key=KEY).command(ARM, 1) == ACCEPTED


def test_a_memory_that_fails_changes_nothing_and_is_said(robot: MemoryRobot) -> None:
    robot.break_storage()
    assert "the memory failed: signing key not changed" in usb(robot).give_key(OTHER_KEY)
    assert "the memory failed: signing key not changed" in usb(robot).give_key(bytes(32), 0)
    assert Station(robot, key=KEY).command(ARM, 1) == ACCEPTED


def test_the_same_key_again_wears_nothing(robot: MemoryRobot) -> None:
    writes = robot.storage()[2]
    for _ in range(5):
        usb(robot).give_key(KEY)
    assert robot.storage()[2] == writes


@pytest.mark.full
def test_storing_the_clock_for_years_does_not_wear_the_flash_out(robot: MemoryRobot) -> None:
    """A Teensy 4.0's emulation: 15 sectors of 2048 records, a record per byte changed, addresses dealt out in fours."""
    _, before, _ = robot.storage()
    minutes = 12
    robot.run(minutes * 60_000)
    _, after, _ = robot.storage()
    sectors = [0] * 15
    for address, (old, new) in enumerate(zip(before, after, strict=True)):
        sectors[address // 4 % 15] += new - old
    erases_per_year = max(sectors) / 2048 / minutes * 60 * 24 * 365
    assert 0 < erases_per_year < 2000  # of 100 000 that the flash stands: 50 years of being switched on


def test_every_frame_on_the_radio_is_signed_and_short_and_none_on_usb(robot: MemoryRobot) -> None:
    station = Station(robot, key=KEY)
    station.mav.request_data_stream_send(1, 1, 0, 1, 1)
    heard = [m for m in station.run(5000) if m.get_type() != "BAD_DATA"]  # half a frame from before
    assert len(heard) > 15
    assert [m for m in heard if len(m.get_msgbuf()) > 100 or not m.get_signed()] == []
    assert {"HEARTBEAT", "OMNI_TRACKING", "SYS_STATUS", "OMNI_STATUS"} <= {m.get_type() for m in heard}


def test_nothing_on_the_radio_moves_the_key_when_the_memory_is_erased() -> None:
    with MemoryRobot(ERASED) as robot:
        robot.run(50)
        assert usb(robot).signing_status().state == 0
        assert Station(robot, USB).give_key(KEY)


def test_frames_of_one_moment_are_numbered_one_by_one(robot: MemoryRobot) -> None:
    """The clock must not run ahead of the time by more than the frames that were sent."""
    station = Station(robot, key=KEY)
    station.mav.param_request_list_send(1, 1)
    stamps = [m.get_msgbuf()[-12:-6] for m in station.run(3000) if m.get_type() == "PARAM_VALUE"]
    times = [int.from_bytes(bytes(stamp), "little") for stamp in stamps]
    steps = [after - before for before, after in pairwise(times)]
    assert min(steps) == 1, "several are sent in one pass"


def test_key_and_clock_are_kept_behind_the_parameters(robot: MemoryRobot) -> None:
    robot.run(5000)
    image = robot.storage()[0]
    tail = 192
    assert image[:-tail] == b"\xff" * (len(image) - tail)
    assert image[-tail:] != b"\xff" * tail
