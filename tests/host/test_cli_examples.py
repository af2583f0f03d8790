# SPDX-License-Identifier: MIT
"""Every example of a help page does what it says: it is run, on a simulated robot and in a scratch folder."""

from __future__ import annotations

import re
import shutil
from contextlib import ExitStack
from pathlib import Path

import pytest
from typer.testing import CliRunner

from omni import checks
from omni.cli import app
from tests.blank_pictures import blank_pictures
from tests.host.cli_examples import CHECKS, RULES, make_files, rule_of, words_of
from tests.host.test_cli_front import examples

EXAMPLES = sorted(set(examples()))
DRAWN = {rule_of(line).head: line for line in EXAMPLES}
"""The examples whose pictures are drawn: one of each rule."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    with pytest.MonkeyPatch.context() as context:
        context.chdir(folder)
        make_files(folder)
    return folder


@pytest.mark.full
@pytest.mark.parametrize("line", EXAMPLES)
def test_an_example_does_its_work(line: str, files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "--world mujoco" in line:
        pytest.importorskip("mujoco", reason="needs pip install 'omniwheel[mujoco]'")
    rule = rule_of(line)
    folder = tmp_path / "scratch"
    shutil.copytree(files, folder)
    if line.startswith("omni params"):
        (folder / "mine.toml").write_text("[parameters]\nISMC_LAM_XY = 15.0\n", encoding="utf-8")
    for pattern in rule.new.split():
        for path in folder.glob(pattern):
            path.unlink()
    monkeypatch.chdir(folder)
    drawn = ExitStack() if line == DRAWN[rule.head] else blank_pictures()
    with drawn, rule.during():
        program = checks.app if line.startswith(CHECKS) else app
        result = CliRunner().invoke(program, words_of(line, rule), input=rule.answers, env={"COLUMNS": "80"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code in rule.codes, (words_of(line, rule), result.output)
    assert "Traceback" not in result.output
    rows = [] if "--json" in line else [text for text in result.stdout.splitlines() if is_row(text)]
    assert not [row for row in rows if len(row) > 80]


def is_row(text: str) -> bool:
    """Return whether a line is a row of a table: a sentence may be as long as it is."""
    return re.search(r"\S {2,}\S", text) is not None or "─" in text


def test_every_rule_is_for_an_example() -> None:
    used = {rule_of(line).head for line in EXAMPLES}
    assert {rule.head for rule in RULES} == used
