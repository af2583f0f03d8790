# SPDX-License-Identifier: MIT
"""What was changed from this page: undo and redo."""

from __future__ import annotations

from collections.abc import Mapping

from omniwheel.errors import ParameterError
from omniwheel.parameters import Parameters, ParameterValue

Values = dict[str, float]


class Edits:
    """Sets parameters so that each step can be taken back. Steps count from the moment of connecting."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._undo: list[tuple[Values, Values]] = []
        self._redo: list[tuple[Values, Values]] = []
        self._last: object = None

    @property
    def steps(self) -> tuple[int, int]:
        """Return how many steps can be undone and redone."""
        return len(self._undo), len(self._redo)

    def set(self, values: Mapping[str, ParameterValue], step: object = None) -> Values:
        """Set parameters, all or none; return what they were before. Raises ParameterError, OmniError.

        What comes again and again with the same ``step``, as while a slider is dragged, is undone in one go.
        """
        wanted = {name: self._parameters.check(name, value) for name, value in values.items()}
        before = {name: self._parameters[name] for name in wanted}
        changed = {name: value for name, value in wanted.items() if value != before[name]}
        self._parameters.set_many(changed)
        if not changed:
            return before
        if step is not None and step == self._last and self._undo and self._undo[-1][1].keys() == changed.keys():
            self._undo[-1] = (self._undo[-1][0], changed)
        else:
            self._undo.append(({name: before[name] for name in changed}, changed))
        self._last = step
        self._redo.clear()
        return before

    def undo(self) -> Values:
        """Take the last step back; return the values that are in use then. Raises ParameterError."""
        return self._move(self._undo, self._redo, 0, "undo")

    def redo(self) -> Values:
        """Take the last undone step again. Raises ParameterError."""
        return self._move(self._redo, self._undo, 1, "redo")

    def _move(
        self, source: list[tuple[Values, Values]], target: list[tuple[Values, Values]], side: int, what: str
    ) -> Values:
        if not source:
            raise ParameterError(f"nothing to {what}")
        step = source[-1]
        self._last = None
        self._parameters.set_many(step[side])
        target.append(source.pop())
        return step[side]
