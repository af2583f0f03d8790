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

In `table.toml`, add `e = N` at the end of `values` of `LIST`, and in `table.toml`, add `e = "f"`
at the end of `names` of `LIST`.

In `table.toml`, add below the last line that begins with `LAST`:

```toml
LAST = 10
```

In `table.toml`, add above the line that begins with `[more]`:

```toml
ABOVE = 1
```

In `table.toml`, add at the end of the table `[more]`:

```toml
x = 2
```

```
an example that nobody asked for
```
"""


def test_a_page_is_read_in_its_order() -> None:
    assert read_page(PAGE) == [
        Edit("a/new.c", "int a;\n\nint b;\n"),
        Edit("table.toml", "b = 2, c = 3", "replace", "b = 2"),
        Edit("table.toml", "SECOND = 2\n", "below", "FIRST"),
        Edit("table.toml", "e = N", "values", "LIST"),
        Edit("table.toml", 'e = "f"', "names", "LIST"),
        Edit("table.toml", "LAST = 10\n", "last", "LAST"),
        Edit("table.toml", "ABOVE = 1\n", "above", "[more]"),
        Edit("table.toml", "x = 2\n", "table", "[more]"),
    ]


def test_steps_do_what_they_say(tmp_path: Path) -> None:
    lists = 'LIST = { values = { a = 0, z = 7 }, names = { a = "b" } }\n'
    (tmp_path / "table.toml").write_text(
        f"  FIRST = 1 # b = 2\n{lists}LAST = 8\nLAST = 9\n[more]\nx = 1\n\n# Other\n[other]\n"
    )
    for edit in read_page(PAGE):
        edit.apply(tmp_path)
    lists = 'LIST = { values = { a = 0, z = 7, e = 8 }, names = { a = "b", e = "f" } }\n'
    assert (tmp_path / "table.toml").read_text() == (
        f"  FIRST = 1 # b = 2, c = 3\nSECOND = 2\n{lists}LAST = 8\nLAST = 9\nLAST = 10\n"
        "ABOVE = 1\n[more]\nx = 1\nx = 2\n\n# Other\n[other]\n"
    )
    assert (tmp_path / "a" / "new.c").read_text() == "int a;\n\nint b;\n"


def test_a_message_takes_the_next_number(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_text('<messages>\n<message id="9"/>\n<message id="12"/>\n')
    Edit("m.xml", '<message id="N" name="A"/>\n', "below", "<messages>").renamed({"A": "B"}).apply(tmp_path)
    assert (tmp_path / "m.xml").read_text().splitlines()[1] == '<message id="13" name="B"/>'


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    (tmp_path / "t").write_text("one\none\n")
    for edit, words in (
        (Edit("t", "x"), "is there already"),
        (Edit("t", "x", "replace", "one"), "2 times"),
        (Edit("t", "x", "below", "two"), "0 lines"),
        (Edit("t", "x", "below", "one"), "2 lines"),
        (Edit("t", "x", "values", "one"), "no list"),
    ):
        with pytest.raises(RecipeError, match=words):
            edit.apply(tmp_path)
    with pytest.raises(RecipeError, match="no code follows"):
        read_page("Create `a`:\n\nNothing.\n\nCreate `b`:\n")
