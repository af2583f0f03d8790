# SPDX-License-Identifier: MIT
"""The robot's pose is as good or bad as docs/concepts/derivations/estimate_consistency.md says, measured again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from omni_reproduce import estimate_consistency as consistency
from omni_reproduce.estimate_consistency import Looks, Setting
from omni_reproduce.posterior_bound import Array

PAGE = Path(__file__).resolve().parents[2] / "docs/concepts/derivations/estimate_consistency.md"
SEEDS, NIGHTLY_SEEDS = 4, 200
RATIO_OF_FEW, NIS_OF_FEW = {True: 1.2, False: 1.4}, 0.035
"""How far few seeds may be from the page: a factor of the error over the claim, with fixes and without; a share of NIS.

Of the page's seeds, ten groups of four were off by no more than 1.17, 1.34 and 3.1 %.
"""
RATIO_OF_MANY, NIS_OF_MANY = {True: 1.08, False: 1.2}, 0.015
"""About three standard errors of the page's 50 seeds."""
KEYS = list(consistency.settings())
SHORT = ("fixes_slip_real", "fixes_pose_real", "gyro_slip_real", "flow_slip_real", "lost_slip_real", "alone_slip_ideal")
"""Driven in every run of the tests; `make nightly` drives all."""
ERROR_RANGE = {True: (0.75, 1.05), False: (0.3, 1.1)}
"""Errors over the claim that a pose as shipped may have, with fixes and without: least and most."""


def kept() -> Mapping[str, tuple[float, float | None]]:
    """Return error over claim and NIS of each row on the page, by its title."""
    rows = {}
    for text in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in text.strip("| ").split("|")]
        if text.startswith("| wheels"):
            rows[cells[0]] = float(cells[2]), float(cells[4]) if len(cells) > 4 and cells[4] else None
    return rows


def check(key: str, seeds: int, ratio: Mapping[bool, float], nis_share: float) -> None:
    setting = consistency.settings()[key]
    found = consistency.measure(setting, seeds)
    claimed, nis = kept()[setting.title]
    assert abs(math.log(found.ratio / claimed)) < math.log(ratio[setting.has_fixes]), (setting.title, found.ratio)
    assert (nis is not None) == setting.has_fixes
    if nis is not None:
        assert found.nis.mean() == pytest.approx(nis, rel=nis_share)


@pytest.mark.full
@pytest.mark.parametrize("key", SHORT)
def test_few_seeds_agree_with_the_page(key: str) -> None:
    check(key, SEEDS, RATIO_OF_FEW, NIS_OF_FEW)


@pytest.mark.nightly
@pytest.mark.parametrize("key", KEYS)
def test_many_seeds_agree_with_the_page(key: str) -> None:
    check(key, NIGHTLY_SEEDS, RATIO_OF_MANY, NIS_OF_MANY)


def test_the_page_has_every_row_and_no_other() -> None:
    assert list(kept()) == [setting.title for setting in consistency.settings().values()]


@pytest.mark.parametrize("key", [key for key in KEYS if key.endswith(("slip_ideal", "slip_real"))])
def test_as_shipped_the_pose_is_as_good_as_it_says(key: str) -> None:
    """By the page's figures, which the tests above drive: with every set of sensors, on both kinds of wheels."""
    setting = consistency.settings()[key]
    error, nis = kept()[setting.title]
    least, most = ERROR_RANGE[setting.has_fixes]
    assert least < error < most
    assert nis is None or abs(nis / 3.0 - 1.0) < 0.05


def test_lost_fixes_come_before_the_first_look_and_never_after() -> None:
    setting = consistency.settings()["lost_slip_ideal"]
    assert setting.begins_with_fixes
    assert not setting.has_fixes
    found = consistency.measure(replace(setting, seconds=4), 1)
    assert found.nis.shape == (1, 0)


def test_a_filter_that_claims_another_noise_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fixes that are called twice as exact as they are: the gate above must close."""
    plain = consistency.settings()["fixes_slip_ideal"]
    wrong = Setting(plain.title, plain.scenario, {**plain.parameters, "EKF_R_XY": 0.0025, "EKF_R_TH": 0.0025})
    monkeypatch.setattr(consistency, "settings", lambda: {"wrong": wrong})
    with pytest.raises(AssertionError):
        check("wrong", 1, RATIO_OF_FEW, NIS_OF_FEW)


def drawn(runs: int, looks: int, share: float) -> tuple[Array, Array]:
    """Return errors (runs * looks, 3) of known covariances, ``share`` times larger than these say."""
    random = np.random.default_rng(3)
    roots = random.normal(size=(runs * looks, 3, 3))
    errors = share * np.einsum("nij,nj->ni", roots, random.normal(size=(runs * looks, 3)))
    return errors, roots @ np.swapaxes(roots, 1, 2)


@pytest.mark.parametrize(("share", "low", "high"), [(1.0, 0.9, 1.0), (1.5, 0.0, 0.05)])
def test_errors_as_large_as_claimed_are_inside_the_bands_and_larger_ones_are_not(
    share: float, low: float, high: float
) -> None:
    """By random numbers of known covariance: 95 % inside, the error over the claim is the share."""
    runs, looks = 40, 500
    nees = consistency.nees_of(*drawn(runs, looks, share)).reshape(runs, looks)
    found = Looks(nees, nees)
    assert found.ratio == pytest.approx(share, rel=0.02)
    assert low <= found.looks_inside <= high
    assert low - 0.05 <= found.runs_inside <= high


def test_without_fixes_each_look_has_its_nees_and_nothing_a_nis() -> None:
    setting = consistency.settings()["alone_slip_ideal"]
    found = consistency.measure(setting, 2)
    assert found.nis.shape == (2, 0)
    assert found.nees.shape == (2, setting.seconds * 1000 // consistency.LOOK_TICKS)
    assert (found.nees > 0.0).all()


def test_the_command_prints_a_row_for_each_setting(capsys: pytest.CaptureFixture[str]) -> None:
    consistency.main(["fixes_slip_ideal", "alone_pose_real", "--seeds", "1"])
    head, _, first, second = capsys.readouterr().out.splitlines()
    assert head == f"| setting | {' | '.join(consistency.HEADINGS)} |"
    assert first.startswith("| wheels + fixes, slip mode, ideal wheels | ")
    assert second.endswith("|  |  |"), "without fixes there is no NIS"


@pytest.mark.parametrize(("arguments", "says"), [(["fixes"], "fixes_slip"), (["--seeds", "0"], "1 or more")])
def test_wrong_arguments_are_refused(arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        consistency.main(arguments)
    assert refused.value.code == 2
    assert says in capsys.readouterr().err
