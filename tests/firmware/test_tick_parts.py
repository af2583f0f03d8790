# SPDX-License-Identifier: MIT
"""The punctuality of ticks as it is measured, and the lamp's patterns."""

from __future__ import annotations

import ctypes
import random
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.native import ROOT, kept_library

PERIOD_NS = 1_000_000
WINDOW = 1000
STATES = {"init": 0, "disarmed": 1, "armed": 2, "failsafe": 3, "estop": 4}
SLOTS = 20


@pytest.fixture(scope="module")
def parts() -> ctypes.CDLL:
    sources = [ROOT / "firmware/app/tick/tick_jitter.cpp", ROOT / "firmware/app/services/status_light.cpp"]
    shim = Path(__file__).parent / "tick_parts_shim.cpp"
    library = ctypes.CDLL(str(kept_library("tick_parts", [*sources, shim])))
    library.light_pattern.restype = ctypes.c_uint32
    library.light_on.restype = ctypes.c_bool
    library.light_on.argtypes = [ctypes.c_int, ctypes.c_bool, ctypes.c_uint64]
    return library


def jitter_of(parts: ctypes.CDLL, starts_ns: Sequence[int]) -> list[float]:
    starts = (ctypes.c_uint64 * len(starts_ns))(*starts_ns)
    out = (ctypes.c_float * len(starts_ns))()
    parts.jitter_run(starts, len(starts_ns), out)
    return list(out)


def test_punctual_ticks_have_no_jitter_and_nothing_is_said_before_a_window_is_complete(parts: ctypes.CDLL) -> None:
    jitter = jitter_of(parts, [12345 + i * PERIOD_NS for i in range(3 * WINDOW)])
    assert jitter == [0.0] * len(jitter)


def test_jitter_is_the_spread_of_the_starts_whatever_the_first_tick_did(parts: ctypes.CDLL) -> None:
    rng = random.Random(4)
    late = [rng.randrange(0, 20_000) for _ in range(2 * WINDOW)]
    late[0] = 19_999  # a late first tick must not make the others look early
    jitter = jitter_of(parts, [i * PERIOD_NS + x for i, x in enumerate(late)])
    assert jitter[WINDOW - 2] == 0.0
    for window in range(2):
        part = late[window * WINDOW : (window + 1) * WINDOW]
        assert jitter[(window + 1) * WINDOW - 1] == pytest.approx((max(part) - min(part)) * 1e-3, abs=1e-3)


def test_missed_ticks_count_as_late_once_and_do_not_shift_the_grid(parts: ctypes.CDLL) -> None:
    starts = [i * PERIOD_NS for i in range(3 * WINDOW + 10)]
    del starts[500:503]  # three ticks never ran
    starts[500] += 250_000
    jitter = jitter_of(parts, starts)
    assert jitter[WINDOW - 1] == pytest.approx(3250.0)
    assert jitter[2 * WINDOW - 1] == 0.0


def test_a_clock_that_runs_a_little_faster_than_the_timer_is_hardly_jitter(parts: ctypes.CDLL) -> None:
    drift_ns = 20  # 20 ppm
    jitter = jitter_of(parts, [i * (PERIOD_NS + drift_ns) for i in range(50 * WINDOW)])
    assert max(jitter) <= drift_ns * WINDOW * 1e-3


def test_every_state_has_its_own_pattern_and_none_is_dark(parts: ctypes.CDLL) -> None:
    patterns = [parts.light_pattern(state, True) for state in STATES.values()]
    patterns.append(parts.light_pattern(STATES["disarmed"], False))
    # Seen from any moment on: no pattern is another one rotated.
    rotated = [{(p >> n | p << (SLOTS - n)) & (1 << SLOTS) - 1 for n in range(SLOTS)} for p in patterns]
    for i, pattern in enumerate(patterns):
        assert 0 < pattern < 1 << SLOTS
        assert all(pattern not in rotated[j] for j in range(len(patterns)) if j != i)


def test_only_disarmed_depends_on_the_ground_station(parts: ctypes.CDLL) -> None:
    for name, state in STATES.items():
        same = parts.light_pattern(state, True) == parts.light_pattern(state, False)
        assert same == (name != "disarmed")


def test_a_state_out_of_range_looks_like_an_emergency_stop(parts: ctypes.CDLL) -> None:
    assert parts.light_pattern(99, True) == parts.light_pattern(STATES["estop"], True)


@pytest.mark.parametrize("state", STATES.values())
def test_the_lamp_plays_its_pattern_every_two_seconds(parts: ctypes.CDLL, state: int) -> None:
    pattern = parts.light_pattern(state, False)
    for start_us in (0, 2_000_000, 86_400_000_000_000):
        seen = sum(parts.light_on(state, False, start_us + slot * 100_000 + 50_000) << slot for slot in range(SLOTS))
        assert seen == pattern


def test_the_documentation_shows_the_patterns(parts: ctypes.CDLL) -> None:
    text = (ROOT / "docs" / "guides" / "bring-up.md").read_text(encoding="utf-8")
    shown = [int(bits[::-1], 2) for bits in re.findall(r"`([01]{20})`", text)]
    order = [
        ("init", True),
        ("disarmed", True),
        ("disarmed", False),
        ("armed", True),
        ("failsafe", True),
        ("estop", True),
    ]
    assert shown == [parts.light_pattern(STATES[name], ground_station) for name, ground_station in order]
