# SPDX-License-Identifier: MIT
"""The real, unmodified MAVProxy as a user runs it: it needs to know nothing of this project."""

from __future__ import annotations

import os
import re
import selectors
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

import pytest

from omniwheel.burst import parse_burst
from omniwheel.robots import parameter_table
from tests.waiting import Deadline, wait_until

PROGRAM = Path(sys.executable).parent / "mavproxy.py"


class MavProxy:
    """MAVProxy with its terminal on pipes."""

    def __init__(self, url: str, folder: Path) -> None:
        self.output = ""
        self.log = folder / "mav.tlog"
        self._seen = 0
        self._process = subprocess.Popen(
            [sys.executable, "-u", str(PROGRAM), f"--master={url}", "--mav20", f"--state-basedir={folder}",
             f"--logfile={self.log}"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=folder,
            env={**os.environ, "HOME": str(folder)},
        )  # fmt: skip

    def enter(self, line: str) -> None:
        """Type a command."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())
        self._process.stdin.flush()

    def expect(self, pattern: str) -> re.Match[str]:
        """Wait for output after the last match that matches ``pattern``."""
        assert self._process.stdout is not None
        deadline = Deadline(lambda: f"MAVProxy did not print {pattern!r}; it printed:\n{self.output}")
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            while not (match := re.compile(pattern).search(self.output, self._seen)):
                if not selector.select(deadline.left_s()):
                    continue
                piece = os.read(self._process.stdout.fileno(), 65536)
                if not piece:
                    pytest.fail(f"MAVProxy ended before it printed {pattern!r}:\n{self.output}")
                self.output += piece.decode(errors="replace")
        self._seen = match.end()
        return match

    def fetch(self, name: str) -> float:
        """Have a parameter read back from the robot; `param set` itself returns before the robot has it."""
        self.enter(f"param fetch {name}")
        return float(self.expect(rf"{name} = ([-+.\d]+)").group(1))

    def __enter__(self) -> MavProxy:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()


@pytest.fixture
def proxy(url: str, tmp_path: Path) -> Iterator[MavProxy]:
    with MavProxy(url, tmp_path) as proxy:
        yield proxy


@pytest.mark.full
@pytest.mark.mavproxy
def test_mavproxy_downloads_sets_arms_sees_the_pose_and_disarms(proxy: MavProxy) -> None:
    count = len(parameter_table())
    proxy.expect(rf"Received {count} parameters")

    proxy.enter("param show ISMC_LAM_XY")
    proxy.expect(r"ISMC_LAM_XY +12\.0")
    proxy.enter("param set ISMC_LAM_XY 15")
    wait_until(lambda: proxy.fetch("ISMC_LAM_XY") == 15.0, "the parameter was not set")

    proxy.enter("arm throttle")
    proxy.expect("COMPONENT_ARM_DISARM: ACCEPTED")
    proxy.expect("ARMED")
    proxy.enter("watch LOCAL_POSITION_NED")
    proxy.expect(r"LOCAL_POSITION_NED \{time_boot_ms : \d+, x : -?\d")
    proxy.enter("disarm")
    proxy.expect("DISARMED")
    assert "fence breach" not in proxy.output


@pytest.mark.full
@pytest.mark.mavproxy
def test_mavproxy_lists_and_downloads_a_burst(proxy: MavProxy, url: str, tmp_path: Path) -> None:
    proxy.expect(r"Received \d+ parameters")
    proxy.enter("long 60118 0.2 1 32 0 0 0 0")
    proxy.expect(r"command : 60118, result : 0")

    def listed() -> bool:
        proxy.enter("log list")
        return proxy.expect(r"No logs|numLogs 1 ").group() != "No logs"

    wait_until(listed, "the burst was not finished")
    proxy.enter("log download 0 burst.bin")
    proxy.expect("Finished downloading")
    burst = parse_burst((tmp_path / "burst.bin").read_bytes())
    assert burst["pose"].shape == (200, 3)
