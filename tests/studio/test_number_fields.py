# SPDX-License-Identifier: MIT
"""Numbers that a person types: a decimal comma is understood, nothing that was typed is dropped."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.studio.parts import until

GAIN = "ISMC_LAM_XY"
FIELD = f"#field-{GAIN}"
KEPT = "8"
REFUSED = "[...document.querySelectorAll('.refusal')].map((shown) => shown.textContent)"


@pytest.fixture(scope="module")
def page(shared_page: Page) -> Iterator[Page]:
    shared_page.fill("#search", GAIN)
    until(shared_page, f"studio.parameters.value_of('{GAIN}') !== undefined")
    before = shared_page.input_value(FIELD)
    yield shared_page
    type_gain(shared_page, before)


def value_at_robot(page: Page) -> float:
    return float(page.evaluate(f"studio.parameters.value_of('{GAIN}')"))


def type_gain(page: Page, typed: str) -> None:
    """Type key by key: setting a field's value would pass over what the browser makes of the keys."""
    page.click(FIELD)
    page.keyboard.press("Control+a")
    page.keyboard.press("Delete")
    page.keyboard.type(typed)
    page.keyboard.press("Tab")


@pytest.mark.parametrize(("typed", "meant"), [("12,5", 12.5), ("0,125", 0.125)])
def test_a_number_is_understood_as_it_was_typed(page: Page, typed: str, meant: float) -> None:
    type_gain(page, typed)
    until(page, f"studio.parameters.value_of('{GAIN}') === {meant}")
    until(page, f"document.querySelector('{FIELD}').value === '{meant:g}'")
    assert page.text_content(f"[data-name={GAIN}] .refusal") == ""


@pytest.mark.parametrize("typed", ["abc", "1,500", "1.234,5", "", "0x10", "1e999"])
def test_what_is_no_number_is_refused_with_a_reason(page: Page, typed: str) -> None:
    type_gain(page, KEPT)
    until(page, f"studio.parameters.value_of('{GAIN}') === {KEPT}")
    type_gain(page, typed)
    until(page, f"document.querySelector('[data-name={GAIN}] .refusal').textContent !== ''")
    assert typed in (page.text_content(f"[data-name={GAIN}] .refusal") or "")
    assert page.input_value(FIELD) == KEPT, "the field shows what the robot uses"
    assert value_at_robot(page) == float(KEPT)


def test_arrow_keys_change_the_last_digit(page: Page) -> None:
    type_gain(page, "7.25")
    until(page, f"studio.parameters.value_of('{GAIN}') === 7.25")
    page.press(FIELD, "ArrowUp")
    until(page, f"Math.abs(studio.parameters.value_of('{GAIN}') - 7.26) < 1e-5")


STEPS = [
    ("1e-7", "ArrowUp", "2e-7"),
    ("1.5E-7", "ArrowDown", "1.4e-7"),
    ("9.9e3", "ArrowUp", "10.0e3"),
    ("7.50", "ArrowUp", "7.51"),
    ("12,5", "ArrowDown", "12.4"),
    ("-0.1", "ArrowUp", "0.0"),
    ("0.1234567890123456", "ArrowUp", "0.1234567890123456"),
]


@pytest.mark.parametrize(("typed", "key", "then"), STEPS)
def test_a_step_is_one_of_the_last_digit_as_it_was_typed(page: Page, typed: str, key: str, then: str) -> None:
    page.fill("#target-x", typed)
    page.press("#target-x", key)
    assert page.input_value("#target-x") == then


def test_a_step_keeps_a_field_in_its_range(page: Page) -> None:
    page.fill("#laps", "1")
    page.press("#laps", "ArrowDown")
    assert page.input_value("#laps") == "1"
    page.fill("#draw-speed", "0.012")
    for _ in range(3):
        page.press("#draw-speed", "ArrowDown")
    assert page.input_value("#draw-speed") == "0.01"
    page.fill("#draw-speed", "1e3")
    page.press("#draw-speed", "ArrowUp")
    assert page.input_value("#draw-speed") == "2e3"
    page.fill("#draw-speed", "0.2")


def test_a_click_on_the_map_fills_a_field_that_had_a_problem(page: Page) -> None:
    page.fill("#target-x", "abc")
    page.press("#target-x", "Tab")
    assert page.get_attribute("#target-x", "aria-invalid") == "true"
    page.locator("#map").click()
    until(page, "document.getElementById('target-x').value !== 'abc'")
    until(page, f"{REFUSED}.every((text) => text === '')")
    assert page.evaluate("document.getElementById('target-form').checkValidity()"), "Drive there is not blocked"
    assert page.get_attribute("#target-x", "aria-invalid") == "false"


FIELDS = ["#target-x", "#target-theta", "#draw-speed", "#laps", "#experiment-choices input"]


@pytest.mark.parametrize("field", FIELDS)
def test_every_field_for_a_number_says_what_it_does_not_take(page: Page, field: str) -> None:
    target = page.locator(field).first
    target.fill("")
    target.press_sequentially("abc")
    target.press("Tab")
    until(page, f"{REFUSED}.some((text) => text.includes('abc'))")
    assert target.input_value() == "abc"
    target.fill("1")
    target.press("Tab")
    until(page, f"{REFUSED}.every((text) => text === '')")


def test_a_browsers_number_field_is_not_used(page: Page) -> None:
    """It drops characters that it does not know, before the page sees them."""
    assert page.locator("input[type=number]").count() == 0
