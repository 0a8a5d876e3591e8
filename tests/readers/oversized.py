"""Files far larger than is meant, and hostile ones of the largest size that is read: `python -m tests.readers.oversized [KIND …]`.

Lines of a gigabyte, ten million columns, packed files that unpack to a gigabyte, and what a megabyte of costs time or memory. Each
is written to a temporary folder and read in a process of its own. Whatever it holds, it is read or refused in `SECONDS_A_MB` and
`MOST_MB`, and what is refused names the file.
"""

import io
import re
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow
import pyarrow.parquet

from taskcal.io.text_file import MAX_FILE_MB
from tests.readers.hostile import ONCE, anywhere
from tests.readers.own_process import Outcome, in_own_process
from tests.readers.program_readers import PROGRAM_READERS
from tests.readers.rapid_modules import modules
from tests.readers.readers import READERS

KINDS = {**READERS, **PROGRAM_READERS}

GIGABYTE = 1_000_000_000

SECONDS_A_MB = 2.0
"""Of computing, for each megabyte that is read."""

MOST_MB = 500.0
"""Of resident memory beyond what the process had."""

GIVEN_UP = 150
"""Seconds of computing after which a process is ended."""

Write = Callable[[BinaryIO], object]
"""Writes the content of a file, never holding all of it."""

HANDED_OVER = ("robot-zip", "mesh")
"""Kinds whose readers are given the bytes, which the studio bounds as they come."""

LINES = {"digits": b"1", "cells": b"1.5,", "letters": b"a", "blanks": b" ", "brackets": b"(", "zero bytes": b"\0"}
"""What fills a line of a gigabyte."""

ROWS = {
    "numbers": (b"1,", b"2,"), "names": (b"x,", b"1,"), "tabs": (b"1\t",), "blanks": (b"1 ",), "commas and blanks": (b"1, ",),
    "quotes": (b'"",',), "quoted line ends": (b'"\n",',), "semicolons": (b"1;",), "sheet of Motive": (b"Format Version,", b"X,"),
}  # fmt: skip
"""What is repeated in each line of a table that is too wide."""

COSTLY = (
    "words", "other digits", "quotes", "quoted cells", "open quotes", "blanks", "tabs", "separators", "signs",
    "labels in one line", "underscored words", "thousands", "backslashes", "text in UTF-16", "wide rows",
    "hundred thousand columns", "an open bracket and blanks", "deep JSON", "deep JSON that is closed", "many keys in JSON",
    "a long number in JSON", "deep TOML", "deep inline tables", "many keys in TOML", "closed XML", "flat XML", "attributes",
    "entities", "aliases that grow", "round brackets", "curly brackets",
)  # fmt: skip
"""Of what `tests.readers.hostile` tries."""


def repeated(piece: bytes, size: int) -> Write:
    """A piece over and over, up to a size."""
    block = piece * (1_000_000 // len(piece))

    def write(stream: BinaryIO) -> None:
        left = size
        while left > 0:
            left -= stream.write(block[:left])

    return write


def lines_of_a_gigabyte(size: int = GIGABYTE) -> Iterator[tuple[str, Write]]:
    """A single line each, far beyond what is read."""
    for name, piece in LINES.items():
        yield f"a gigabyte of {name} in a line", repeated(piece, size)


def wide_tables(columns: int = 10_000_000) -> Iterator[tuple[str, Write]]:
    """Tables of far too many columns, in few enough bytes to be read."""
    for name, pieces in ROWS.items():

        def write(stream: BinaryIO, pieces: tuple[bytes, ...] = pieces) -> None:
            for piece in pieces:
                # what is longer comes less often, so that the file is read
                repeated(piece, min(columns * len(piece), int(0.95e6 * MAX_FILE_MB / len(pieces))))(stream)
                stream.write(b"\n")

        yield f"columns of {name}", write


def costly_files(size: int) -> Iterator[tuple[str, Write]]:
    """What a megabyte of costs time or memory, up to the largest size that is read."""
    for name in COSTLY:

        def write(stream: BinaryIO, name: str = name) -> None:
            stream.write(next(content for said, content in anywhere(size) if said == name))

        yield name, write


def campaigns(size: int) -> Iterator[tuple[str, Write]]:
    """Tables that are what they should be, in the forms that people write."""
    joints = [f"J{k}_deg" for k in range(1, 7)]
    header = ["id", *joints, "x_mm", "y_mm", "z_mm"]
    row = "{:.4f},-52.7610,-105.2011,-110.8037,71.7963,94.5966,2188.6205,-865.4579,693.3739"

    def written(stream: BinaryIO, form: Callable[[str], str], encoding: str = "utf-8", end: str = "") -> None:
        left, k = size, 0
        stream.write(form(",".join(header) + "\n").encode(encoding))
        while left > 0:
            lines = (f"p{n},{row.format(n * 1e-4 % 170.0)}\n" for n in range(k, k + 1000))
            left, k = left - stream.write(form("".join(lines)).encode(encoding)), k + 1000
        stream.write(end.encode(encoding))

    yield "commas", lambda stream: written(stream, str)
    yield "decimal commas", lambda stream: written(stream, lambda text: text.replace(",", ";").replace(".", ","))
    yield "minus signs", lambda stream: written(stream, lambda text: text.replace("-", "\u2212"))
    yield "UTF-16", lambda stream: written(stream, str, "utf-16-le")
    yield "quoted ids", lambda stream: written(stream, lambda text: text.replace("p", '"p"'))
    yield "a broken row at the end", lambda stream: written(stream, str, end="p,1,2,3\n")
    yield "a character of four bytes", lambda stream: written(stream, str, end="# \U0001f600\n")


def bombs(sound: bytes, size: int = GIGABYTE) -> Iterator[tuple[str, Write]]:
    """A sound zip file in which each of the first parts unpacks to a gigabyte, stated or not."""
    with zipfile.ZipFile(io.BytesIO(sound)) as packed:
        parts = {name: packed.read(name) for name in packed.namelist()}
    for hit in list(parts)[:3]:
        for honest in (True, False):

            def write(stream: BinaryIO, hit: str = hit, honest: bool = honest) -> None:
                out = io.BytesIO()
                with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as again:
                    for name, content in parts.items():
                        if name != hit:
                            again.writestr(name, content)
                            continue
                        with again.open(name, "w", force_zip64=True) as target:
                            repeated(b" ", size)(target)  # pyright: ignore[reportArgumentType]
                content = out.getvalue()
                if not honest:
                    content = content.replace(size.to_bytes(4, "little"), (1000).to_bytes(4, "little"))
                stream.write(content)

            yield f"{hit} of a gigabyte{'' if honest else ', and a directory that says otherwise'}", write


def parquets(rows: int = 50_000_000) -> Iterator[tuple[str, Write]]:
    """Columns that pack to next to nothing, texts and names without end."""
    zeros = lambda: pyarrow.array(np.zeros(rows, dtype=np.int8))  # noqa: E731

    def written(stream: BinaryIO, table: pyarrow.Table, **options: object) -> bytes:
        out = io.BytesIO()
        pyarrow.parquet.write_table(table, out, compression="zstd", **options)
        stream.write(out.getvalue())
        return out.getvalue()

    yield "equal numbers", lambda stream: written(stream, pyarrow.table({"J1_deg": zeros()}))

    def lying(stream: BinaryIO) -> None:
        out = io.BytesIO()
        pyarrow.parquet.write_table(pyarrow.table({"J1_deg": zeros()}), out, compression="zstd", row_group_size=rows)
        # counts stand in seven bits a byte, and zeros may follow them
        stream.write(out.getvalue().replace(_varint(2 * rows), _varint(200, len(_varint(2 * rows)))))

    yield "equal numbers, and a directory that says otherwise", lying
    text = "a" * rows
    yield "a long text", lambda stream: written(stream, pyarrow.table({"id": [text], "x_mm": [1.0]}))
    many = [text[: rows // 1000]] * 1000
    yield (
        "texts alike",
        lambda stream: written(stream, pyarrow.table({"id": many, "x_mm": [1.0] * 1000}), use_dictionary=True),
    )
    yield (
        "columns",
        lambda stream: written(stream, pyarrow.table({f"x{k}": [1.0] for k in range(rows // 1000)})),
    )


def _varint(number: int, length: int = 1) -> bytes:
    """A number as Thrift's compact protocol writes it, in a length that it does not need."""
    out = bytearray()
    while number or len(out) < length:
        out.append(number & 0x7F)
        number >>= 7
    return bytes(byte | 0x80 for byte in out[:-1]) + bytes(out[-1:])


def files_of(kind: str, sound: bytes, largest_mb: float) -> Iterator[tuple[str, Write]]:
    """What is wrong with each oversized file of a kind, and what writes it."""
    if kind not in HANDED_OVER:
        yield from lines_of_a_gigabyte()
    yield from wide_tables()
    yield from costly_files(int(0.98e6 * largest_mb))
    if kind == "campaign":
        yield from campaigns(int(0.95e6 * largest_mb))
    if sound.startswith(b"PK"):
        yield from bombs(sound)
    if kind == "parquet":
        yield from parquets()
    if kind == "rapid":
        yield from modules(int(0.98e6 * largest_mb))


def check(kind: str, path: Path, write: Write) -> Outcome:
    """Write one file and read it, each in a process of its own.

    Raises:
        AssertionError: it cannot be written.
    """

    def written() -> None:
        with path.open("wb") as stream:
            write(stream)

    made = in_own_process(written, GIVEN_UP)
    assert made.said == "read", made.said
    return in_own_process(lambda: ONCE.get(kind, KINDS[kind].read)(path), GIVEN_UP)


def sound(outcome: Outcome, path: Path) -> bool:
    """Whether the reader kept its promise."""
    seconds = SECONDS_A_MB * min(MAX_FILE_MB, max(1.0, path.stat().st_size / 1e6))
    return outcome.within(seconds, MOST_MB) and (outcome.said == "read" or path.name in outcome.said)


def bound_of(kind: str, path: Path) -> float:
    """The size up to which a reader of text reads, by what it says of a gigabyte, 10⁶ bytes."""
    said = check(kind, path, lambda stream: stream.truncate(GIGABYTE)).said
    stated = re.search(r"is larger than ([\d.]+) MB", said)
    return float(stated[1]) if stated else MAX_FILE_MB


def main(kinds: list[str]) -> int:
    """Print what breaks the promise and the costliest files of each kind; says how many break it."""
    broken = 0
    for kind in kinds:
        outcomes: dict[str, Outcome] = {}
        with tempfile.TemporaryDirectory() as folder:
            name, content = KINDS[kind].files()[0]
            path = Path(folder) / name
            # what is loaded once is no part of what a file costs
            path.write_bytes(content)
            KINDS[kind].read(path)
            for wrong, write in files_of(kind, content, bound_of(kind, path)):
                outcomes[wrong] = outcome = check(kind, path, write)
                if not sound(outcome, path):
                    broken += 1
                    cost = f"{outcome.seconds:.1f} s, {outcome.megabytes:.0f} MB"
                    print(f"{kind}, {wrong}: {cost}: {outcome.said[:600]}", flush=True)
        slowest, largest = (
            max(outcomes, key=lambda wrong: outcomes[wrong].seconds),
            max(outcomes, key=lambda wrong: outcomes[wrong].megabytes),
        )
        print(
            f"{kind}: {len(outcomes)} files, at most {outcomes[slowest].seconds:.1f} s ({slowest}) and "
            f"{outcomes[largest].megabytes:.0f} MB ({largest}), {sum(o.said == 'read' for o in outcomes.values())} read",
            flush=True,
        )
    return broken


if __name__ == "__main__":
    chosen = sys.argv[1:] or list(KINDS)
    if not set(chosen) <= set(KINDS):
        sys.exit(f"usage: python -m tests.readers.oversized [{'|'.join(KINDS)} …]")
    sys.exit(min(main(chosen), 1))
