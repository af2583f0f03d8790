# SPDX-License-Identifier: MIT
"""A drawn line as waypoints of a smooth path: where they lie, what is refused, what the core makes of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hil_sim.scenario import load_scenario
from omniwheel.drawn_path import MOST_POINTS, DrawnPathError, drawn_path, preview, read_line
from omniwheel.frames import Pose
from omniwheel.robots import parameter_table

TABLE = parameter_table()
VALUES = load_scenario("fast").robot.parameter_values()
CIRCLE = [(math.cos(a), math.sin(a)) for a in np.linspace(0.0, 2 * math.pi, 400)]


def test_points_lie_on_the_line_at_equal_distances_from_end_to_end() -> None:
    path = drawn_path([(0.0, 0.0), (0.3, 0.0), (0.3, 0.0), (1.0, 0.0)], 0.5, heading_rad=0.7)
    assert len(path.points) == MOST_POINTS
    assert [p.x for p in path.points] == pytest.approx(np.linspace(0.0, 1.0, MOST_POINTS), abs=1e-9)
    assert {p.theta for p in path.points} == {0.7}
    assert path.period_s == pytest.approx(2.0)
    assert path.length_m == pytest.approx(1.0)


def test_along_the_path_the_robot_faces_where_it_goes() -> None:
    path = drawn_path(CIRCLE, 0.5, laps=2.0)
    assert len(path.points) == MOST_POINTS
    for point in path.points:
        assert math.remainder(point.theta - math.atan2(point.y, point.x) - math.pi / 2, 2 * math.pi) == pytest.approx(
            0.0, abs=0.02
        )
    gaps = [math.dist(a[:2], b[:2]) for a, b in zip(path.points, (*path.points[1:], path.points[0]), strict=True)]
    assert gaps == pytest.approx([gaps[5]] * MOST_POINTS, rel=0.05), "the last leads to the first"


def test_a_hand_that_shakes_shakes_less() -> None:
    generator = np.random.default_rng(3)
    shaken = np.column_stack([np.linspace(0.0, 2.0, 800), 0.005 * generator.standard_normal(800)])
    points = drawn_path(shaken.tolist(), 0.5).points
    assert np.std([p.y for p in points[1:-1]]) < 0.004


@pytest.mark.parametrize(
    ("line", "speed", "words"),
    [
        ([], 1.0, "2 to 20000 points, not 0"),
        ([(0.0, 0.0)], 1.0, "2 to 20000 points, not 1"),
        ([(0.0, 0.0)] * 20_001, 1.0, "not 20001"),
        ([(0.0, 0.0), (0.01, 0.0)], 1.0, "0.010 m long"),
        ([(0.0, 0.0), (math.nan, 0.0)], 1.0, "within ±10000 m"),
        ([(0.0, 0.0), (1e308, 1e308), (-1e308, 0.0)], 1.0, "within ±10000 m"),
        ([(0.0, 0.0), (1.0,)], 1.0, "x and y"),
        ([(0.0, 0.0), ("a", "b")], 1.0, "x and y"),
        ([(0.0, 0.0), (1.0, 0.0)], 0.0, "speed"),
        ([(0.0, 0.0), (1.0, 0.0)], math.nan, "speed"),
    ],
)
def test_what_is_no_path_is_refused(line: list[tuple[float, float]], speed: float, words: str) -> None:
    with pytest.raises(DrawnPathError, match=words):
        drawn_path(line, speed)


def test_the_preview_is_what_the_core_plans() -> None:
    circle = drawn_path(CIRCLE, 0.2)
    slow = preview(circle, VALUES, TABLE, circle.points[0])
    assert np.hypot(*slow.line.T) == pytest.approx(np.ones(len(slow.line)), abs=0.01)
    assert slow.slowed == pytest.approx(1.0)
    assert slow.way_s == 0.0
    assert preview(drawn_path(CIRCLE, 0.2), VALUES, TABLE, Pose(0.0, 0.0, 0.0)).way_s > 1.0
    assert slow.duration_s == pytest.approx(2 * math.pi / 0.2 + VALUES["TRJ_RAMP"], rel=0.01)
    fast = preview(drawn_path(CIRCLE, 50.0), VALUES, TABLE, Pose(1.0, 0.0, 0.0))
    assert fast.slowed > 10.0
    assert math.isinf(preview(drawn_path(CIRCLE, 0.2, laps=0.0), VALUES, TABLE, Pose(0.0, 0.0, 0.0)).duration_s)


@pytest.mark.parametrize(
    "text",
    [
        "x,y\n# a comment\n0,0.5\n1,0.2\n\n",
        "y;x\n0.5;0\n0.2;1\n",
        " y\tx\n0.5\t0\n0.2\t1\n \n\n",
        "\ufeff0,0.5\n1,0.2",
        "# y,x\n0.5,0\n0.2,1\n",
        "# a line, drawn by hand, slowly\n# y; x\n0.5; 0\n0.2; 1\n",
        "# a line, drawn by hand\n0,0.5\n# y,x\n1,0.2\n",
        "# y x\n0.5,0\n0.2,1\n",
        "# y | x\n0.5,0\n0.2,1\n",
        "# y\tx\n0.5,0\n0.2,1\n",
        "# y;x\n0.5,0\n0.2,1\n",
        "#(y / x)\n0.5;0\n0.2;1\n",
        "# x y, as they were drawn\n# y x\n0.5,0\n0.2,1\n",
        "# by hand; slowly\n0,0.5\n1,0.2\n",
        "\ufeffy,x\r\n0.5,0\r\n\r\n0.2,1\r\n\r\n",
    ],
)
def test_the_heading_line_says_which_column_is_what_and_without_one_x_comes_first(tmp_path: Path, text: str) -> None:
    file = tmp_path / "line.csv"
    file.write_text(text, encoding="utf-8", newline="")
    assert read_line(file) == [[0.0, 0.5], [1.0, 0.2]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no rows"),
        ("x,y\n", "no points"),
        ("x,y\n0,0\n1,a\n", ":3: y is 'a'"),
        ("x,y\n0,0\n1,1_0\n", ":3: y is '1_0'"),
        ("0,0\n1\n", ":2: 1 cells"),
        ("0,5;0,25\n", ":1: x is '0,5'"),
        ("0,3,0,0\n", ":1: 4 cells"),
        ("x,y\n0,3,0,0\n", ":2: 4 cells"),
        (",0.1,0.2\n", ":1: 3 cells"),
        ("0.1,0.2,heading\n0.3,0.4,0\n", ":1: 3 cells"),
        ("x,y\nmetres,metres\n0,0\n", ":2: x is 'metres'"),
        ("t,x,y\n0,0,0\n1,1,1\n", ":1: .*'t'.* x, y$"),
        ("x,y,theta\n0,0,0\n1,1,1\n", ":1: .*'theta'.* x, y$"),
        ("x,y,x\n0,0,0\n1,1,1\n", ":1: .*'x'"),
        ("x\n0\n1\n", ":1: .*y"),
        ("# x [m], y [m]\n0,0\n1,1\n", r":1: .*'x \[m\]'"),
        ("# t,x\n0,0\n1,1\n", ":1: .*'t'"),
        ("# y [mm] x [mm]\n0,0\n1,1\n", ":1: "),
        ("# y (m) | x (m)\n0,0\n1,1\n", ":1: "),
        ("# y_m x_m\n0,0\n1,1\n", ":1: "),
        ("# Y X\n0,0\n1,1\n", ":1: .*'Y'"),
        ("# x\n0,0\n1,1\n", ":1: .*y"),
        ("# x x\n0,0\n1,1\n", ":1: .*'x'"),
        ("# x y x\n0,0\n1,1\n", ":1: .*'x'"),
    ],
)
def test_a_file_that_is_no_line_is_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "line.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DrawnPathError, match=words):
        read_line(file)
    with pytest.raises(DrawnPathError, match="cannot be read"):
        read_line(tmp_path / "missing.csv")
