# SPDX-License-Identifier: MIT
"""Whether this user may open serial ports and flash a Teensy (Linux; elsewhere nothing has to be set up)."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from omniwheel.ports import TEENSY_VID

UDEV_FOLDERS = (Path("/etc/udev/rules.d"), Path("/lib/udev/rules.d"), Path("/run/udev/rules.d"))
SERIAL_GROUPS = ("dialout", "uucp")


def teensy_rule(folders: Iterable[Path] = UDEV_FOLDERS) -> Path | None:
    """Return the udev rule file that speaks of PJRC's USB vendor id, or None."""
    wanted = f"{TEENSY_VID:04x}"
    for folder in folders:
        for path in sorted(folder.glob("*.rules")) if folder.is_dir() else ():
            try:
                text = path.read_text(encoding="utf-8", errors="replace").lower()
            except OSError:
                continue
            if any(wanted in line and not line.lstrip().startswith("#") for line in text.splitlines()):
                return path
    return None


def refused_ports(devices: Sequence[str]) -> list[str]:
    """Return the ports that this user may not open."""
    return [device for device in devices if not os.access(device, os.R_OK | os.W_OK)]


def missing_group(groups: Sequence[str] = SERIAL_GROUPS) -> str | None:
    """Return the group that owns serial ports here and this user is not in; None: in it, or there is none."""
    import grp

    mine = {*os.getgroups(), os.getegid()}
    for name in groups:
        try:
            group = grp.getgrnam(name)
        except KeyError:
            continue
        return None if group.gr_gid in mine or os.geteuid() == 0 else name
    return None
