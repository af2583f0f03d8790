# SPDX-License-Identifier: MIT
"""Requests for parameters that the robot need not hear twice: its answers go to every client."""

from __future__ import annotations

from collections.abc import Hashable

from omni.hub.rules import Kind
from omniwheel.dialect import Message

LIST_SILENCE_S = 1.5
"""A list is under way as long as parameters of it come no further apart than this."""
READ_S = 1.0
"""A parameter that one client asked for is not asked for again for another one within this time."""
_NO_INDEX = 65535


class ParameterRequests:
    """Which list and which single parameters are on their way."""

    def __init__(self) -> None:
        self._list_s = float("-inf")
        self._reads: dict[Hashable, tuple[int, float]] = {}

    def is_new(self, client: int, message: Message, kind: Kind, now_s: float) -> bool:
        """Return whether the robot must hear a request, or it repeats a recent one."""
        if kind is Kind.LIST:
            return self.list_is_new(now_s)
        return kind is not Kind.READ or self.read_is_new(client, message, now_s)

    def list_is_new(self, now_s: float) -> bool:
        """Return whether no list is on its way; from now on one is."""
        if now_s - self._list_s < LIST_SILENCE_S:
            return False
        self._list_s = now_s
        return True

    def read_is_new(self, client: int, message: Message, now_s: float) -> bool:
        """Return whether no other client waits for this parameter; a client's own repetition is new."""
        index = int(message.param_index)
        key: Hashable = index if index >= 0 else str(message.param_id)
        asker, at_s = self._reads.get(key, (client, float("-inf")))
        if asker != client and now_s - at_s < READ_S:
            return False
        self._reads[key] = (client, now_s)
        return True

    def seen(self, value: Message, now_s: float) -> None:
        """Take note of a PARAM_VALUE."""
        self._reads.pop(str(value.param_id), None)
        self._reads.pop(int(value.param_index), None)
        if value.param_index == value.param_count - 1:
            self._list_s = float("-inf")
        elif value.param_index != _NO_INDEX and now_s - self._list_s < LIST_SILENCE_S:
            self._list_s = now_s
