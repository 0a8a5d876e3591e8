"""Remarks by reason."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from taskcal.presentation.grouped_remarks import group_remarks
from taskcal.programs.source import Place


def at(line: int, name: str = "a.mod") -> Place:
    return Place(path=Path(name), line=line)


def test_remarks_of_one_reason_are_one_line():
    remarks = [(at(k), f"'p{k}' is assigned to in a.mod:{k + 1}") for k in range(3, 10)]
    remarks.insert(2, (at(1), "is out of reach"))
    assert group_remarks(remarks) == [
        "a.mod:3: 'p3' is assigned to in a.mod:4 (7 times; also in line 4, 5, 6, and 3 more)",
        "a.mod:1: is out of reach",
    ]
    assert group_remarks([(at(1), "x"), (at(2, "b.mod"), "x")]) == ["a.mod:1: x (2 times; also in file b.mod:2)"]


@given(st.lists(st.tuples(st.integers(1, 99), st.sampled_from(["a 1", "a 2", "b 'x'", "b 'y'", "c"]))))
def test_nothing_is_lost_and_nothing_is_said_twice(remarks):
    lines = group_remarks([(at(line), text) for line, text in remarks])
    assert len(lines) == len({text[0] for _, text in remarks})
    counts = [int(line.partition("(")[2].partition(" times")[0] or 1) for line in lines]
    assert sum(counts) == len(remarks)
