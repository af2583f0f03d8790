# SPDX-License-Identifier: MIT
"""The board layer's system part, compiled for the PC against a model of the chip's registers."""

from __future__ import annotations

import ctypes
import shutil
from pathlib import Path

import pytest

from tests.boards.teensy40.chip import write_wiring_header
from tests.native import ROOT, build_library, generated_dir

HERE = Path(__file__).resolve().parent
FAKES = HERE / "fakes_system"
BOARD = ROOT / "firmware" / "boards" / "teensy40"
BOARD_PARTS = (
    "battery",
    "clock",
    "flash_log",
    "main",
    "motor_pins",
    "motor_stop",
    "pins",
    "ports",
    "storage",
    "watchdog",
)
_RESULTS: dict[str, type] = {
    "time_us": ctypes.c_uint64,
    "time_ns": ctypes.c_uint64,
    "board_now_us": ctypes.c_uint64,
    "battery_sample": ctypes.c_float,
    "board_battery_V": ctypes.c_float,
    "board_serial_number": ctypes.c_uint64,
    "fake_journal": ctypes.c_char_p,
    "watchdog_line": ctypes.c_char_p,
    "flash_bytes": ctypes.POINTER(ctypes.c_uint8),
}
_BOOLEAN = (
    "fake_watchdog_atomic",
    "fake_watchdog_bitten",
    "fake_watchdog_misused",
    "fake_timer_fires",
    "fake_resets",
    "fake_usb_waited",
    "fake_radio_waited",
    "flash_misused",
    "flash_faulted",
    "fake_i2c_waits_for_interrupts",
    "flash_power_on",
    "usb_write",
    "radio_write",
    "storage_doubtful",
    "storage_write",
    "storage_read",
    "board_storage_fill",
    "board_output_enable_wired",
    "board_stop_button_open",
)


@pytest.fixture(scope="session")
def system_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    sources = [
        *(BOARD / f"{name}.cpp" for name in BOARD_PARTS),
        *(ROOT / "firmware" / "app" / name for name in ("storage/param_store.cpp", "drivers/pca9685.cpp")),
        *(
            ROOT / "shared" / "core" / "src" / name
            for name in ("config/params.c", "tick/loop.c", "math/math.c", "actuate/bridge.c")
        ),
        *(generated_dir() / "src").glob("*_gen.c"),
        FAKES / "fake_teensy.cpp",
        FAKES / "fake_ports.cpp",
        FAKES / "fake_flash.cpp",
        HERE / "system_shim.cpp",
    ]
    out = tmp_path_factory.mktemp("teensy40")
    # The fakes' pins come first; of the robot's own headers only those of sensors are taken: it has none.
    generated = write_wiring_header(out, ROOT / "shared" / "robots" / "three_wheel.toml")
    return build_library(out, "system", sources, [FAKES, generated])


@pytest.fixture
def chip(system_library: Path, tmp_path: Path) -> ctypes.CDLL:
    """A library of its own, so that static objects are new, with a chip just out of power-on reset and erased flash."""
    library = ctypes.CDLL(str(shutil.copy(system_library, tmp_path / system_library.name)))
    for name, result in _RESULTS.items():
        getattr(library, name).restype = result
    for name in _BOOLEAN:
        getattr(library, name).restype = ctypes.c_bool
    library.flash_program.argtypes = [ctypes.c_size_t, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t]
    library.battery_begin.argtypes = [ctypes.c_uint8, ctypes.c_float]
    for name in ("usb_read", "usb_write", "radio_read", "radio_write"):
        getattr(library, name).argtypes = [ctypes.c_char_p, ctypes.c_size_t]
    for name in ("storage_write", "storage_read"):
        getattr(library, name).argtypes = [ctypes.c_size_t, ctypes.c_char_p, ctypes.c_size_t]
    library.fake_reset()
    library.flash_reset(0xFF)
    library.watchdog_begin()
    return library
