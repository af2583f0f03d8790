# SPDX-License-Identifier: MIT
"""The front of the command line: groups, quick help, completion, negative numbers, and examples that can be typed."""

from __future__ import annotations

import errno
import itertools
import json
import os
import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Collection, Iterator
from typing import Any

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from omni import checks
from omni.cli import app
from omni.cli.command_table import TABLE
from omni.cli.common import BAD_INPUT
from omni.cli.negative_numbers import _arguments_last

ROOT_COMMAND: Any = typer.main.get_command(app)
DRAWING = {"pydantic", "pygments", "markdown_it"}
"""What typer imports for a page of its own, or for a value. Without arguments ``omni`` shows such a page."""
HEAVY = DRAWING | {
    *("numpy", "pymavlink", "matplotlib", "scipy", "serial", "hil_sim", "omni_reproduce", "optuna", "unicorn"),
}
"""Packages that take long to import. Help and completion need none of them."""
LIGHT = {
    *("hil_sim", "hil_sim.limits", "hil_sim.processes", "hil_sim.schema", "hil_sim.studies"),
    *("hil_sim.studies.errors", "hil_sim.studies.figures", "image_check", "image_check.check"),
    *("omni_reproduce", "omni_reproduce.experiment", "omni_reproduce.registry"),
}
"""Modules of heavy packages of our own that hold bounds and names for help pages, and import nothing heavy."""
PORTS = ("--link ", "--radio ", "--port ")
"""Options whose values are ports."""
NAMES = [entry.name for entry in TABLE]


def commands(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield every command and group with the words that lead to it."""
    yield words, command
    if hasattr(command, "list_commands"):
        context = command.make_context("omni", [], resilient_parsing=True)
        for name in command.list_commands(context):
            found = command.get_command(context, name)
            if not found.hidden:
                yield from commands(found, (*words, name))


ALL = list(commands(ROOT_COMMAND))
CHECKS = "python -m omni.checks "
CHECKS_COMMAND: Any = typer.main.get_command(checks.app)


def examples() -> list[str]:
    """Return the lines that begin with ``omni``, or with CHECKS, in the examples of all commands."""
    found = []
    for _, command in [*ALL, *commands(CHECKS_COMMAND)]:
        plain = re.sub(r"(?<!\\)\[/?[a-z]*\]", "", command.epilog or "").replace("\\[", "[")
        found += [line.strip() for line in plain.splitlines() if line.strip().startswith(("omni ", CHECKS))]
    return found


def imported_by(*words: str, **environment: str) -> tuple[set[str], str]:
    """Return the packages that a command line imports, and what it prints."""
    program = (
        "import sys, atexit\n"
        "atexit.register(lambda: print('\\n@', *{name.split('.')[0] for name in sys.modules}, file=sys.stderr))\n"
        f"sys.argv = ['omni', *{list(words)!r}]\n"
        "from omni.cli import main\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, env={**os.environ, **environment}
    )
    return set(done.stderr.rsplit("@", 1)[-1].split()), done.stdout


def completed(line: str) -> list[str]:
    """Return what the Tab key offers at the end of a line in bash."""
    words = line.split(" ")
    environment = {"_OMNI_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    return imported_by(**environment)[1].split()


def test_the_help_page_names_every_command_in_its_group() -> None:
    text = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "80"}).output
    panels = re.split(r"╭─ (.+?) ─+╮", text)
    shown = dict(zip(panels[1::2], panels[2::2], strict=True))
    for entry in TABLE:
        assert re.search(rf"^│ {re.escape(entry.name)} ", shown[entry.group], re.MULTILINE), entry


@pytest.mark.parametrize("words", [["stop"], ["params", "diff"]])
def test_a_help_page_fills_the_lines_of_the_terminal(words: list[str]) -> None:
    """Typer keeps the line breaks of a docstring: at 80 columns every second line had one word."""
    lines = [
        line.strip() for line in CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "80"}).output.splitlines()
    ]
    text = lines[1 : next(at for at, line in enumerate(lines) if line.startswith("╭"))]
    for line, after in itertools.pairwise(text):
        assert not (line and after) or len(line) + 1 + len(after.split()[0]) > 78, line


@pytest.mark.parametrize("words", [["--help"], ["--version"], []])
def test_help_and_version_import_nothing_heavy(words: list[str]) -> None:
    imported, output = imported_by(*words)
    assert output
    assert "omniwheel" in imported
    assert not imported & (HEAVY if words else HEAVY - DRAWING)


def places() -> Iterator[str]:
    """Yield a line for every place where Tab can be pressed: names of commands and options, arguments, values."""
    for words, command in ALL:
        line = " ".join(("omni", *words, ""))
        yield line
        yield f"{line}--"
        for option in (p for p in command.params if p.param_type_name == "option" and not p.is_flag):
            yield f"{line}{option.opts[0]} "


def heavy_by_line(lines: list[str], light: Collection[str] = LIGHT) -> dict[str, list[str]]:
    """Return the lines whose completion imports something heavy, each with what it is the first to import."""
    program = (
        "import contextlib, io, json, os, sys\n"
        "from omni.cli import main\n"
        "seen, found = set(), {}\n"
        "for line in json.load(sys.stdin):\n"
        "    words = {'COMP_WORDS': line, 'COMP_CWORD': str(line.count(' '))}\n"
        "    os.environ.update(words, _OMNI_COMPLETE='complete_bash')\n"
        "    sys.argv = ['omni']\n"
        "    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):\n"
        "        main()\n"
        f"    new = {{name for name in sys.modules if name.split('.')[0] in {HEAVY!r}}} - {set(light)!r} - seen\n"
        "    if new: found[line] = sorted(new)\n"
        "    seen |= new\n"
        "print(json.dumps(found))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], input=json.dumps(lines), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


def test_completing_a_command_imports_nothing_heavy() -> None:
    environment = {"_OMNI_COMPLETE": "complete_bash", "COMP_WORDS": "omni mon", "COMP_CWORD": "1"}
    imported, output = imported_by(**environment)
    assert sorted(output.split()) == ["monitor", "montecarlo"]
    assert not imported & HEAVY


def test_completing_a_command_draws_nothing_and_reads_no_schema() -> None:
    """Rich is slow to import, and so is what reads robots and parameters."""
    imported, _ = imported_by(_OMNI_COMPLETE="complete_bash", COMP_WORDS="omni mon", COMP_CWORD="1")
    assert not imported & {"rich", "omni_schema"}


def test_the_tab_key_leaves_words_alone_and_a_command_does_not() -> None:
    """A number that is none is no reason to offer nothing; the command itself refuses it."""
    assert completed("omni run --seed many four_w") == ["four_wheel"]
    refused = CliRunner().invoke(app, ["run", "four_wheel", "--seed", "many"])
    assert refused.exit_code == BAD_INPUT
    assert {"--seed", "many"} <= set(re.findall(r"[\w-]+", refused.output))


def test_the_front_page_shows_each_option_with_its_help() -> None:
    text = re.sub(r"[\s│]+", " ", CliRunner().invoke(app, ["--help"], env={"COLUMNS": "80"}).output)
    for option in ROOT_COMMAND.params:
        assert f"{option.opts[0]} " in text
        assert option.help in text
    assert "[env var: OMNI_SIGNING_KEY]" in text


@pytest.mark.full
def test_the_tab_key_imports_nothing_heavy_anywhere() -> None:
    """Ports come from pyserial, which is little and knows every system; all else is read from files."""
    lines = [line for line in places() if not line.endswith(PORTS)]
    assert len(lines) > 400
    assert heavy_by_line(lines) == {}
    ports = [line for line in places() if line.endswith(PORTS)]
    assert {name.split(".")[0] for names in heavy_by_line(ports).values() for name in names} <= {"serial"}


def test_a_heavy_import_behind_the_tab_key_is_found() -> None:
    """Without LIGHT, the schema of the world, whose plants the help page of a scenario shows, is one."""
    assert "hil_sim.schema" in heavy_by_line(["omni run "], light=set())["omni run "]


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("omni doc", ["doctor"]),
        ("omni params list ISMC_LAM", ["ISMC_LAM_TH", "ISMC_LAM_XY"]),
        ("omni params set ISMC_LAM_X", ["ISMC_LAM_XY="]),
        ("omni params set CTL_MODE=i", ["CTL_MODE=ismc"]),
        ("omni robots check three", ["three_wheel"]),
        ("omni run dem", ["demo"]),
        ("omni drive trajectory cir", ["circle"]),
        ("omni run demo --preset report_t", ["report_torque"]),
        ("omni monitor --link tcp", ["tcp:127.0.0.1:5760"]),
    ],
)
def test_the_tab_key_offers_what_begins_so(line: str, offered: list[str]) -> None:
    assert sorted(completed(line)) == offered


@pytest.mark.parametrize(
    ("program", "words"),
    [
        *(pytest.param(app, words, id=" ".join(("omni", *words))) for words, _ in ALL),
        *(pytest.param(checks.app, words, id=" ".join((CHECKS, *words))) for words, _ in commands(CHECKS_COMMAND)),
    ],
)
def test_every_help_page_fits_80_columns_and_says_what_the_command_does(program: Any, words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(program, [*words, "--help"], env={"COLUMNS": "80"})
    assert result.exit_code == 0, result.output
    assert max(len(line) for line in result.output.splitlines()) <= 80
    assert len(result.output.split("Options")[0].split()) > 5


@pytest.mark.parametrize("line", examples())
def test_every_example_of_a_help_page_can_be_typed(line: str) -> None:
    """Each is parsed to its end: commands, options and types. What it does is the matter of other tests."""
    command = CHECKS_COMMAND if line.startswith(CHECKS) else ROOT_COMMAND
    words = shlex.split(line.removeprefix(CHECKS).removeprefix("omni ").split(" | ")[0].split("  #")[0])
    context = command.make_context("omni", words)
    while hasattr(command, "resolve_command") and (rest := [*context._protected_args, *context.args]):
        name, command, left = command.resolve_command(context, rest)
        context = command.make_context(name, left, parent=context)
    assert not hasattr(command, "resolve_command") or command.invoke_without_command


@given(st.lists(st.floats(-9, 9).map(lambda value: f"{value:.3f}"), min_size=1, max_size=4), st.randoms())
def test_numbers_stay_in_their_order_wherever_the_options_stand(numbers: list[str], draw: Any) -> None:
    groups = [[number] for number in numbers]
    options = [["--for", "-2"], ["--json"], ["-l", "tcp:x:1"], ["--start", "1", "-2", "3"], ["--world=-1"]]
    for option in options:
        groups.insert(draw.randint(0, len(groups)), option)
    words = [word for group in groups for word in group]
    found = _arguments_last(words, {"--for": 1, "--json": 0, "-l": 1, "--start": 3, "--world": 1})
    assert found[found.index("--") + 1 :] == numbers
    assert sorted(found[: found.index("--")]) == sorted(word for option in options for word in option)


@pytest.mark.parametrize(
    "words",
    [
        ["drive", "velocity", "-0.1", "0", "-.5", "--for", "1"],
        ["drive", "pose", "--for", "1", "-0.5", "0", "-1e-1"],
        ["drive", "duty", "-0.3", "0", "0"],
        ["drive", "velocity", "--", "-0.1", "0", "0"],
    ],
)
def test_negative_numbers_need_no_dashes_before_them(words: list[str]) -> None:
    """They get as far as the link, which is not there; as options they would be a usage error."""
    result = CliRunner().invoke(app, [*words[:2], "--link", "tcp:127.0.0.1:1", *words[2:]], env={"COLUMNS": "200"})
    assert result.exit_code == 1, result.output
    assert "tcp:127.0.0.1:1" in result.stderr


def test_an_unknown_option_is_still_an_error() -> None:
    result = CliRunner().invoke(app, ["drive", "velocity", "0", "0", "-0.1", "--fro", "2"])
    assert result.exit_code == 2
    assert "--fro" in result.stderr


SEVERAL_MEANINGS = {"--link", "--port", "--param", "--set"}
"""The robot's link or ports to offer; a serial or a TCP port; a range to search."""


def test_an_option_has_the_same_short_form_in_every_command() -> None:
    forms: dict[str, set[tuple[str, ...]]] = {}
    for _, command in ALL:
        for option in (p for p in command.params if p.param_type_name == "option"):
            short = tuple(name for name in option.opts if not name.startswith("--"))
            forms.setdefault(option.opts[0], set()).add(short)
    assert {name for name, shorts in forms.items() if len(shorts) > 1} <= SEVERAL_MEANINGS


def test_a_time_is_always_called_duration() -> None:
    for words, command in ALL:
        for option in command.params:
            if {"--for", "--seconds"} & set(option.opts):
                assert option.opts[0] == "--duration", words


@pytest.mark.parametrize("module", ["typer", "omni.cli", "omni.cli.run", "hil_sim", "numpy"])
def test_ctrl_c_while_modules_load_shows_no_traceback(module: str) -> None:
    program = (
        "import sys\n"
        "class CtrlC:\n"
        "    @staticmethod\n"
        "    def find_spec(name, path=None, target=None):\n"
        f"        if name == {module!r}: raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, CtrlC)\n"
        "sys.argv = ['omni', 'run', 'demo']\n"
        "from omni.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    assert "interrupted" in done.stderr


def test_a_home_folder_that_cannot_be_written_is_an_error_of_the_completion(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: Any) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "/home/user/.bashrc")

    monkeypatch.setattr("typer.completion.install", refuse)
    result = CliRunner().invoke(app, ["--install-completion"])
    assert result.exit_code == 1
    assert "/home/user/.bashrc: Permission denied" in result.stderr


STYLES = re.compile(r"(?<!\\)\[/?(?:bold|cyan|dim|green|red|yellow)?\]")


def bracketed(source: str) -> set[str]:
    """Return every text in brackets that a reader of this help shall see; what only sets a style is none."""
    return set(re.findall(r"\[[^\[\]]*\]?", STYLES.sub("", source).replace("\\[", "[")))


@pytest.mark.parametrize("words", [words for words, _ in ALL], ids=lambda words: " ".join(("omni", *words)))
def test_no_bracket_of_a_help_text_is_taken_for_markup(words: tuple[str, ...]) -> None:
    command = dict(ALL)[words]
    sources = [command.help, command.epilog, *(getattr(p, "help", "") for p in command.params if not p.hidden)]
    shown = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "1000"}).output
    missing = {text for source in sources for text in bracketed(source or "") if text not in shown}
    assert not missing, "a bracket needs a backslash before it"


def test_a_bracket_that_was_lost_is_found() -> None:
    assert bracketed("How far [m or rad]. [bold]Examples[/] \\[default: 3]") == {"[m or rad]", "[default: 3]"}


@pytest.mark.full
@pytest.mark.parametrize("words", [["robots"], ["run", "demo"], ["monitor", "--link", "tcp:127.0.0.1:1"]])
@pytest.mark.parametrize("stale", ["omniwheel._core", "omni_schema"])
def test_an_old_build_is_one_sentence(words: list[str], stale: str) -> None:
    """The module is there and lacks every name that is asked of it, as one of an older version may."""
    program = (
        "import importlib.util, sys, types\n"
        f"module = types.ModuleType({stale!r})\n"
        "module.__path__ = []\n"
        f"module.__spec__ = importlib.util.find_spec({stale!r})\n"
        "sys.modules[module.__name__] = module\n"
        f"sys.argv = ['omni', *{words!r}]\n"
        "from omni.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert done.returncode == 1, done.stderr
    assert "make setup" in done.stderr


def test_a_function_that_the_compiled_module_lacks_is_an_old_build() -> None:
    from omniwheel._core import lib
    from omniwheel.stale_build import stale_build

    with pytest.raises(AttributeError) as caught:
        lib.omni_of_a_later_version  # noqa: B018
    assert "omni_of_a_later_version" in (stale_build(caught.value) or "")
    assert stale_build(AttributeError("'int' object has no attribute 'x'")) is None
    assert stale_build(ImportError("No module named 'optuna'", name="optuna")) is None


@pytest.mark.parametrize("words", [[], pytest.param(["--board", "cortex-m7"], marks=pytest.mark.needs("arm", "qemu"))])
def test_a_port_in_use_gets_a_hint(words: list[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        result = CliRunner().invoke(app, ["sitl", *words, "--link", f"tcp:127.0.0.1:{taken.getsockname()[1]}"])
    assert result.exit_code == 1
    assert "choose another port" in " ".join(result.stderr.split())
