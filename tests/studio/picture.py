# SPDX-License-Identifier: MIT
"""The studio's picture of the guide: ``python -m tests.studio.picture``. Somebody has to look at it.

Beside it stands the fingerprint of the page's files. With another one the picture is old.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from playwright.sync_api import sync_playwright

from tests.studio.parts import CHROMIUM, SAFE, studio, until

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "images" / "studio.png"
FINGERPRINT = PICTURE.with_suffix(".sha256")
PAGE = ROOT / "host" / "omni" / "studio" / "page"


def fingerprint() -> str:
    """Return the SHA-256 of what decides how the page looks and what is on it."""
    files = sorted(path for path in PAGE.iterdir() if path.is_file())
    return hashlib.sha256(b"".join(path.name.encode() + path.read_bytes() for path in files)).hexdigest()


def draw(path: Path) -> None:
    """Drive the simulated fast robot along its path, change a gain, and take the picture."""
    with studio("fast") as program, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SAFE)
        page = browser.new_page(viewport={"width": 1500, "height": 930}, color_scheme="light")
        page.goto(program.url)
        until(page, "robot?.pose")
        page.click("#arm")
        until(page, "robot.armed")
        page.select_option("#path", "rose")
        page.click("#start-path")
        until(page, "robot.phase === 'path' && robot.path_time_s > 3")
        page.fill("#search", "ISMC")
        page.fill("#field-ISMC_LAM_XY", "12")
        page.press("#field-ISMC_LAM_XY", "Enter")
        until(page, "robot.path_time_s > 6")
        page.screenshot(path=path)
        browser.close()


if __name__ == "__main__":
    draw(PICTURE)
    FINGERPRINT.write_text(fingerprint() + "\n", encoding="ascii")
