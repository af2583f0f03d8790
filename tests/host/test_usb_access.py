# SPDX-License-Identifier: MIT
from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from omniwheel.usb_access import missing_group, refused_ports, teensy_rule

RULE = 'ATTRS{idVendor}=="16C0", ATTRS{idProduct}=="04*", MODE:="0666"\n'

linux_only = pytest.mark.skipif(sys.platform == "win32", reason="POSIX groups")


def test_the_rule_is_found_by_the_vendor_id_whatever_its_name(tmp_path: Path) -> None:
    (tmp_path / "10-others.rules").write_text("# 16c0 in a comment\n", encoding="utf-8")
    assert teensy_rule([tmp_path, tmp_path / "missing"]) is None
    (tmp_path / "20-mine.rules").write_text(RULE, encoding="utf-8")
    assert teensy_rule([tmp_path / "missing", tmp_path]) == tmp_path / "20-mine.rules"


def test_ports_that_cannot_be_opened_are_named(tmp_path: Path) -> None:
    port = tmp_path / "ttyACM0"
    port.touch()
    assert refused_ports([str(port), str(tmp_path / "gone")]) == [str(tmp_path / "gone")]


@linux_only
def test_a_group_that_one_is_not_in_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import grp

    other = next(group for group in grp.getgrall() if group.gr_gid not in {*os.getgroups(), os.getegid()})
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert missing_group(["no_such_group", other.gr_name]) == other.gr_name
    assert missing_group([grp.getgrgid(os.getegid()).gr_name]) is None
    assert missing_group(["no_such_group"]) is None
