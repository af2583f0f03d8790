# SPDX-License-Identifier: MIT
"""The check of the built pages finds links that lead nowhere."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).resolve().parents[2] / "docs" / "_ext" / "check_pages.py"
GOOD = '<h1 id="top">a</h1><a href="b.html#there">b</a><a href="https://mavlink.io">out</a><a href="#top">up</a>'


def check(folder: Path, page: str) -> subprocess.CompletedProcess[str]:
    (folder / "a.html").write_text(page, encoding="utf-8")
    (folder / "b.html").write_text('<p id="there">b</p>', encoding="utf-8")
    return subprocess.run([sys.executable, PROGRAM, folder], capture_output=True, text=True, check=False)


def test_good_pages_pass(tmp_path: Path) -> None:
    assert check(tmp_path, GOOD).returncode == 0


@pytest.mark.parametrize(
    ("page", "says"),
    [
        ('<a href="c.html">c</a>', "c.html: there is no such file"),
        ('<a href="b.html#here">b</a>', "b.html#here: there is no such place"),
        ('<a href="#nowhere">b</a>', "#nowhere: there is no such place"),
        ('<img src="c.png">', "c.png: there is no such file"),
        ('<script src="https://cdn.example/x.js"></script>', "comes from another host"),
    ],
)
def test_a_dead_link_is_an_error(tmp_path: Path, page: str, says: str) -> None:
    done = check(tmp_path, GOOD + page)
    assert done.returncode == 1
    assert says in done.stdout
