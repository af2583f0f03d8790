# SPDX-License-Identifier: MIT
"""The window in which a robot is chosen, in a real browser: what runs the firmware, and firmware for a board."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.arm import need_emulated_firmware
from tests.host.hex_files import teensy_program, write_hex
from tests.image import flashed
from tests.needs import need
from tests.studio.parts import Opener, studio, until


def choose(page: Page, processor: str) -> None:
    page.click("#choose")
    until(page, "document.getElementById('processor').options.length > 0")
    page.select_option("#processor", processor)


def test_a_missing_emulator_is_said_before_and_after_it_is_tried(
    open_page: Opener, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with studio() as program:
        page = open_page(program.url)
        choose(page, "emulated")
        words = page.text_content("#processor-problem") or ""
        assert "qemu-system-arm is not installed. Debian: apt-get install qemu-system-arm" in words
        page.click("#simulate-form button")
        until(page, "document.getElementById('connect-trouble').textContent.includes('is not installed. Debian')")
        page.select_option("#processor", "image")
        page.fill("#image", "")
        page.click("#simulate-form button")
        until(page, "document.getElementById('connect-trouble').textContent.includes('image')")
        file = write_hex(tmp_path / "firmware.hex", teensy_program())
        page.select_option("#flash-what", "")
        page.fill("#flash-file", str(file))
        page.get_by_role("button", name="Check", exact=True).click()
        until(page, "document.getElementById('flash-text').textContent.includes('The image is valid')")
        assert "nothing was uploaded" in (page.text_content("#flash-lines") or "")
        stop = page.locator("#connect-dialog .stop").bounding_box()
        assert stop is not None
        assert stop["y"] + stop["height"] < 950  # however much stands above it


@pytest.mark.nightly
def test_the_emulated_processor_drives(open_page: Opener) -> None:
    need_emulated_firmware()
    with studio() as program:
        page = open_page(program.url)
        choose(page, "emulated")
        page.click("#simulate-form button")
        until(page, "state.link.phase === 'connected' && robot?.pose")
        assert "emulated Cortex-M7" in (page.text_content("#fact-link") or "")
        until(page, "/lost, \\d+ ms, .* of 200 kB/.test(document.getElementById('fact-quality').textContent)")
        page.click("#arm")
        until(page, "robot.armed")
        page.keyboard.press("Space")
        until(page, "robot.state === 'estop'")


@pytest.mark.nightly
def test_the_flashed_image_drives(open_page: Opener) -> None:
    image = flashed.image_path()
    need("image")
    with studio() as program:
        page = open_page(program.url)
        choose(page, "image")
        page.fill("#image", str(image))
        page.select_option("#robot-file", "three_wheel")
        page.click("#simulate-form button")
        until(page, "state.link.phase === 'connected' && robot?.pose")
        assert page.is_hidden("#simulator")
        page.click("#arm")
        until(page, "robot.armed")
        page.keyboard.press("Space")
        until(page, "robot.state === 'estop'")
