# SPDX-License-Identifier: MIT
"""The whole road: rendered pictures of a driving robot, the camera's poses, the bridge, the real firmware."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.figures.gyro import start_run
from hil_sim.faults import Fault
from hil_sim.scenario import load_scenario
from omniwheel import FirmwareProcess
from omniwheel._core import lib
from omniwheel.frames import Pose
from omniwheel.mocap import Bridge, BridgeSettings
from omniwheel.mocap.camera.frames import Frame
from omniwheel.mocap.camera.geometry import Located
from omniwheel.mocap.camera.source import CameraSource, claim
from tests.host.mocap.rendered.lab import FLOOR, SMALL, scene, watcher
from tests.host.mocap.rendered.scene import Scene, Sheet, View
from tests.host.mocap.test_bridge import Lab

RATE_HZ = 10.0
LATENCY_S = 0.06
SETTLED_S = 3.5
"""By then the filter has forgotten its wrong start."""
NEAR = tuple(Sheet(tag.tag, 0.7 * tag.x, 0.7 * tag.y, tag.heading) for tag in FLOOR)
SCENE = scene(View(SMALL, (0.05, -0.6, 1.5), (0.0, 0.0, 0.0), 0.1), floor=NEAR)


class Filmed:
    """Pictures of the lab's robot. Each comes ``LATENCY_S`` late, and its time is that at which it comes."""

    ended = False

    def __init__(self, lab: Lab, of: Scene) -> None:
        self._lab = lab
        self._scene = of
        self._number = 0

    def read(self, timeout_s: float) -> Frame | None:
        comes_s = (self._number + 1) / RATE_HZ + LATENCY_S
        left_s = comes_s - self._lab.clock()
        if left_s > 0.0 and timeout_s > 0.0:
            self._lab.sleep(min(left_s, timeout_s))
        if left_s > timeout_s:
            return None
        self._number += 1
        picture = self._scene.picture(self._lab.truth_at(comes_s - LATENCY_S), self._number)
        return Frame(picture, comes_s, self._number)

    def close(self) -> None:
        """Nothing to close."""


@pytest.mark.full
def test_a_robot_that_did_not_know_its_place_drives_by_the_camera(tmp_path: Path) -> None:
    """It stands 0.2 m from where it starts to believe; the camera alone can tell it."""
    path = {"TRJ_TYPE": "circle", "TRJ_SIZE": 0.2, "TRJ_PERIOD": 20.0, "TRJ_ROT": "fixed", "EKF_GATE": 0.0}
    with FirmwareProcess("three_wheel") as process:
        # The camera says how sure it is. A filter that takes its poses for 5 mm needs longer than this test.
        lab = Lab(process.urls[0], {**path, "FIX_DELAY": 0.0})
        source = CameraSource(
            "camera", Filmed(lab, SCENE), watcher(tmp_path, SCENE), latency_s=LATENCY_S, clock=lab.clock
        )
        with Bridge(source, lab, BridgeSettings(budget_bytes_s=2000.0), clock=lab.clock) as bridge:
            bridge.run(1.0)
            bridge.robot.arm()
            bridge.robot.start_trajectory()
            worst_m = worst_rad = speed_m_s = 0.0
            for _ in range(150):
                bridge.robot.connection._send_heartbeat()  # the mocap bridge is no ground station
                bridge.run(0.02)
                tracking = bridge.robot.status.tracking
                if tracking is not None and lab.clock() > SETTLED_S:
                    truth = lab.truth_at(tracking.time_s)
                    worst_m = max(worst_m, math.dist(tracking.pose[:2], truth[:2]))
                    worst_rad = max(worst_rad, abs(math.remainder(tracking.pose[2] - truth.theta, math.tau)))
                    speed_m_s = max(speed_m_s, math.hypot(*lab.world.twist[:2]))
            statistics = bridge.report()
    assert statistics.sent > 30
    assert source.reasons == {}
    assert speed_m_s > 0.05  # 60 ms taken as of now would be off by 3 mm and more
    assert worst_m < 0.003
    assert worst_rad < 0.01
    assert all(0 < message.sd_xy_mm10 < 30 for _, message in lab.fixes("compact")[1:])
    for _, message in lab.fixes("compact"):
        truth = lab.truth_at(message.time_boot_ms * 1e-3)
        assert math.dist((message.x_mm * 1e-3, message.y_mm * 1e-3), truth[:2]) < 0.002


@pytest.mark.parametrize("late_s", [0.0, 0.01, 0.03])
def test_what_a_camera_claims_makes_no_filter_refuse_its_poses(late_s: float) -> None:
    """At 0.8 m/s, with pictures that are older than the robot is told. The corners alone claim half a millimetre."""
    sharp = np.diag([0.0005, 0.0005, 0.0007]) ** 2
    found = Located(Pose(0.0, 0.0, 0.0), 0.1, sharp, np.zeros((3, 3)))
    errors = []
    for sds in (claim(found, 0.8, 1.0), (0.005, 0.005)):
        scenario = load_scenario("fast").with_seed(3)
        path = {"TRJ_TYPE": 3.0, "TRJ_SIZE": 0.5, "TRJ_PERIOD": 4.0, "TRJ_LAPS": 0.0, "TRJ_ROT": 2.0}
        swing = {"TRJ_ROT_AMP": 0.5, "TRJ_ROT_N": 2.0, "EKF_R_XY": sds[0], "EKF_R_TH": sds[1]}
        fixes = {"fix_rate_Hz": 20.0, "fix_sd_xy_m": 0.0005, "fix_sd_theta_rad": 0.0007, "fix_delay_s": 0.06}
        late = (Fault("pose_delay", 0.0, 1e9, value=late_s),) if late_s else ()
        scenario = replace(scenario.with_parameters({**path, **swing}).with_world(fixes), faults=late)
        run, _config = start_run(scenario, "late pictures", 1000)
        off, speeds, refused = [], [], run.robot.estimator.pose_ekf.refused
        for _ in range(600):
            lib.hil_run_advance(run, 20)
            pose, truth = run.robot.estimator.pose_ekf.pose, run.world.pose
            off.append(math.hypot(pose.x - truth[0], pose.y - truth[1]))
            speeds.append(math.hypot(*run.world.twist[0:2]))
        assert np.mean(speeds[200:]) > 0.7
        assert run.robot.estimator.pose_ekf.refused == refused
        assert not run.outputs.faults & lib.OMNI_FAULT_STOP_MASK
        errors.append(float(np.sqrt(np.mean(np.square(off[200:])))))
    assert errors[0] < 1.2 * errors[1]
