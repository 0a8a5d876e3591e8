"""``taskcal board``."""

import pytest

from taskcal.observations.calibration_board import read_boards

FLAGS = "board --kind charuco --columns 5 --rows 7 --square-mm 30 --marker-mm 20 --dictionary 5X5_100"


def test_a_board_from_options_is_described_beside_its_pdf(run, tmp_path):
    """The description prints the same sheet."""
    pdf, again = tmp_path / "mine.pdf", tmp_path / "again.pdf"
    assert run(*FLAGS.split(), "-o", pdf).status == 0
    (board,) = read_boards(tmp_path / "mine.toml")
    assert (board.kind, board.columns, board.rows, board.dictionary) == ("charuco", 5, 7, "5X5_100")
    assert run("board", tmp_path / "mine.toml", "-o", again).status == 0
    assert pdf.read_bytes() == again.read_bytes()
    assert pdf.read_bytes().startswith(b"%PDF-")


@pytest.mark.parametrize(
    ("changed", "status", "said"),
    [
        ("--marker-mm 40", 1, "marker_mm = 40 does not fit"),
        ("--columns 8", 1, "take --page A3"),
        ("--kind chess", 1, "kind: must be 'charuco'"),
        ("--page A9", 1, "'A9' is not a page"),
        ("-o board.svg", 2, "not the name of a PDF"),
        ("board.toml", 2, "states the board; leave this out"),
    ],
)
def test_a_wrong_board_is_refused_and_nothing_written(run, tmp_path, monkeypatch, changed, status, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "board.toml").write_text("[[board]]\n")
    ended = run(*FLAGS.split(), "-o", "new.pdf", *changed.split())
    assert (ended.status, said in " ".join(ended.err.split())) == (status, True), ended.err
    assert not (tmp_path / "new.pdf").exists()
