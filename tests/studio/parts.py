# SPDX-License-Identifier: MIT
"""The studio as a program, and how to wait for what its page shows."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.request import urlopen

import pytest
from playwright.sync_api import Page

from tests.waiting import LONGEST_S, wait_until

os.environ.setdefault("OMNI_STATE_DIR", tempfile.mkdtemp(prefix="omni-state-"))  # what a person sees stays alone
SHELL = shutil.which("chromium-headless-shell")
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome") or SHELL
"""A browser that a person would use: for figures and pictures."""
WITHOUT_WINDOW = SHELL or CHROMIUM
"""For tests: the same engine without all that is around a page, if it is installed; it takes two thirds of the time."""
NIGHTLY = pytest.mark.nightly
"""A variant of a test whose other variants CI runs."""
WAIT_MS = 1000 * LONGEST_S
"""For what comes in a moment on an idle machine."""
Opener = Callable[..., Page]

SAFE = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]


@dataclass
class Program:
    """A program of ours that runs in the background; ``ready`` is what it said first."""

    process: subprocess.Popen[str]
    ready: dict[str, Any]

    @property
    def url(self) -> str:
        return str(self.ready["url"])

    def state(self) -> Any:
        with urlopen(f"{self.url}state.json") as answer:
            return json.load(answer)

    def hear_robot(self) -> None:
        """Wait until the robot has been heard: the studio is ready before."""
        wait_until(lambda: self.state()["robot"], "no robot is heard")

    def end(self) -> str:
        """End it as Ctrl-C does; return what it said to standard error."""
        self.process.terminate()
        return self.process.communicate(timeout=60)[1]


@contextmanager
def running(*words: str) -> Iterator[Program]:
    """Run an ``omni`` command that says in JSON when it is ready."""
    command = [sys.executable, "-m", "omni", *words, "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield Program(process, json.loads(process.stdout.readline()))
    finally:
        if process.poll() is None:
            process.terminate()
            process.communicate(timeout=60)


def studio(*words: str) -> AbstractContextManager[Program]:
    """Run the studio on a port of its own."""
    return running("studio", "--no-browser", "--port", "0", *words)


def run_async(work: Coroutine[Any, Any, Any]) -> Any:
    """Run a coroutine in a thread of its own and return its result: a browser's loop may have this thread."""
    with ThreadPoolExecutor(max_workers=1) as other:
        return other.submit(asyncio.run, work).result()


def take_over(page: Page) -> None:
    """Make this page the one that commands the robot."""
    if page.evaluate("studio.state.commands") != "this page":
        page.click("#take-over")
    until(page, "state.commands === 'this page'")


def until(page: Page, condition: str, wait_s: float = LONGEST_S) -> None:
    """Wait until a JavaScript expression is true; it may use ``studio``, ``state`` and ``robot``.

    Playwright's own waiting evaluates text inside the page, which the page's security policy forbids.
    """
    look = f"() => {{ const state = window.studio?.state, robot = state?.robot; return Boolean({condition}); }}"
    seen = "() => [document.getElementById('notice')?.textContent, window.studio?.state]"
    wait_until(
        lambda: page.evaluate(look),
        lambda: f"this never came true: {condition}; the page shows {page.evaluate(seen)}",
        pause=lambda: let_live(page, 20),
        seconds=wait_s,
    )


def let_live(page: Page, milliseconds: int) -> None:
    """Let time pass for a page: between two looks at it, or because its own timers are the subject."""
    page.wait_for_timeout(milliseconds)
