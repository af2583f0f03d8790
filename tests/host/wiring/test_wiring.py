# SPDX-License-Identifier: MIT
"""The wiring table and diagram: everything of the robot file is there, nothing lies on top of anything else."""

from __future__ import annotations

import json
import random
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from typer.testing import CliRunner

from omni.cli import app
from omni.cli.common import console
from omni_schema import Robot, parse_robot
from omni_schema.toml_file import read_toml
from omniwheel.robots import find_robot_file, parameter_table, read_robot, robot_names
from omniwheel.wiring import connections, draw_wiring, electrics, plan_wiring
from omniwheel.wiring.pages import pages
from tests.host.wiring.geometry import Drawing

DOCS = Path(__file__).parents[3] / "docs"
FREE_PINS = [pin for pin in range(40) if pin not in (0, 1, 18, 19)]


def document(template: str = "three_wheel", remove: tuple[str, ...] = (), **wiring: Any) -> dict[str, Any]:
    """Return a robot file with other wiring."""
    found = dict(read_toml(find_robot_file(template)))
    found["wiring"] = {key: value for key, value in {**found["wiring"], **wiring}.items() if key not in remove}
    return found


def robot(template: str = "three_wheel", remove: tuple[str, ...] = (), **wiring: Any) -> Robot:
    return parse_robot(document(template, remove, **wiring), parameter_table(), "test.toml")


def strange(seed: int) -> Robot:
    """Return a robot wired at random: any pins and channels, each option there or not."""
    draw = random.Random(seed)
    template, wheels = draw.choice([("three_wheel", 3), ("four_wheel", 4)])
    pins = draw.sample([pin for pin in FREE_PINS if not 14 <= pin <= 27], 2 * wheels + 2)
    channels = draw.sample(range(16), 2 * wheels)
    wiring: dict[str, Any] = {
        "in1_channel": channels[:wheels],
        "in2_channel": channels[wheels:],
        "encoder_pins": [pins[2 * i : 2 * i + 2] for i in range(wheels)],
        "output_enable_pin": pins[-1],
        "stop_button_pin": pins[-2],
        "i2c_speed_Hz": draw.choice([100_000, 400_000, 1_000_000]),
        "light_pin": draw.choice([20, 21]),
        "battery_pin": 14,
        "battery_divider": draw.choice([1.0, 2.5, 5.7, 99.9]),
    }
    gone = [
        name for name in ("encoder_pins", "output_enable_pin", "light_pin", "stop_button_pin") if draw.random() < 0.4
    ]
    gone += ["battery_pin", "battery_divider"] if draw.random() < 0.4 else []
    if "light_pin" in gone and 13 in pins:
        gone.remove("light_pin")
    file = document(template, tuple(gone), **wiring)
    if draw.random() < 0.5:
        file["gyro"] = {"chip": "ICM-42688-P", "axis": draw.choice([3, -1]), "address": draw.choice([0x68, 0x69])}
    if draw.random() < 0.5 and not {24, 25} & set(pins):
        file["flow"] = draw.choice([{"chip": "OTOS"}, {"chip": "Pinpoint", "steps_per_mm": 19.894, "x_wheel_mm": 50.0}])
    return parse_robot(file, parameter_table(), "test.toml")


def without_chip(driver: str, **wiring: Any) -> Robot:
    pins = {"motor_driver": driver, "motor_pins": [[10, 11], [14, 15], [22, 23]]}
    return robot("three_wheel", ("in1_channel", "in2_channel", "output_enable_pin"), **{**pins, **wiring})


ROBOTS = [
    pytest.param(without_chip("in1_in2"), id="motors on pins"),
    pytest.param(without_chip("pwm_dir", output_enable_pin=9, stop_button_pin=12), id="motors on pins, enable"),
    *(pytest.param(read_robot(name), id=name) for name in robot_names()),
    pytest.param(robot("four_wheel", ("encoder_pins", "output_enable_pin"), in1_channel=[15] * 4), id="all wrong"),
    *(pytest.param(strange(seed), id=f"strange {seed}") for seed in range(12)),
]


@pytest.mark.parametrize("file", ROBOTS)
def test_no_words_overlap_or_leave_the_paper(file: Robot) -> None:
    drawing = Drawing(draw_wiring(plan_wiring(file)))
    assert [text for text in drawing.texts if not text.inside(drawing.paper)] == []
    assert [(a.what, b.what) for a, b in combinations(drawing.texts, 2) if a.overlaps(b)] == []


@pytest.mark.parametrize("file", ROBOTS)
def test_no_words_are_crossed_by_wires_edges_or_discs(file: Robot) -> None:
    drawing = Drawing(draw_wiring(plan_wiring(file)))
    assert [text.what for text in drawing.texts for wire in drawing.wires if text.overlaps(wire)] == []
    cut = [(t.what, b.what) for t in drawing.texts for b in drawing.boxes if t.overlaps(b) and not t.inside(b)]
    assert cut == []
    beside = [(t.what, d.what) for t in drawing.texts for d in drawing.discs if t.overlaps(d) and not t.inside(d)]
    assert beside == []


@pytest.mark.parametrize("file", ROBOTS)
def test_no_parts_overlap_or_leave_the_paper(file: Robot) -> None:
    drawing = Drawing(draw_wiring(plan_wiring(file)))
    parts = [*drawing.boxes, *(disc for disc in drawing.discs if disc.what != "joint")]
    assert [part for part in [*parts, *drawing.wires] if not part.inside(drawing.paper)] == []
    assert [(a, b) for a, b in combinations(parts, 2) if a.overlaps(b)] == []


@pytest.mark.parametrize("file", ROBOTS)
def test_every_pin_and_channel_is_at_the_end_of_its_wire(file: Robot) -> None:
    """Encoder A of wheel 2 ends where the drawing says its pin's number, IN1 at its channel's."""
    plan = plan_wiring(file)
    drawing = Drawing(draw_wiring(plan))
    for wheel in plan.wheels:
        box = next(text for text in drawing.texts if text.what == f"DRV8871 {wheel.number}")
        numbers = wheel.motor_pins or (wheel.in1_channel, wheel.in2_channel)
        for name, number in zip(plan.motor_inputs, numbers, strict=True):
            (pin,) = [t for t in drawing.texts if t.what == name and 0 < t.bottom - box.bottom < 60]
            row = [
                t.what for t in drawing.texts if abs(t.bottom - pin.bottom) < 6 and pin.left - 200 < t.left < pin.left
            ]
            assert str(number) in row
        if wheel.encoder_pins is None:
            continue
        for name, number in zip("AB", wheel.encoder_pins, strict=True):
            lane = [t for t in drawing.texts if t.what == f"{name}{wheel.number}"]
            assert len(lane) == 2
            right = max(t.right for t in lane)
            beyond = [t for t in drawing.texts if abs(t.bottom - lane[0].bottom) < 6 and t.left > right]
            assert min(beyond, key=lambda t: t.left).what == str(number)
    if plan.output_enable_pin is not None and plan.chip:
        enable = drawing.row_of("OE")
        row = [text.what for text in drawing.texts if abs(text.bottom - enable) < 6]
        assert str(plan.output_enable_pin) in row
        assert "1 kΩ" in drawing.words
    if plan.stop_button_pin is not None:
        assert f"{plan.stop_button_pin} stop button" in drawing.words


def test_the_same_file_gives_the_same_bytes_and_text_stays_text() -> None:
    one, other = (draw_wiring(plan_wiring(read_robot("three_wheel"))) for _ in range(2))
    assert one == other
    assert "<path" not in one
    assert ">Teensy 4.0</text>" in one


def test_a_robot_without_output_enable_says_what_that_means() -> None:
    plan = plan_wiring(robot(remove=("output_enable_pin",)))
    words = " ".join(Drawing(draw_wiring(plan)).words)
    assert "Read the warning below" in words
    assert "only the I2C bus can stop a motor" in words
    assert "not wired" in words
    assert "1 kΩ" not in words
    assert any(row.start == "ground" and row.end == "PCA9685 OE" for row in connections(plan))
    assert "Read the warning below" not in Drawing(draw_wiring(plan_wiring(read_robot("three_wheel")))).words


@pytest.mark.parametrize(
    ("file", "words"),
    [
        (robot(remove=("encoder_pins",)), "encoder_pins"),
        (
            robot(encoder_decoder=["hardware", "hardware", "auto"]),
            "cannot be built from this file: wiring.encoder_decoder asks",
        ),
        (robot(in1_channel=[9, 9, 3]), "channel 9 is used twice"),
        (robot(battery_pin=14, battery_divider=2.0), "6.0 V onto pin 14"),
    ],
)
def test_what_cannot_work_is_warned_of(file: Robot, words: str) -> None:
    (warning,) = plan_wiring(file).warnings
    assert words in warning


def test_an_encoder_that_interrupts_could_not_follow_is_warned_of() -> None:
    found = document()
    found["encoder"] = {**found["encoder"], "counts_per_revolution": 1_000_000}
    (warning,) = plan_wiring(parse_robot(found, parameter_table(), "test.toml")).warnings
    assert warning.startswith("Wheel 2's encoder brings up to ")  # the others have hardware decoders


def test_a_supply_that_the_bridges_do_not_take_is_warned_of() -> None:
    found = document()
    found["motor"] = {**found["motor"], "supply_V": 48.0}
    (warning,) = plan_wiring(parse_robot(found, parameter_table(), "test.toml")).warnings
    assert "48 V is outside a DRV8871's range: 6.5 to 45 V" in warning


def test_a_stop_button_is_in_the_table_the_drawing_and_its_notes() -> None:
    plan = plan_wiring(robot(stop_button_pin=10))
    (row,) = [row for row in connections(plan) if "stop button" in row.start]
    assert row.end == "Teensy 10"
    assert "normally closed" in row.note
    words = " ".join(Drawing(draw_wiring(plan)).words)
    assert "10 stop button" in words
    assert "a cut wire stops, too" in words
    without = plan_wiring(read_robot("three_wheel"))
    assert not any("stop button" in row.start for row in connections(without))
    assert "stop button" not in " ".join(Drawing(draw_wiring(without)).words)


def test_a_gyro_is_in_the_table_the_drawing_and_its_notes() -> None:
    file = document() | {"gyro": {"chip": "ICM-42688-P", "axis": -1, "address": 0x69}}
    plan = plan_wiring(parse_robot(file, parameter_table(), "test.toml"))
    bus, supply = (row for row in connections(plan) if row.end.startswith("ICM-42688-P"))
    assert bus.start == "Teensy 17 (SDA1), 16 (SCL1)"
    assert "x of the chip points down" in bus.note
    assert "AD0 to 3.3 V (address 0x69)" in bus.note
    assert supply.start == "Teensy 3.3 V"
    words = " ".join(Drawing(draw_wiring(plan)).words)
    assert "SDA1 17" in words
    assert "x of the chip points down" in words
    assert "ICM" not in " ".join(Drawing(draw_wiring(plan_wiring(read_robot("three_wheel")))).words)


def test_a_sensor_of_floor_motion_is_in_the_table_the_drawing_and_its_notes() -> None:
    wheels = {"steps_per_mm": 13.263, "x_wheel_mm": 60.0, "y_wheel_mm": -45.0}
    file = document() | {"flow": {"chip": "Pinpoint", **wheels}}
    plan = plan_wiring(parse_robot(file, parameter_table(), "test.toml"))
    bus, supply = (row for row in connections(plan) if row.end.startswith("Pinpoint"))
    assert bus.start == "Teensy 25 (SDA2), 24 (SCL2)"
    assert "x wheel 60 mm left of the robot's centre, y wheel -45 mm in front of it" in bus.note
    assert supply.start == "Teensy 3.3 V"
    words = " ".join(Drawing(draw_wiring(plan)).words)
    assert "SDA2 25" in words
    assert "x wheel 60 mm left" in words


@pytest.mark.full
@pytest.mark.parametrize(
    ("chip", "address", "words"),
    [
        ("LSM6DSO", 0x6B, "SDO/SA0 to 3.3 V (address 0x6B), CS to 3.3 V"),
        ("ISM330DHCX", 0x6A, "SDO/SA0 to ground (address 0x6A), CS to 3.3 V"),
        ("BMI270", 0x68, "SDO to ground (address 0x68), CSB to 3.3 V"),
    ],
)
def test_each_chips_pins_have_its_own_names(chip: str, address: int, words: str) -> None:
    gyro: dict[str, object] = {"chip": chip, "axis": 3, "address": address}
    if chip == "BMI270":
        gyro["config_file"] = "not/there.c"
    plan = plan_wiring(parse_robot(document() | {"gyro": gyro}, parameter_table(), "test.toml"))
    assert any(words in row.note for row in connections(plan))
    assert chip in " ".join(Drawing(draw_wiring(plan)).words)
    warned = [warning for warning in plan.warnings if "config_file" in warning]
    assert len(warned) == (1 if chip == "BMI270" else 0)


def test_the_stop_buttons_pull_ups_give_what_the_advice_says_within_what_a_pin_bears() -> None:
    assert electrics.button_A() == pytest.approx(0.15e-3)
    assert 3e-3 < electrics.button_A(electrics.BUTTON_PULL_UP_OHM) < electrics.PIN_LIMIT_A


def test_the_recommended_pull_up_is_surely_off_and_within_what_the_pin_sinks() -> None:
    """Resistors of 5 %, with and without the board's pull-down and the 100 kOhm of the processor in reset."""
    worst_down = 1.0 / (1.0 / (0.95 * electrics.BOARD_PULL_DOWN_OHM) + 1.0 / 100e3)
    assert electrics.oe_level_V(1.05 * electrics.OE_PULL_UP_OHM, worst_down) > electrics.OE_OFF_V + 0.5
    assert electrics.oe_level_V(electrics.OE_PULL_UP_OHM, None) == electrics.LOGIC_V
    assert electrics.oe_sink_A(0.95 * electrics.OE_PULL_UP_OHM) < electrics.PIN_LIMIT_A
    assert electrics.OE_ON_V < electrics.oe_level_V(10e3) < electrics.OE_OFF_V


def test_the_documentation_is_what_the_robot_files_say() -> None:
    """After a change: ``python -m omniwheel.wiring.pages`` writes them anew."""
    for path, text in pages(DOCS).items():
        assert path.read_text(encoding="utf-8") == text, path


def run(*words: str, code: int = 0) -> Any:
    result = CliRunner().invoke(app, ["robots", "wiring", *words], env={"COLUMNS": "400"})
    assert result.exit_code == code, (result.output, result.stderr, result.exception)
    return result


def test_the_command_prints_the_table_and_writes_the_drawing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "width", 400)
    out = tmp_path / "mine.svg"
    text = run("three_wheel", "--out", str(out)).stdout
    assert any(line.rstrip().endswith("note") for line in text.splitlines())
    for row in connections(plan_wiring(read_robot("three_wheel"))):
        assert row.start in text
        assert row.note in text
    assert out.read_text(encoding="utf-8") == draw_wiring(plan_wiring(read_robot("three_wheel")))


def test_json_has_the_table_and_the_warnings(tmp_path: Path) -> None:
    file = tmp_path / "bare.toml"
    file.write_text(tomli_w.dumps(document(remove=("output_enable_pin",))), encoding="utf-8")
    report = json.loads(run(str(file), "--json").stdout)
    assert "only the I2C bus" in report["warnings"][0]
    assert {"start": "Teensy 3.3 V", "end": "PCA9685 VCC"}.items() <= report["connections"][1].items()
    assert report["drawing"] is None


def test_a_drawing_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    assert "ends in .svg" in run("three_wheel", "--out", str(tmp_path / "a.png"), code=2).stderr
    run("three_wheel", "--out", str(tmp_path / "no" / "a.svg"), code=2)
