# SPDX-License-Identifier: MIT
"""Reading foreign CSV logs: counts, spikes, heading, clock; and what is said of files that are wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from omniwheel.errors import LogError
from omniwheel.logs.importer import Frozen, frozen_columns, import_log, unwrap_heading
from omniwheel.logs.log import WheelLog, load_log, save_log
from omniwheel.logs.mapping import Mapping, read_mapping
from tests.host.logs import synthetic


def rows(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def changed(tmp_path: Path, lines: list[str]) -> Path:
    path = tmp_path / "changed.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_counts_come_back_whole_and_the_path_of_the_good_ones_is_the_true_one(runs: list[WheelLog]) -> None:
    log = runs[0]
    assert np.array_equal(log.counts, np.round(log.counts))
    speed, pose = synthetic.motion(synthetic.Known(), synthetic.duties(1))
    turned = np.where(log.good, log.counts, speed * synthetic.T / synthetic.RAD).sum(axis=0) * synthetic.RAD
    # What is left is the noise of the counts: 2 counts per period, 1600 periods, four standard deviations.
    assert np.allclose(turned, speed.sum(axis=0) * synthetic.T, atol=4.0 * 2.05 * 40.0 * synthetic.RAD)
    assert np.allclose(log.heading_rad, pose[:, 2] - pose[0, 2], atol=1e-5)
    assert log.duty.max() <= 0.5


def test_every_spike_is_rejected_and_next_to_nothing_else(runs: list[WheelLog]) -> None:
    for log in runs:
        spiky = np.abs(log.counts) > 40.0
        assert spiky.any()
        assert not log.good[spiky].any()
        assert log.good[~spiky].mean() > 0.99


def test_a_speed_limit_rejects_what_no_wheel_can_do(tmp_path: Path, files: Path) -> None:
    text = synthetic.MAPPING.replace("threshold = 4.0", "threshold = 1000.0\nmax_rad_s = 60.0")
    (tmp_path / "mapping.toml").write_text(text, encoding="utf-8")
    log, _ = import_log(files / "run1.csv", read_mapping(tmp_path / "mapping.toml"))
    fast = np.abs(log.wheel_rad_s) > 60.0
    assert fast.any()
    assert np.array_equal(log.good, ~fast)


def test_repeated_and_missing_rows_are_counted_and_the_speed_lasts_over_a_gap(
    tmp_path: Path, files: Path, mapping: Mapping
) -> None:
    lines = rows(files / "run1.csv")
    path = changed(tmp_path, [*lines[:200], lines[199], *lines[200:300], *lines[304:]])
    log, report = import_log(path, mapping)
    whole, _ = import_log(files / "run1.csv", mapping)
    assert (report.dropped_rows, report.missing_rows) == (1, 4)
    assert np.array_equal(log.counts[299], 5.0 * whole.counts[303])
    assert np.allclose(log.wheel_rad_s[299], whole.wheel_rad_s[303])


def shifted(lines: list[str], seconds: float) -> list[str]:
    """Rows whose time, in the first column, is later by so much."""
    cells = [line.split(",", 1) for line in lines]
    return [f"{float(time) + seconds:.3f},{rest}" for time, rest in cells]


@pytest.mark.parametrize("share", [0.5, 0.97, 0.995])
@pytest.mark.parametrize("back_s", [0.1, 0.5, 5.0, 1e9])
def test_a_log_whose_clock_began_again_is_refused(
    tmp_path: Path, files: Path, mapping: Mapping, share: float, back_s: float
) -> None:
    heading, *lines = rows(files / "run1.csv")
    at = int(share * len(lines))
    path = changed(tmp_path, [heading, *lines[:at], *shifted(lines[at:], -back_s)])
    with pytest.raises(LogError, match=f"row {at + 1} ") as error:
        import_log(path, mapping)
    assert "cut" in error.value.hint


def test_a_log_with_a_long_gap_is_refused(tmp_path: Path, files: Path, mapping: Mapping) -> None:
    heading, *lines = rows(files / "run1.csv")
    path = changed(tmp_path, [heading, *lines[:800], *shifted(lines[800:], 60.0)])
    with pytest.raises(LogError, match="no row from") as error:
        import_log(path, mapping)
    assert "cut" in error.value.hint


def test_a_restarted_heading_goes_on_where_it_was() -> None:
    true = np.linspace(0.0, 20.0, 401)
    logged = np.mod(true, 2.0 * np.pi)
    logged[250:] = np.mod(true[250:] - true[250] + 1.0, 2.0 * np.pi)
    unwrapped, restarts = unwrap_heading(logged, np.full(401, 0.01))
    assert restarts == [250]
    assert np.allclose(unwrapped[:250], true[:250])
    assert np.allclose(np.diff(unwrapped[250:]), np.diff(true[250:]))
    assert unwrapped[250] == unwrapped[249]


def test_stored_logs_come_back(tmp_path: Path, runs: list[WheelLog]) -> None:
    save_log(runs[0], tmp_path / "log.npz")
    again = load_log(tmp_path / "log.npz")
    for name in ("time_s", "counts", "good", "duty", "heading_rad"):
        assert np.array_equal(getattr(again, name), getattr(runs[0], name))
    assert np.array_equal(again.require_truth().xy, runs[0].require_truth().xy)
    (tmp_path / "bad.npz").write_bytes(b"PK no archive")
    with pytest.raises(LogError, match="not an imported log"):
        load_log(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"w3"]', '"w4"]', "no column 'w4'"),
        ("counts_per_revolution = 264", "counts_per_revolution = 1000", "off whole counts"),
        ("full_scale = 100.0", "full_scale = 10.0", "exceeds its full scale"),
        ('quantity = "speed"', 'quantity = "angle"', "wheels.quantity"),
        ('unit = "rad/s"', 'unit = "rad"', "wheels.unit"),
        ("sign = -1", "sign = 2", "heading.sign"),
        ("period_s = 0.01", "period_s = -1", "log.period_s"),
        ('["w1", "w2", "w3"]', '["w1", "w2"]', "wheels.columns"),
        ('x = "x_m"', 'x = "x_m"\nz = "z_m"', "truth.z"),
        ("[truth]", "[camera]", "camera"),
        ("[wheels]", "[duties]", "wheels"),
    ],
)
def test_a_wrong_mapping_is_named(tmp_path: Path, files: Path, old: str, new: str, told: str) -> None:
    assert old in synthetic.MAPPING
    (tmp_path / "mapping.toml").write_text(synthetic.MAPPING.replace(old, new), encoding="utf-8")
    with pytest.raises(LogError, match=told):
        import_log(files / "run1.csv", read_mapping(tmp_path / "mapping.toml"), files / "truth_run1.csv")


@pytest.mark.parametrize(
    ("cell", "told"), [("nan", "w2 is not finite"), ("", "w2 is ''"), ("1.0,2.0", "9 cells beside 8 columns")]
)
def test_a_bad_cell_is_named(tmp_path: Path, files: Path, mapping: Mapping, cell: str, told: str) -> None:
    lines = rows(files / "run1.csv")
    cells = lines[10].split(",")
    cells[3] = cell
    lines[10] = ",".join(cells)
    with pytest.raises(LogError, match=told):
        import_log(changed(tmp_path, lines), mapping)


def test_too_short_and_missing_files_are_named(tmp_path: Path, files: Path, mapping: Mapping) -> None:
    with pytest.raises(LogError, match="cannot be read"):
        import_log(tmp_path / "none.csv", mapping)
    with pytest.raises(LogError, match="at least 20"):
        import_log(changed(tmp_path, rows(files / "run1.csv")[:10]), mapping)
    with pytest.raises(LogError, match="has no rows"):
        import_log(changed(tmp_path, rows(files / "run1.csv")[:1]), mapping)


def test_another_delimiter_and_a_row_that_was_cut_off_are_named(tmp_path: Path, files: Path, mapping: Mapping) -> None:
    lines = rows(files / "run1.csv")
    with pytest.raises(LogError, match="one column") as error:
        import_log(changed(tmp_path, [line.replace(",", ";") for line in lines]), mapping)
    assert "delimiter" in error.value.hint
    with pytest.raises(LogError, match="cells beside 8 columns") as error:
        import_log(changed(tmp_path, [*lines[:200], lines[200][:20]]), mapping)
    assert "that row" in error.value.hint


def test_a_csv_file_is_no_imported_log(files: Path) -> None:
    with pytest.raises(LogError, match=r"is not an imported log$"):
        load_log(files / "run1.csv")


def test_a_sensor_that_stops_is_named_and_a_setpoint_is_not() -> None:
    time = np.round(np.arange(0.0, 10.0, 0.01), 2)
    draw = np.random.default_rng(4)
    stopped = draw.normal(size=len(time))
    stopped[420:600] = stopped[420]
    pause = draw.normal(size=len(time))
    pause[100:140] = pause[100]
    columns = {"imu": stopped, "pause": pause, "wanted": np.where(time < 5.0, 0.0, 1.0), "dead": np.zeros(len(time))}
    assert frozen_columns(columns, time) == (Frozen("imu", 4.2, 5.99),)


def test_a_column_of_a_robot_at_rest_is_not_frozen(tmp_path: Path, files: Path, mapping: Mapping) -> None:
    lines = [line.split(",") for line in rows(files / "run1.csv")]
    columns = [lines[0].index(name) for name in ("w1", "w2", "w3", "alpha")]
    for row in range(401, 501):
        for column in columns:
            lines[row][column] = lines[400][column] if column == columns[-1] else "0.0"
    found = import_log(changed(tmp_path, [",".join(line) for line in lines]), mapping)[1].frozen
    assert not {entry.column for entry in found} & {"w1", "w2", "w3"}
    assert not any(entry.column == "alpha" and 3.9 < entry.start_s < 5.1 for entry in found)


def test_a_heading_that_is_frozen_while_the_wheels_are_driven_is_not_known(
    tmp_path: Path, files: Path, mapping: Mapping
) -> None:
    lines = [line.split(",") for line in rows(files / "run1.csv")]
    column, frozen = lines[0].index("alpha"), range(401, 501)
    for row in frozen:
        lines[row][column] = lines[400][column]
    log, summary = import_log(changed(tmp_path, [",".join(line) for line in lines]), mapping)
    known = np.isfinite(log.heading_rad)
    assert np.array_equal(np.flatnonzero(~known), np.arange(400, 500)), "rest at both ends is known"
    assert [entry.column for entry in summary.frozen].count("alpha") == 1


def test_a_byte_order_mark_blank_lines_and_another_order_of_the_columns_change_nothing(
    tmp_path: Path, files: Path, mapping: Mapping
) -> None:
    turned = [",".join(reversed(line.split(","))) for line in rows(files / "run1.csv")]
    path = tmp_path / "turned.csv"
    path.write_text("\n".join([*turned[:9], "", *turned[9:], "", " ", ""]), encoding="utf-8-sig")
    assert np.array_equal(import_log(path, mapping)[0].counts, import_log(files / "run1.csv", mapping)[0].counts)
    marked = tmp_path / "mapping.toml"
    marked.write_bytes(b"\xef\xbb\xbf" + (files / "mapping.toml").read_bytes() + b"\n\n")
    assert read_mapping(marked).wheels == mapping.wheels


def test_columns_of_one_name_and_a_file_without_names_are_refused(
    tmp_path: Path, files: Path, mapping: Mapping
) -> None:
    lines = rows(files / "run1.csv")
    names = lines[0].split(",")
    twice = changed(tmp_path, [",".join([*names[:-1], names[0]]), *lines[1:]])
    with pytest.raises(LogError, match=f":1: .*{names[0]}"):
        import_log(twice, mapping)
    with pytest.raises(LogError, match=":1: "):
        import_log(changed(tmp_path, lines[1:]), mapping)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("period_s = 0.01", "period_s = 0.005"),
        ("period_s = 0.01", "period_s = 0.02"),
        ('column = "t"', 'column = "t"\nunit = "ms"'),
    ],
)
def test_a_period_or_clock_unit_that_the_rows_contradict_is_refused(
    tmp_path: Path, files: Path, before: str, after: str
) -> None:
    """Whole multiples, too, where speeds stay whole counts."""
    assert before in synthetic.MAPPING
    (tmp_path / "mapping.toml").write_text(synthetic.MAPPING.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(LogError, match=r"rows are .* s apart .* log\.period_s") as caught:
        import_log(files / "run1.csv", read_mapping(tmp_path / "mapping.toml"))
    assert "log.time.unit" in (caught.value.hint or "")


def test_a_log_of_which_most_is_rejected_is_refused(tmp_path: Path, files: Path) -> None:
    text = synthetic.MAPPING.replace("threshold = 4.0", "max_rad_s = 0.5")
    (tmp_path / "mapping.toml").write_text(text, encoding="utf-8")
    with pytest.raises(LogError, match=r"% of the counts in w[123] are rejected"):
        import_log(files / "run1.csv", read_mapping(tmp_path / "mapping.toml"))


def with_column(files: Path, tmp_path: Path, name: str, cell: Callable[[int, str], str]) -> Path:
    """Return a log one of whose columns is another one; ``cell`` gets the row from 0 and what stands there."""
    lines = rows(files / "run1.csv")
    column = lines[0].split(",").index(name)
    for row in range(1, len(lines)):
        cells = lines[row].split(",")
        cells[column] = cell(row - 1, cells[column])
        lines[row] = ",".join(cells)
    return changed(tmp_path, lines)


@pytest.mark.parametrize("value", ["1e20", "-1e20", "1e308"])
@pytest.mark.parametrize("column", ["w2", "alpha"])
@pytest.mark.filterwarnings("error")
def test_one_cell_that_no_sensor_shows_is_refused(
    tmp_path: Path, files: Path, mapping: Mapping, column: str, value: str
) -> None:
    path = with_column(files, tmp_path, column, lambda row, cell: value if row == 500 else cell)
    with pytest.raises(LogError, match=rf"502: {column}"):
        import_log(path, mapping)


def test_a_heading_that_jumps_in_every_row_is_none(tmp_path: Path, files: Path, mapping: Mapping) -> None:
    path = with_column(files, tmp_path, "alpha", lambda row, _: f"{1.0 * row:.6f}")
    with pytest.raises(LogError, match="alpha"):
        import_log(path, mapping)


def test_a_wheel_that_never_changes_while_others_do_is_refused(tmp_path: Path, files: Path, mapping: Mapping) -> None:
    path = with_column(files, tmp_path, "w2", lambda *_: "0.0")
    with pytest.raises(LogError, match="w2"):
        import_log(path, mapping)
