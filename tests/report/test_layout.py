"""No word and no number is ever broken, at whatever width."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.report.content import fold, lay_out_facts, lay_out_table

words = st.text("abcdefghij0123456789.-+σ±_/", min_size=1, max_size=22)
sentences = st.lists(words, min_size=1, max_size=12).map(" ".join)
cells = st.one_of(words, sentences, st.just(""))


@st.composite
def tables(draw):
    columns = draw(st.integers(1, 11))
    header = draw(st.lists(st.one_of(words, sentences), min_size=columns, max_size=columns))
    rows = draw(st.lists(st.lists(cells, min_size=columns, max_size=columns), min_size=0, max_size=6))
    return header, rows, draw(st.sets(st.integers(0, columns - 1)))


def text_of(lines):
    return [word for line in lines for word in line.split()]


@settings(max_examples=30)
@given(tables(), st.sampled_from([40, 60, 80, 100, 140]))
def test_every_word_of_a_table_stands_whole_and_lines_keep_the_width(table, width):
    header, rows, left = table
    lines = lay_out_table(header, [("", rows)], left, width)
    shown = text_of(lines)
    for row in rows:
        for cell in row:
            assert set(cell.split()) <= set(shown)
    for line in lines:
        # a single word that is wider than the line stays whole, behind its label
        assert len(line) <= width or max(map(len, line.split())) + max(map(len, header)) + 5 > width


@settings(max_examples=30)
@given(tables())
def test_what_fits_is_a_plain_table_with_one_line_for_each_row(table):
    header, rows, left = table
    lines = lay_out_table(header, [("", rows)], left, 4000)
    assert len(lines) == 2 + len(rows)
    assert text_of(lines[:1]) == " ".join(header).split()
    for line, row in zip(lines[2:], rows, strict=True):
        assert text_of([line]) == " ".join(row).split()


@settings(max_examples=30)
@given(st.lists(st.tuples(words, sentences), max_size=6), st.sampled_from([60, 80]))
def test_facts_keep_their_words_and_the_width(facts, width):
    lines = lay_out_facts(facts, width)
    assert text_of(lines) == " ".join(f"{label} {text}" for label, text in facts).split()
    assert all(len(line) <= width for line in lines)


def test_numbers_stand_under_each_other():
    lines = lay_out_table(["name", "value"], [("", [["a", "1.5"], ["bb", "10.25"]])], {0}, 80)
    assert lines[2].rstrip().endswith("   1.5")
    assert lines[3].endswith("10.25")
    assert len({len(line) for line in lines[2:]}) == 1


def test_a_wide_table_of_few_rows_is_turned_on_its_side():
    header = ["rows", *(f"value{k} mm" for k in range(12))]
    rows = [[f"row{i}", *(f"{i}.{k:04d}" for k in range(12))] for i in range(2)]
    lines = lay_out_table(header, [("", rows)], {0}, 60)
    assert text_of(lines[:1]) == ["rows", "row0", "row1"]
    assert text_of([lines[2]]) == ["value0", "mm", "0.0000", "1.0000"]


def test_a_wide_table_of_many_rows_stacks_them():
    header = ["id", *(f"value{k}" for k in range(12))]
    rows = [[f"r{i}", *(f"{i}.{k:06d}" for k in range(12))] for i in range(9)]
    lines = lay_out_table(header, [("", rows)], {0}, 60)
    assert lines[0] == " id r0"
    assert text_of([lines[1]]) == ["value0", "0.000000"]
    assert len(lines) == 9 * 13


def test_columns_without_a_word_are_no_trouble():
    lines = lay_out_table(["0", "", "x" * 30, "y" * 30], [("", [["", "", "", ""]])], (), 40)
    assert {"0", "x" * 30, "y" * 30} <= set(text_of(lines))


def test_headings_of_groups_stand_over_their_rows():
    lines = lay_out_table(["a", "b"], [("first", [["1", "2"]]), ("second", [["3", "4"]])], (), 80)
    assert [line.strip() for line in lines[2:]] == ["first", "1   2", "second", "3   4"]


@pytest.mark.parametrize("width", [1, 8, 60])
def test_folding_never_breaks_a_word(width):
    rng = np.random.default_rng(width)
    text = " ".join("x" * int(k) for k in rng.integers(1, 30, 40))
    assert " ".join(fold(text, width)) == text


@settings(max_examples=30)
@given(tables(), st.sampled_from([40, 60, 80]), st.data())
def test_columns_that_a_table_can_do_without_go_in_their_order_and_are_named(table, width, data):
    header, rows, left = table
    header = [f"c{k}" for k in range(len(header))]
    spare = data.draw(st.lists(st.integers(1, len(header) - 1), unique=True)) if len(header) > 1 else []
    whole = lay_out_table(header, [("", rows)], left, width)
    lines = lay_out_table(header, [("", rows)], left, width, spare)
    if lines == whole:
        return
    said = " ".join(text_of(lines)).split("(not shown for want of width: ")[1].rstrip(")").split(", ")
    gone = {header.index(name) for name in said}
    assert gone == set(spare[: len(gone)])
    assert all(len(line) <= width for line in lines)
    for k in set(range(len(header))) - gone:
        assert {word for row in rows for word in row[k].split()} <= set(text_of(lines))
