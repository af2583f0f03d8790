# SPDX-License-Identifier: MIT
"""Table 9: the published lines, the ladder's order, and coverage on a few robots."""

from __future__ import annotations

from pathlib import Path

import pytest

from omni_reproduce import identification
from omni_reproduce.experiment import Context


@pytest.mark.full
def test_table_9_says_what_reproduces_and_what_works(tmp_path: Path) -> None:
    result = identification.run(Context(tmp_path, quick=True, seeds=2))
    rows = {(row.setting, row.quantity): row for row in result.rows}
    published = {row.quantity: row for row in result.rows if row.setting.startswith("Table 8")}
    assert set(published) == {"a11", "a22", "a33", "beta_1", "beta_2", "d", "J", "f1", "f2", "f3"}
    for name in ("a11", "a33", "beta_1", "f1"):
        assert published[name].ours == pytest.approx(published[name].published, rel=3e-3)
    for axis in identification.AXES:
        as_published = rows["least squares, as published", f"{axis}, simulated robot"]
        works = rows["output error", f"{axis}, simulated robot"]
        assert as_published.ours is not None
        assert as_published.limit is not None
        assert as_published.ours > 0.98
        assert as_published.limit < 0.2
        assert works.ours == pytest.approx(works.limit, abs=0.01)
    assert abs(rows["output error, real wheels", "dry_drag_V: error"].ours or 100.0) < 10.0
    for name in ("inertia_xy_V_s2", "inertia_theta_V_s2", "wheel_1_radius_m", "wheel_distance_m"):
        error = rows["output error, real wheels", f"{name}: error"]
        assert abs(error.ours or 0.0) < 1.0
    shares = [row.ours for row in result.rows if "inside" in row.quantity and row.setting == "output error"]
    assert len(shares) == 15
    assert sum(share or 0.0 for share in shares) >= 85.0 * len(shares)
    assert all(figure.read_bytes().startswith(b"\x89PNG") for figure in result.pictures)
    assert len(result.notes) == 4
