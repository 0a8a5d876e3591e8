"""Faults of a file, gathered into one error."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import MAX_MET, MAX_SHOWN, Faults, FaultyFile, FileError


def fault(line: int) -> FileError:
    return FileError(Path("a.csv"), f"fault of line {line}", line=line)


@given(st.lists(st.integers(1, 99), unique=True, min_size=2, max_size=50))
def test_faults_are_one_error_in_the_order_of_lines(lines: list[int]) -> None:
    faults = Faults()
    for line in lines:
        with faults.collecting():
            raise fault(line)
    with pytest.raises(FaultyFile) as raised:
        faults.raise_any()
    said = str(raised.value).splitlines()
    assert raised.value.line == min(lines)
    assert said[:MAX_SHOWN] == [str(fault(line)) for line in sorted(lines)[:MAX_SHOWN]]
    rest = len(lines) - MAX_SHOWN
    assert said[MAX_SHOWN:] == ([f"and {rest} more fault{'s' if rest > 1 else ''}"] if rest > 0 else [])


def test_a_single_fault_is_raised_as_it_is_and_none_is_no_error() -> None:
    faults = Faults()
    faults.raise_any()
    alone = fault(3)
    with faults.collecting():
        raise alone
    with pytest.raises(FileError) as raised:
        faults.raise_any()
    assert raised.value is alone


def test_the_faults_within_a_fault_count_one_by_one() -> None:
    faults = Faults()
    with faults.collecting():
        raise FaultyFile([fault(5), fault(7)])
    with faults.collecting():
        raise fault(6)
    with pytest.raises(FaultyFile) as raised:
        faults.raise_any()
    assert [each.line for each in raised.value.faults] == [5, 6, 7]


def test_what_is_not_of_the_file_is_not_gathered() -> None:
    with pytest.raises(ZeroDivisionError), Faults().collecting():
        raise ZeroDivisionError


def test_search_ends_after_many_faults_and_says_so() -> None:
    faults = Faults()
    for line in range(1, MAX_MET):
        with faults.collecting():
            raise fault(line)
    with (
        pytest.raises(FaultyFile, match=f"and at least {MAX_MET - MAX_SHOWN} more faults$"),
        faults.collecting(),
    ):
        raise fault(MAX_MET)
