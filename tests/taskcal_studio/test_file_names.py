"""Names of dropped files: whatever a browser sends, a plain name in one folder comes of it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import TaskcalError
from taskcal_studio.project import LONGEST, free_name, plain_name


@given(st.text(max_size=200))
def test_every_name_becomes_a_plain_one_of_the_same_kind(given_name: str) -> None:
    name = plain_name(given_name + ".csv", (".csv",))
    assert name.endswith(".csv")
    assert name[0] not in ".-"
    assert not set(name) & set('/\\:*?"<>|\0\n\r ')
    assert len(name) <= LONGEST + len("-file.csv")
    assert plain_name(name, (".csv",)) == name


@pytest.mark.parametrize(
    ("given_name", "kept"),
    [
        ("../../etc/passwd.csv", "passwd.csv"),
        ("C:\\Users\\me\\part 1.mod", "part-1.mod"),
        ("..csv", "file.csv"),
        (".bashrc.csv", "bashrc.csv"),
        ("con.csv", "con-file.csv"),
        ("NUL.day 2.csv", "NUL-file.day-2.csv"),
        ("a\0b.csv", "a-b.csv"),
        ("<img src=x onerror=alert(1)>.csv", "img-src-x-onerror-alert-1.csv"),
        ("Messung Süd.CSV", "Messung-Süd.csv"),
    ],
)
def test_attacks_and_common_names(given_name: str, kept: str) -> None:
    assert plain_name(given_name, (".csv", ".mod")) == kept


def test_other_kinds_of_files_are_refused_with_what_is_taken() -> None:
    with pytest.raises(TaskcalError, match=r"run\.sh.*ends in \.csv"):
        plain_name("run.sh", (".csv",))


def test_taken_file_name_gets_number_ignoring_case() -> None:
    """A taken name gets a number, and names that differ only in letter case are equal."""
    assert free_name("a.csv", []) == "a.csv"
    assert free_name("a.csv", ["A.CSV", "a-2.csv"]) == "a-3.csv"
