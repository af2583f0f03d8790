# SPDX-License-Identifier: MIT
"""The real MAVProxy against the emulated processor: the same conversation as with the PC firmware."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.arm import need_emulated_firmware
from tests.host.test_mavproxy import (
    MavProxy,
    test_mavproxy_downloads_sets_arms_sees_the_pose_and_disarms,  # noqa: F401
)


@pytest.fixture
def proxy(tmp_path: Path) -> Iterator[MavProxy]:
    need_emulated_firmware()
    command = [str(Path(sys.executable).with_name("omni")), "sitl", "--board", "cortex-m7", "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        try:
            assert process.stdout is not None
            with MavProxy(json.loads(process.stdout.readline())["links"][0], tmp_path) as proxy:
                yield proxy
        finally:
            process.terminate()
            process.wait(60.0)
