# SPDX-License-Identifier: MIT
"""The proofs can fail: faults planted into the core are found, and a page that says something else is noticed."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest

from tests import kept
from tests.needs import need
from tests.proof.frama_c import (
    ROOT,
    Place,
    Proof,
    Result,
    core_functions,
    fingerprint,
    generate,
    judge,
    reached_functions,
    run,
    without_comments,
)
from tests.proof.prove import (
    PAGE,
    Unreached,
    _page,
    differences,
    page_blocks,
    read_not_proved,
    read_proofs,
    to_make,
    unreached,
)

PLACE = Place("omni_f", "float_to_int", "x < 256")
PROOF = Proof("bridge", "it holds", "nothing")

MUTANTS = {
    "a duty that is not limited": (
        "bridge",
        "actuate/bridge.c",
        "omni_clampf(omni_absf(duty), 0.0f, 1.0f)",
        "omni_absf(duty)",
    ),
    "a stop that passes": (
        "safety",
        "supervise/safety.c",
        "OMNI_STATE_ESTOP, OMNI_STATE_FAILSAFE},",
        "OMNI_STATE_FAILSAFE, OMNI_STATE_FAILSAFE},",
    ),
    "voltages that may be NaN": (
        "wheel_speed",
        "actuate/saturation.c",
        "!(limit > 0.0f) || !omni_all_finite(values, count)",
        "!(limit > 0.0f)",
    ),
    "a duty beyond its limit": (
        "wheel_speed",
        "control/wheel_speed.c",
        "omni_clampf(voltage_V[i] / supply_V, -config->duty_limit, config->duty_limit)",
        "voltage_V[i] / supply_V",
    ),
    "duties of the tick that are not limited": (
        "tick_three",
        "tick/tick.c",
        "omni_clampf(actuation->duty[i], -1.0f, 1.0f)",
        "actuation->duty[i]",
    ),
    "parameters that may be NaN": ("config", "config/params.c", "if (!omni_is_finite(value)) {", "if (false) {"),
    "parameters beyond their range": (
        "config",
        "config/params.c",
        "value < info->minimum || value > info->maximum",
        "false",
    ),
}


@pytest.fixture(scope="module")
def frama_c() -> None:
    need("frama-c")
    generate()


@pytest.mark.full
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name == "a stop that passes" else pytest.mark.nightly) for name in MUTANTS],
)
def test_a_fault_in_the_core_is_not_proved(frama_c: None, name: str, tmp_path: Path) -> None:
    proof_name, file, right, wrong = MUTANTS[name]
    core = tmp_path / "core"
    shutil.copytree(ROOT / "shared" / "core", core)
    source = core / "src" / file
    text = source.read_text(encoding="utf-8")
    assert right in text
    source.write_text(text.replace(right, wrong, 1), encoding="utf-8")
    proof = next(proof for proof in read_proofs() if proof.name == proof_name)
    result = run(proof, core, tmp_path)
    assert result.open - set(read_not_proved()[0])


def row(status: str, kind: str = "user check", file: str = "bridge.c") -> dict[str, str]:
    return {
        "directory": "tests/proof/drivers",
        "file": file,
        "line": "7",
        "function": "omni_f_12",
        "property kind": kind,
        "status": status,
        "property": "x\n <  256",
    }


def test_what_eva_leaves_open_is_kept_under_the_name_in_the_sources() -> None:
    assert judge(PROOF, [row("Unknown", "float_to_int")], set()).open == {PLACE}
    assert judge(PROOF, [row("Valid"), row("Considered valid", "user hypothesis")], set()).open == set()


def test_a_check_that_is_false_or_never_reached_is_not_proved() -> None:
    assert {place.kind for place in judge(PROOF, [row("Invalid"), row("Dead")], set()).open} == {
        "user check (invalid)",
        "user check (dead)",
    }
    assert judge(PROOF, [row("Dead", file="safety.c")], set()).open == set()


def test_a_new_alarm_and_a_row_that_is_not_needed_any_more_are_differences() -> None:
    result = Result(PROOF, open={PLACE})
    assert differences([result], {}, all_ran=True) == [f"bridge: not proved: {PLACE}"]
    assert differences([result], {PLACE: "why"}, all_ran=True) == []
    assert len(differences([Result(PROOF)], {PLACE: "why"}, all_ran=True)) == 1
    assert differences([Result(PROOF)], {PLACE: "why"}, all_ran=False) == []


def test_a_function_that_no_proof_reaches_must_be_listed() -> None:
    functions = core_functions(sorted((ROOT / "shared" / "core" / "src").rglob("*.[ch]")))
    assert {
        "omni_robot_tick",
        "gate_actuation",
        "omni_clampf",
        "omni_pid_step",
        "propagate_covariance",
        "get_none",
    } - functions == {"get_none"}
    results = [Result(PROOF, reached=functions - {"gate_actuation"})]
    assert unreached(results, []) == ["no proof reaches gate_actuation"]
    assert unreached(results, [Unreached(("gate_actuation",), (), "why")]) == []
    assert unreached(results, [Unreached((), ("tick/*.c",), "why")]) == []
    assert unreached(results, [Unreached((), ("model/*.c",), "why")]) != []
    proved = [Result(PROOF, reached=functions)]
    assert len(unreached(proved, [Unreached(("gate_actuation",), ("model/*.c",), "why")])) == 2


def test_a_proof_is_made_again_if_and_only_if_something_it_depends_on_has_changed(
    frama_c: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    core = tmp_path / "core"
    shutil.copytree(ROOT / "shared" / "core", core)
    before = fingerprint(PROOF, core)
    monkeypatch.setattr(kept, "has_passed", lambda name, inputs: (name, inputs) == ("proof: bridge", before))

    def made(proof: Proof) -> bool:
        return to_make([proof], {proof.name: fingerprint(proof, core)}) == [proof]

    assert not made(PROOF)
    assert made(dataclasses.replace(PROOF, options=("-eva-precision 3",)))
    for path in (core / "src" / "tick" / "tick.c", core / "include" / "omni" / "robot.h"):
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("\n", "\n\n/* Another comment. */\n", 1), encoding="utf-8")
        assert not made(PROOF)
        path.write_text(f"{text}\nextern int another;\n", encoding="utf-8")
        assert made(PROOF)
        path.write_text(text, encoding="utf-8")
    (core / "src" / "tick" / "more.c").write_text("int more;\n", encoding="utf-8")
    assert made(PROOF)


def test_comments_do_not_count_but_strings_and_what_frama_c_reads_do() -> None:
    text = """a = '"'; /* b's */ c("/* d */", '\\''); // e\n\n  /*@ assert f; */ //@ g\nh"""
    assert without_comments(text) == """a = '"'; c("/* d */", '\\'');\n/*@ assert f; */ //@ g\nh"""


def test_reached_functions_are_read_from_the_log() -> None:
    assert reached_functions("  omni_f_12: 3 stmts out of 4 (75.0%)\n  g: 1 stmts out of 1 (100.0%)\n") == {
        "omni_f",
        "g",
    }


def test_the_page_says_what_the_files_say(tmp_path: Path) -> None:
    proofs, (places, functions) = read_proofs(), read_not_proved()
    assert _page(page_blocks(proofs, places, functions), write=False) == []
    changed = [dataclasses.replace(proofs[0], shows="something else"), *proofs[1:]]
    copy = tmp_path / "proof.md"
    shutil.copyfile(PAGE, copy)
    blocks = page_blocks(changed, places, functions)
    assert len(_page(blocks, write=False, path=copy)) == 1
    assert _page(blocks, write=True, path=copy) == []
    assert _page(blocks, write=False, path=copy) == []


def test_nothing_is_taken_for_granted_in_the_sources() -> None:
    """`admit` would make Eva believe whatever stands there."""
    paths = [*(ROOT / "shared" / "core").rglob("*.[ch]"), *(ROOT / "tests" / "proof").rglob("*.[ch]")]
    assert len(paths) > 50
    assert [path.name for path in paths if "admit" in path.read_text(encoding="utf-8")] == []
