"""Text layout of tables, and numbers with the digits that they are worth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.identification.calibration import COVERAGE_95
from taskcal.report.calibration import with_interval
from taskcal.report.content import (
    Column,
    Numbers,
    Section,
    Text,
    TextTable,
    decimals_of,
    fold,
    lay_out_facts,
    lay_out_table,
    millimetres,
    signed,
)

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
def test_layout_keeps_words_whole_and_the_width(table, width):
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
def test_layout_has_one_line_a_row_if_it_fits(table):
    header, rows, left = table
    lines = lay_out_table(header, [("", rows)], left, 4000)
    assert len(lines) == 2 + len(rows)
    assert text_of(lines[:1]) == " ".join(header).split()
    for line, row in zip(lines[2:], rows, strict=True):
        assert text_of([line]) == " ".join(row).split()


@settings(max_examples=30)
@given(st.lists(st.tuples(words, sentences), max_size=6), st.sampled_from([60, 80]))
def test_facts_keep_words_and_width(facts, width):
    lines = lay_out_facts(facts, width)
    assert text_of(lines) == " ".join(f"{label} {text}" for label, text in facts).split()
    assert all(len(line) <= width for line in lines)


def test_layout_aligns_numbers():
    lines = lay_out_table(["name", "value"], [("", [["a", "1.5"], ["bb", "10.25"]])], {0}, 80)
    assert lines[2].rstrip().endswith("   1.5")
    assert lines[3].endswith("10.25")
    assert len({len(line) for line in lines[2:]}) == 1


def test_layout_transposes_wide_tables_of_few_rows():
    header = ["rows", *(f"value{k} mm" for k in range(12))]
    rows = [[f"row{i}", *(f"{i}.{k:04d}" for k in range(12))] for i in range(2)]
    lines = lay_out_table(header, [("", rows)], {0}, 60)
    assert text_of(lines[:1]) == ["rows", "row0", "row1"]
    assert text_of([lines[2]]) == ["value0", "mm", "0.0000", "1.0000"]


def test_layout_stacks_wide_tables_of_many_rows():
    header = ["id", *(f"value{k}" for k in range(12))]
    rows = [[f"r{i}", *(f"{i}.{k:06d}" for k in range(12))] for i in range(9)]
    lines = lay_out_table(header, [("", rows)], {0}, 60)
    assert lines[0] == " id r0"
    assert text_of([lines[1]]) == ["value0", "0.000000"]
    assert len(lines) == 9 * 13


def test_layout_accepts_empty_columns():
    lines = lay_out_table(["0", "", "x" * 30, "y" * 30], [("", [["", "", "", ""]])], (), 40)
    assert {"0", "x" * 30, "y" * 30} <= set(text_of(lines))


def test_layout_puts_headings_over_groups():
    lines = lay_out_table(["a", "b"], [("first", [["1", "2"]]), ("second", [["3", "4"]])], (), 80)
    assert [line.strip() for line in lines[2:]] == ["first", "1   2", "second", "3   4"]


@pytest.mark.parametrize("width", [1, 8, 60])
def test_fold_breaks_no_word(width):
    rng = np.random.default_rng(width)
    text = " ".join("x" * int(k) for k in rng.integers(1, 30, 40))
    assert " ".join(fold(text, width)) == text


@settings(max_examples=30)
@given(tables(), st.sampled_from([40, 60, 80]), st.data())
def test_layout_drops_spare_columns_in_order(table, width, data):
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


@pytest.mark.parametrize(
    ("uncertainty", "decimals"), [(0.012, 3), (0.5, 2), (0.0996, 3), (3.0, 1), (250.0, 0), (0.0, 4), (float("nan"), 4)]
)
def test_interval_has_two_digits_of_uncertainty(uncertainty: float, decimals: int) -> None:
    assert decimals_of(uncertainty) == decimals


@pytest.mark.parametrize(("value", "uncertainty"), [(0.1234567, 0.012), (-12.3, 0.4), (0.0, 1e-5), (1e4, 33.0)])
def test_value_and_interval_agree(value: float, uncertainty: float) -> None:
    best, interval = (text.replace("−", "-") for text in with_interval(value, uncertainty))
    low, high = map(float, interval.split(" to "))
    half = 0.5 * 10.0 ** -decimals_of(uncertainty)
    assert float(best) == pytest.approx(value, abs=1.001 * half)
    assert low == pytest.approx(value - COVERAGE_95 * uncertainty, abs=1.001 * half)
    assert high == pytest.approx(value + COVERAGE_95 * uncertainty, abs=1.001 * half)
    assert {len(part.partition(".")[2]) for part in (best, str(interval.split()[0]))} == {decimals_of(uncertainty)}


def test_signed_zero_has_no_sign() -> None:
    assert [signed(value, 2) for value in (-0.001, 0.0, 0.001, -0.01)] == ["0.00", "0.00", "0.00", "−0.01"]


def test_table_of_columns_formats_and_omits_values() -> None:
    """A column is declared once: absent values are dashes, columns without any are left out, zero has no sign."""
    rows = [{"name": "a", "m": -1e-9, "n": 3}, {"name": "b", "m": None, "n": 4}, {"name": "c", "m": np.inf, "n": 5}]
    columns = (
        Column("name", "name"),
        millimetres("error mm", "m", "+.3f"),
        Column("points", "n", "d"),
        Column("rotation mrad", "r", ".3f", optional=True),
        Column("double", lambda row: 2 * row["n"], ".1f"),
    )
    table = TextTable.of("errors", columns, rows)
    assert table.header == ("name", "error mm", "points", "double")
    assert table.rows == (("a", "0.000", "3", "6.0"), ("b", "–", "4", "8.0"), ("c", "–", "5", "10.0"))
    assert table.text_columns == (0,)


def test_words_of_a_section_are_paragraphs_and_nothing_is_left_out() -> None:
    section = Section("title", "first", None, Numbers(None, ("1", "mm", "length")), "second")
    assert section.blocks == (Text("first"), Numbers(("1", "mm", "length")), Text("second"))


def test_rows_by_headings_are_groups_under_one_header() -> None:
    columns = (
        Column("name", "name"),
        Column("size", "size", ".1f", optional=True),
        Column("empty", "empty", optional=True),
    )
    rows = {"first": [{"name": "a", "size": 1.0, "empty": ""}], "second": [{"name": "b"}]}
    table = TextTable.of("both", columns, rows)
    assert table.header == ("name", "size")
    assert table.groups == (("first", (("a", "1.0"),)), ("second", (("b", "–"),)))
