# SPDX-License-Identifier: MIT
"""The bridge to the real firmware: in lockstep with a world (simulated time), and over a pseudo-terminal."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from typer.testing import CliRunner

from hil_sim.lockstep import LockstepLink
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omni.cli import app
from omniwheel import FirmwareProcess
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkTimeoutError, SetpointError
from omniwheel.frames import Pose
from omniwheel.link import open_link
from omniwheel.mocap import Bridge, BridgeSettings, MocapPose
from omniwheel.mocap.bridge import FRAME_BYTES, FRAME_BYTES_SD, MESSAGES, OVERHEAD_BYTES, BridgeCounts
from omniwheel.mocap.simulated import Cameras, SimulatedSource
from omniwheel.robot import connect
from omniwheel.telemetry import Tracking
from tests.host.mocap.natnet_server import Body, Server

MESSAGE_NAMES = {"compact": "OMNI_POSE_FIX", "vicon": "VICON_POSITION_ESTIMATE"}


class Lab:
    """Firmware in lockstep with a world whose only pose sensor is a bridge; all time is the world's."""

    def __init__(self, url: str, parameters: dict[str, Any]) -> None:
        scenario = load_scenario("demo")
        scenario = replace(scenario, world={**scenario.world, "fix_rate_Hz": 0.0}, start_pose=(0.2, 0.0, 0.0))
        self.world = new_world(scenario)
        base = open_link(url)
        robot = connect(base, heartbeat=False)
        robot.parameters.set_many(parameters)
        robot.enter_hil()
        self.link = LockstepLink(base, self.world)
        self.url = url
        self.history: list[Pose] = []
        self.sent: list[Any] = []
        self._codec = mavlink.MAVLink(None, 9, 9)
        self._remember()

    def _remember(self) -> None:
        self.history.append(Pose(*self.world.truth))

    def clock(self) -> float:
        return self.link.clock_s()

    def sleep(self, seconds: float) -> None:
        for _ in range(max(1, round(seconds * 1e3))):
            self.link.run(1)
            self._remember()

    def read(self, timeout_s: float) -> bytes:
        data = self.link.read(0.0)
        if not data and timeout_s > 0.0:
            self.sleep(1e-3)
            data = self.link.read(0.0)
        return data

    def write(self, data: bytes) -> None:
        for message in self._codec.parse_buffer(data) or ():
            self.sent.append((self.clock(), message))
        self.link.write(data)

    def close(self) -> None:
        self.link.close()

    def truth_at(self, time_s: float) -> Pose:
        return self.history[min(max(0, round(time_s * 1e3)), len(self.history) - 1)]

    def fixes(self, kind: str) -> list[tuple[float, Any]]:
        return [(time_s, m) for time_s, m in self.sent if m.get_type() == MESSAGE_NAMES[kind]]


class RadioLab(Lab):
    """The same through a 9600-baud radio: every byte takes its time on the wire, both ways, and waits for its turn."""

    byte_s = 10.0 / 9600.0
    radio_s = 0.012

    def __init__(self, url: str, parameters: dict[str, Any]) -> None:
        self.longest_wait_s = 0.0
        self._up: list[tuple[float, bytes]] = []
        self._down: list[tuple[float, bytes]] = []
        self._free_s = {"up": 0.0, "down": 0.0}
        super().__init__(url, parameters)

    def _due(self, way: str, data: bytes) -> tuple[float, bytes]:
        self._free_s[way] = max(self._free_s[way], self.clock()) + len(data) * self.byte_s
        return self._free_s[way] + self.radio_s, data

    def sleep(self, seconds: float) -> None:
        for _ in range(max(1, round(seconds * 1e3))):
            while self._up and self._up[0][0] <= self.clock():
                self.link.write(self._up.pop(0)[1])
            super().sleep(1e-3)
            data = self.link.read(0.0)
            if data:
                self._down.append(self._due("down", data))

    def read(self, timeout_s: float) -> bytes:
        if timeout_s > 0.0 and not (self._down and self._down[0][0] <= self.clock()):
            self.sleep(1e-3)
        return self._down.pop(0)[1] if self._down and self._down[0][0] <= self.clock() else b""

    def write(self, data: bytes) -> None:
        self.longest_wait_s = max(self.longest_wait_s, self._free_s["up"] - self.clock())
        for message in self._codec.parse_buffer(data) or ():
            self.sent.append((self.clock(), message))
        self._up.append(self._due("up", data))


@pytest.fixture
def lab() -> Iterator[Callable[..., Lab]]:
    with FirmwareProcess("three_wheel") as process:
        yield lambda **parameters: Lab(process.urls[0], parameters)


def cameras(lab: Lab, **settings: float) -> SimulatedSource:
    # The lab's history starts with the world; the source counts from when it is made.
    start_s = lab.clock()
    return SimulatedSource(
        lambda time_s: lab.truth_at(start_s + time_s), cameras=Cameras(**settings), clock=lab.clock, sleep=lab.sleep
    )


@pytest.mark.parametrize("kind", list(MESSAGES))
def test_the_robot_follows_late_fixes_because_they_are_stamped_in_its_time(lab: Callable[..., Lab], kind: str) -> None:
    here = lab(TRJ_TYPE="circle", TRJ_SIZE=0.2, TRJ_PERIOD=20.0, TRJ_ROT="fixed", EKF_GATE=0.0, FIX_DELAY=0.0)
    source = cameras(here, latency_s=0.08, sd_xy_m=0.0, sd_theta_rad=0.0)
    settings = BridgeSettings(message=kind, rate_Hz=20.0, budget_bytes_s=2000.0)
    with Bridge(source, here, settings, clock=here.clock) as bridge:
        bridge.run(1.0)
        bridge.robot.arm()
        bridge.robot.start_trajectory()
        worst_m = speed_m_s = 0.0
        for _ in range(200):
            bridge.robot.connection._send_heartbeat()  # the bridge is no ground station; here somebody must be
            bridge.run(0.02)
            tracking = bridge.robot.status.tracking
            if tracking is not None and here.clock() > 4.0:
                truth = here.truth_at(tracking.time_s)
                worst_m = max(worst_m, math.dist(tracking.pose[:2], truth[:2]))
                speed_m_s = max(speed_m_s, math.hypot(*here.world.twist[:2]))
        statistics = bridge.report()
    assert speed_m_s > 0.05  # 80 ms late fixes taken as of now would be off by 4 mm and more
    assert worst_m < 0.002
    assert statistics.latency_mean_s == pytest.approx(0.09, abs=0.02)
    assert abs(statistics.offset_s) < 0.005  # the robot's clock is the lab's
    for time_s, message in here.fixes(kind):
        taken_s = message.time_boot_ms * 1e-3 if kind == "compact" else message.usec * 1e-6
        assert 0.075 < time_s - taken_s < 0.14
        truth = here.truth_at(taken_s)
        y = message.y_mm * 1e-3 if kind == "compact" else -message.y
        assert y == pytest.approx(truth.y, abs=0.001)


def test_the_budget_holds_for_all_bytes_and_the_newest_pose_wins(lab: Callable[..., Lab]) -> None:
    here = lab()
    settings = BridgeSettings(message="vicon", rate_Hz=50.0, budget_bytes_s=480.0)
    source = cameras(here, rate_Hz=100.0, latency_s=0.01)
    with Bridge(source, here, settings, clock=here.clock) as bridge:
        here.sent.clear()
        start_s = here.clock()
        statistics = bridge.run(5.0)
    frames = [(time_s, len(message.get_msgbuf())) for time_s, message in here.sent]
    assert sum(size for _, size in frames) <= 480.0 * (here.clock() - start_s) + FRAME_BYTES["vicon"] + OVERHEAD_BYTES
    assert max(size for _, size in frames) <= FRAME_BYTES["vicon"]
    assert statistics.sent / 5.0 == pytest.approx(settings.possible_rate_Hz, rel=0.1)
    assert settings.possible_rate_Hz == 10.0
    assert statistics.overtaken + statistics.sent == pytest.approx(statistics.received, abs=2)
    assert statistics.latency_max_s < 0.03  # never a queue


@pytest.mark.parametrize("kind", list(MESSAGES))
def test_over_a_9600_baud_radio_the_robots_clock_is_known_to_milliseconds(kind: str) -> None:
    quiet = {"SR1_STATE": 1.0, "SR1_WHEELS": 0.0, "SR1_STATUS": 0.2, "EKF_GATE": 0.0}
    with FirmwareProcess("three_wheel", parameters=quiet) as process:
        here = RadioLab(process.urls[0], {})
        with Bridge(cameras(here), here, BridgeSettings(message=kind), clock=here.clock) as bridge:
            statistics = bridge.run(6.0)
    assert statistics.round_trip_s > 0.07  # two frames of 26 bytes and the radio, each way
    assert abs(statistics.offset_s) < 0.005  # the true offset is nil
    assert abs(statistics.offset_s) < statistics.offset_error_s
    assert statistics.bytes_sent <= 480.0 * here.clock() + FRAME_BYTES[kind] + OVERHEAD_BYTES
    assert here.longest_wait_s < 0.06  # behind one fix and one request at most
    assert statistics.sent / 6.0 > 0.85 * BridgeSettings(message=kind).possible_rate_Hz


def test_rate_and_frame_sizes(lab: Callable[..., Lab]) -> None:
    here = lab()
    with Bridge(cameras(here), here, BridgeSettings(rate_Hz=5.0), clock=here.clock) as bridge:
        bridge.run(4.0)
    fixes = here.fixes("compact")
    assert len(fixes) == pytest.approx(20, abs=1)
    assert all(len(message.get_msgbuf()) <= FRAME_BYTES["compact"] for _, message in fixes)


class Telling:
    """A source whose poses say how good they are."""

    def __init__(self, source: SimulatedSource, sd: float) -> None:
        self._source, self._sd = source, sd
        self.name, self.clock, self.close, self.ended = source.name, source.clock, source.close, False

    def read(self, timeout_s: float) -> MocapPose | None:
        pose = self._source.read(timeout_s)
        return None if pose is None else replace(pose, sd_xy_m=self._sd, sd_theta_rad=self._sd)


@pytest.mark.parametrize("kind", list(MESSAGES))
def test_how_good_a_pose_is_reaches_the_robot(lab: Callable[..., Lab], kind: str) -> None:
    """The robot believes a fix as far as its source does: twenty of 50 mm move it less than twenty of 1 mm."""
    claims, ways = [], []
    for sd in (0.001, 0.05, 0.0):
        here = lab(EKF_GATE=0.0, EKF_ADAPT=0.0)
        source = Telling(cameras(here, latency_s=0.02, sd_xy_m=0.0, sd_theta_rad=0.0), sd)
        with Bridge(source, here, BridgeSettings(message=kind, budget_bytes_s=3000.0), clock=here.clock) as bridge:
            bridge.robot.set_pose_estimate(0.25, 0.0, 0.0)  # it is at 0.2
            bridge.run(1.0)
            tracking = bridge.robot.wait_for(Tracking)
        claims.append(tracking.pose_sd[0])
        ways.append(0.25 - tracking.pose.x)
        sizes = {len(message.get_msgbuf()) for _, message in here.fixes(kind)}
        assert max(sizes) <= (FRAME_BYTES if sd == 0.0 else FRAME_BYTES_SD)[kind]
    assert claims[0] < 0.5 * claims[2] < 0.25 * claims[1]
    assert ways[0] > ways[2] > 1.2 * ways[1] > 0.0


def test_over_a_radio_a_long_message_does_not_say_how_good_it_is(lab: Callable[..., Lab]) -> None:
    """It would take 133 ms at 9600 baud: fewer fixes, and their times out of what the robot believes."""
    here = lab()
    source = Telling(cameras(here, rate_Hz=100.0, latency_s=0.01), 0.002)
    settings = BridgeSettings("vicon", rate_Hz=50.0, budget_bytes_s=480.0)
    with Bridge(source, here, settings, clock=here.clock) as bridge:
        here.sent.clear()
        start_s = here.clock()
        statistics = bridge.run(6.0)
    assert max(len(message.get_msgbuf()) for _, message in here.sent) <= FRAME_BYTES["vicon"]
    most = 480.0 * (here.clock() - start_s) + FRAME_BYTES["vicon"] + OVERHEAD_BYTES
    assert sum(len(message.get_msgbuf()) for _, message in here.sent) <= most
    assert statistics.sent / 6.0 == pytest.approx(settings.possible_rate_sd_Hz, rel=0.1)


@pytest.mark.parametrize("kind", list(MESSAGES))
@pytest.mark.parametrize("sd", [1e-30, 1e-9, 1e20, 1e200])
def test_no_standard_deviation_is_too_small_or_too_large_for_a_message(kind: str, sd: float) -> None:
    message = MESSAGES[kind](Pose(0.0, 0.0, 0.0), 1000, sd, sd)
    message.pack(mavlink.MAVLink(None))
    told = message.sd_theta_mrad10 * 1e-4 if kind == "compact" else math.sqrt(message.covariance[20])
    assert told == pytest.approx(1e-4 if sd < 1.0 else 6.5535)


def test_a_short_message_counts_its_own_rounding() -> None:
    message = MESSAGES["compact"](Pose(0.0, 0.0, 0.0), 1000, 0.0003, 0.0)
    assert message.sd_xy_mm10 == 5  # the root of 0.3 mm squared and 1 mm squared over twelve, rounded up
    assert message.sd_theta_mrad10 == 0


@pytest.mark.full
def test_a_stream_that_stops_is_silence_and_one_that_comes_back_goes_on(lab: Callable[..., Lab]) -> None:
    here = lab()
    source = cameras(here)
    with Bridge(source, here, clock=here.clock) as bridge:
        bridge.run(1.0)
        source._cameras = replace(source._cameras, drop_probability=1.0)
        bridge.run(0.5)
        before = len(here.fixes("compact"))
        bridge.run(2.0)
        assert len(here.fixes("compact")) == before
        source._cameras = replace(source._cameras, drop_probability=0.0)
        bridge.run(1.0)
        assert len(here.fixes("compact")) - before == pytest.approx(20, abs=3)


def test_old_and_unrepresentable_poses_are_counted_and_not_sent(lab: Callable[..., Lab]) -> None:
    here = lab()
    source = Queue(here)
    with Bridge(source, here, clock=here.clock) as bridge:
        here.sent.clear()
        now_s = here.clock()
        source.put(Pose(0.0, 0.0, 0.0), now_s - 0.3)
        bridge.step(0.0)
        source.put(Pose(40.0, 0.0, 0.0), now_s)
        bridge.step(0.0)
        statistics = bridge.report()
    assert (statistics.received, statistics.stale, statistics.refused, statistics.sent) == (2, 1, 1, 0)
    assert here.fixes("compact") == []


def sent_in_vain(here: Lab, pose: Pose) -> BridgeCounts:
    """Send one pose again and again to a robot that believes to be elsewhere."""
    source = Queue(here)
    with Bridge(source, here, clock=here.clock) as bridge:
        bridge.robot.set_pose_estimate(1.0, 1.0, 0.0)
        for _ in range(5):
            source.put(pose, here.clock())
            bridge.step(0.0)
            here.sleep(0.2)
        bridge.ask_used()
        return bridge.report()


def test_what_the_robot_refuses_is_told_with_its_reason(lab: Callable[..., Lab]) -> None:
    statistics = sent_in_vain(lab(), Pose(0.0, 0.0, 0.0))
    assert statistics.sent > 3
    assert statistics.used == 0
    assert statistics.in_vain
    assert len(statistics.reasons) == 1  # however often the robot says it


def test_what_no_message_can_express_is_told_with_its_reason(lab: Callable[..., Lab]) -> None:
    statistics = sent_in_vain(lab(), Pose(500.0, 0.0, 0.0))
    assert statistics.refused > 3
    assert statistics.in_vain
    assert len(statistics.reasons) == 1


def test_poses_that_are_used_are_counted(lab: Callable[..., Lab]) -> None:
    statistics = sent_in_vain(lab(), Pose(1.001, 1.0, 0.0))
    assert statistics.used == statistics.sent > 3
    assert not statistics.in_vain
    assert not statistics.reasons


def test_the_command_fails_if_not_one_pose_was_used(tmp_path: Any) -> None:
    recording = tmp_path / "far.csv"
    lines = [f"{0.05 * i:.2f},{0.05 * i:.2f},{i},500.0,0.0,0.0" for i in range(5)]
    recording.write_text("\n".join(["taken_s,arrived_s,frame,x_m,y_m,theta_rad", *lines]) + "\n")
    with FirmwareProcess() as process:
        words = ("--source", f"recorded:{recording}", "--link", process.urls[0])
        statistics = json.loads(run("mocap", "bridge", *words, "--json", code=1).stdout)
    assert statistics["reasons"]


class Queue:
    """A source of poses put in by hand."""

    name = "queue"
    ended = False

    def __init__(self, lab: Lab) -> None:
        self.clock = lab.clock
        self._poses: list[MocapPose] = []

    def put(self, pose: Pose, taken_s: float) -> None:
        self._poses.append(MocapPose(pose, taken_s, self.clock(), len(self._poses)))

    def read(self, timeout_s: float) -> MocapPose | None:
        return self._poses.pop(0) if self._poses else None

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    "bad", [{"message": "odometry"}, {"rate_Hz": 0.0}, {"budget_bytes_s": math.inf}, {"max_age_s": math.nan}]
)
def test_bad_settings_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(SetpointError, match="must be"):
        BridgeSettings(**bad)


def test_a_robot_that_does_not_answer_timesync_is_an_error(fake_robot: Callable[..., Any]) -> None:
    robot = fake_robot()
    source = SimulatedSource(clock=robot.clock, sleep=lambda seconds: None)
    with pytest.raises(LinkTimeoutError, match="TIMESYNC"):
        Bridge(source, robot, timeout_s=2.0, clock=robot.clock)
    assert robot.closed


def test_the_command_bridges_a_recording_over_a_serial_line(tmp_path: Any) -> None:
    recording = tmp_path / "still.csv"
    run("mocap", "record", str(recording), "--source", "simulated", "--for", "4")
    process = FirmwareProcess(links=["tcp:127.0.0.1:0", "pty"], parameters={"EKF_GATE": 0.0})
    with process, connect(process.urls[0]) as watcher:
        words = ("--source", f"recorded:{recording}", "--link", f"{process.urls[1]},9600", "--json")
        statistics = json.loads(run("mocap", "bridge", *words).stdout)
        last = watcher.wait_until(lambda s: s.control is not None and s.control.fixes_accepted > 0, 10.0, "fixed")
        watcher.pump(0.3)
        pose = watcher.wait_for(Tracking).pose
    assert statistics["sent"] > 5
    assert statistics["refused"] == 0
    assert last.control is not None
    assert math.hypot(pose.x, pose.y) == pytest.approx(0.5, abs=0.05)


@pytest.mark.full
def test_the_command_bridges_optitrack() -> None:
    """From the packets of a rigid body on the network to the robot's estimate."""
    turned = (0.0, 0.0, math.sin(0.35), math.cos(0.35))
    process = FirmwareProcess(links=["tcp:127.0.0.1:0", "tcp:127.0.0.1:0"], parameters={"EKF_GATE": 0.0})
    with Server(bodies=[Body(7, (0.4, -0.3, 0.1), turned)]) as server, process, connect(process.urls[0]) as watcher:
        words = ("--source", f"natnet:127.0.0.1:{server.port}/robot", "--link", process.urls[1])
        statistics = json.loads(run("mocap", "bridge", *words, "--duration", "2", "--json").stdout)
        last = watcher.wait_until(lambda s: s.control is not None and s.control.fixes_accepted > 20, 10.0, "fixed")
        watcher.pump(0.3)
        pose = watcher.wait_for(Tracking).pose
    assert statistics["sent"] > 20
    assert last.control is not None
    assert (pose.x, pose.y, pose.theta) == pytest.approx((0.4, -0.3, 0.7), abs=0.05)


def test_mocap_errors_are_one_line(tmp_path: Any) -> None:
    result = run("mocap", "record", str(tmp_path / "x.csv"), "--source", "optitrack", code=2)
    assert "vicon:HOST/OBJECT" in result.stderr
    result = run("mocap", "bridge", "--source", "simulated", "--as", "odometry", "--link", "tcp:127.0.0.1:9", code=2)
    assert "compact, vicon" in result.stderr
    (tmp_path / "there.csv").write_text("", encoding="ascii")
    result = run("mocap", "record", str(tmp_path / "there.csv"), "--source", "simulated", code=2)
    assert "exists already" in " ".join(result.stderr.split())


def run(*words: str, code: int = 0) -> Any:
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == code, (result.output, result.stderr, result.exception)
    return result
