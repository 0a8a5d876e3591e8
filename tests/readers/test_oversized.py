"""Smaller ones of the files of `python -m tests.readers.oversized`."""

from contextlib import suppress

import pytest

from taskcal.errors import TaskcalError
from taskcal.io.text_file import MAX_FILE_MB
from tests.readers.oversized import (
    KINDS,
    MOST_MB,
    bombs,
    campaigns,
    check,
    lines_of_a_gigabyte,
    parquets,
    sound,
    wide_tables,
)
from tests.readers.rapid_modules import modules

# each is written and read in a process of its own
pytestmark = pytest.mark.long

CAMPAIGN_MB = 8
"""Of the largest size that is read, 50 MB, and as much of the memory."""

OF_A_KIND = ("campaign", "points", "robot", "urdf", "calibration", "rapid", "krl", "tp", "apt", "csv_path")
LINE_MB = 60


@pytest.mark.parametrize("kind", OF_A_KIND)
def test_a_line_beyond_what_is_read_is_refused_unread(kind, tmp_path):
    path = tmp_path / KINDS[kind].files()[0][0]
    for _, write in lines_of_a_gigabyte(size=LINE_MB * 1_000_000):
        outcome = check(kind, path, write)
        assert sound(outcome, path), outcome
        assert outcome.said != "read"


@pytest.mark.parametrize("kind", ["campaign", "dh", "csv_path", "rapid", "krl", "tp", "apt"])
def test_ten_million_columns_are_refused_in_little_memory(kind, tmp_path):
    path = tmp_path / KINDS[kind].files()[0][0]
    for wrong, write in wide_tables():
        outcome = check(kind, path, write)
        assert sound(outcome, path), (wrong, outcome)
        assert outcome.said != "read"


@pytest.mark.parametrize("kind", ["workbook", "backup", "robot-zip"])
def test_what_unpacks_to_far_more_is_refused_unpacked(kind, tmp_path):
    name, content = KINDS[kind].files()[0]
    for wrong, write in bombs(content, size=700_000_000):
        outcome = check(kind, tmp_path / name, write)
        assert sound(outcome, tmp_path / name), (wrong, outcome)


def test_parquet_files_that_swell_are_refused_in_little_memory(tmp_path):
    path = tmp_path / "file.parquet"
    for wrong, write in parquets():
        outcome = check("parquet", path, write)
        assert sound(outcome, path), (wrong, outcome)
        assert outcome.said != "read"


def test_campaigns_are_read_in_little_memory(tmp_path):
    path = tmp_path / "file.csv"
    # what is loaded once is no part of what a file costs
    path.write_bytes(KINDS["campaign"].files()[0][1])
    with suppress(TaskcalError):
        KINDS["campaign"].read(path)
    for wrong, write in campaigns(CAMPAIGN_MB * 1_000_000):
        outcome = check("campaign", path, write)
        assert sound(outcome, path), (wrong, outcome)
        assert outcome.megabytes < MOST_MB * CAMPAIGN_MB / MAX_FILE_MB, wrong


@pytest.mark.parametrize(("wrong", "write"), list(modules(49_000_000)), ids=[wrong for wrong, _ in modules(1)])
def test_large_modules_take_little_memory(wrong, write, tmp_path):
    path = tmp_path / KINDS["rapid"].files()[0][0]
    outcome = check("rapid", path, write)
    assert sound(outcome, path), (wrong, outcome)
