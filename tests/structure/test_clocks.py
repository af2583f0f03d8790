# SPDX-License-Identifier: MIT
"""No test reads the wall clock or sleeps but through :mod:`tests.waiting`.

There it only ends what hangs, so no verdict depends on a machine's speed.
"""

from __future__ import annotations

import ast

import pytest

from tests.structure.test_sizes import ROOT, sources

MEASURES = "a program that measures speed or prints how long it took; it is no test"
ALLOWED = {
    "tests/waiting.py": "the helper itself",
    "tests/studio/parts.py": "the same for a page: its loop has to run meanwhile",
    "tests/hil_sim/test_poll_backoff.py": "its subject is the share of a processor that waiting takes, in real time",
    "tests/host/mocap/natnet_server.py": "stands for cameras: frames have times of exposure on the reader's clock",
    "tests/host/mocap/fake_vicon/pyvicon_datastream.py": "stands for a library that blocks until the next frame",
    "tests/ci/run_steps.py": "a program: CI's steps, their limit and their seconds",
    "tests/fuzz/fuzz.py": MEASURES,
    "tests/fuzz/long_run.py": MEASURES,
    "tests/firmware/stop_latency.py": MEASURES,
    "tests/image_build/front_ends.py": MEASURES,
    "tests/mutation/__main__.py": MEASURES,
    "tests/omni_reproduce/kept_page.py": MEASURES,
    "tests/parity/compare.py": MEASURES,
    "tests/soak/soak.py": MEASURES,
    "tests/studio/mavproxy_graph.py": MEASURES,
    "tests/studio/measure.py": MEASURES,
    "tests/studio/memory.py": MEASURES,
    "tests/studio/peers.py": MEASURES,
    "tests/studio/wire.py": "part of tests/studio/measure.py and memory.py: notes when messages pass",
}
"""Files that may, each with its reason."""
RECEIVES = {"recv", "recvfrom", "poll"}
ENDLESS = {
    "tests/hil_sim/echo_robot.py": "a server: it ends with its connection",
    "tests/host/mocap/natnet_server.py": "a server: it ends with its test",
    "tests/host/shared_line.py": "a server: it ends with its test",
    "tests/host/test_timesync.py": "simulated time",
    "tests/studio/wire.py": "a server: it ends with its connections",
}
"""Files with a loop that receives without a deadline, each with its reason."""
SIGNS = ("import time", "from time", "import asyncio", "datetime", "wait_for_timeout")
"""One of these is in a file that has a clock."""
METHODS = {"datetime": {"now", "utcnow", "today"}, "date": {"today"}}


def modules(tree: ast.AST) -> dict[str, str]:
    """Return the names under which a file imports modules that have a clock."""
    imports = (node for node in ast.walk(tree) if isinstance(node, ast.Import))
    return {
        one.asname or one.name: one.name for node in imports for one in node.names if one.name in {"time", "asyncio"}
    }


def clocks(text: str) -> set[str]:
    """Return what of a Python file reads the wall clock or sleeps."""
    tree = ast.parse(text)
    known = modules(tree)
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == "time":
            found.add("from time import")
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = known.get(node.value.id)
            sleeps = (module, node.attr) == ("asyncio", "sleep") or node.attr == "wait_for_timeout"
            if module == "time" or sleeps or node.attr in METHODS.get(node.value.id, ()):
                found.add(f"{node.value.id}.{node.attr}")
    return found


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import time\nend = time.monotonic() + 5", {"time.monotonic"}),
        ("import time as clock\nclock.sleep(1)", {"clock.sleep"}),
        ("from time import sleep", {"from time import"}),
        ("from datetime import datetime\ndatetime.now()", {"datetime.now"}),
        ("import asyncio\nasync def f(): await asyncio.sleep(1)", {"asyncio.sleep"}),
        ("def f(page): page.wait_for_timeout(100)", {"page.wait_for_timeout"}),
        ("def f(time, replay): return time.clock(), replay.now()", set()),
        ("import asyncio\nasyncio.run(f())", set()),
    ],
)
def test_clocks_are_found(text: str, found: set[str]) -> None:
    assert clocks(text) == found


def endless(text: str) -> bool:
    """Return whether a Python file receives or polls in a ``while`` loop without a :class:`tests.waiting.Deadline`."""
    for loop in ast.walk(ast.parse(text)):
        if isinstance(loop, ast.While):
            called = {
                node.func.attr for node in ast.walk(loop) if isinstance(node, ast.Call) and hasattr(node.func, "attr")
            }
            if called & RECEIVES and "left_s" not in called:
                return True
    return False


def python_files(*words: str) -> dict[str, str]:
    """Return the text of every Python file of the tests that holds one of these words, by its path."""
    files = {str(path.relative_to(ROOT)): path for path in sources(".py")}
    texts = {name: path.read_text(encoding="utf-8") for name, path in files.items() if name.startswith("tests/")}
    return {name: text for name, text in texts.items() if any(word in text for word in words)}


@pytest.mark.full
def test_no_test_reads_the_wall_clock_but_through_the_helper() -> None:
    found = {file: names for file, text in python_files(*SIGNS).items() if (names := clocks(text))}
    new = {file: names for file, names in found.items() if file not in ALLOWED}
    assert not new, "use wait_until, receive_until or pass_time of tests/waiting.py"
    assert set(found) == set(ALLOWED), "an entry of ALLOWED has no use any more"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("while True: socket.recv(timeout=60)", True),
        ("while child.poll() is None: robot.pump()", True),
        ("while True: socket.recv(timeout=deadline.left_s())", False),
        ("while time_s < end_s: robot.pump()", False),
    ],
)
def test_loops_without_a_deadline_are_found(text: str, found: bool) -> None:
    assert endless(text) is found


@pytest.mark.full
def test_a_loop_that_receives_has_one_deadline() -> None:
    assert {file for file, text in python_files(*RECEIVES).items() if endless(text)} == set(ENDLESS)
