# SPDX-License-Identifier: MIT
"""Every kind of file that a user hands over, cut off and changed anywhere: an error with a message, or success."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from hil_sim.scenario import load_scenario
from omni.cli import app
from omni_schema import SchemaError
from omniwheel import parameter_file, signing
from omniwheel.errors import LogError, OmniError
from omniwheel.flashing.hex_file import read_hex
from omniwheel.identification.sources import read_dataset
from omniwheel.log_sources import read_run, read_tlog
from omniwheel.logs.calibration import load_calibration
from omniwheel.logs.importer import import_log
from omniwheel.logs.log import load_log, save_log
from omniwheel.logs.mapping import read_mapping
from omniwheel.mocap.recorded import COLUMNS, read_recording
from omniwheel.robots import parameter_table, read_robot
from tests.host.hex_files import hex_lines, teensy_program
from tests.host.logs import synthetic
from tests.host.test_files import FRAME

Reader = Callable[[Path], object]
ALLOWED = (OmniError, SchemaError)
NESTED = "[" * 100_000
ROBOT = read_robot("three_wheel")


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a good file of every kind, by the names of READERS."""
    folder = tmp_path_factory.mktemp("originals")
    (folder / "mapping.toml").write_text(synthetic.MAPPING)
    (folder / "robot.toml").write_text(synthetic.ROBOT)
    synthetic.write(folder, "run1", synthetic.Known(), 1)
    log, _ = import_log(folder / "run1.csv", read_mapping(folder / "mapping.toml"), folder / "truth_run1.csv")
    save_log(log, folder / "log.npz")
    lines = (folder / "run1.csv").read_text().splitlines()[:60]
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    (folder / "poses.csv").write_text(",".join(COLUMNS) + "\n0.0,0.1,1,0.0,0.0,0.0\n1.0,1.1,2,0.0,0.0,0.0\n")
    (folder / "robot.key").write_text("ab" * signing.KEY_BYTES + "\n")
    (folder / "robot.key").chmod(0o600)
    (folder / "params.toml").write_text("[parameters]\nWS_P = 2.5\nCTL_MODE = 'ismc'\n")
    (folder / "program.hex").write_text("\n".join(hex_lines(teensy_program())) + "\n")
    (folder / "log.tlog").write_bytes(((1).to_bytes(8, "big") + FRAME) * 40)
    curve = "\n".join(f"{name} = [1.0, 1.0, 1.0]" for name in (
        "forward_duty_per_rad_s", "reverse_duty_per_rad_s", "forward_deadband", "reverse_deadband",
        "time_constant_s"))  # fmt: skip
    scales = "forward_scale = [1.0, 1.0, 1.0]\nreverse_scale = [1.0, 1.0, 1.0]"
    (folder / "robot.calibration.toml").write_text(f"[odometry]\n{scales}\n[motor_curve]\n{curve}\n")
    (folder / "scenario.toml").write_text("[scenario]\nname='x'\ndescription='y'\nextends='demo'\nduration_s=0.5\n")
    result = CliRunner().invoke(
        app, ["run", "--core-only", str(folder / "scenario.toml"), "--out", str(folder / "runs")]
    )
    assert result.exit_code == 0, result.output
    return folder


def run_folder(file: str) -> Reader:
    def read(path: Path) -> object:
        path.rename(path.with_name(file))
        return read_run(path.parent)

    return read


READERS: dict[str, Reader] = {
    "log.npz": load_log,
    "log.csv": lambda path: import_log(path, read_mapping(path.with_name("mapping.toml"))),
    "mapping.toml": read_mapping,
    "robot.toml": read_robot,
    "robot.calibration.toml": lambda path: load_calibration(path, 3),
    "poses.csv": read_recording,
    "robot.key": signing.read_key_file,
    "params.toml": lambda path: parameter_file.read(path, parameter_table()),
    "program.hex": read_hex,
    "log.tlog": lambda path: (read_dataset(path, ROBOT.parameter_values()), read_tlog(path, ROBOT)),
    "scenario.toml": lambda path: load_scenario(str(path)),
}


def reads(read: Reader, path: Path) -> None:
    with suppress(*ALLOWED):
        read(path)


@st.composite
def damages(draw: st.DrawFn) -> Callable[[bytes], bytes]:
    """Cut a file off, and change some bytes of what is left."""
    share = draw(st.floats(0.0, 1.0))
    changes = draw(st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(0, 255)), max_size=4))

    def damage(data: bytes) -> bytes:
        left = bytearray(data[: round(share * len(data))])
        for place, value in changes:
            if left:
                left[min(int(place * len(left)), len(left) - 1)] = value
        return bytes(left)

    return damage


@pytest.mark.full
@pytest.mark.parametrize("name", READERS)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(damage=damages())
@example(damage=lambda _: NESTED.encode())
@example(damage=lambda _: b"a = " + NESTED.encode())
@example(damage=lambda _: b"\x00" * 100)
def test_a_damaged_file_is_an_error_with_a_message(
    originals: Path, tmp_path: Path, name: str, damage: Callable[[bytes], bytes]
) -> None:
    (tmp_path / "mapping.toml").write_text(synthetic.MAPPING)
    path = tmp_path / name
    path.write_bytes(damage((originals / name).read_bytes()))
    path.chmod(0o600)
    reads(READERS[name], path)


@pytest.mark.full
@pytest.mark.parametrize("name", ["summary.json", "record.npz"])
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(damage=damages())
@example(damage=lambda _: NESTED.encode())
@example(damage=lambda _: b"[1, 2]")
@example(damage=lambda _: b'{"parameters": {"WHEELS": 1e999, "ENC_CPR": "x"}}')
def test_a_damaged_run_is_an_error_with_a_message(
    originals: Path, tmp_path: Path, name: str, damage: Callable[[bytes], bytes]
) -> None:
    (original,) = (originals / "runs").iterdir()
    for file in ("summary.json", "record.npz"):
        data = (original / file).read_bytes()
        (tmp_path / file).write_bytes(damage(data) if file == name else data)
    reads(read_run, tmp_path)


def test_a_run_of_which_only_the_frame_is_right_cannot_be_plotted(originals: Path, tmp_path: Path) -> None:
    (original,) = (originals / "runs").iterdir()
    (tmp_path / "record.npz").write_bytes((original / "record.npz").read_bytes())
    (tmp_path / "summary.json").write_text(json.dumps({"parameters": {"WHEELS": 3}}))
    result = CliRunner().invoke(app, ["plot", str(tmp_path)])
    assert result.exit_code == 2
    assert "holds another kind of run" in result.output
    assert not (tmp_path / "run.png").exists()


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, 0.0])
def test_counts_per_revolution_of_a_log_are_a_finite_number(originals: Path, tmp_path: Path, value: float) -> None:
    with np.load(originals / "log.npz") as stored:
        arrays = dict(stored)
    np.savez(tmp_path / "log.npz", **{**arrays, "counts_per_revolution": np.array(value)})
    with pytest.raises(LogError):
        load_log(tmp_path / "log.npz")


@pytest.mark.parametrize("value", ["inf", "nan", "0.2", "-1", "true"])
def test_counts_per_revolution_of_a_mapping_are_a_finite_number(tmp_path: Path, value: str) -> None:
    lines = synthetic.MAPPING.splitlines()
    text = "\n".join(f"counts_per_revolution = {value}" if "counts_per_rev" in line else line for line in lines)
    assert text != synthetic.MAPPING
    (tmp_path / "mapping.toml").write_text(text)
    with pytest.raises(LogError, match="counts_per_revolution"):
        read_mapping(tmp_path / "mapping.toml")


@pytest.mark.parametrize(
    ("name", "value"), [("heading_rad", np.zeros(3)), ("time_s", np.zeros((40, 2))), ("truth_xy", np.zeros((5, 2)))]
)
def test_arrays_that_do_not_belong_together_are_no_log(
    originals: Path, tmp_path: Path, name: str, value: np.ndarray
) -> None:
    with np.load(originals / "log.npz") as stored:
        arrays = dict(stored)
    np.savez(tmp_path / "log.npz", **{**arrays, name: value})
    with pytest.raises(LogError):
        load_log(tmp_path / "log.npz")
