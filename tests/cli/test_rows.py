from pathlib import Path

import pytest
import typer

from taskcal.cli.options.campaign import choose_rows
from taskcal.errors import FileError


def test_an_endless_row_number_is_refused_and_shortened(tmp_path: Path) -> None:
    path = tmp_path / "rows.txt"
    path.write_text("1\n" + "9" * 5000 + "\n")
    with pytest.raises(FileError, match=r"rows\.txt:2: '9+…9+ \(5000 characters\)' is not a row number"):
        choose_rows(str(path), 50, Path("campaign.csv"))


@pytest.mark.parametrize("text", ["1:" + "9" * 200, "١:٣"], ids=["endless", "other digits"])
def test_a_range_of_anything_but_counts_is_refused(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="is not a range of rows"):
        choose_rows(text, 50, Path("campaign.csv"))
