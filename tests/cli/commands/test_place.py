"""taskcal place."""

from pathlib import Path

import pytest

from taskcal.tables.forms import read_csv
from tests.cli.conftest import IRB6660, Run


def allowing(cell: Path, position_mm: float) -> Path:
    """The task of forty poses with another tolerance."""
    task = cell / f"list-{position_mm:g}.toml"
    task.write_text((cell / "list.toml").read_text().replace("position_mm = 0.1", f"position_mm = {position_mm:g}"))
    return task


def test_placements_of_a_task(run: Run, cell: Path, tmp_path: Path) -> None:
    path = tmp_path / "map.csv"
    ended = run(
        "place", "--robot", IRB6660, allowing(cell, 5.0), "--region=-150:150,0,0", "--steps", "2", "-o", path, "--json"
    )  # fmt: skip
    assert ended.status == 0
    found = ended.json
    assert [p["x_mm"] for p in found["placements"]] == [-150.0, 150.0]
    assert found["best"][0]["expected_mm"] == min(p["expected_mm"] for p in found["placements"] if p["possible"])
    assert found["now"]["after_mm"] is None
    assert list(read_csv(path).numbers("x_mm")) == [-150.0, 150.0]


def test_text_table_output(run: Run, cell: Path) -> None:
    """The text table lists the placements and the present one."""
    ended = run("place", "--robot", IRB6660, allowing(cell, 5.0), "--region", "0,0,0")
    assert ended.status == 0
    assert "Best of 1 placements" in ended.out
    assert "present placement" in ended.out


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--region", "1,2"], "has 2 ranges"),
        (["--region", "a,0,0"], "'a' is not a range"),
        (["--region", "0,0,0", "--turn", "1:x"], "'1:x' is not a range"),
        (["--region", "0,0,0", "--force-n", "1,2"], "'1,2' is not 3 numbers"),
        (["--region", "0,0,0", "--calibration", "cal.json"], "give one of them"),
    ],
)
def test_what_cannot_be_understood_is_a_usage_error(run: Run, cell: Path, options: list[str], reason: str) -> None:
    options = [str(cell / word) if word.endswith(".json") else word for word in options]
    ended = run("place", "--robot", IRB6660, cell / "list.toml", *options)
    assert ended.status == 2
    assert reason in " ".join(ended.err.split())


@pytest.mark.parametrize("share", [0.5, 0.99, 1.01, 2.0])
@pytest.mark.parametrize("by", ["--robot", "--calibration"])
def test_a_tolerance_that_no_place_keeps_is_said_and_ends_with_status_1(
    run: Run, cell: Path, by: str, share: float
) -> None:
    """A share of what the best one expects, of which the rest follows; the figures are those of the run without a decision."""
    given = ["place", by, IRB6660 if by == "--robot" else cell / "cal.json"]
    region = ["--region=0:20,0,0", "--steps", "2", "--touched-off"]
    best = run(*given, allowing(cell, 1000.0), *region, "--json").json["best"][0]["expected_mm"]
    ended = run(*given, allowing(cell, share * best), *region)
    met = share > 1.0
    assert (ended.status, "recommended        none: " in ended.out) == ((0, False) if met else (1, True))
    assert (
        met
        or f"error: no placement of forty poses is recommended; the best is at 0, 0, 0 mm, 0.0°: {best:.3g} mm"
        in (ended.err)
    )


def test_nowhere_to_put_it(run: Run, cell: Path) -> None:
    ended = run("place", "--robot", IRB6660, cell / "list.toml", "--region", "9000,0,0")
    assert ended.status == 1
    assert "out of reach" in " ".join(ended.out.split())


def test_the_page_of_a_region_has_a_figure_and_a_table(run: Run, cell: Path, tmp_path: Path) -> None:
    page = tmp_path / "place.html"
    region = ["--region=0:30,0,0", "--steps", "2", "--touched-off"]
    given = ["place", "--calibration", cell / "cal.json", allowing(cell, 5.0), *region]
    ended = run(*given, "--report", page, "--json")
    assert ended.status == 0, ended.err
    assert ended.json["report"] == str(page)
    text = page.read_text(encoding="utf-8")
    assert "Expected error over the region" in text
    assert "Best of 2 placements" in text
    assert text.count("<figure>") == 1
