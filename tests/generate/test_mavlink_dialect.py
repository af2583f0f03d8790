# SPDX-License-Identifier: MIT
"""The C and Python dialects come from one source and must mean the same on the wire."""

import importlib.util
import re
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from mavlink_dialect import generate_c, generate_python, trimmed_dialect
from omni_schema import SchemaError

ROOT = Path(__file__).resolve().parents[2]
LINK = ROOT / "shared" / "link"

EMPTY_DIALECT = "<mavlink><version>3</version><dialect>0</dialect><enums/><messages>{}</messages></mavlink>"


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("generated")
    generate_c(LINK, out)
    generate_python(LINK, out)
    return out


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("generated_omni_dialect", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def c_messages(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Return id, checksum seed and length of every message by name, as the C headers define them."""
    messages = {}
    for header in folder.glob("mavlink_msg_*.h"):
        text = header.read_text()
        name = re.findall(r"#define MAVLINK_MSG_ID_(\w+) (\d+)", text)[0]
        crc = re.findall(rf"#define MAVLINK_MSG_ID_{name[1]}_CRC (\d+)", text)
        length = re.findall(rf"#define MAVLINK_MSG_ID_{name[1]}_LEN (\d+)", text)
        messages[name[0]] = (int(name[1]), int(crc[0]), int(length[0]))
    return messages


def python_messages(module: Any) -> dict[str, tuple[int, int, int]]:
    return {cls.msgname: (cls.id, cls.crc_extra, cls.unpacker.size) for cls in module.mavlink_map.values()}


@pytest.mark.full
def test_checksums_and_lengths_agree(generated: Path) -> None:
    in_c = c_messages(generated / "mavlink" / "omni")
    in_python = python_messages(load(generated / "dialects" / "omni.py"))
    assert "HEARTBEAT" in in_c
    assert any(name.startswith("OMNI_") for name in in_c)
    assert in_c == {name: in_python[name] for name in in_c}


@pytest.mark.full
def test_every_message_we_define_reaches_both(generated: Path) -> None:
    ours = set(re.findall(r'<message [^>]*name="(\w+)"', (LINK / "omni.xml").read_text()))
    assert ours <= set(c_messages(generated / "mavlink" / "omni"))
    assert ours <= set(python_messages(load(generated / "dialects" / "omni.py")))


def test_our_ids_stay_clear_of_the_public_dialects(generated: Path) -> None:
    for name, (number, _, length) in c_messages(generated / "mavlink" / "omni").items():
        if name.startswith("OMNI_"):
            assert number > 60100
            assert length <= 255


def test_an_unknown_standard_message_is_named(tmp_path: Path) -> None:
    (tmp_path / "omni.xml").write_text(EMPTY_DIALECT.format(""))
    (tmp_path / "standard.toml").write_text('messages = ["HEARTBEET"]')
    with pytest.raises(SchemaError, match="did you mean HEARTBEAT"):
        trimmed_dialect(tmp_path)


def test_a_message_that_exists_already_is_refused(tmp_path: Path) -> None:
    (tmp_path / "omni.xml").write_text(EMPTY_DIALECT.format('<message id="60200" name="HEARTBEAT"/>'))
    (tmp_path / "standard.toml").write_text('messages = ["HEARTBEAT"]')
    with pytest.raises(SchemaError, match="HEARTBEAT: this message exists already"):
        trimmed_dialect(tmp_path)


def test_malformed_xml_is_named(tmp_path: Path) -> None:
    (tmp_path / "omni.xml").write_text("<mavlink>")
    (tmp_path / "standard.toml").write_text("messages = []")
    with pytest.raises(SchemaError, match=r"omni\.xml: is not valid XML"):
        trimmed_dialect(tmp_path)


@pytest.mark.full
def test_the_headers_are_the_same_on_another_day(
    generated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "strftime", lambda *_: "Fri Feb 29 2132")
    generate_c(LINK, tmp_path)
    headers = sorted((tmp_path / "mavlink").rglob("*.h"))
    assert len(headers) > 20
    for header in headers:
        assert header.read_bytes() == (generated / header.relative_to(tmp_path)).read_bytes(), header.name
