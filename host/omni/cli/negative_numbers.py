# SPDX-License-Identifier: MIT
"""Commands whose arguments are numbers: ``omni drive velocity 0.1 -0.2 0`` needs no ``--`` before the negative one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from typer.core import TyperCommand

_NEGATIVE = re.compile(r"-(\d|\.\d|inf$|nan$)")


class NumberCommand(TyperCommand):
    """A command in whose line a word like -0.2 is an argument, unless it is the value of an option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command's words."""
        if "--" not in args and any(_NEGATIVE.match(word) for word in args):
            args = _arguments_last(args, self._words_of_options())
        return super().parse_args(ctx, args)

    def _words_of_options(self) -> Mapping[str, int]:
        """Return how many words follow each option."""
        options = [parameter for parameter in self.params if parameter.param_type_name == "option"]
        return {
            name: 0 if getattr(option, "is_flag", False) else option.nargs
            for option in options
            for name in (*option.opts, *option.secondary_opts)
        }


def _arguments_last(args: list[str], words_of_options: Mapping[str, int]) -> list[str]:
    options: list[str] = []
    arguments: list[str] = []
    rest = iter(args)
    for word in rest:
        if not word.startswith("-") or _NEGATIVE.match(word):
            arguments.append(word)
            continue
        options.append(word)
        options += [value for _, value in zip(range(words_of_options.get(word, 0)), rest, strict=False)]
    return [*options, "--", *arguments]
