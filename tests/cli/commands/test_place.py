"""taskcal place."""

from pathlib import Path

import pytest

from taskcal.tables.forms import read_csv
from tests.cli.conftest import IRB6660, Run


def test_placements_of_a_task(run: Run, cell: Path, tmp_path: Path) -> None:
    path = tmp_path / "map.csv"
    ended = run(
        "place", "--robot", IRB6660, cell / "list.toml", "--region=-150:150,0,0", "--steps", "2", "-o", path, "--json"
    )  # fmt: skip
    assert ended.status == 0
    found = ended.json
    assert [p["x_mm"] for p in found["placements"]] == [-150.0, 150.0]
    assert found["best"][0]["expected_mm"] == min(p["expected_mm"] for p in found["placements"] if p["possible"])
    assert found["now"]["after_mm"] is None
    assert list(read_csv(path).numbers("x_mm")) == [-150.0, 150.0]


def test_text_table_output(run: Run, cell: Path) -> None:
    """The text table lists the placements and the present one."""
    ended = run("place", "--robot", IRB6660, cell / "list.toml", "--region", "0,0,0")
    assert ended.status == 0
    assert "Best of 1 placements" in ended.out
    assert "present placement" in ended.out


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--region", "1,2"], "has 2 ranges"),
        (["--region", "a,0,0"], "'a' is not a range"),
        (["--region", "0,0,0", "--turn", "1:x"], "'1:x' is not a range"),
        (["--region", "0,0,0", "--force-n", "1,2"], "'1,2' is not a force"),
        (["--region", "0,0,0", "--calibration", "cal.json"], "give one of them"),
    ],
)
def test_what_cannot_be_understood_is_a_usage_error(run: Run, cell: Path, options: list[str], reason: str) -> None:
    options = [str(cell / word) if word.endswith(".json") else word for word in options]
    ended = run("place", "--robot", IRB6660, cell / "list.toml", *options)
    assert ended.status == 2
    assert reason in " ".join(ended.err.split())


def test_nowhere_to_put_it(run: Run, cell: Path) -> None:
    ended = run("place", "--robot", IRB6660, cell / "list.toml", "--region", "9000,0,0")
    assert ended.status == 1
    assert "out of reach" in " ".join(ended.out.split())


def test_the_page_of_a_region_has_a_figure_and_a_table(run: Run, cell: Path, tmp_path: Path) -> None:
    page, words = tmp_path / "place.html", tmp_path / "place.md"
    region = ["--region=0:30,0,0", "--steps", "2", "--touched-off"]
    given = ["place", "--calibration", cell / "cal.json", cell / "list.toml", *region]
    ended = run(*given, "--report", page, "--markdown", words, "--json")
    assert ended.status == 0, ended.err
    assert ended.json["report"] == str(page)
    text = words.read_text(encoding="utf-8")
    assert "Figure: Expected error over the region" in text
    assert "**Best of 2 placements" in text
    assert page.read_text(encoding="utf-8").count("<figure>") == 1
