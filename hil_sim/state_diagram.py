# SPDX-License-Identifier: MIT
"""The safety states as a diagram, drawn from the table that the robot uses."""

from __future__ import annotations

from omniwheel._core import ffi, lib

EVENTS = {
    "OMNI_SAFETY_READY": "ready",
    "OMNI_SAFETY_ARM": "arm",
    "OMNI_SAFETY_DISARM": "disarm",
    "OMNI_SAFETY_FAULT": "stop fault",
    "OMNI_SAFETY_ESTOP": "emergency stop",
    "OMNI_SAFETY_ESTOP_CLEAR": "release",
}
"""Events of ``omni_safety_event_t`` and what the diagram calls them."""


def _name(state: int) -> str:
    return str(ffi.string(lib.omni_safety_state_name(state)).decode()).upper()


def diagram() -> str:
    """Return the table as a Mermaid state diagram; what leaves a state as it is, is not drawn."""
    lines = ["```mermaid", "stateDiagram-v2", f"    [*] --> {_name(0)}"]
    for state in range(lib.OMNI_STATE_COUNT):
        arrows: dict[int, list[str]] = {}
        for event, words in EVENTS.items():
            following = lib.omni_safety_next(state, getattr(lib, event))
            if following != state:
                arrows.setdefault(following, []).append(words)
        lines += [f"    {_name(state)} --> {_name(to)}: {', '.join(words)}" for to, words in arrows.items()]
    return "\n".join([*lines, "```"])
