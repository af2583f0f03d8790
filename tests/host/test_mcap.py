# SPDX-License-Identifier: MIT
"""MCAP files: read by the package mcap itself, read back as the same run, and readable up to where they were cut."""

from __future__ import annotations

import io
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

import omniwheel
from omniwheel import Run, sync
from omniwheel.errors import LogError, MissingPackageError
from omniwheel.log_sources import open_log
from omniwheel.mcap_file import CHUNK_BYTES, read_mcap, schema_of
from omniwheel.paths import robots_dir
from omniwheel.robots import read_robot
from omniwheel.run import COLUMNS
from omniwheel.tlog_reader import TlogReader


@pytest.fixture(scope="module")
def run() -> Run:
    with sync.simulate("fast_three_wheel") as robot:
        robot.parameters["LIM_V"] = 0.3
        robot.arm()
        robot.drive(0.2, 0.0, 0.5, duration=2.0)
        return robot.run


@pytest.fixture
def saved(run: Run, tmp_path: Path) -> Path:
    path = tmp_path / "drive.mcap"
    run.save(path)
    return path


def messages_of(path: Path, topic: str) -> list[dict[str, Any]]:
    with path.open("rb") as file:
        found = list(make_reader(file).iter_messages(topics=[topic]))
    assert all(channel.message_encoding == "json" and schema.encoding == "jsonschema" for schema, channel, _ in found)
    return [json.loads(message.data) for _, _, message in found]


def test_the_run_is_read_back(run: Run, saved: Path) -> None:
    again = omniwheel.load(saved)
    before, after = run.to_numpy(), again.to_numpy()
    for name in COLUMNS:
        np.testing.assert_array_equal(before[name], after[name])
    assert again.events == run.events
    assert again.parameters == run.parameters
    assert again.parameters["LIM_V"] == pytest.approx(0.3)
    assert again.robot_file == (robots_dir() / "fast_three_wheel.toml").read_bytes()


def test_it_can_be_saved_as_a_telemetry_log_again(run: Run, saved: Path, tmp_path: Path) -> None:
    omniwheel.load(saved).save(tmp_path / "drive.tlog")
    again = omniwheel.load(tmp_path / "drive.tlog")
    np.testing.assert_array_equal(again.pose, run.pose)


def test_commands_take_it_as_a_log(saved: Path) -> None:
    log = open_log(saved, read_robot("fast_three_wheel"))
    assert log.truth is not None
    assert len(log.time_s) > 50


def test_the_package_mcap_reads_poses_and_units(run: Run, saved: Path) -> None:
    poses = messages_of(saved, "/OMNI_TRACKING")
    last = [message["pose"] for message in poses if message["source_component"] == 1][-1]
    assert last == pytest.approx(run.pose[-1])
    with saved.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    schemas = {schema.name: json.loads(schema.data) for schema in summary.schemas.values()}
    fields = schemas["OMNI_WHEELS"]["properties"]
    assert "[rad/s]" in fields["speed"]["description"]
    assert fields["speed"]["type"] == "array"
    assert "[m]" in schemas["OMNI_TRACKING"]["properties"]["pose"]["description"]


def test_the_package_mcap_reads_texts_parameters_and_robot_file(run: Run, saved: Path) -> None:
    texts = [entry["message"] for entry in messages_of(saved, "/log")]
    assert any("armed" in text for text in texts)
    with saved.open("rb") as file:
        reader = make_reader(file)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {record.name: record.data for record in reader.iter_attachments()}
    assert float(metadata["parameters"]["LIM_V"]) == run.parameters["LIM_V"]
    assert attachments["robot.toml"] == run.robot_file


@pytest.mark.full
def test_a_file_that_was_cut_opens_up_to_there(run: Run, saved: Path, tmp_path: Path) -> None:
    whole = saved.read_bytes()
    whole_records = read_mcap(saved).records
    assert whole_records == run.records
    total = len(whole_records)
    kept = []
    for share in np.linspace(0.0, 1.0, 60):
        path = tmp_path / "cut.mcap"
        path.write_bytes(whole[: int(share * len(whole))])
        try:
            records = read_mcap(path).records
        except LogError:
            records = b""
        assert whole_records.startswith(records)
        kept.append(len(records))
    assert kept == sorted(kept)
    assert kept[-1] == total
    largest_step = max(np.diff(kept))
    assert largest_step <= CHUNK_BYTES
    assert len({size for size in kept if size}) > 3


def chunks_of(path: Path) -> list[tuple[int, int]]:
    """First byte and length of each compressed chunk."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return sorted((chunk.chunk_start_offset, chunk.chunk_length) for chunk in summary.chunk_indexes)


@pytest.mark.parametrize(
    ("at", "cut"), [("data", False), ("length", False), ("opcode", False), ("data", True), ("opcode", True)]
)
def test_damage_in_the_middle_is_no_end(saved: Path, at: str, cut: bool) -> None:
    chunks = chunks_of(saved)
    assert len(chunks) > 2
    start, length = chunks[1]
    place = {"data": start + length // 2, "length": start + 1, "opcode": start}[at]
    content = bytearray(saved.read_bytes())
    content[place] ^= 0x55
    saved.write_bytes(content[:-20] if cut else content)
    with pytest.raises(LogError) as caught:
        read_mcap(saved)
    assert str(saved) in str(caught.value)


def test_a_damaged_parameter_is_found(saved: Path) -> None:
    content = bytearray(saved.read_bytes())
    content[content.index(b"LIM_V") + 4] ^= 1
    saved.write_bytes(content)
    with pytest.raises(LogError):
        read_mcap(saved)


@pytest.mark.parametrize("tail", [b"", bytes(4096)], ids=["short", "zeros of a power cut"])
def test_a_cut_tail_is_an_end(run: Run, saved: Path, tail: bytes) -> None:
    start, length = chunks_of(saved)[-1]
    for size in (start, start + 5, start + length // 2 if not tail else start):
        content = saved.read_bytes()
        path = saved.with_name("cut.mcap")
        path.write_bytes(content[:size] + tail)
        records = read_mcap(path).records
        assert 0 < len(records) < len(run.records)
        assert run.records.startswith(records)


def test_damage_in_the_index_loses_nothing(run: Run, saved: Path) -> None:
    content = bytearray(saved.read_bytes())
    content[-60:] = bytes(60)
    saved.write_bytes(content)
    assert read_mcap(saved).records == run.records


def test_numbers_that_are_not_finite_are_kept(tmp_path: Path) -> None:
    from omniwheel.dialect import mavlink

    codec = mavlink.MAVLink(None, 1, 1)
    numbers = [math.nan, math.inf, -math.inf, 1.5]
    message = mavlink.MAVLink_omni_wheels_message(0, numbers, [0.0] * 4, numbers[::-1], [0.0] * 4, [0.0] * 4, 1, 1)
    path = tmp_path / "nan.mcap"
    Run.from_records(bytes(8) + bytes(message.pack(codec))).save(path)
    written = messages_of(path, "/OMNI_WHEELS")[0]
    assert written[message.fieldnames[1]] == [None, "Infinity", "-Infinity", 1.5]
    assert schema_of("OMNI_WHEELS")["properties"]["speed"]["items"]["type"] == ["number", "string", "null"]
    (again,) = TlogReader(path, records=read_mcap(path).records)
    for name in message.fieldnames:
        np.testing.assert_array_equal(getattr(again, name), getattr(message, name))


@pytest.mark.parametrize("content", [b"", b"no such file" * 20])
def test_other_files_are_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError):
        omniwheel.load(path)


def test_files_with_other_messages_are_refused(tmp_path: Path) -> None:
    from mcap.writer import Writer

    for topic, data in (("/chatter", b"{}"), ("/HEARTBEAT", b"{}"), ("/HEARTBEAT", b"[")):
        content = io.BytesIO()
        writer = Writer(content)
        writer.start()
        writer.add_message(writer.register_channel(topic, "json", 0), 0, data, 0)
        writer.finish()
        (tmp_path / "other.mcap").write_bytes(content.getvalue())
        with pytest.raises(LogError):
            omniwheel.load(tmp_path / "other.mcap")


def test_without_the_package_the_error_says_what_to_install(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(MissingPackageError) as caught:
        run.save(tmp_path / "drive.mcap")
    assert "omniwheel[mcap]" in caught.value.hint
    assert not list(tmp_path.iterdir())
