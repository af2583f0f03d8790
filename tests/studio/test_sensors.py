# SPDX-License-Identifier: MIT
"""Gyro and floor-motion sensor on the page: what the real firmware tells of them, and nothing where there is none."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from playwright.sync_api import Page, expect
from websockets.sync.client import connect

from omni.studio.session import PLOT_RATE_HZ, Session, begin_telemetry, end_telemetry, set_automatic_rate, set_rate
from omniwheel.sensor_messages import RADIO_RATE_HZ
from tests.studio.parts import WAIT_MS, Opener, Program, studio, take_over, until
from tests.studio.test_hostile import socket_url
from tests.waiting import receive_until

USB, RADIO = "tcp:127.0.0.1:5760", "/dev/ttyUSB0,9600"
HEADER = 16
"""Bytes of a message of samples."""
BLOCK = struct.Struct("<II")
"""Behind it: a signal's place and number of samples."""
GYRO_ONLY = {"GYRO_AXIS": 3.0, "FLOW_MODE": 0.0}


@pytest.fixture(scope="module", params=["gyro", "flow"])
def sensing(request: pytest.FixtureRequest) -> Iterator[tuple[Program, str]]:
    """A studio with a simulated robot that has one of the two."""
    with studio(request.param) as program:
        program.hear_robot()
        yield program, request.param


def text(page: Page, name: str, pattern: str) -> None:
    until(page, f"{pattern}.test(document.getElementById('{name}').textContent)")
    expect(page.locator(f"#{name}")).to_be_visible(timeout=WAIT_MS)


def hidden(page: Page, *names: str) -> None:
    for name in names:
        expect(page.locator(f"#{name}")).to_be_hidden(timeout=WAIT_MS)


def signals(page: Page) -> list[str]:
    """Return the keys that the dialog of a plot offers."""
    page.locator(".panel button", has_text="Signals").first.click()
    page.wait_for_selector("#signal-list input")
    found: list[str] = page.evaluate(
        "() => [...document.querySelectorAll('#signal-list input')].map((one) => one.value)"
    )
    page.click("#close-signals")
    return found


def set_axis(page: Page, value: str) -> None:
    page.fill("#search", "GYRO_AXIS")
    page.fill("#field-GYRO_AXIS", value)
    page.press("#field-GYRO_AXIS", "Enter")


def test_the_page_has_a_line_for_the_sensor_that_the_robot_has(sensing: tuple[Program, str], open_page: Opener) -> None:
    program, scenario = sensing
    page = open_page(program.url)
    until(page, "robot?.sensors.length === 1")
    has, has_not = ("gyro", "floor") if scenario == "gyro" else ("floor", "gyro")
    words = r"/^gyro: used, bias [+-]0\.\d{5} rad\/s, sd 0\.\d{5}$/" if has == "gyro" else "/^floor odometry: used 0, /"
    text(page, f"{has}-text", words)
    hidden(page, f"{has}-advice", f"{has_not}-text", f"{has_not}-advice")
    keys = signals(page)
    assert ("gyro.rate" in keys, "flow.nis" in keys) == (scenario == "gyro", scenario == "flow")


@pytest.mark.full
def test_its_numbers_come_to_be_plotted(sensing: tuple[Program, str]) -> None:
    program, scenario = sensing
    key = "gyro.rate" if scenario == "gyro" else "flow.nis"
    with connect(socket_url(program)) as socket:
        socket.send(json.dumps({"do": "show", "signals": [key], "id": 1}))

        def holds_samples(message: str | bytes) -> bool:
            return isinstance(message, bytes) and len(message) > HEADER and BLOCK.unpack_from(message, HEADER)[1] > 0

        receive_until(socket.recv, holds_samples, "no samples")


def test_a_robot_without_sensors_shows_none(shared_studio: Program, open_page: Opener) -> None:
    page = open_page(shared_studio.url)
    until(page, "robot?.pose")
    hidden(page, "gyro-text", "gyro-advice", "floor-text", "floor-advice")
    assert not [key for key in signals(page) if key.startswith(("gyro.", "flow."))]
    assert shared_studio.state()["robot"]["sensors"] == []


def test_a_sensor_that_is_switched_on_later_appears_and_goes_again(open_page: Opener) -> None:
    """The world has none: the robot says so of a sensor that it is told to have."""
    with studio("sitl") as program:
        page = open_page(program.url)
        until(page, "robot?.pose")
        take_over(page)
        set_axis(page, "3")
        text(page, "gyro-text", "/^gyro: not used: estimate from the wheels only$/")
        text(page, "gyro-advice", "/omni bringup gyro/")
        assert "gyro.bias" in signals(page)
        set_axis(page, "0")
        hidden(page, "gyro-text", "gyro-advice")
        until(page, "robot.sensors.length === 0")
        assert "gyro.bias" not in signals(page)


# ---- how often a robot is asked


class Asked:
    """A robot that notes what it is asked for."""

    def __init__(self, url: str, known: dict[str, float]) -> None:
        self.url = url
        self.rates: dict[str, float | None] = {}
        self.parameters = SimpleNamespace(known=known)

    def set_message_interval(self, name: str, rate_hz: float | None) -> None:
        self.rates[name] = rate_hz


def asked(url: str, known: dict[str, float]) -> Any:
    return Asked(url, known)


def test_on_a_fast_link_a_sensor_comes_as_often_as_all_that_is_plotted() -> None:
    robot = asked(USB, GYRO_ONLY)
    begin_telemetry(robot)
    assert robot.rates["OMNI_GYRO"] == robot.rates["OMNI_TRACKING"] == PLOT_RATE_HZ
    assert "OMNI_FLOW" not in robot.rates, "it has none"
    set_rate(robot, 20.0)
    assert robot.rates["OMNI_GYRO"] == 20.0
    set_automatic_rate(robot)
    assert robot.rates["OMNI_GYRO"] == PLOT_RATE_HZ
    end_telemetry(robot)
    assert set(robot.rates.values()) == {None}


def test_on_a_slow_radio_it_comes_rarely_and_the_radio_keeps_its_own_rates() -> None:
    robot = asked(RADIO, GYRO_ONLY)
    begin_telemetry(robot)
    assert robot.rates == {"OMNI_GYRO": RADIO_RATE_HZ}
    set_rate(robot, 20.0)
    set_automatic_rate(robot)
    assert robot.rates.pop("OMNI_GYRO") == RADIO_RATE_HZ
    assert set(robot.rates.values()) == {None}
    robot.rates.clear()
    end_telemetry(robot)
    assert robot.rates == {"OMNI_GYRO": None}


@pytest.mark.full
def test_a_sensor_that_comes_up_leaves_the_rate_that_was_chosen() -> None:
    robot = asked(USB, GYRO_ONLY)
    robot.parameters.complete = True
    set_rate(robot, 20.0)
    session = SimpleNamespace(sensors=())
    Session._update_sensor_streams(cast("Session", session), robot)
    assert robot.rates["OMNI_TRACKING"] == 20.0
    assert robot.rates["OMNI_GYRO"] == PLOT_RATE_HZ
    assert [sensor.name for sensor in session.sensors] == ["gyro"]
