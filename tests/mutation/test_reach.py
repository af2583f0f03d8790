# SPDX-License-Identifier: MIT
"""A test is not thought long because it was the first that needed a library."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutation import reach
from tests.mutation.reach import LONGEST_S, Recorder

TEST = "tests/firmware/test_x.py::test_first"


def test_the_time_of_building_a_library_is_not_the_tests(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    used_s = [50.0]

    def build(name: str) -> Path:
        used_s[0] += 2 * LONGEST_S
        return Path(name)

    monkeypatch.setattr(reach, "processor_s", lambda: used_s[0])
    (tmp_path / "test").write_bytes(bytes(4))
    (tmp_path / "calls").touch()
    recorder = Recorder(tmp_path)
    watched = recorder.watched(build)
    for test in (TEST, f"{TEST} again"):
        recorder.pytest_runtest_logstart(test)
        assert watched("robot") == Path("robot")
        used_s[0] += 1.5
        recorder.pytest_runtest_logfinish(test)
    assert recorder.found == {TEST: (1.5, []), f"{TEST} again": (1.5, [])}
