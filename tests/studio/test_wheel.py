# SPDX-License-Identifier: MIT
"""The wheel that users install brings the studio's whole page."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
STUDIO = ROOT / "host" / "omni" / "studio"


@pytest.mark.nightly
def test_the_wheel_holds_every_file_of_the_page(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "-q", "-w", str(tmp_path), "."]
    subprocess.run(words, cwd=ROOT, check=True)
    (wheel,) = tmp_path.glob("omniwheel-*.whl")
    inside = set(zipfile.ZipFile(wheel).namelist())
    files = [path for folder in ("page", "vendor") for path in (STUDIO / folder).iterdir() if path.is_file()]
    assert len(files) > 15
    assert {f"omni/studio/{path.relative_to(STUDIO).as_posix()}" for path in files} <= inside
