# SPDX-License-Identifier: MIT
"""The parity program on Unicorn's Cortex-M7, around the core inside the flashed image or around a newer compiler's."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tests.image.elf_call import ElfCall
from tests.image.guest import GuestSources, build_alone, build_guest, run_guest
from tests.parity.builds import OUT, ROOT

_PROGRAM = ROOT / "tests" / "parity" / "program"
_CORE = ROOT / "shared" / "core"
FOLDER = OUT / "image"


def core_sources() -> list[Path]:
    """Return the files of the control core, the generated tables included."""
    return [*sorted((_CORE / "src").rglob("*.c")), *sorted((OUT / "generated" / "src").glob("*.c"))]


def core_includes() -> list[Path]:
    """Return the folders of its headers."""
    return [_CORE / "include", OUT / "generated" / "include"]


def _sources() -> GuestSources:
    return GuestSources(sorted(_PROGRAM.glob("*.c")), core_sources(), core_includes())


@dataclass(frozen=True)
class FlashedCore:
    """The core as it was linked into an image."""

    image: Path

    @property
    def name(self) -> str:
        return f"image {self.image.parent.name}"

    def prepare(self) -> None:
        """Build the parity program as a guest of the image. Raises BuildError."""
        build_guest(FOLDER, self.guest.stem, _sources(), self.image)

    def parity(self, arguments: list[str]) -> tuple[int, str]:
        """Run it and return its exit code and output."""
        machine = ElfCall(self.image)
        machine.load(self.guest)
        return run_guest(machine, self.guest.stem, arguments)

    @property
    def guest(self) -> Path:
        """Path of the parity program for this image."""
        name = f"parity-{self.image.parent.name}"
        return FOLDER / name / f"{name}.elf"


@dataclass(frozen=True)
class NewerCore:
    """The core compiled by another compiler as the image's is; the program around it comes from the usual one."""

    compiler: Path

    name = "newer gcc"
    _program = FOLDER / "parity-newer" / "parity-newer.elf"

    def prepare(self) -> None:
        """Build core and program. Raises BuildError."""
        build_alone(FOLDER, self._program.stem, _sources(), str(self.compiler))

    def parity(self, arguments: list[str]) -> tuple[int, str]:
        """Run it and return its exit code and output."""
        return run_guest(ElfCall(self._program), self._program.stem, arguments)
