"""Files of a megabyte that were made to cost time or memory: `python -m tests.readers.hostile [KIND …]`.

Each is read in a process of its own, which says how long it computed and how much memory it took. Whatever the file holds, it is
read or refused within `LONGEST` seconds and `MOST_MB`.
"""

import io
import json
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

from taskcal.reading.reader import read_campaign
from tests.readers.own_process import Outcome, in_own_process
from tests.readers.readers import READERS
from tests.reading.known_campaign import ROBOT
from tests.tables.test_spreadsheet import book

MEGABYTE = 1_000_000

LONGEST = 2.0
"""Seconds of computing."""

MOST_MB = 250.0
"""Of resident memory, beyond what the process had."""

GIVEN_UP = 10
"""Seconds of computing after which a process is ended."""


ONCE: dict[str, Callable[[Path], object]] = {
    kind: lambda path: read_campaign(path, ROBOT) for kind in ("campaign", "workbook")
}
"""Readers that the random damage asks twice, and a user once."""


def filled(piece: str, size: int) -> bytes:
    """A piece repeated to a size."""
    content = piece.encode()
    return content * max(1, size // len(content))


REPEATED = {
    "digits": "1", "columns": "1,", "lines": "1\n", "rows": "1,2.5,3,4\n", "quotes": '"', "quoted cells": '"",',
    "open quotes": '"a\n', "zero bytes": "\0",
    "words": "nan,inf,-1e308,1e308,1e-320\n", "other digits": "٣,४.५;", "blanks": " ", "tabs": "\t",
    "empty lines": "\n", "separators": ";", "comments": "# 1,2,3\n", "round brackets": "(", "square brackets": "[",
    "curly brackets": "{", "closed brackets": "()[]{}", "all separators": "1,2;3\t4|5 6\n", "decimal commas": "1,5;2,5;3,5\n",
    "exponents": "1e", "points": "1.", "signs": "-", "blank numbers": "1 2 3\n", "labels": "X=1.0 Y=2.0 Z=3.0\n",
    "labels in one line": "X=1.0 Y=2.0 ", "other labels": "a: 1\nb: 2\nX=1\n", "underlines": "x_mm_", "names": "x_mm,y_mm,z_mm,",
    "joints": "J1,J2,J3,", "underscored words": "a_x b_y ", "umlauts": "äöü°µ;", "carriage returns": "\r", "backslashes": "\\",
    "dots": "a.", "colons": "a: ", "dashes": "- ", "equals": "a=", "keys": "a=1\n", "thousands": "1.234.567,8;",
    "groups": "1 234 567 ", "tables": "[[a]]\n", "elements": "<a>", "empty elements": "<a/>", "ampersands": "&lt;",
    "aliases": "*a ", "anchors": "&a [", "markers": "Marker1:X,", "bars": "|", "hashes": "#", "primes": "'", "triple quotes": '"""',
}  # fmt: skip
"""What a file may hold over and over."""


def anywhere(size: int) -> Iterator[tuple[str, bytes]]:
    """Files that no reader can make sense of."""
    for name, piece in REPEATED.items():
        yield name, filled(piece, size)
    yield "an open bracket and blanks", b"a (" + b" " * size + b"b\n1,2,3\n1,2,3\n"
    yield "text in UTF-16", "1;2,5\n".encode("utf-16-le") * (size // 12)
    yield "marked UTF-16", b"\xff\xfe" + bytes(range(256)) * (size // 256)
    yield "marked UTF-32", b"\xff\xfe\0\0" + b"1\0\0\0,\0\0\0" * (size // 8)
    yield "all bytes", bytes(range(256)) * (size // 256)
    yield "separator stated", b"sep=;\n" + filled("1;2;3\n", size)
    yield (
        "hundred thousand columns",
        b"\n".join([filled("x,", size // 3), filled("1,", size // 3), filled("2,", size // 3)]),
    )
    yield "wide rows", b"\n".join([filled("1.5,", size // 50)] * 50)
    yield "deep JSON", filled('{"a":[', size)
    yield "deep JSON that is closed", b"[" * (size // 2) + b"]" * (size // 2)
    yield "many keys in JSON", json.dumps({f"k{k}": k for k in range(size // 16)}).encode()
    yield "a long number in JSON", b'{"a": ' + b"9" * size + b"}"
    yield "deep TOML", b"a = " + b"[" * (size // 2) + b"]" * (size // 2)
    yield "deep inline tables", filled("a = {", size)
    yield "a long key", b"[" + filled("a.", size) + b"a]"
    yield "many keys in TOML", "".join(f"k{k} = {k}\n" for k in range(size // 16)).encode()
    yield "many tables in TOML", "".join(f"[k{k}]\na=1\n" for k in range(size // 16)).encode()
    yield "closed XML", b"<robot>" + b"<a>" * (size // 7) + b"</a>" * (size // 7) + b"</robot>"
    yield "flat XML", b"<robot>" + b"<link/>" * (size // 7) + b"</robot>"
    yield "attributes", b"<robot " + "".join(f'a{k}="1" ' for k in range(size // 10)).encode() + b"/>"
    yield "a long attribute", b'<robot name="' + b"a" * size + b'"/>'
    laughs = "".join(f'<!ENTITY a{k + 1} "{f"&a{k};" * 10}">' for k in range(9))
    yield "entities", f'<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY a0 "a">{laughs}]><robot name="&a9;"/>'.encode()
    yield (
        "aliases that grow",
        ("a0: &a0 [x]\n" + "".join(f"a{k + 1}: &a{k + 1} [{f'*a{k},' * 9}]\n" for k in range(9))).encode(),
    )


def swollen(content: bytes, size: int) -> Iterator[tuple[str, bytes]]:
    """A sound file with one part made large."""
    yield "sound file again and again", content * max(1, size // len(content))
    lines = content.split(b"\n")
    last = next((line for line in reversed(lines) if line.strip()), b"")
    yield "last line again and again", content + (b"\n" + last) * (size // (len(last) + 1))
    first = lines[0]
    yield "first line again and again", (first + b"\n") * (size // (len(first) + 1)) + content
    digits = next((k for k, byte in enumerate(content) if chr(byte).isdigit()), 0)
    for name, piece in (
        ("digits", b"1"),
        ("blanks", b" "),
        ("letters", b"a"),
        ("quotes", b'"'),
        ("brackets", b"("),
        ("commas", b","),
    ):
        yield f"{name} in it", content[:digits] + piece * size + content[digits:]
        yield f"{name} at its end", content + piece * size
    yield "sums in it", content[:digits] + b"1+" * (size // 2) + content[digits:]
    yield "its first half, and lines", content[: len(content) // 2] + b"\n" * size


def tables(size: int) -> Iterator[tuple[str, bytes]]:
    """Tables that are what they should be, but for their size."""
    joints = [f"J{k}_deg" for k in range(1, 7)]
    row = "10.5,-20.5,30.5,40,50,60,1200.5,300.25,800"
    header = ",".join([*joints, "x_mm", "y_mm", "z_mm"])
    count = size // (len(row) + 1)
    yield "rows alike", "\n".join([header, *[row] * count]).encode()
    named = [f"p,{row}"] * count
    yield "ids alike", "\n".join([f"id,{header}", *named]).encode()
    yield "ids", "\n".join([f"id,{header}", *(f"p{k},{row}" for k in range(count))]).encode()
    rising = (f"{k * 170.0 / count:.6f},{row.partition(',')[2]}" for k in range(count))
    yield "rising rows", "\n".join([header, *rising]).encode()
    yield "rows of nan", "\n".join([header, *[row.replace("30.5", "nan")] * count]).encode()
    yield "rows too short", "\n".join([header, *[row.rpartition(",")[0], row] * (count // 2)]).encode()
    targets = size // 60
    wide = ",".join([*joints, *(f"t{k}_{a}_mm" for k in range(targets) for a in "xyz")])
    yield "targets", "\n".join([wide, *[",".join(["1.5"] * (6 + 3 * targets))] * 2]).encode()
    long = (f"p{k // 5},t{k % 5},{row}" for k in range(count))
    yield "a target a row", "\n".join([f"id,target,{header}", *long]).encode()
    each = (f"p{k},t{k},{row}" for k in range(count))
    yield "another target each row", "\n".join([f"id,target,{header}", *each]).encode()
    markers = size // 100
    motive = [
        "Format Version,1.23", "", ",Type," + "Marker," * (3 * markers),
        ",Name," + ",".join(f"m{k},m{k},m{k}" for k in range(markers)),
        ",ID," + "1," * (3 * markers), ",," + "Position," * (3 * markers), "Frame,Time," + "X,Y,Z," * markers,
        *("1,0.0," + "1.0," * (3 * markers) for _ in range(3)),
    ]  # fmt: skip
    yield "motion capture", "\n".join(motive).encode()


def documents(size: int) -> Iterator[tuple[str, bytes]]:
    """Robots and tasks of far too many parts."""
    joints = size // 60
    toml = "".join(f'[[joint]]\nname = "J{k}"\nmdh = {{ a_mm = 1.0 }}\nlimits_deg = [-1, 1]\n' for k in range(joints))
    yield "joints in TOML", f'name = "a"\n{toml}'.encode()
    links = size // 150
    urdf = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<axis xyz="0 0 1"/></joint>'
        for k in range(links)
    )
    yield "a long chain", f'<robot name="a">{urdf}<link name="l{links}"/></robot>'.encode()
    mimics = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="base"/><child link="l{k}"/>'
        f'<mimic joint="j{max(k - 1, 0)}"/></joint>'
        for k in range(size // 170)
    )
    yield "mimics of mimics", f'<robot name="a"><link name="base"/>{mimics}</robot>'.encode()
    rows = "".join(f"{k},90,0,400,0\n" for k in range(size // 15))
    yield "joints in a table", f"joint,alpha_deg,a_mm,d_mm,theta_offset_deg\n{rows}".encode()
    depth = size // 30
    yield (
        "an angle in brackets",
        f'name="a"\n[[joint]]\nmdh={{a_mm=1}}\nangle="{"(" * depth}J1{")" * depth}"\n'.encode(),
    )
    yield "an angle of sums", f'name="a"\n[[joint]]\nmdh={{a_mm=1}}\nangle="{"J1+" * (size // 3)}J1"\n'.encode()
    yield (
        "reflectors",
        ("[[tool]]\nname='c'\nreflectors_mm={" + ",".join(f"r{k}=[0,0,{k}]" for k in range(size // 20)) + "}").encode(),
    )
    yield "many tools", "".join(f"[[tool]]\nname='t{k}'\n" for k in range(size // 22)).encode()
    yield "rows of numbers", b"\n".join(str(k).encode() for k in range(size // 7))
    yield "one row again and again", b"3\n" * (size // 2)


def workbooks(size: int) -> Iterator[tuple[str, bytes]]:
    """Packed folders."""
    cells = size // 40
    yield "many rows", book(("a", [[k + 0.123456, k + 0.5, k + 0.25] for k in range(cells // 3)]))
    yield "many columns", book(("a", [[k + 0.5 for k in range(min(cells // 3, 16_000))]] * 3))
    yield "many sheets", book(*((f"s{k}", [[k]]) for k in range(size // 2000)))
    yield "long cells", book(("a", [["x" * 32_000, k] for k in range(100)]))
    sound = READERS["workbook"].files()[0][1]
    sheet = b"<row>" * (size // 6)
    for name, part, content in (
        ("zeros", "xl/worksheets/sheet1.xml", b"\0" * 100 * size),
        ("blanks", "xl/worksheets/sheet1.xml", b" " * 100 * size),
        ("deep rows", "xl/worksheets/sheet1.xml", b"<worksheet><sheetData>" + sheet),
        ("deep texts", "xl/sharedStrings.xml", b"<sst>" + b"<si><t>" * (size // 8)),
        ("many texts", "xl/sharedStrings.xml", b"<sst>" + b"<si><t>a</t></si>" * (4 * size // 18) + b"</sst>"),
        ("styles", "xl/styles.xml", b"<styleSheet><cellXfs>" + b"<xf/>" * (4 * size // 5) + b"</cellXfs></styleSheet>"),
    ):
        yield name, _with_part(sound, part, content)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as parts:
        parts.writestr("xl/workbook.xml", b"")
        for k in range(size // 110):
            parts.writestr(f"p{k}.xml", b"")
    yield "parts", packed.getvalue()


def _with_part(content: bytes, part: str, put: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as whole, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as again:
        for name in {*whole.namelist(), part}:
            again.writestr(name, put if name == part else whole.read(name))
    return out.getvalue()


def hostile_files(kind: str, size: int = MEGABYTE) -> Iterator[tuple[str, str, bytes]]:
    """The name of each hostile file of a kind, what is wrong with it, and its content."""
    sound = READERS[kind].files()
    name, content = sound[0]
    sources: list[Iterator[tuple[str, bytes]]] = [anywhere(size), swollen(content, size), tables(size), documents(size)]
    if kind in ("workbook", "campaign", "points"):
        sources.append(workbooks(size))
    for source in sources:
        for said, hostile in source:
            yield name, said, hostile


def check(kind: str, name: str, content: bytes, folder: Path) -> Outcome:
    """Read one file in a process of its own."""
    path = folder / name
    path.write_bytes(content)
    return in_own_process(lambda: ONCE.get(kind, READERS[kind].read)(path), GIVEN_UP)


def sound(outcome: Outcome) -> bool:
    """Whether the reader kept its promise."""
    return outcome.within(LONGEST, MOST_MB)


def main(kinds: list[str]) -> int:
    """Print what breaks the promise and the costliest files of each kind; says how many break it."""
    broken = 0
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            for name, content in READERS[kind].files()[:1]:
                # what is loaded once is no part of what a file costs
                (Path(folder) / name).write_bytes(content)
                READERS[kind].read(Path(folder) / name)
            outcomes: list[tuple[str, Outcome]] = []
            for name, wrong, content in hostile_files(kind):
                outcome = check(kind, name, content, Path(folder))
                outcomes.append((wrong, outcome))
                if not sound(outcome):
                    cost = f"{outcome.seconds:.1f} s, {outcome.megabytes:.0f} MB"
                    print(f"{kind}, {wrong}: {cost}: {outcome.said[:600]}", flush=True)
            broken += sum(not sound(outcome) for _, outcome in outcomes)
            slowest, largest = (
                max(outcomes, key=lambda named: named[1].seconds),
                max(outcomes, key=lambda named: named[1].megabytes),
            )
            print(
                f"{kind}: {len(outcomes)} files, at most {slowest[1].seconds:.2f} s ({slowest[0]}) and "
                f"{largest[1].megabytes:.0f} MB ({largest[0]}), {sum(o.said == 'read' for _, o in outcomes)} read",
                flush=True,
            )
    return broken


if __name__ == "__main__":
    chosen = sys.argv[1:] or list(READERS)
    if not set(chosen) <= set(READERS):
        sys.exit(f"usage: python -m tests.readers.hostile [{'|'.join(READERS)} …]")
    sys.exit(min(main(chosen), 1))
