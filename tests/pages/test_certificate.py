"""A certificate is one sheet, with all that it states, as the command prints it."""

from pathlib import Path

import pypdfium2 as pdfium
import pytest

from taskcal.cli import main
from tests.pages.made_pages import LOOP, TASK

pytestmark = [pytest.mark.browser, pytest.mark.long]


@pytest.mark.parametrize("targets", ["1", "3"])
def test_a_certificate_is_printed_on_one_sheet(targets: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("task.toml").write_text(TASK)
    for command in (
        ["simulate", "--robot", LOOP, "--task", "task.toml", "-o", "measured.csv", "--targets", targets],
        ["identify", "measured.csv", "--robot", LOOP, "--holdout", "0.3", "-o", "cal.json"],
        ["report", "cal.json", "--task", "task.toml", "--certificate", "certificate.pdf"],
    ):
        assert main(command) == 0
    (sheet,) = pdfium.PdfDocument("certificate.pdf")
    said = sheet.get_textpage().get_text_range()
    for part in ("serial number", "milling <a pocket>", "box of 500", "J6", "SHA-256", "calibrated by", "Taskcal"):
        assert part in said
