# SPDX-License-Identifier: MIT
"""The links of an image as others see them: MAVProxy, pymavlink, terminals, clients that come and go, restarts."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from pymavlink import mavutil

import omniwheel.robot
from hil_sim.image_firmware import ImageFirmware
from omniwheel.errors import FirmwareStartError, LinkError
from omniwheel.robot import Robot
from tests.host.test_mavproxy import (
    MavProxy,
    test_mavproxy_downloads_sets_arms_sees_the_pose_and_disarms,  # noqa: F401
)
from tests.waiting import wait_until

PATIENCE_S = 60.0
OMNI = str(Path(sys.executable).with_name("omni"))


@pytest.fixture
def proxy(image: Path, tmp_path: Path) -> Iterator[MavProxy]:
    command = [OMNI, "sitl", "--image", str(image), "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        try:
            assert process.stdout is not None
            with MavProxy(json.loads(process.stdout.readline())["links"][0], tmp_path) as proxy:
                yield proxy
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(PATIENCE_S)


def connect(url: str) -> Robot:
    """Connect to a robot that a busy machine emulates slowly."""
    return omniwheel.robot.connect(url, timeout_s=PATIENCE_S)


def connect_when_back(url: str) -> Robot:
    """Connect to a board that may be restarting."""

    def attempt() -> Robot | None:
        try:
            return omniwheel.robot.connect(url)
        except LinkError:
            return None

    found = wait_until(attempt, "the board did not come back")
    assert found is not None
    return found


def test_pymavlink_talks_to_both_links_at_once(image: Path) -> None:
    with ImageFirmware(image, links=["usb=tcp:127.0.0.1:0", "uart=tcp:127.0.0.1:0"], scenario="stand") as firmware:
        links = [mavutil.mavlink_connection(url) for url in firmware.urls]
        try:
            for link in links:
                beat = link.wait_heartbeat(timeout=PATIENCE_S)
                assert beat is not None
                link.param_fetch_one("CTL_PERIOD")
                value = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=PATIENCE_S)
                assert value is not None
                assert value.param_id == "CTL_PERIOD"
        finally:
            for link in links:
                link.close()
        assert firmware.messages == ""


def test_each_client_is_a_session_of_its_own(image: Path) -> None:
    with ImageFirmware(image, scenario="stand") as firmware:
        for number in range(3):
            with connect(firmware.urls[0]) as robot:
                assert robot.version is not None, number
        with connect(firmware.urls[0]) as robot:
            robot.arm()
            robot.disarm()


def test_a_terminal_is_a_serial_port_with_a_name_of_ones_choice(image: Path, tmp_path: Path) -> None:
    name = tmp_path / "teensy"
    with ImageFirmware(image, links=[f"usb=pty:{name}"], scenario="stand") as firmware:
        assert name.is_symlink()
        assert firmware.urls == (str(name),)
        for _ in range(2):
            with connect(str(name)) as robot:
                assert robot.parameters["CTL_PERIOD"] >= 1
    assert not name.exists()


def test_saved_parameters_outlive_the_power(image: Path, tmp_path: Path) -> None:
    storage = tmp_path / "memory"
    with (
        ImageFirmware(image, storage=storage, scenario="stand") as firmware,
        connect(firmware.urls[0]) as robot,
    ):
        robot.parameters.set_many({"ISMC_LAM_XY": 7.5})
        robot.store()
    assert storage.stat().st_size == 60 * 1024
    with (
        ImageFirmware(image, storage=storage, scenario="stand") as firmware,
        connect(firmware.urls[0]) as robot,
    ):
        assert robot.parameters["ISMC_LAM_XY"] == 7.5
    with ImageFirmware(image, scenario="stand") as firmware, connect(firmware.urls[0]) as robot:
        assert robot.parameters["ISMC_LAM_XY"] != 7.5


def listen_until_it_hangs_up(robot: Robot) -> None:
    for _ in range(1000):
        robot.pump(0.1)


def test_a_board_that_restarts_hangs_up_and_comes_back(image: Path) -> None:
    with ImageFirmware(image, scenario="stand") as firmware:
        with connect(firmware.urls[0]) as robot:
            robot.reboot()
            with pytest.raises(LinkError):
                listen_until_it_hangs_up(robot)
        with connect_when_back(firmware.urls[0]) as robot:
            assert robot.version.serial_number == 15048881  # burnt into the chip; what the USB port tells, too


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "cannot read the firmware image"), (b"\x7fELF and no more", "is not an image"), (b"hello", "Intel hex")],
)
def test_a_file_that_is_no_image_is_refused_with_a_hint(tmp_path: Path, content: bytes | None, said: str) -> None:
    path = tmp_path / "firmware.elf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FirmwareStartError) as caught, ImageFirmware(path):
        pass
    assert said in str(caught.value)
    assert "make firmware" in caught.value.hint


@pytest.mark.parametrize("link", ["usb=udp:127.0.0.1:1", "radio=pty", "tcp:127.0.0.1:99999"])
def test_a_link_that_the_board_has_not_is_refused(image: Path, link: str) -> None:
    with pytest.raises(FirmwareStartError, match="link '"), ImageFirmware(image, links=[link]):
        pass


def test_a_storage_file_that_is_none_is_refused_and_left_alone(image: Path, tmp_path: Path) -> None:
    storage = tmp_path / "memory"
    storage.write_bytes(b"my thesis")
    with (
        pytest.raises(FirmwareStartError, match="do not fit the parameter memory"),
        ImageFirmware(image, storage=storage),
    ):
        pass
    assert storage.read_bytes() == b"my thesis"
