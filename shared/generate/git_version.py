# SPDX-License-Identifier: MIT
"""Writes ``omni/version_gen.h``: the project's version and the state of the source tree at build time."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

NO_GIT = "0" * 16


def _git(root: Path, *arguments: str) -> str | None:
    command = ["git", "-C", str(root), *arguments]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=True, timeout=30)
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.strip()


def git_state(root: Path) -> tuple[str, bool]:
    """Return the first 16 hex digits of the commit and whether tracked files differ from it.

    Without git, or if ``root`` is not the top of its own work tree, it is 16 zeros and False.
    """
    top = _git(root, "rev-parse", "--show-toplevel")
    commit = _git(root, "rev-parse", "HEAD")
    if not top or not commit or Path(top).resolve() != root.resolve():
        return NO_GIT, False
    changes = _git(root, "status", "--porcelain", "--untracked-files=no")
    return commit[:16], bool(changes)


def version_header(version: str, commit: str, dirty: bool) -> str:
    """Return the header's text; ``version`` is major.minor.patch."""
    match = re.match(r"(\d+)\.(\d+)\.(\d+)", version)
    if match is None:
        raise ValueError(f"version {version!r}: major.minor.patch is needed")
    major, minor, patch = match.groups()
    return f"""\
/* SPDX-License-Identifier: MIT
 * Written by shared/generate at build time. */
#ifndef OMNI_VERSION_GEN_H
#define OMNI_VERSION_GEN_H

#include <stdint.h>

#define OMNI_VERSION_MAJOR {major}
#define OMNI_VERSION_MINOR {minor}
#define OMNI_VERSION_PATCH {patch}
#define OMNI_VERSION_STRING "{version}"
/* First 64 bits of the commit; zero when built outside a git work tree. */
#define OMNI_GIT_HASH UINT64_C(0x{commit})
#define OMNI_GIT_HASH_STRING "{commit}"
#define OMNI_GIT_DIRTY {int(dirty)}

#endif
"""


def write_version_header(root: Path, version: str, out: Path) -> None:
    """Write the header below ``out`` unless it says the same already, so that nothing is rebuilt for nothing."""
    path = out / "include" / "omni" / "version_gen.h"
    text = version_header(version, *git_state(root))
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
