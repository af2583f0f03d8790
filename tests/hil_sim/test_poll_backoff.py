# SPDX-License-Identifier: MIT
"""How the ends of a lockstep link wait: looking or asleep, the same is exchanged."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import omniwheel.robot
from hil_sim.hil import HilLoop, run_hil
from hil_sim.lockstep import ASLEEP, LOOKING, MEASURED, Waiting
from hil_sim.record import Record
from hil_sim.scenario import load_scenario
from omniwheel._core import ffi, lib
from omniwheel.firmware_process import FirmwareProcess
from tests.hil_sim.echo_robot import Bench, EchoRobot, answer
from tests.waiting import receive_until

LOOK_US, NEAR_US = lib.OMNI_POLL_MAX_us, lib.OMNI_POLL_SHORT_WAIT_us

many_processors = pytest.mark.skipif(lib.omni_poll_processors() < 2, reason="needs two processors")
needs_linux = pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processors cannot be chosen here")


def poll_backoff(looks: bool = True) -> Any:
    made = ffi.new("omni_poll_backoff_t *")
    made.enabled = looks
    return made


def wait(p: Any, waited_us: int) -> bool:
    """Let one wait pass; return whether it was looked."""
    looked = bool(lib.omni_poll_backoff_should_poll(p))
    lib.omni_poll_backoff_record(p, looked, waited_us)
    return looked


def sleeps_after_a_failure(p: Any) -> int:
    assert wait(p, LOOK_US + 1), "it looks"
    count = 0
    while not lib.omni_poll_backoff_should_poll(p):
        wait(p, NEAR_US - 1)
        count += 1
    return count


def test_who_waits_in_vain_sleeps_more_and_more() -> None:
    p = poll_backoff()
    assert [sleeps_after_a_failure(p) for _ in range(10)] == [0, 2, 6, 14, 30, 62, 126, 254, 254, 254]
    assert p.failed_polls == 10


def test_success_makes_up_for_failures() -> None:
    p = poll_backoff()
    for _ in range(5):
        sleeps_after_a_failure(p)
    for _ in range(200):
        assert wait(p, 10)
    assert sleeps_after_a_failure(p) == 0


def test_an_idle_or_paced_link_is_not_looked_at() -> None:
    p = poll_backoff()
    looks = [wait(p, 1000) for _ in range(1000)]
    assert sum(looks) == 2
    assert not any(looks[2:])


def test_a_link_that_gets_busy_again_is_looked_at() -> None:
    p = poll_backoff()
    for _ in range(1000):
        wait(p, 1000)
    assert any(wait(p, 100) for _ in range(5))


def test_asleep_means_asleep() -> None:
    p = poll_backoff(looks=False)
    assert not any(wait(p, 10) for _ in range(500))
    assert (p.polled, p.slept) == (0, 500)


def on_one_processor(action: Callable[[], None]) -> None:
    """Do it in a thread of its own that may use one processor only."""

    def run() -> None:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        action()

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()


@needs_linux
def test_one_processor_is_not_wasted() -> None:
    p = ffi.new("omni_poll_backoff_t *")
    on_one_processor(lambda: lib.omni_poll_backoff_init(p, True))
    assert not p.enabled
    lib.omni_poll_backoff_init(p, True)
    assert p.enabled == (lib.omni_poll_processors() > 1)


def late(robot: EchoRobot, sensors: Any) -> None:
    """Answer in two pieces, and beyond what is looked for."""
    data = robot.answer_bytes(sensors)
    robot.sock.sendall(data[:30])
    time.sleep(2.0 * LOOK_US * 1e-6 * (sensors.sequence % 3))
    robot.sock.sendall(data[30:])


@contextmanager
def echo(dialect: ModuleType, looks: bool, respond: Callable[[EchoRobot, Any], None] = answer) -> Iterator[Bench]:
    bench = Bench(dialect, looks=looks)
    bench.robot(respond)
    try:
        yield bench
    finally:
        bench.close()


def test_looking_changes_nothing_in_the_world(dialect: ModuleType, make_world: Any) -> None:
    ends = []
    for looks, respond in [(True, answer), (False, answer), (True, late), (False, late)]:
        world, record = make_world(slip_max=0.1), Record(100)
        with echo(dialect, looks, respond) as bench:
            assert bench.run(world, 60, record) == lib.HIL_OK
        ends.append(bytes(ffi.buffer(world.c)) + record.samples.tobytes())
    assert len(set(ends)) == 1


@many_processors
def test_real_time_is_slept_through(dialect: ModuleType, make_world: Any) -> None:
    with echo(dialect, True) as bench:
        bench.link.realtime_factor = 5.0
        assert bench.run(make_world(), 30) == lib.HIL_OK
        p = bench.link.waiting.poll_backoff
        assert (p.polled, p.failed_polls, p.slept) == (0, 0, 0)
        bench.link.realtime_factor = 0.0
        assert bench.run(make_world(), 30) == lib.HIL_OK
        assert p.polled + p.failed_polls + p.slept > 0


def logged(folder: Path, waiting: Waiting) -> tuple[bytes, bytes]:
    folder.mkdir()
    run = run_hil(replace(load_scenario("demo"), duration_s=1.5), out_dir=folder, waiting=waiting)
    return (folder / "telemetry.tlog").read_bytes(), run.record.tobytes()


def test_the_firmware_says_the_same_looking_or_asleep_and_on_one_processor(tmp_path: Path) -> None:
    results = [logged(tmp_path / waiting, waiting) for waiting in (LOOKING, ASLEEP, MEASURED)]
    if hasattr(os, "sched_setaffinity"):
        on_one_processor(lambda: results.append(logged(tmp_path / "one", MEASURED)))
    assert len(results) > 1
    assert len(set(results)) == 1


def changing(ticks: int, every: int) -> tuple[bytes, list[bytes]]:
    """Drive with real firmware; change how both ends wait ``every`` so many ticks. Return the samples and frames."""
    scenario = load_scenario("demo")
    frames: list[bytes] = []
    with FirmwareProcess(parameters=scenario.parameter_values(), lockstep=True) as firmware:
        base = firmware.open_link()
        try:
            loop = HilLoop(scenario, base)
            loop.robot.connection.recorder = frames.append
            waiting = loop.link._lockstep.waiting
            waiting.may_change = False
            loop.robot.arm()
            samples = b""
            for part in range(ticks // 50):
                if every and part % every == 0:
                    waiting.prefers_looking = waiting.poll_backoff.enabled = not waiting.prefers_looking
                samples += loop.advance(50).tobytes()
            return samples, frames
        finally:
            base.close()


def test_a_change_of_the_way_in_mid_run_changes_nothing() -> None:
    results = [changing(1500, every) for every in (0, 1, 3)]
    assert results[0][1]
    assert all(result == results[0] for result in results)


def used_s(pid: int | None) -> float:
    """Return the processor time that a process has used."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) * 1e-9


@many_processors
@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="needs Linux's /proc")
@pytest.mark.parametrize(("paced", "lockstep"), [(False, True), (True, True), (True, False)])
def test_firmware_that_has_nothing_to_do_sleeps(paced: bool, lockstep: bool) -> None:
    """Idle after a run, or paced in real time: looking would use the whole of a processor."""
    scenario = load_scenario("stand")
    with FirmwareProcess(parameters=scenario.parameter_values(), lockstep=lockstep) as firmware:
        base = firmware.open_link()
        try:
            if not lockstep:
                omniwheel.robot.connect(base, heartbeat=False).enter_hil()
            loop = HilLoop(scenario, base)
            loop.advance(300)
            begin_s, begin_wall_s = used_s(firmware.pid), time.monotonic()
            if paced:
                loop.link.set_realtime_factor(1.0)
                loop.advance(500)
            else:
                time.sleep(0.5)
            assert used_s(firmware.pid) - begin_s < 0.5 * (time.monotonic() - begin_wall_s)
        finally:
            base.close()


def busy_share(firmware: FirmwareProcess, dialect: ModuleType, *, host_sleeps: int, ticks: int = 2000) -> float:
    """Let a host ask 0.1 ms after each answer; return the share of the time in which the firmware used a processor."""
    mav = dialect.MAVLink(None, srcSystem=254, srcComponent=1)
    zeros = [[0] * 4, 12.0, 0, 0, 0, [0] * 8, 0, [0.0] * 3, 0, [0.0] * 3, 0]
    sensors = dialect.MAVLink_omni_hil_sensors_message
    frames = [sensors(1000 * n, n, *zeros, host_sleeps).pack(mav) for n in range(1, ticks + 1)]
    answer_id = dialect.MAVLINK_MSG_ID_OMNI_HIL_ACTUATORS.to_bytes(3, "little")
    base = firmware.open_link()
    begin_s = begin_wall_s = 0.0
    try:
        for number, frame in enumerate(frames):
            if number == 100:  # the first ones are told before it obeys
                begin_s, begin_wall_s = used_s(firmware.pid), time.monotonic()
            base.write(frame)
            receive_until(base.read, lambda data: answer_id in data, "no answer")
            ready_s = time.monotonic() + 100e-6
            while time.monotonic() < ready_s:
                pass
        return (used_s(firmware.pid) - begin_s) / (time.monotonic() - begin_wall_s)
    finally:
        base.close()


@many_processors
@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="needs Linux's /proc")
def test_firmware_sleeps_if_its_host_says_that_it_does(dialect: ModuleType) -> None:
    """Firmware that looks uses 98 % here on a quiet computer. How much it looks on a busy one is its own choice."""
    with FirmwareProcess(lockstep=True) as firmware:
        assert busy_share(firmware, dialect, host_sleeps=1) < 0.5
