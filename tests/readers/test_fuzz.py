"""A small part of the random damage that `python -m tests.readers.fuzz` does."""

import pytest

from taskcal.errors import TaskcalError
from tests.readers.fuzz import check_case
from tests.readers.readers import READERS


@pytest.mark.parametrize("kind", READERS)
def test_sound_files_are_read(kind, tmp_path):
    read = 0
    files = READERS[kind].files()[:12]
    for name, content in files:
        path = tmp_path / name
        path.write_bytes(content)
        try:
            READERS[kind].read(path)
            read += 1
        except TaskcalError:
            pass
    # some forms of tables hold points only, or too few rows to tell their units
    assert read > 0.5 * len(files)


@pytest.mark.parametrize("kind", READERS)
def test_damaged_files_are_read_or_refused(kind, tmp_path):
    outcomes = {check_case(kind, seed, tmp_path) for seed in range(15)}
    assert "refused" in outcomes
