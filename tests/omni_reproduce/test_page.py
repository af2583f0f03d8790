# SPDX-License-Identifier: MIT
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from omni_reproduce import numbers, page, registry, study
from omni_reproduce.experiment import Context, Result, Row
from omniwheel.errors import OmniError
from omniwheel.number_text import finite

ROWS = (
    Row("table2", "as published", "x RMSE", "m", 0.00081, 0.00002, 20, published=0.0008, explanation="one | two"),
    Row("table2", "corrected law", "x RMSE", "m", 0.0002, limit=0.0001, explanation="one | two"),
    Row("table2", "corrected law", "nothing", "m", float("nan")),
)


def outcome(rows: tuple[Row, ...] = ROWS, error: str = "") -> study.Outcome:
    experiment = registry.Experiment("table2", "A title", "nowhere")
    return study.Outcome(experiment, Result(rows, (Path("a/fig10.png"),), ("A *note*.",)), 1.5, error)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.1314, "0.131"), (0.0, "0"), (12.345, "12.3"), (1234.5, "1234"), (1e-7, "1.00e-07"), (None, "–")],
)
def test_numbers_have_three_significant_digits(value: float | None, text: str) -> None:
    assert numbers.number(value) == text


def test_a_deviation_has_the_decimals_of_its_mean_and_never_looks_like_zero() -> None:
    assert numbers.mean_and_sd(0.1314, 0.0123) == "0.131 ± 0.012"
    assert numbers.mean_and_sd(12.0, 0.003) == "12.000 ± 0.003"
    assert numbers.mean_and_sd(12.0, None) == "12.0"


def test_every_row_is_in_the_page_and_equal_explanations_appear_once() -> None:
    text = page.markdown([outcome()], "facts")
    assert text.count("x RMSE") == 2
    assert text.count("one | two") == 1
    assert "![fig10](fig10.png)" in text
    assert "1.01" in text  # ours over published


def test_the_summary_has_the_headline_rows_their_columns_and_the_digest_of_everything() -> None:
    experiment = registry.Experiment("table2", "A title", "nowhere", about="What it is.", headline=r"law\|x")
    other = replace(outcome(), experiment=experiment)
    text = page.summary([other], "facts")
    table = [line for line in text.splitlines() if line.startswith("|")]
    assert table[0] == "| setting | quantity | unit | ours | limit |"
    assert [line.split(" | ")[:2] for line in table[2:]] == [["| corrected law", "x RMSE"]]
    assert "What it is." in text
    assert "![fig10](fig10.png)" in text
    changed = replace(other, result=replace(other.result, rows=(*ROWS[:-1], replace(ROWS[2], ours=1.0))))
    digests = [re.findall("<!-- 3 rows, sha256 (.*) -->", page.summary([each], "")) for each in (other, changed)]
    assert len({found for (found,) in digests}) == 2, "a row that the summary does not show has changed"


def test_html_is_escaped_and_holds_the_table_and_the_picture() -> None:
    text = page.html(page.markdown([outcome((Row("e", "<script>", "q", "m", 1.0),))], "facts"))
    assert "<script>" not in text
    assert "<td>q</td>" in text
    assert 'src="fig10.png"' in text


def test_json_has_one_entry_per_row_and_no_number_json_cannot_hold() -> None:
    everything = json.loads(json.dumps(finite(page.data([outcome()], {"quick": True})), allow_nan=False))
    assert [row["quantity"] for row in everything["rows"]] == ["x RMSE", "x RMSE", "nothing"]
    promised = {"experiment", "quantity", "published", "ours", "sd", "seeds", "limit", "explanation"}
    assert set(everything["rows"][0]) >= promised
    assert everything["rows"][2]["ours"] is None


def test_a_refusal_is_reported_and_does_not_stop_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(self: registry.Experiment, context: Context) -> Result:
        if self.name == "bad":
            raise OmniError("no data", hint="give some")
        context.progress(0.5)
        return Result(ROWS)

    monkeypatch.setattr(registry.Experiment, "run", run)
    seen: list[tuple[int, float]] = []
    pair = [registry.Experiment(name, name, "nowhere") for name in ("bad", "good")]
    outcomes = study.run_all(pair, Context(tmp_path), lambda number, share: seen.append((number, share)))
    assert [entry.error for entry in outcomes] == ["no data", ""]
    assert outcomes[1].result.rows == ROWS
    assert seen == [(0, 1.0), (1, 0.5), (1, 1.0)]


def test_names_lead_to_experiments_in_the_reports_order() -> None:
    everything = registry.select([])
    assert [entry.name for entry in everything] == [entry.name for entry in registry.EXPERIMENTS]
    for entry in registry.EXPERIMENTS:
        for name in (entry.name, *entry.targets):
            assert registry.select([name]) == [entry]


def test_unknown_names_and_diagrams_are_refused_with_a_hint() -> None:
    with pytest.raises(registry.UnknownTargetError, match="did you mean"):
        registry.select(["controler"])
    with pytest.raises(registry.UnknownTargetError, match="shows no data"):
        registry.select(["fig2"])
