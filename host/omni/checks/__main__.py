# SPDX-License-Identifier: MIT
"""``python -m omni.checks``."""

from omni.checks import app

if __name__ == "__main__":
    app(prog_name="python -m omni.checks")
