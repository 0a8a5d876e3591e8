"""Nothing that was measured is lost: the campaign is whole after a kill at any byte."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.errors import FileError
from taskcal.live.journal import Journal, Row
from taskcal.reading.pictures import Corners, read_corners
from taskcal.tables.forms import read_table
from tests.planning.without_tracker import instrument_of

ROBOT = tc.load_robot("ur5")
Q = np.random.default_rng(0).uniform(-1.0, 1.0, size=(6, 6)) + np.array([0.0, -1.5, 1.5, 0.0, 0.0, 0.0])
CORNERS = Corners(
    source="", images=("",), width=1600, height=1200, image=np.zeros(5, dtype=int), board=("board",) * 5, id=np.arange(5),
    pixel=np.zeros((5, 2)),
)  # fmt: skip
PURPOSES = ("chosen", "chosen", "kept-out", "reference", "chosen", "kept-out")
ROWS = [
    Row(
        number=k + 1,
        purpose=purpose,
        station=1 + k // 4,
        time_s=20.0 * k,
        joints=q,
        point=np.array([1.0, 2.0, 0.1 * k]),
    )
    for k, (q, purpose) in enumerate(zip(Q, PURPOSES, strict=True))
]


def _begun(path: Path, count: int = 6) -> Journal:
    journal = Journal(path, ROBOT)
    journal.begin({"seed": 1})
    for row in ROWS[:count]:
        if row.number == 5:
            journal.note({"fit": 4})
        journal.append(row)
    return journal


def test_a_kill_at_any_byte_costs_at_most_the_line_in_hand(tmp_path: Path) -> None:
    """Whatever part of the last line is there, all rows before it are, and the next is appended behind them."""
    path = tmp_path / "c.csv"
    _begun(path)
    whole = path.read_bytes()
    last = whole[:-1].rfind(b"\n") + 1
    for cut in range(last, len(whole) + 1):
        path.write_bytes(whole[:cut])
        journal = Journal(path, ROBOT)
        journal.resume({"seed": 1})
        assert len(journal.rows) == (6 if cut == len(whole) else 5)
        assert journal.dropped == (last < cut < len(whole))
        if cut < len(whole):
            journal.append(ROWS[5])
        assert path.read_bytes() == whole
    for row, read in zip(ROWS, journal.rows, strict=True):
        assert (read.number, read.purpose, read.station) == (row.number, row.purpose, row.station)
        np.testing.assert_allclose(read.joints, row.joints, atol=1e-10)
        np.testing.assert_allclose(read.point, row.point, atol=1e-9)
    assert journal.noted("fit") == (4,)


def test_corners_and_rows_of_images_are_whole_after_a_kill(tmp_path: Path) -> None:
    """Corners are there before their row; whatever part of them was written without it is taken off, and comes again."""
    path, observe = tmp_path / "c.csv", instrument_of("pixels")
    pixel = np.random.default_rng(1).uniform(10.0, 1000.0, size=(3, 5, 2))
    rows = [
        replace(
            row, purpose="chosen", fixture="board", station=1, corners=replace(CORNERS, images=(f"{k}.png",), pixel=uv)
        )
        for k, (row, uv) in enumerate(zip(ROWS[:3], pixel, strict=True))
    ]
    journal = Journal(path, ROBOT, observe=observe)
    journal.begin({"seed": 1})
    for row in rows[:2]:
        journal.append(row)
    corners = tmp_path / "c.corners.csv"
    before = corners.read_bytes(), path.read_bytes()
    journal.append(rows[2])
    seen, whole = corners.read_bytes(), path.read_bytes()
    half = len(whole) - 9
    for cut, end in [*((k, len(before[1])) for k in range(len(before[0]), len(seen) + 1, 7)), (len(seen), half)]:
        corners.write_bytes(seen[:cut])
        path.write_bytes(whole[:end])
        journal = Journal(path, ROBOT, observe=observe)
        journal.resume({"seed": 1})
        assert (corners.read_bytes(), path.read_bytes()) == before
        journal.append(rows[2])
        assert (corners.read_bytes(), path.read_bytes()) == (seen, whole)
    assert [row.image for row in journal.rows] == ["0.png", "1.png", "2.png"]
    (read,) = read_corners(read_table(corners))
    np.testing.assert_allclose(read.pixel, pixel.reshape(-1, 2), atol=1e-4)


def test_the_file_is_an_ordinary_campaign(tmp_path: Path) -> None:
    """Every other command reads it, and has nothing to say of its columns."""
    _begun(tmp_path / "c.csv", 4)
    campaign = tc.read_campaign(tmp_path / "c.csv", ROBOT)
    assert campaign.ids == ("1", "2", "3-kept-out", "4-reference")
    assert not campaign.notes
    np.testing.assert_allclose(campaign.q, Q[:4], atol=1e-9)


def test_another_campaign_is_not_gone_on_with(tmp_path: Path) -> None:
    """Other settings, another robot, an edited row and no file at all are refused; nothing is overwritten."""
    path = tmp_path / "c.csv"
    with pytest.raises(FileError, match="--resume"):
        Journal(path, ROBOT).resume({"seed": 1})
    _begun(path)
    with pytest.raises(FileError, match="already"):
        Journal(path, ROBOT).begin({"seed": 1})
    path.rename(tmp_path / "d.csv")
    with pytest.raises(FileError, match="remove it"):
        Journal(path, ROBOT).begin({"seed": 1})
    (tmp_path / "d.csv").rename(path)
    with pytest.raises(FileError, match="another seed"):
        Journal(path, ROBOT).resume({"seed": 2})
    with pytest.raises(FileError, match=r"another instrument.*: a tracker, not socket \(1f\)"):
        Journal(path, ROBOT).resume({"seed": 1, "instrument": "socket (1f)"})
    with pytest.raises(FileError, match="columns"):
        Journal(path, tc.load_robot("barrett-wam")).resume({"seed": 1})
    path.write_text(path.read_text().replace("3-kept-out", "8"))
    with pytest.raises(FileError, match=":4"):
        Journal(path, ROBOT).resume({"seed": 1})


WRITER = """
import sys
from pathlib import Path
sys.path.insert(0, {root!r})
from tests.live.test_journal import ROBOT, ROWS, Journal
from dataclasses import replace
journal = Journal(Path({path!r}), ROBOT)
journal.begin({{"seed": 1}})
while True:
    number = len(journal.rows) + 1
    journal.append(replace(ROWS[number % 6], number=number))
    journal.note({{"fit": number}})
    print(number, flush=True)
"""


def test_rows_that_were_said_survive_kill_9(tmp_path: Path) -> None:
    """A process that is killed while it writes leaves every row that it had said was there."""
    path = tmp_path / "c.csv"
    code = WRITER.format(root=str(Path(__file__).parents[2]), path=str(path))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        while int(process.stdout.readline()) < 20:
            pass
        time.sleep(0.01)
        os.kill(process.pid, signal.SIGKILL)
        said = [int(line) for line in process.stdout if line.endswith("\n")]
    journal = Journal(path, ROBOT)
    journal.resume({"seed": 1})
    assert len(journal.rows) >= max(said, default=20)
    assert [row.number for row in journal.rows] == list(range(1, len(journal.rows) + 1))
    assert journal.noted("fit")[-1] <= len(journal.rows)


def _edits(text: str) -> Iterator[str]:
    """Lines taken out, doubled, swapped, put in, changed in a digit, a word or their kind, and what is no line at all."""
    lines = text.splitlines(keepends=True)
    for k, line in enumerate(lines):
        digits = [i for i, character in enumerate(line) if character.isdigit()]
        i = digits[len(digits) // 2]
        changes = [
            [line, line],
            [f"{line[:i]}{(int(line[i]) + 1) % 10}{line[i + 1 :]}"],
            [f"{line.rstrip()}0\n"],
            [line, '{"look": [3, 1, 2]}\n'],
            *([other] for other in ("[1, 2]\n", "null\n", '{"fit": 4, "fit": 5}\n')),
            *([] if k == len(lines) - 1 else [[]]),  # a last line that is gone is as after a kill
        ]
        yield from ("".join([*lines[:k], *changed, *lines[k + 1 :]]) for changed in changes)
    yield "".join([lines[0], *lines[2:1:-1], *lines[1:2], *lines[3:]])


@pytest.mark.parametrize("suffix", [".csv", ".measure.jsonl"])
def test_whatever_is_changed_in_a_campaign_it_is_not_gone_on_with(tmp_path: Path, suffix: str) -> None:
    """A moved point, a row kept out that becomes a chosen one, a look or a row that is removed: each is named by its line."""
    path = tmp_path / "c.csv"
    _begun(path)
    edited, tried = path.with_suffix(suffix), 0
    whole = edited.read_text()
    for text in dict.fromkeys(_edits(whole)):
        edited.write_text(text)
        with pytest.raises(FileError, match=r"begin another campaign|other columns|twice"):
            Journal(path, ROBOT).resume({"seed": 1})
        tried += 1
    edited.write_text(whole)
    Journal(path, ROBOT).resume({"seed": 1})
    assert tried > 50


def test_two_processes_do_not_write_one_campaign(tmp_path: Path) -> None:
    path = tmp_path / "c.csv"
    first = _begun(path)
    with pytest.raises(FileError, match="another process"):
        Journal(path, ROBOT).resume({"seed": 1})
    first.close()
    Journal(path, ROBOT).resume({"seed": 1})
