# SPDX-License-Identifier: MIT
"""The real studio in a real browser: Debian's Chromium, without a window."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from tests.needs import need
from tests.studio.parts import SAFE, WAIT_MS, WITHOUT_WINDOW, Opener, Program, studio, take_over, until


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    need("browser")
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=WITHOUT_WINDOW, args=SAFE)
        yield found
        found.close()


@pytest.fixture(scope="session")
def shared_studio(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """A studio with a simulated robot, for tests that leave it disarmed."""
    with studio("sitl", "--out", str(tmp_path_factory.mktemp("shared") / "runs")) as program:
        program.hear_robot()
        yield program


@pytest.fixture(scope="module")
def simulated() -> Iterator[Program]:
    """A studio with a simulated robot, for the tests of one file."""
    with studio("sitl") as program:
        program.hear_robot()
        yield program


@pytest.fixture(scope="module")
def shared_page(shared_studio: Program, browser: Browser) -> Iterator[Page]:
    """A page of the shared studio that is in command, for the tests of one file; they leave the robot disarmed."""
    errors: list[str] = []
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.set_default_timeout(WAIT_MS)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(shared_studio.url)
    until(page, "robot?.pose")
    take_over(page)
    yield page
    page.close()
    assert errors == []


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Opener]:
    """Open an address in a browser of its own; an error of the page's script fails the test."""
    errors: list[str] = []
    with ExitStack() as stack:

        def opened(url: str, width: int = 1500, height: int = 950) -> Page:
            context = browser.new_context(viewport={"width": width, "height": height}, accept_downloads=True)
            stack.callback(context.close)
            page = context.new_page()
            page.set_default_timeout(WAIT_MS)
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.goto(url)
            return page

        yield opened
    assert errors == []
