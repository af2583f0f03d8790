# SPDX-License-Identifier: MIT
"""PlatformIO runs this after it has linked: prints what memory the firmware takes, and fails above the budget."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from SCons.Script import DefaultEnvironment

env: Any = DefaultEnvironment()
sys.path.insert(0, str(Path(env.subst("$PROJECT_DIR")) / "firmware" / "boards" / "teensy40" / "platformio"))

from build_inputs import CONTROLLER  # noqa: E402
from memory_budget import CONTROLLER_CODE, Usage, report  # noqa: E402


def check(target: Any, source: Any, env: Any) -> int:
    """Measure the program just linked."""
    command = ["arm-none-eabi-size", "-A", str(target[0])]
    search = {"PATH": str(env["ENV"]["PATH"])}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=search)
    usage = Usage.from_size_output(done.stdout)
    added = CONTROLLER_CODE if os.environ.get(CONTROLLER) else 0
    print(report(usage, added))
    return 0 if usage.within_budget(added) else 1


env.AddPostAction("$PROGPATH", env.VerboseAction(check, "Measuring memory"))
