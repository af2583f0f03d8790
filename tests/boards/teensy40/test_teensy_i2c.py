# SPDX-License-Identifier: MIT
"""The Teensy's I2C master: what is on the wire, in time and when it goes wrong."""

from __future__ import annotations

import ctypes
import random
from itertools import pairwise

import pytest

from tests.boards.teensy40.chip import BY_CHIP, FOR_EVER, MAX_READ, NACK, SCL, SDA, START, STOP, Bus, Transaction, build

PCA9685 = 0x40
MODE1 = Transaction(PCA9685, b"\x00", 1)
PAIRS = {2: 3, 8: 9, 13: 14}
UPDATE = [Transaction(PCA9685, bytes([6 + 4 * first, *range(8)])) for first in PAIRS]
ZEROS = [Transaction(PCA9685, bytes([6, 0, 0, 0, 0]))]
SPEEDS = (100_000, 400_000, 1_000_000)
SLOWEST_RISE_NS = {100_000: 1000, 400_000: 300, 1_000_000: 120}  # NXP UM10204, table 10


PORTS = {"LPI2C1": (), "LPI2C3": ("-DGYRO_PORT",), "LPI2C4": ("-DFLOW_PORT",)}


@pytest.fixture(scope="module", params=list(PORTS.values()), ids=list(PORTS))
def library(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The motors' bus, the gyro's, the floor-motion sensor's: the fakes' PWM chip hangs on the one that is tested."""
    return build(tmp_path_factory.mktemp("io"), request.param)


@pytest.fixture
def bus(library: ctypes.CDLL) -> Bus:
    return Bus(library)


def no_mistakes(bus: Bus) -> bool:
    return int(bus.c.bus_mistakes()) == 0


def works(bus: Bus) -> bool:
    """Say whether a batch goes through now, with the right bytes on the wire."""
    bus.events()
    done = bus.submit(*UPDATE) and bus.finish() == "done"
    return done and bus.events() == [event for t in UPDATE for event in t.events()] + [STOP]


@pytest.mark.full
def test_a_batch_is_joined_by_repeated_starts_and_ends_with_one_stop(bus: Bus) -> None:
    assert works(bus)
    assert bus.poll() == "idle"  # reported once
    assert no_mistakes(bus)


@pytest.mark.full
def test_a_read_follows_its_write_and_brings_the_chips_bytes(bus: Bus) -> None:
    assert bus.submit(MODE1)
    assert bus.finish() == "done"
    assert bus.read[0] == 0x11  # power-up state
    assert bus.events() == [*MODE1.events(b"\x11"), STOP]


def test_an_address_alone_finds_who_is_there(bus: Bus) -> None:
    found = []
    for address in range(8, 120):
        assert bus.submit(Transaction(address))
        status = bus.finish()
        assert status in ("done", "nack")
        assert bus.events() == [START, address << 1 | (0 if status == "done" else NACK), STOP]
        found += [address] if status == "done" else []
    assert found == [PCA9685, 0x70]  # 0x70: the chip's all-call address
    assert bus.counter("nacks") == 110
    assert no_mistakes(bus)


def test_the_last_read_of_a_batch_is_what_poll_gives(bus: Bus) -> None:
    first = Transaction(PCA9685, b"\x00", 1)
    second = Transaction(PCA9685, b"\xfe", 1)
    assert bus.submit(first, second, *UPDATE)
    assert bus.finish() == "done"
    assert bus.read[0] == 0x1E
    assert list(bus.read[1:]) == [0] * (MAX_READ - 1)


def test_the_longest_write_and_read_fit(bus: Bus) -> None:
    longest = Transaction(PCA9685, bytes(range(40)), MAX_READ)
    assert bus.submit(*[longest] * 9)
    assert bus.finish() == "done"
    assert no_mistakes(bus)


def test_a_busy_master_takes_nothing_new(bus: Bus) -> None:
    assert bus.submit(*UPDATE)
    assert not bus.submit(*ZEROS)
    assert bus.poll() == "busy"
    assert bus.finish() == "done"
    assert bus.events() == [event for t in UPDATE for event in t.events()] + [STOP]


def test_what_is_no_batch_is_refused(bus: Bus) -> None:
    assert not bus.submit()
    assert not bus.submit(*[MODE1] * 10)
    assert bus.poll() == "idle"
    assert bus.events() == []


def random_batch(rng: random.Random) -> list[Transaction]:
    batch = []
    for _ in range(rng.randint(1, 9)):
        length = rng.choice((0, 1, 2, 5, 9, 40))
        write = bytes([rng.randint(0x06, 0x45), *rng.randbytes(length - 1)]) if length else b""
        batch.append(Transaction(rng.choice((PCA9685, PCA9685, PCA9685, 0x23)), write, rng.choice((0, 0, 1, 8))))
    return batch


def expected(batch: list[Transaction], events: list[int]) -> list[int]:
    """Return the wire's events; the chip's own bytes are taken from ``events``."""
    out: list[int] = []
    for transaction in batch:
        if transaction.address != PCA9685:
            reading = 1 if transaction.read and not transaction.write else 0
            return [*out, START, transaction.address << 1 | reading | NACK, STOP]
        answer_at = len(out) + len(transaction.events(bytes(transaction.read))) - transaction.read
        answer = bytes(event & 0xFF for event in events[answer_at : answer_at + transaction.read])
        out += transaction.events(answer)
    return [*out, STOP]


@pytest.mark.full
def test_random_batches_leave_exactly_their_bytes(bus: Bus) -> None:
    rng = random.Random(4)
    for _ in range(10_000):
        batch = random_batch(rng)
        assert bus.submit(*batch)
        status = bus.finish()
        events = bus.events()
        assert status == ("done" if all(t.address == PCA9685 for t in batch) else "nack")
        assert events == expected(batch, events)
    assert no_mistakes(bus)


def test_a_hundred_thousand_batches_back_to_back(bus: Bus) -> None:
    packed = b"".join(t.packed() for t in ZEROS)
    for _ in range(100_000):
        assert bus.c.i2c_submit(packed, 1)
        bus.c.bus_advance_us(100)
        assert bus.c.i2c_poll(bus.read) == 2
        if bus.counter("batches") % 4000 == 0:
            bus.events()
    assert bus.counter("batches") == 100_000
    assert bus.counter("nacks") + bus.counter("timeouts") + bus.counter("recoveries") == 0
    assert no_mistakes(bus)


# ---------------------------------------------------------------- time


@pytest.mark.parametrize("speed_hz", SPEEDS)
def test_the_registers_meet_the_i2c_specification(library: ctypes.CDLL, speed_hz: int) -> None:
    low_min, high_min, setup_min, hold_min, data_min, rise = {  # UM10204 table 10, ns
        100_000: (4700, 4000, 4700, 4000, 250, 1000),
        400_000: (1300, 600, 600, 600, 100, 300),
        1_000_000: (500, 260, 260, 260, 50, 120),
    }[speed_hz]
    fields = [library.timing_field(speed_hz, field) for field in range(7)]
    prescale, low, high, hold, data, spikes, idle = fields
    unit = 2**prescale * 1e9 / 60e6

    def latency(rise_ns: float) -> int:
        return int((2 + spikes + 0.91 * rise_ns * 0.06) / 2**prescale)

    assert all(0 < field <= 63 for field in (low, high, hold, data))
    assert 0 < spikes <= 15
    assert 0 < idle < 4096
    assert spikes / 60e6 >= 50e-9  # spikes that must not count
    for edge in (20, rise):
        seen = 1.421 * edge  # until 70 % of the supply
        assert (low + high + 2 + latency(edge)) * unit >= 1e9 / speed_hz * 0.999
        assert (low + 1) * unit >= low_min
        assert (high + 1 + latency(edge)) * unit - seen >= high_min
        assert (hold + 1 + latency(edge)) * unit - seen >= setup_min
        assert (hold + 1) * unit >= hold_min
        assert (low + 1) * unit - (data + 1) * unit - seen >= data_min


@pytest.mark.parametrize(("speed_hz", "at_most_us"), [(100_000, 3000), (400_000, 760), (1_000_000, 300)])
def test_an_update_of_three_pairs_keeps_its_time(library: ctypes.CDLL, speed_hz: int, at_most_us: float) -> None:
    fast, slow = (library.batch_ns(speed_hz, rise, 30, 3) / 1000 for rise in (20, SLOWEST_RISE_NS[speed_hz]))
    bits = 3 * (1 + 1 + 8) * 9
    assert bits * 1e6 / speed_hz < fast < slow <= at_most_us


@pytest.mark.parametrize("speed_hz", SPEEDS)
def test_the_bus_time_is_measured(library: ctypes.CDLL, speed_hz: int) -> None:
    bus = Bus(library, speed_hz)
    assert bus.submit(*UPDATE)
    assert bus.finish() == "done"
    assert bus.counter("last_us") == pytest.approx(270 * 1e6 / speed_hz, rel=0.05)
    assert bus.counter("longest_us") == bus.counter("last_us")


def test_interrupts_that_come_late_stretch_the_clock_and_lose_nothing(bus: Bus) -> None:
    assert bus.submit(*UPDATE)
    bus.c.interrupts_held(True)
    bus.c.bus_advance_us(150)
    bus.c.interrupts_held(False)
    assert bus.finish() == "done"
    assert bus.events() == [event for t in UPDATE for event in t.events()] + [STOP]
    assert no_mistakes(bus)


# ---------------------------------------------------------------- faults

ANSWERED = [*UPDATE[:1], MODE1]


@pytest.mark.parametrize(
    "batch", [UPDATE, ANSWERED, [Transaction(PCA9685)], ZEROS], ids=("update", "read", "scan", "zero")
)
@pytest.mark.parametrize("leave_stop", [False, True], ids=("own-stop", "asked-stop"))
def test_a_byte_that_is_not_acknowledged_ends_the_batch_with_a_stop(
    bus: Bus, batch: list[Transaction], leave_stop: bool
) -> None:
    bus.c.bus_leave_stop(leave_stop)
    bus.submit(*batch)
    bus.finish()
    sent = [event for event in bus.events() if not event & (START | STOP | BY_CHIP)]
    for n, refused in enumerate(sent):
        bus.c.bus_refuse_byte(n)
        before = bus.counter("nacks")
        assert bus.submit(*batch)
        assert bus.finish() == "nack"
        events = bus.events()
        assert events[-2:] == [refused | NACK, STOP]
        assert events.count(STOP) == 1
        assert bus.counter("nacks") == before + 1
        bus.c.bus_refuse_byte(-1)
        assert works(bus)
    assert no_mistakes(bus)


@pytest.mark.parametrize("clocks", [1, 4, 9])
@pytest.mark.parametrize("batch", [UPDATE, ANSWERED, ZEROS], ids=("update", "read", "zero"))
def test_a_data_line_held_low_anywhere_is_freed_by_at_most_nine_clocks(
    bus: Bus, batch: list[Transaction], clocks: int
) -> None:
    bus.submit(*batch)
    bus.finish()
    for n in range(len(bus.events())):
        recoveries = bus.counter("recoveries")
        bus.c.bus_hold(SDA, n, clocks)
        assert bus.submit(*batch)
        assert bus.finish() == "stuck"
        bus.events()
        bus.c.i2c_recover()
        assert not bus.submit(*batch)
        bus.c.i2c_recover()  # asking again does not begin again
        bus.tick(300)
        assert bus.events() == [STOP]  # no START: nothing that a chip could take for an address
        assert bus.c.bus_clocks() == clocks + 1  # the last one is the STOP's
        assert bus.counter("recoveries") == recoveries + 1
        assert works(bus)
    assert bus.counter("sda_stuck") == bus.counter("scl_stuck") == 0
    assert no_mistakes(bus)


@pytest.mark.parametrize("line", [SDA, SCL])
def test_a_line_held_for_ever_is_reported_and_tried_again(bus: Bus, line: int) -> None:
    for n in range(0, 34, 3):
        bus.c.bus_hold(line, n, FOR_EVER)
        assert bus.submit(*UPDATE)
        assert bus.finish() == "stuck"
        bus.c.i2c_recover()
        bus.tick(2000)
        assert bus.counter("sda_stuck" if line == SDA else "scl_stuck") == n // 3 + 1
        assert bus.submit(*UPDATE)  # the bus may have been freed: try again
        assert bus.finish() == "stuck"
        bus.c.bus_let_go()
        bus.c.i2c_recover()
        bus.tick()
        assert works(bus)
    assert no_mistakes(bus)


def test_a_bus_that_hangs_is_given_up_in_time(bus: Bus) -> None:
    bus.c.bus_hold(SCL, 5, FOR_EVER)
    assert bus.submit(*UPDATE)
    assert [bus.tick(), bus.tick()] == ["busy", "stuck"]
    assert bus.counter("timeouts") == 1


def test_recovery_is_over_within_a_tick_and_needs_no_waiting(bus: Bus) -> None:
    bus.c.bus_hold(SDA, 0, 9)
    bus.c.i2c_recover()
    bus.tick(150)
    assert works(bus)


def test_without_a_free_timer_the_tick_clears_the_bus(bus: Bus) -> None:
    bus.c.timer_allowed(False)
    bus.c.bus_hold(SDA, 0, 9)
    bus.c.i2c_recover()
    for _ in range(30):
        assert bus.tick() == "idle"
    assert bus.events() == [STOP]
    assert works(bus)


def test_recovery_of_a_bus_that_is_free_or_busy_harms_nothing(bus: Bus) -> None:
    bus.c.i2c_recover()
    bus.tick(150)
    assert bus.c.bus_clocks() == 1  # a chip that is being written to gets no bits that it would take for data
    assert works(bus)
    for us in range(0, 280, 9):
        assert bus.submit(*UPDATE)
        bus.c.bus_advance_us(us)
        bus.c.i2c_recover()
        bus.tick(200)
        assert works(bus)
    assert no_mistakes(bus)


def test_what_went_wrong_is_told(bus: Bus) -> None:
    bus.c.bus_refuse_byte(3)
    for status, hold in (("nack", None), ("stuck", (SDA, 3, 9)), ("stuck", (SCL, 3, FOR_EVER))):
        if hold:
            bus.c.bus_hold(*hold)
        assert bus.submit(*UPDATE)
        assert bus.finish() == status
        bus.c.bus_let_go()
        if status == "stuck":
            bus.c.i2c_recover()
            bus.tick()
    assert works(bus)
    stats = (ctypes.c_uint32 * 4)()
    bus.c.i2c_stats(stats)
    assert list(stats[:3]) == [1, 2, 2]  # lost to a low SDA, and never ended
    assert stats[3] == bus.counter("last_us") > 260


# ---------------------------------------------------------------- the motor driver on this bus

DUTIES = (0.5, -3996 / 4096, 1.0)
COUNTS = (4096, 2048, 100, 4096, 4096, 0)
"""Of IN1 and IN2 of each wheel."""
CHANNELS = (9, 8, 13, 14, 3, 2)


def duties(bus: Bus) -> list[float]:
    return [float(bus.c.chip_duty(channel)) for channel in range(16)]


def expected_duties() -> list[float]:
    duty = dict(zip(CHANNELS, COUNTS, strict=True))
    return [duty.get(channel, 0) / 4096 for channel in range(16)]


@pytest.mark.parametrize("speed_hz", SPEEDS)
def test_the_motor_driver_sets_up_the_chip_and_its_channels(library: ctypes.CDLL, speed_hz: int) -> None:
    bus = Bus(library, speed_hz)
    for tick in range(30):
        bus.drive(1000 * tick, DUTIES)
    assert duties(bus) == expected_duties()
    assert bus.c.driver_failures() == 0
    updates = [b for a, b in pairwise([STOP, *bus.events()]) if a == STOP]
    # At 1 MHz and 400 kHz an update per tick.
    assert len(updates) >= (27 if speed_hz > 100_000 else 10)


@pytest.mark.parametrize("line", [SDA, SCL])
@pytest.mark.parametrize("from_event", [0, 1, 5, 33, 34])
def test_the_motor_driver_comes_back_after_a_stuck_bus(bus: Bus, line: int, from_event: int) -> None:
    now = iter(range(0, 1_000_000_000, 1000))
    for _ in range(10):
        bus.drive(next(now), DUTIES)
    bus.events()
    bus.c.bus_hold(line, from_event, 5)
    for _ in range(20):
        bus.drive(next(now), None)
    if line == SCL:
        assert bus.c.driver_failures() >= 5
        bus.c.bus_let_go()
    for _ in range(20):
        bus.drive(next(now), DUTIES)
    assert bus.c.driver_failures() == 0
    assert duties(bus) == expected_duties()
    assert no_mistakes(bus)


@pytest.mark.parametrize("line", [SDA, SCL])
@pytest.mark.parametrize("from_event", [0, 1, 5, 33, 34])
def test_a_stuck_bus_fails_an_update_in_every_tick(bus: Bus, line: int, from_event: int) -> None:
    """docs/reference/safety.md promises 12 ms until SAFE_I2C_N = 10 of them stop it, however long a batch takes."""
    now = iter(range(0, 1_000_000_000, 1000))
    for _ in range(10):
        bus.drive(next(now), DUTIES)
    bus.events()
    bus.c.bus_hold(line, from_event, 1000 if line == SDA else 0)
    ticks = 0
    while bus.c.driver_failures() < 10:
        bus.drive(next(now), DUTIES)
        ticks += 1
    begun = 2 if from_event >= 33 else 1  # ticks until the batch that meets the low line has begun
    assert ticks <= 12 + begun


def test_a_chip_that_lost_its_power_is_set_up_again(bus: Bus) -> None:
    for tick in range(100):
        bus.drive(1000 * tick, DUTIES)
        if tick == 20:
            bus.c.chip_power_cycle()
            assert duties(bus) == [0.0] * 16
    assert duties(bus) == expected_duties()


@pytest.mark.parametrize("speed_hz", SPEEDS)
def test_the_longest_update_is_not_taken_for_a_stuck_bus(library: ctypes.CDLL, speed_hz: int) -> None:
    """Four wheels on scattered channels, and MODE1 read back: with slow edges 5.2 ms at 100 kHz."""
    bus = Bus(library, speed_hz)
    bus.c.bus_rise_time(SLOWEST_RISE_NS[speed_hz])
    for tick in range(1000):
        bus.c.driver_tick_scattered(ctypes.c_uint64(1000 * tick))
    assert bus.c.driver_errors() == 0
    assert [duty for duty in duties(bus) if duty > 0.0] == [1.0, 0.75] * 4
    assert no_mistakes(bus)


@pytest.mark.parametrize(("speed_hz", "at_most_ms"), [(100_000, 12), (400_000, 5), (1_000_000, 3)])
def test_a_line_held_low_in_the_longest_update_is_noticed(library: ctypes.CDLL, speed_hz: int, at_most_ms: int) -> None:
    """After twice the update's time and 0.5 ms, seen by the next tick."""
    bus = Bus(library, speed_hz)
    bus.c.bus_rise_time(SLOWEST_RISE_NS[speed_hz])
    now = iter(range(0, 1_000_000, 1000))
    for _ in range(100):
        bus.c.driver_tick_scattered(ctypes.c_uint64(next(now)))
    assert bus.c.driver_errors() == 0
    bus.c.bus_hold(SCL, 20, 0)
    held_in = 6  # ticks until an update of 5.2 ms begins at the latest
    ticks = 0
    while bus.c.driver_errors() == 0:
        bus.c.driver_tick_scattered(ctypes.c_uint64(next(now)))
        ticks += 1
    assert ticks <= at_most_ms + held_in


@pytest.mark.parametrize("line", [None, SDA])
@pytest.mark.parametrize("from_event", [0, 1, 5, 33])
def test_motors_are_stopped_after_a_reset_in_the_middle_of_an_update(
    bus: Bus, line: int | None, from_event: int
) -> None:
    for tick in range(20):
        bus.drive(1000 * tick, DUTIES)
    assert any(duties(bus))
    bus.events()
    if line is not None:
        bus.c.bus_hold(line, from_event, 5)  # a chip that waits for the clocks of a cut transfer
        bus.drive(20_000, DUTIES)
    steps = next((n for n in range(200) if bus.c.motor_stop_step()), None)
    assert steps is not None, "within 10 ms"
    assert not any(duties(bus))
    assert no_mistakes(bus)
