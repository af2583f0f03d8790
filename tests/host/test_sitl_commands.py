# SPDX-License-Identifier: MIT
"""``omni sitl --commands``: lines on standard input, answers on standard output, refusals on standard error."""

from __future__ import annotations

import io
import json
import random
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest

from omni.cli.sitl_commands import LONGEST_LINE, lines_of

COMMAND = [sys.executable, "-m", "omni", "sitl", "--commands", "--end-with-stdin", "--port", "0", "--json"]
PULLED = {"fault": "encoder_stuck", "wheel": 1}


@dataclass
class Child:
    process: subprocess.Popen[bytes]
    catalogue: dict[str, Any]

    def say(self, line: bytes) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + b"\n")
        self.process.stdin.flush()

    def until(self, condition: Callable[[dict[str, Any]], bool]) -> list[dict[str, Any]]:
        """Return what it said of its world up to where the condition holds."""
        assert self.process.stdout is not None
        said = []
        for line in self.process.stdout:
            said.append(dict(json.loads(line)["now"]))
            if condition(said[-1]):
                return said
        raise AssertionError(f"it ended, having said {said}")

    def refusals(self) -> list[str]:
        """Close its standard input, and return what it said on standard error until it ended."""
        errors = self.process.communicate(timeout=60)[1].decode()
        assert self.process.returncode == 0
        return errors.splitlines()


@contextmanager
def sitl() -> Iterator[Child]:
    pipe = subprocess.PIPE
    with subprocess.Popen(COMMAND, stdin=pipe, stdout=pipe, stderr=pipe) as process:
        assert process.stdout is not None
        yield Child(process, json.loads(process.stdout.readline())["world"])
        if process.poll() is None:
            process.kill()


@pytest.mark.full
def test_commands_are_done_and_said_and_bad_lines_change_nothing() -> None:
    draw = random.Random(5)
    with sitl() as child:
        assert PULLED["fault"] in {fault["name"] for fault in child.catalogue["faults"]}
        child.say(json.dumps({**PULLED, "on": True}).encode())
        assert child.until(lambda now: now["on"] == [PULLED])[0]["on"] in ([], [PULLED])
        bad = [
            b"x",
            b"\xff\xfe\x00",
            b'{"fault": "encoder_stuc", "wheel": 1, "on": false}',
            b'{"speed": 1e999}',
            b" " * 3 * LONGEST_LINE + b'{"mend": true}',
            *(b"%" + draw.randbytes(50).replace(b"\n", b"") for _ in range(20)),
        ]
        for line in bad:
            child.say(line)
        child.say(b"")  # nothing is no command, and no mistake
        child.say(b'{"speed": 0.5}')
        assert child.until(lambda now: now["speed"] == 0.5) == [{"on": [PULLED], "speed": 0.5}]
        child.say(b'{"mend": true}')
        assert child.until(lambda now: not now["on"]) == [{"on": [], "speed": 0.5}]
        refusals = child.refusals()
    assert len(refusals) == len(bad)
    assert all(line.startswith("error: command: ") and "No fault or speed was changed" in line for line in refusals)
    assert "did you mean encoder_stuck" in refusals[2]


def test_a_line_that_is_too_long_counts_once_and_its_end_not_at_all() -> None:
    long = b"x" * (2 * LONGEST_LINE + 7)
    exact = b"y" * (LONGEST_LINE - 1) + b"\n"
    text = b"a\n" + long + b"\n" + b"b\n" + exact + b"c"
    assert list(lines_of(io.BytesIO(text))) == [b"a\n", long[:LONGEST_LINE], b"b\n", exact, b"c"]


@pytest.mark.full
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_a_signal_ends_it_while_its_input_is_open(number: signal.Signals) -> None:
    command = [word for word in COMMAND if word != "--end-with-stdin"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe) as process:
        assert process.stdout is not None
        process.stdout.readline()
        json.loads(process.stdout.readline())  # its world goes on, and it waits for commands
        process.send_signal(number)
        assert process.wait(timeout=60) == 0
        assert process.stderr is not None
        assert process.stderr.read() == b""
