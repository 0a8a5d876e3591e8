"""taskcal identify: rows that are wrong, and which rows a message names."""

import re
from pathlib import Path

import pytest

from taskcal.identification.calibration import load_calibration
from tests.cli.commands.test_identify import identify
from tests.cli.conftest import Run


def shift(source: Path, target: Path, row: int, mm: float) -> None:
    """Move a measured point along x."""
    lines = source.read_text().splitlines()
    column = lines[0].split(",").index("x_mm")
    cells = lines[row + 1].split(",")
    cells[column] = str(float(cells[column]) + mm)
    lines[row + 1] = ",".join(cells)
    target.write_text("\n".join(lines))


def commented(path: Path, row: int) -> None:
    """Two lines of comment before a row, so that its line follows from its row in no simple way."""
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[: row + 1], "# the tracker", "# was moved", *lines[row + 1 :]]))


@pytest.mark.parametrize("choice", ["a gap", "held out at random"])
def test_a_wrong_row_has_one_number_in_table_json_page_and_file(
    run: Run, cell: Path, tmp_path: Path, choice: str
) -> None:
    """Row 33 of the campaign is in line 37 of its file, whichever rows are fitted."""
    bad, cal, page = tmp_path / "bad.csv", tmp_path / "a.json", tmp_path / "page.html"
    shift(cell / "one.csv", bad, 33, 5.0)
    commented(bad, 12)
    (tmp_path / "rows.txt").write_text("\n".join(str(row) for row in range(60) if not 5 <= row < 20))
    # the seed is one with which row 33 is fitted, after rows that are not
    chosen = ["--rows", tmp_path / "rows.txt"] if choice == "a gap" else ["--holdout", "0.2", "--seed", "0"]
    left_out = identify(run, bad, tmp_path / "without.json", *chosen, "--json").json["left_out"]
    assert [(row["row"], row["line"], row["id"]) for row in left_out] == [(33, 37, "33")]
    options = [*chosen, "--gross-errors", "keep"]
    result = identify(run, bad, cal, *options, "--json").json
    named = [(o["row"], o["line"], o["id"], o["target"]) for o in result["outliers"]]
    assert named == [(33, 37, "33", "tool")]
    assert result["outliers"][0]["residual_mm"] == pytest.approx(5.0, abs=0.5)
    fitted = load_calibration(cal)
    assert fitted.ids.index("33") < 33
    assert [(o.row, o.line, o.id) for o in fitted.outliers] == [(33, 37, "33")]
    text = identify(run, bad, cal, *options).out
    assert re.search(r"^ *33 +37 +33 +tool ", text[text.index("Outliers") :], re.MULTILINE)
    assert run("report", cal, "-o", page).status == 0
    table = page.read_text(encoding="utf-8").split("Outliers (significance level")[-1]
    assert re.findall(r"<td[^>]*>([^<]*)</td>", table)[:4] == ["33", "37", "33", "tool"]


@pytest.mark.parametrize("choice", ["a gap", "held out at random"])
def test_a_row_that_cannot_be_right_is_named_as_the_file_has_it(
    run: Run, cell: Path, tmp_path: Path, choice: str
) -> None:
    bad = tmp_path / "bad.csv"
    shift(cell / "one.csv", bad, 33, 900.0)
    commented(bad, 12)
    (tmp_path / "rows.txt").write_text("\n".join(str(row) for row in range(60) if not 5 <= row < 20))
    options = ["--rows", tmp_path / "rows.txt"] if choice == "a gap" else ["--holdout", "0.2", "--seed", "0"]
    ended = identify(run, bad, tmp_path / "a.json", *options)
    assert ended.status == 0
    assert "left out: row 33 (id 33, line 37), 900." in " ".join(ended.out.split())
    assert re.search(r"^ *33 +37 +33 +900\.", ended.out[ended.out.index("Gross errors") :], re.MULTILINE)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0\n1\nthree\n", ":3: 'three' is not a row number"),
        ("0\n60\n", ":2: row 60: "),
        ("-1\n", ":1: '-1' is not a row number"),
        ("5\n6\n5\n", ":3: row 5 is in line 1 already"),
        ("# nothing\n", ": names no row"),
    ],
)
def test_invalid_rows_file_is_reported_without_campaign(
    run: Run, cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, message: str
) -> None:
    """An error in the file of rows is reported without mention of the campaign."""
    monkeypatch.delattr("taskcal.cli.commands.doctor.diagnose_file")
    rows = tmp_path / "rows.txt"
    rows.write_text(text)
    ended = identify(run, cell / "one.csv", tmp_path / "a.json", "--rows", rows)
    assert ended.status == 1
    assert f"{rows}{message}" in ended.err
