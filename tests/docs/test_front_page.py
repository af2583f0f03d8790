# SPDX-License-Identifier: MIT
"""Pages that Sphinx does not build still lead somewhere, and every fault has its entry under its symptom."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hil_sim.metrics import tracking_rmse
from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
from hil_sim.world import world_config
from omniwheel._core import ffi, lib
from tests.hub.parts import omni

ROOT = Path(__file__).resolve().parents[2]
SAFETY = (ROOT / "docs" / "reference" / "safety.md").read_text(encoding="utf-8")
TROUBLES = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")


def fault_names() -> list[str]:
    names = [ffi.string(lib.omni_fault_name(1 << bit)).decode() for bit in range(32)]
    return [name for name in names if name != "?"]


def pages() -> list[Path]:
    """Return every page as a forge shows it: without those that only the built website has."""
    return [*ROOT.glob("*.md"), *(page for page in (ROOT / "docs").rglob("*.md") if "generated" not in page.parts)]


def test_every_link_of_a_page_leads_to_a_file_of_the_repository() -> None:
    found = [
        (page.relative_to(ROOT).as_posix(), target)
        for page in pages()
        for target in LINK.findall(re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL))
        if "://" not in target
    ]
    assert len(found) > 300
    dead = [
        link for link in found if "generated/" in link[1] or not (ROOT / link[0]).parent.joinpath(link[1]).is_file()
    ]
    assert dead == []


def test_the_core_has_faults_and_warnings() -> None:
    assert {"stall", "link loss", "pose stale"} <= set(fault_names())


@pytest.mark.parametrize("name", fault_names())
def test_every_fault_has_its_entry(name: str) -> None:
    rows = [line.split(" | ") for line in TROUBLES.splitlines() if line.startswith(f"| `{name}` |")]
    assert len(rows) == 1, f"docs/troubleshooting.md: one row that begins with | `{name}` |"
    assert all(len(cell.strip(" |")) > 10 for cell in rows[0][1:]), "a cause, and what to do"


@pytest.mark.parametrize("name", fault_names())
def test_the_safety_page_spells_every_fault_as_the_robot_does(name: str) -> None:
    """The core's table is the one place that spells them: a person searches for what the robot has said."""
    assert sum(line.startswith(f"| `{name}` |") for line in SAFETY.splitlines()) == 1


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "how-to-add").glob("*.md")), ids=lambda page: page.stem)
def test_every_file_that_a_recipe_names_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"`((?:shared|firmware|hil_sim|host|tests|omni_reproduce)/[^`\s]+)`", text)
    created = re.findall(r"Create `([^`]+)`", text)
    wanted = [name for name in named if "NAME" not in name and name not in created]
    assert [name for name in wanted if not (ROOT / name).exists()] == []


def test_every_word_of_the_glossary_is_used_elsewhere() -> None:
    glossary = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    words = re.findall(r"^([a-zA-Z][^\n|]*)\n  \S", glossary, re.MULTILINE)
    others = [
        page for page in (ROOT / "docs").rglob("*.md") if page.name != "glossary.md" and "generated" not in page.parts
    ]
    text = " ".join(" ".join(page.read_text(encoding="utf-8").lower().split()) for page in others)
    assert len(words) > 50
    unused = [word for word in words if not re.search(rf"(?<![a-z]){re.escape(word.lower())}(?:s|es)?(?![a-z])", text)]
    assert unused == []


@pytest.mark.full
def test_the_program_of_the_front_page_drives() -> None:
    (program,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    with omni("sitl", "--port", "0", "--json") as (_, ready):
        program = program.replace("tcp:127.0.0.1:5760", ready["links"][0])
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    found = re.search(r"\bx=([-\d.e]+), y=([-\d.e]+)", done.stdout)
    assert found is not None
    assert (float(found[1]), float(found[2])) == pytest.approx((0.1, 0.1), abs=0.01)


@pytest.mark.full
def test_the_front_page_s_errors_are_those_of_the_picture_and_of_a_run_on_real_wheels() -> None:
    """The fast robot's from the numbers behind the picture, which a test runs again; the slow one's from a run."""
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    numbers = json.loads((ROOT / "docs" / "images" / "pictures.json").read_text(encoding="utf-8"))["demo.png"]
    position, heading = 1e3 * numbers["rmse.position_m"], 1e3 * numbers["rmse.theta_rad"]
    assert f"off its path by {position:.1f} mm and {heading:.1f} mrad" in text
    demo = load_scenario("demo")
    assert world_config(demo.robot).rollers_per_row > 0
    slow = tracking_rmse(run_in_process(demo).record)
    assert f"they are {1e3 * slow.position_m:.1f} mm and {1e3 * slow.theta_rad:.1f} mrad" in text
