import time
from pathlib import Path

import pytest

from taskcal.tables.text import has_labelled_values, parse_labelled_values

LOG = "Pos 1\nCnt=1  X=-5907.204 Y= -40.5 Z=3\n\nPos 2\nCnt=1  X=1 Y=2 Z=3\nlaser off\nCnt=2  X=4 Y=5 Z=6e-1\n"


def test_a_log_is_a_table_with_its_sections_as_ids():
    assert has_labelled_values(LOG)
    sheet = parse_labelled_values(Path("a.txt"), LOG)
    assert tuple(sheet.rows) == (
        ("id", "Cnt", "X", "Y", "Z"),
        ("1", "1", "-5907.204", "-40.5", "3"),
        ("2", "1", "1", "2", "3"),
        ("2", "2", "4", "5", "6e-1"),
    )
    assert tuple(sheet.lines) == (2, 2, 5, 7)
    assert sheet.notes == ("1 line without Cnt, X, Y … are left out: laser off (line 6)",)


ROW = "X=1 Y=2 Z=3"


@pytest.mark.parametrize(
    ("headers", "ids"),
    [
        (["Pos 1", "Pos 2 (perhaps not so good)", "Pos 3 T=21.5"], ("1", "2", "3")),
        (["Pos 1 - good", "POS 2: bad", "Pos 3, 10:30"], ("1", "2", "3")),
        (["Pos 1", "Pos 1b again", "Pos 1.2", "Pos 1-3"], ("1", "1b", "1.2", "1-3")),
    ],
)
def test_labelled_values_keep_headers_with_trailing_text(headers, ids):
    sheet = parse_labelled_values(Path("a.txt"), "".join(f"{header}\n{ROW}\n" for header in headers))
    assert tuple(row[0] for row in sheet.rows[1:]) == ids
    assert all(header in " ".join(sheet.notes) for header in headers if "T=" in header or "good" in header)


def test_labelled_values_take_no_remark_for_a_header():
    sheet = parse_labelled_values(Path("a.txt"), f"Pos 1\n{ROW}\nTemp 21 C\n{ROW}\nGain 1=2\n{ROW}\n")
    assert [row[0] for row in sheet.rows[1:]] == ["1", "1", "1"]
    assert "Temp 21 C (line 3), Gain 1=2 (line 5)" in sheet.notes[0]


def test_without_sections_there_are_no_ids():
    assert tuple(parse_labelled_values(Path("a.txt"), "A=1 B=2 C=3\n").rows) == (("A", "B", "C"), ("1", "2", "3"))


def test_a_table_is_no_log():
    assert not has_labelled_values("a,b,c\n1,2,3\n")
    assert not has_labelled_values("x=1 y=2 z=3\n" + "1 2 3\n" * 5)


def test_a_long_word_in_a_log_costs_little():
    begin = time.process_time()
    (note,) = parse_labelled_values(Path("a.txt"), LOG + "a" * 200_000).notes
    assert note.startswith("2 lines without Cnt, X, Y … are left out: laser off (line 6), aaaa")
    assert len(note) < 200
    assert time.process_time() - begin < 1.0
