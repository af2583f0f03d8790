# SPDX-License-Identifier: MIT
"""The whole road: rendered pictures of a driving robot, the camera's poses, the bridge, the real firmware."""

from __future__ import annotations

import math
from pathlib import Path

from omniwheel import FirmwareProcess
from omniwheel.mocap import Bridge, BridgeSettings
from omniwheel.mocap.camera.frames import Frame
from omniwheel.mocap.camera.source import CameraSource
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
    assert all(0 < message.sd_xy_mm10 < 30 for _, message in lab.fixes("compact"))
    for _, message in lab.fixes("compact"):
        truth = lab.truth_at(message.time_boot_ms * 1e-3)
        assert math.dist((message.x_mm * 1e-3, message.y_mm * 1e-3), truth[:2]) < 0.002
