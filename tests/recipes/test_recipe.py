# SPDX-License-Identifier: MIT
"""The reader of recipes, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.recipes.recipe import Edit, RecipeError, read_page

PAGE = """
# A thing

Create `a/new.c`:

```c
int a;

int b;
```

Words. In `table.toml`, put `b = 2, c = 3` in place of
`b = 2`. More words.

In `table.toml`, add below the line that begins with `FIRST`:

```toml
SECOND = 2
```

```
an example that nobody asked for
```
"""


def test_a_page_is_read_in_its_order() -> None:
    assert read_page(PAGE) == [
        Edit("a/new.c", "int a;\n\nint b;\n"),
        Edit("table.toml", "b = 2, c = 3", old="b = 2"),
        Edit("table.toml", "SECOND = 2\n", below="FIRST"),
    ]


def test_steps_do_what_they_say(tmp_path: Path) -> None:
    (tmp_path / "table.toml").write_text("  FIRST = 1 # b = 2\nLAST = 9\n")
    for edit in read_page(PAGE):
        edit.apply(tmp_path)
    assert (tmp_path / "table.toml").read_text() == "  FIRST = 1 # b = 2, c = 3\nSECOND = 2\nLAST = 9\n"
    assert (tmp_path / "a" / "new.c").read_text() == "int a;\n\nint b;\n"


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    (tmp_path / "t").write_text("one\none\n")
    for edit, words in (
        (Edit("t", "x"), "is there already"),
        (Edit("t", "x", old="one"), "2 times"),
        (Edit("t", "x", below="two"), "0 lines"),
    ):
        with pytest.raises(RecipeError, match=words):
            edit.apply(tmp_path)
    with pytest.raises(RecipeError, match="no code follows"):
        read_page("Create `a`:\n\nNothing.\n\nCreate `b`:\n")
