# SPDX-License-Identifier: MIT
"""The planted bugs fit the sources as they are; the quickest are built and found."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from image_check.run import all_checks
from tests.image.planted.bugs import KIT, ROOT, Bug, Tree, all_bugs, read_bug
from tests.image.planted.page import PAGE, filled_in, finders, table
from tests.image.planted.search import Result, Search
from tests.needs import need, refuse

WANTED = 20
QUICKEST = ("encoders-priority", "oe-glitch")
"""One line each in files that few others include, found by checks that take some seconds."""


@pytest.mark.parametrize("bug", all_bugs(), ids=lambda bug: bug.name)
def test_a_patch_fits_the_sources(bug: Bug) -> None:
    command = ["git", "-C", str(ROOT), "apply", "--check", str(bug.path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{bug.path.name} is stale: make it anew\n{done.stderr}"


@pytest.mark.parametrize("bug", all_bugs(), ids=lambda bug: bug.name)
def test_a_bug_is_one_in_the_flashed_program_and_says_what_it_does(bug: Bug) -> None:
    command = ["git", "-C", str(ROOT), "apply", "--numstat", str(bug.path)]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    changed = [line.split("\t")[2] for line in listed.splitlines()]
    assert changed
    assert all(name.startswith(("firmware/app/", "firmware/boards/teensy40/", "shared/core/")) for name in changed)
    assert len(bug.robot) > 20


def test_the_page_has_each_bug_once_and_names_checks_that_there_are() -> None:
    text = PAGE.read_text(encoding="utf-8")
    bugs = all_bugs()
    assert len(bugs) >= WANTED
    assert [text.count(f"| {bug.title} |") for bug in bugs] == [1] * len(bugs)
    assert set(finders(text).values()) <= {check.name for check in all_checks()}


def test_the_page_says_what_was_found_and_why_the_rest_was_not(tmp_path: Path) -> None:
    patch = "Subject: No brake\nOn a robot: it does not stop.\nMissed: nobody looks.\n---\n"
    (tmp_path / "brake.patch").write_text(patch)
    bug = read_bug(tmp_path / "brake.patch")
    bugs = {"brake": bug}
    missed = table(bugs, {"brake": Result(bug.digest, "", "")})
    assert "| No brake | **not found**: nobody looks. |" in missed
    page = filled_in(PAGE.read_text(encoding="utf-8"), bugs, {"brake": Result(bug.digest, "stops", "rolls on")})
    assert "find 1 of 1 planted bugs (100 %).\n" in page
    assert finders(page) == {"No brake": "stops"}


def test_the_page_has_a_row_for_what_was_not_run_to_its_end(tmp_path: Path) -> None:
    for name in ("brake", "wheel"):
        (tmp_path / f"{name}.patch").write_text(f"Subject: No {name}\nOn a robot: it does not stop.\n---\n")
    bugs = {name: read_bug(tmp_path / f"{name}.patch") for name in ("brake", "wheel")}
    page = filled_in(PAGE.read_text(encoding="utf-8"), bugs, {"brake": Result(bugs["brake"].digest, "", "")})
    assert "find 0 of 2 planted bugs (0 %). Not found counts also what has no verdict yet: 1.\n" in page
    assert "| No brake | **not found**: a check is missing |\n" in page
    assert "| No wheel | no verdict yet: not run to its end |\n" in page
    assert finders(page) == {}


def test_a_patch_without_a_head_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.patch").write_text("Subject: half a head\n---\n")
    with pytest.raises(ValueError, match="needs Subject and On a robot"):
        read_bug(tmp_path / "x.patch")


@pytest.mark.nightly
def test_the_quickest_are_built_and_found(tmp_path: Path) -> None:
    need("image")
    if not KIT.is_dir():
        refuse("make firmware-build-check")
    bugs = {bug.name: bug for bug in all_bugs()}
    told = finders(PAGE.read_text(encoding="utf-8"))
    tree = Tree(tmp_path / "tree")
    for name in QUICKEST:
        image = tree.image(bugs[name], tmp_path / "images")
        result = Search("ci", {told[bugs[name].title]: 1.0}).of(image, bugs[name], "")
        assert result is not None
        assert result.found_by, f"{name}: {told[bugs[name].title]} does not find it any more"
