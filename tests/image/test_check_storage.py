# SPDX-License-Identifier: MIT
"""The checks of an image that are about its store and its restarts: a good image passes, and planted bugs are found."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.image_file import FLASH_BASE, Image, read_image
from hil_sim.scenario import load_scenario
from image_check.bench import CheckError, Context
from image_check.hangs import crash, watchdog
from image_check.power import power_cuts
from image_check.restarts import reboots
from image_check.signing import signing_clock
from image_check.storage import saves

Run = Callable[[Context], list[str]]
RETURN_0 = struct.pack("<2H", 0x2000, 0x4770)
RETURN_1 = struct.pack("<2H", 0x2001, 0x4770)
NOTHING = struct.pack("<H", 0xBF00)
STORE_R1_AT_R0 = struct.pack("<H", 0x6001)
BRANCH_TO_ITSELF = struct.pack("<H", 0xE7FE)


@pytest.fixture(scope="module")
def good(image: Path) -> Context:
    """Return what the checks need, as before an upload."""
    return Context(read_image(image), load_scenario("stand", "three_wheel"), depth="short")


def place_in_flash(image: Image, symbol: str) -> int:
    """Return where in flash memory the start-up code finds a function."""
    address = image.symbols[symbol] & ~1
    for segment in image.elf.iter_segments("PT_LOAD"):
        if segment["p_vaddr"] <= address < segment["p_vaddr"] + segment["p_filesz"]:
            return int(segment["p_paddr"]) - FLASH_BASE + address - int(segment["p_vaddr"])
    raise AssertionError(symbol)


def planted(context: Context, symbol: str, code: bytes, *, instead_of: bytes = b"") -> Context:
    """Return the same with other code at a function's beginning, or at the first place in it that has `instead_of`."""
    image = context.image
    at = place_in_flash(image, symbol)
    if instead_of:
        at = image.flash.index(instead_of, at, at + 64)
    return replace(context, image=replace(image, flash=image.flash[:at] + code + image.flash[at + len(code) :]))


@pytest.mark.nightly  # `make firmware-check` runs the same checks
@pytest.mark.parametrize("check", [saves, power_cuts, watchdog, crash, signing_clock])
def test_a_good_image_passes(good: Context, check: Run) -> None:
    assert all(figure for figure in check(good))


@pytest.mark.nightly
def test_a_good_image_survives_restarts(good: Context) -> None:
    assert reboots(good)[0].startswith("8 starts; power cuts: ")


@pytest.mark.nightly
def test_a_day_of_a_signing_clock_needs_late_erases(good: Context) -> None:
    figures = signing_clock(replace(good, depth="ci"))
    assert "late erases, the first after" in figures[1]


@pytest.mark.parametrize(
    ("check", "symbol", "code", "words"),
    [
        (saves, "_ZN4omni8FlashLog11take_recordEjPj", RETURN_0, "read back wrong"),
        (saves, "_ZN4omni8FlashLog6appendEjj", RETURN_1, "read back wrong"),
        (power_cuts, "_ZN4omni8FlashLog5blankEjj", RETURN_1, "would set bits"),
        (reboots, "_ZN4omni8FlashLog6appendEjj", RETURN_1, "neither the old nor the new"),
        (watchdog, "_ZN4omni16Teensy40Watchdog9configureEm", RETURN_0, "no reset"),
        (crash, "omni_on_fault", BRANCH_TO_ITSELF, "output-enable pin is on for"),
        (signing_clock, "_ZN4omni7Signing5storeEy", RETURN_1, "changes nothing in flash memory"),
    ],
)
def test_a_planted_bug_is_found(good: Context, check: Run, symbol: str, code: bytes, words: str) -> None:
    with pytest.raises(CheckError, match=words):
        check(planted(good, symbol, code))


def test_a_fault_handler_that_leaves_the_output_on_is_found(good: Context) -> None:
    with pytest.raises(CheckError, match="output-enable pin is on for"):
        crash(planted(good, "omni_on_fault", NOTHING, instead_of=STORE_R1_AT_R0))
