"""A few of the files of a megabyte of `python -m tests.readers.hostile`: those that once cost too much."""

import time

import pytest

from tests.readers.hostile import GIVEN_UP, LONGEST, check, hostile_files, sound
from tests.readers.own_process import in_own_process

# every file is made and read in a process of its own; the mends have quick tests beside their modules
pytestmark = pytest.mark.long

COSTLY = {
    "campaign": ("round brackets", "letters in it", "an open bracket and blanks", "lines"),
    "poses": ("a long number in JSON",),
    "cell": ("many tools",),
    "dh": ("joints in a table",),
    "urdf": ("entities", "a long chain"),
    "calibration": ("deep JSON",),
}
"""What is wrong with the files, by their kind."""


@pytest.mark.parametrize("kind", COSTLY)
def test_costly_files_are_refused_soon_in_little_memory(kind, tmp_path):
    wanted = set(COSTLY[kind])
    for name, said, content in hostile_files(kind):
        if said in wanted:
            wanted.discard(said)
            outcome = check(kind, name, content, tmp_path)
            assert sound(outcome), outcome
            assert outcome.said != "read"
    assert not wanted


def test_a_reader_that_fails_takes_long_or_much_memory_is_found():
    def slow():
        begin = time.process_time()
        while time.process_time() - begin < LONGEST + 0.1:
            pass

    def large():
        assert bytearray(b"1" * 600_000_000)

    def failing():
        raise KeyError("part")

    for reading in (slow, large, failing):
        assert not sound(in_own_process(reading, GIVEN_UP))
    assert sound(in_own_process(lambda: None, GIVEN_UP))
