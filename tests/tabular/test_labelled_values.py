import time
from pathlib import Path

from taskcal.tabular.labelled_values import has_labelled_values, parse_labelled_values

LOG = "Pos 1\nCnt=1  X=-5907.204 Y= -40.5 Z=3\n\nPos 2\nCnt=1  X=1 Y=2 Z=3\nlaser off\nCnt=2  X=4 Y=5 Z=6e-1\n"


def test_a_log_is_a_table_with_its_sections_as_ids():
    assert has_labelled_values(LOG)
    sheet = parse_labelled_values(Path("a.txt"), LOG)
    assert sheet.rows == (
        ("id", "Cnt", "X", "Y", "Z"),
        ("1", "1", "-5907.204", "-40.5", "3"),
        ("2", "1", "1", "2", "3"),
        ("2", "2", "4", "5", "6e-1"),
    )
    assert sheet.lines == (2, 2, 5, 7)
    assert sheet.notes == ("1 line without Cnt, X, Y … are left out",)


def test_without_sections_there_are_no_ids():
    assert parse_labelled_values(Path("a.txt"), "A=1 B=2 C=3\n").rows == (("A", "B", "C"), ("1", "2", "3"))


def test_a_table_is_no_log():
    assert not has_labelled_values("a,b,c\n1,2,3\n")
    assert not has_labelled_values("x=1 y=2 z=3\n" + "1 2 3\n" * 5)


def test_a_long_word_in_a_log_costs_little():
    begin = time.process_time()
    assert parse_labelled_values(Path("a.txt"), LOG + "a" * 200_000).notes == (
        "2 lines without Cnt, X, Y … are left out",
    )
    assert time.process_time() - begin < 1.0
