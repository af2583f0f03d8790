# SPDX-License-Identifier: MIT
"""Stand-ins for PlatformIO, for the loader and for USB, as `omni flash` sees them."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from image_check.run import Outcome
from omni.cli import app
from omni.cli import flash as command
from omniwheel.flashing import boards, loader, source
from omniwheel.ports import Port
from tests.host.hex_files import teensy_program, write_hex

PROGRAM = """\
#!/bin/sh
exec '{python}' - "$0" "$@" <<'END'
import os, pathlib, sys
folder = pathlib.Path(sys.argv[1]).parent
(folder / "{name}.called").write_text(repr((sys.argv[2:], os.environ.get("OMNI_ROBOT"))))
sys.exit({exit_code})
END
"""


class Bench:
    """What the code under test sees of PlatformIO, of the loader and of USB."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        self.ports: list[Port] = []
        self.waiting: int | None = 0
        self.stays = False
        self.rebooted: list[tuple[str, int]] = []
        self.hex = write_hex(folder / "firmware.hex", teensy_program())
        self.git_hash = ""
        self.program("pio", 0)
        self.program("teensy_loader_cli", 0)
        monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
        monkeypatch.setenv("PLATFORMIO_CORE_DIR", str(folder / "core"))
        for module in (boards, loader):
            monkeypatch.setattr(module, "bootloaders", lambda: self.waiting)
        monkeypatch.setattr(boards, "serial_ports", lambda: self.ports)
        monkeypatch.setattr("omniwheel.flashing.loader.serial.Serial", self._open)
        monkeypatch.setattr(loader, "LEAVE_S", 0.0)
        monkeypatch.setattr(command, "build", self._build)
        monkeypatch.setattr(
            "image_check.run.run_checks", lambda *_, **__: [Outcome("boots", "it boots", ("0.3 s",), "", 0.1)]
        )

    def program(self, name: str, exit_code: int) -> None:
        path = self.folder / name
        path.write_text(PROGRAM.format(python=sys.executable, name=name, exit_code=exit_code))
        path.chmod(0o755)

    def called(self, name: str) -> tuple[list[str], str | None]:
        arguments, robot = eval((self.folder / f"{name}.called").read_text())
        return arguments, robot

    def was_called(self, name: str) -> bool:
        return (self.folder / f"{name}.called").exists()

    def _open(self, device: str, baud: int) -> Any:
        self.rebooted.append((device, baud))
        return open(os.devnull)

    def _build(self, robot: str) -> source.Build:
        source.build(robot)
        return source.Build(self.folder / "firmware.elf", self.hex, self.git_hash)


def teensy(device: str, number: str = "") -> Port:
    return Port(device, "USB Serial", "teensy", number)


def flash(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["flash", *arguments])
