# SPDX-License-Identifier: MIT
"""A robot's bodies as URDF, SDF, PROTO and MJCF: read back by parsers, and the same robot in all of them."""

from __future__ import annotations

import math
import os
import re
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hil_sim.models.export import FORMATS
from hil_sim.models.parts import KEYS, RobotParts, robot_parts
from omni.cli import app
from omniwheel.robots import find_robot_file, read_robot
from tests.native import ROOT
from tests.needs import need

ROBOTS = ("three_wheel", "fast_three_wheel", "four_wheel")


def parts_of(name: str) -> RobotParts:
    return robot_parts(read_robot(name))


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_wheel_is_as_round_as_its_file_says(robot: str) -> None:
    """Barrels reach the rim in their middles and, to a twentieth of a millimetre, where one hands over to the next."""
    parts = parts_of(robot)
    for wheel in parts.wheels:
        assert parts.wheels[0].radius_m == pytest.approx(read_robot(robot).geometry["wheel_radius_m"])
        a, long, half = parts.roller_radius_m, parts.barrel_half_axis_m(wheel), parts.roller_half_length_m
        edge = math.hypot(wheel.radius_m - a + a * math.sqrt(1.0 - (half / long) ** 2), half)
        assert 0.0 < wheel.radius_m - edge < 5e-5
        for offset, radius in parts.barrel_spheres(wheel):
            assert math.hypot(wheel.radius_m - a, offset) + radius == pytest.approx(wheel.radius_m)


@pytest.mark.parametrize("robot", ROBOTS)
def test_all_masses_and_inertias_add_up_to_the_file(robot: str) -> None:
    parts, simulation = parts_of(robot), read_robot(robot).simulation
    count = len(parts.rollers)
    mass = parts.chassis.mass_kg
    height = parts.chassis.mass_kg * parts.chassis_height_m
    for wheel in parts.wheels:
        mass += wheel.hub.mass_kg + count * parts.roller.mass_kg
        spin = wheel.armature_kg_m2 + wheel.hub.inertia_kg_m2[0]
        rim = wheel.radius_m - parts.roller_radius_m
        spin += count * (parts.roller.inertia_kg_m2[0] + parts.roller.mass_kg * rim**2)
        assert spin == pytest.approx(read_robot(robot).motor["inertia_kg_m2"], rel=1e-3)
    assert mass == pytest.approx(simulation["mass_kg"])
    assert height / mass == pytest.approx(0.5 * parts.wheels[0].radius_m)


def turned(rpy: list[float]) -> np.ndarray:
    """Return roll, pitch, yaw about fixed axes as a matrix."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.array(z @ y @ x)


def floats(text: str | None) -> list[float]:
    return [float(word) for word in (text or "").split()]


def urdf_places(text: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return middle and axis of every joint in the chassis' frame."""
    frames = {"base_link": (np.zeros(3), np.eye(3))}
    places = {}
    for joint in ET.fromstring(text).iter("joint"):
        names = [joint.find(tag).get("link") for tag in ("parent", "child")]  # type: ignore[union-attr]
        origin, axis = joint.find("origin"), joint.find("axis")
        assert origin is not None
        assert axis is not None
        middle, around = frames[str(names[0])]
        frame = middle + around @ floats(origin.get("xyz")), around @ turned(floats(origin.get("rpy")))
        frames[str(names[1])] = frame
        places[str(joint.get("name"))] = frame[0], frame[1] @ floats(axis.get("xyz"))
    return places


def sdf_places(text: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    model = ET.fromstring(text).find("model")
    assert model is not None
    frames = {"base_link": (np.zeros(3), np.eye(3))}
    for link in model.findall("link"):
        pose = link.find("pose")
        if pose is not None:
            middle, around = frames[str(pose.get("relative_to"))]
            numbers = floats(pose.text)
            frames[str(link.get("name"))] = middle + around @ numbers[:3], around @ turned(numbers[3:])
    places = {}
    for joint in model.findall("joint"):
        middle, around = frames[str(joint.findtext("child"))]
        assert joint.findtext("parent") in frames
        places[str(joint.get("name"))] = middle, around @ floats(joint.findtext("axis/xyz"))
    return places


@pytest.mark.parametrize("robot", ROBOTS)
def test_urdf_sdf_and_mujoco_put_every_hinge_at_the_same_place(robot: str) -> None:
    urdf, sdf = (FORMATS[name](read_robot(robot)) for name in ("urdf", "sdf"))
    one, other = urdf_places(urdf), sdf_places(sdf)
    assert list(one) == list(other)
    assert len(one) == len(parts_of(robot).wheels) * 19
    for name, (middle, axis) in one.items():
        assert np.allclose(middle, other[name][0], atol=1e-8)
        assert np.allclose(axis, other[name][1], atol=1e-8)
    for number, wheel in enumerate(parts_of(robot).wheels, 1):
        middle, axis = one[f"axle_{number}"]
        along = np.array([-math.sin(wheel.bearing_rad), math.cos(wheel.bearing_rad), 0.0])
        assert np.allclose(np.cross(axis, [0.0, 0.0, 1.0]), along)  # a positive turn rolls counter-clockwise
    mujoco = pytest.importorskip("mujoco", reason="needs pip install 'omniwheel[mujoco]'")
    model = mujoco.MjModel.from_xml_string(FORMATS["mjcf"](read_robot(robot)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name, (middle, axis) in one.items():
        joint = model.joint(name).id
        assert np.allclose(data.xanchor[joint] - data.qpos[0:3], middle, atol=1e-8)
        assert abs(float(np.dot(data.xaxis[joint], axis))) == pytest.approx(1.0)


@pytest.mark.parametrize("robot", ROBOTS)
def test_mujoco_reads_the_urdf(robot: str) -> None:
    mujoco = pytest.importorskip("mujoco", reason="needs pip install 'omniwheel[mujoco]'")
    model = mujoco.MjModel.from_xml_string(FORMATS["urdf"](read_robot(robot)))
    wheels = len(parts_of(robot).wheels)
    assert model.nv == 19 * wheels
    rollers = len(parts_of(robot).rollers) * parts_of(robot).roller.mass_kg
    mass = wheels * (parts_of(robot).wheels[0].hub.mass_kg + rollers)
    assert model.body_mass.sum() == pytest.approx(mass, rel=1e-6)  # the chassis is its fixed base


@pytest.mark.full
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_ros_parser_reads_the_urdf(robot: str, tmp_path: Path) -> None:
    parser = pytest.importorskip("yourdfpy", reason="needs pip install yourdfpy")
    (tmp_path / "robot.urdf").write_text(FORMATS["urdf"](read_robot(robot)), encoding="utf-8")
    read = parser.URDF.load(tmp_path / "robot.urdf")
    assert read.validate(), read.errors
    assert len(read.actuated_joints) == 19 * len(parts_of(robot).wheels)


@pytest.fixture(scope="module")
def sdf_reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Gazebo's own parser of SDF: a program around the library of the SDF project (Debian: libsdformat-dev)."""
    need("sdformat")
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "sdformat12"], capture_output=True, text=True, check=True
    )
    program = tmp_path_factory.mktemp("sdf") / "sdf_reader"
    source = Path(__file__).with_name("sdf_reader.cpp")
    subprocess.run(["c++", str(source), "-o", str(program), *flags.stdout.split()], check=True)
    return program


@pytest.mark.full
@pytest.mark.parametrize("ending", ["sdf", "urdf"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_gazebos_parser_understands_the_same_robot(sdf_reader: Path, robot: str, ending: str, tmp_path: Path) -> None:
    """No error, no warning, masses that can be, and every hinge at the place and axis that our reader finds."""
    text = FORMATS[ending](read_robot(robot))
    path = tmp_path / f"robot.{ending}"
    path.write_text(text, encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
    done = subprocess.run([str(sdf_reader), str(path)], capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    rows = [line.split() for line in done.stdout.splitlines()]
    links = {name: (float(mass), valid) for kind, name, mass, valid, *rest in rows if kind == "link"}
    assert {valid for _, valid in links.values()} == {"1"}
    if ending == "sdf":  # a URDF's chassis is fixed to the world there
        mass = sum(mass for mass, _ in links.values())
        assert mass == pytest.approx(read_robot(robot).simulation["mass_kg"], rel=1e-6)
    places = urdf_places(text) if ending == "urdf" else sdf_places(text)
    joints = {row[1]: [float(word) for word in row[3:]] for row in rows if row[0] == "joint"}
    assert set(joints) == set(places)
    for name, (middle, axis) in places.items():
        assert np.allclose(joints[name], [*middle, *axis], atol=1e-6)


def proto_tokens(text: str) -> list[str]:
    """Return a PROTO's words, without comments; a string is one word."""
    body = re.sub(r"#[^\n]*", "", text)
    return re.findall(r'"[^"]*"|[\[\]{}]|[^\s,\[\]{}]+', body)


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_proto_is_well_formed_and_has_every_hinge(robot: str) -> None:
    text = FORMATS["proto"](read_robot(robot))
    assert text.startswith("#VRML_SIM R2023b utf8\n")
    tokens, open_ones = proto_tokens(text), []
    for before, token in zip(["", *tokens], tokens, strict=False):
        if token == "{":
            assert re.fullmatch(r"[A-Z]\w*|\]", before), before  # a node's kind, or the PROTO's fields
        if token in "[{":
            open_ones.append(token)
        elif token in "]}":
            assert open_ones.pop() + token in ("[]", "{}")
    assert open_ones == []
    wheels = len(parts_of(robot).wheels)
    assert tokens.count("HingeJoint") == 19 * wheels
    assert tokens.count("RotationalMotor") == wheels
    masses = [float(tokens[number + 1]) for number, token in enumerate(tokens) if token == "mass"]
    assert sum(masses) == pytest.approx(read_robot(robot).simulation["mass_kg"], rel=1e-6)


def test_the_command_writes_what_the_ending_says_and_refuses_the_rest(tmp_path: Path) -> None:
    for ending, beginning in (("urdf", "<?xml"), ("sdf", "<?xml"), ("proto", "#VRML_SIM"), ("mjcf", "<?xml")):
        path = tmp_path / f"robot.{ending}"
        done = CliRunner().invoke(app, ["robots", "export", "three_wheel", str(path)])
        assert done.exit_code == 0, done.output
        assert path.read_text(encoding="utf-8").startswith(beginning)
        said = " ".join(done.output.split())
        assert ("motor and gear turn with" in said) == (ending != "mjcf"), "what a format cannot have is said"
        assert ("friction coefficient on the floor is 0.6" in said) == (ending in ("urdf", "proto"))
    for words in (["robot.xyz"], ["robot.urdf", "--format", "obj"]):
        refused = CliRunner().invoke(app, ["robots", "export", "three_wheel", str(tmp_path / words[0]), *words[1:]])
        assert refused.exit_code == 2
        assert "urdf, sdf, proto, mjcf" in " ".join(refused.output.split())
    assert not (tmp_path / "robot.xyz").exists()


def test_every_format_has_unequal_wheels_or_says_so_and_says_that_gears_have_play(tmp_path: Path) -> None:
    robot = tmp_path / "worn.toml"
    plain = find_robot_file("three_wheel").read_text(encoding="utf-8")
    worn = "wheel_friction = [1.0, 0.5, 1.0]\nwheel_drag = [1.0, 1.0, 3.0]\nbacklash_rad = 0.02\n"
    robot.write_text(plain + worn, encoding="utf-8")
    texts = {}
    for ending in FORMATS:
        path = tmp_path / f"worn.{ending}"
        done = CliRunner().invoke(app, ["robots", "export", str(robot), str(path)])
        assert done.exit_code == 0, done.output
        said = " ".join(done.output.split())
        assert "Left out: the gears have a play of 0.02 rad at each wheel." in said
        assert ("friction coefficients on the floor are 0.6 0.3 0.6" in said) == (ending in ("urdf", "proto"))
        texts[ending] = path.read_text(encoding="utf-8")
        assert ending == "mjcf" or "a play of 0.02 rad" in texts[ending]
    mu = [float(node.text or "") for node in ET.fromstring(texts["sdf"]).iter("mu")]
    assert mu == pytest.approx([0.6] * 18 + [0.3] * 18 + [0.6] * 18)
    for ending, tag, name in (("urdf", "dynamics", "friction"), ("mjcf", "joint", "damping")):
        numbers = [float(node.get(name, "0")) for node in ET.fromstring(texts[ending]).iter(tag)]
        assert numbers[-1] == pytest.approx(3.0 * numbers[1 if ending == "urdf" else 2])


def test_the_page_lists_the_keys() -> None:
    page = (ROOT / "docs" / "guides" / "robot-file.md").read_text(encoding="utf-8")
    for name, key in KEYS.items():
        unit = f" {key.unit}" if key.unit else ""
        assert f"| `{name}` | {key.doc} | {key.least:g} to {key.most:g}{unit} | {key.assumed} |" in page
