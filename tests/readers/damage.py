"""Random damage to the bytes of a small file, and to what a zip file packs."""

import io
import re
import zipfile

import numpy as np

from tests.robot_programs.fuzz import mutated

NUMBERS = (
    b"1e400 1e308 -1e308 nan inf 9999999999999999999999 0 -0 1e-320 1_000 0x10 \xd9\xa3 "
    b"'' [] {} null true 1,5 1.234,5 #N/A"
).split()
"""What may stand where a number does."""

NAMES = tuple(
    name.encode()
    for name in (
        "\u202elmx.eno",
        "\u05d0\u05d1",
        "\u202d",
        "\ufeffx",
        "x\u0301",
        "\U0001f916",
        "Ｘ",
        "ﬁ",
        "Σς",
        "\0",
        "\u0661\u0662",
    )
)
"""What may stand where a name does: written from right to left, joined, without width, wide, folded to more letters than it has."""

Content = bytes
Files = list[tuple[str, Content]]


def damaged(rng: np.random.Generator, content: Content, others: list[Content]) -> Content:
    """Bytes changed at random; numbers or a name replaced; cut off, repeated, or joined with another file's."""
    match int(rng.integers(9)):
        case 0 | 1 | 2:
            return _replaced(rng, content, rb"-?\d+(?:\.\d+)?", NUMBERS, int(rng.integers(1, 3)))
        case 3:
            other, at = others[int(rng.integers(len(others)))], int(rng.integers(len(content) + 1))
            return content[:at] + other[int(rng.integers(len(other) + 1)) :]
        case 4:
            at, size = int(rng.integers(len(content) + 1)), int(rng.integers(1, 200))
            return content[:at] + content[at : at + size] * int(rng.integers(2, 60)) + content[at + size :]
        case 5 | 6:
            at = int(rng.integers(len(content) + 1))
            return content[:at] + bytes(rng.integers(0, 256, 1, dtype=np.uint8)) + content[at + int(rng.integers(2)) :]
        case 7:
            return _replaced(rng, content, rb"[A-Za-z_]\w*", NAMES, 1)
        case _:
            return mutated(rng, content, marks=b"[](){}\\;:=\"'!,<>%$&*/+-. \n\r\t09eE#|\xff\x00\xe4")


def _replaced(
    rng: np.random.Generator, content: Content, pattern: bytes, by: tuple[bytes, ...] | list[bytes], count: int
) -> Content:
    """Some of the places where a pattern is, chosen with repetition."""
    found = list(re.finditer(pattern, content))
    for k in rng.integers(0, len(found), count) if found else ():
        content = content[: found[k].start()] + by[int(rng.integers(len(by)))] + content[found[k].end() :]
    return content


def damaged_zip(rng: np.random.Generator, content: Content, others: list[Content]) -> Content:
    """A zip file with damage inside one of its parts, or to itself."""
    if rng.random() < 0.3:
        return damaged(rng, content, others)
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as whole, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as again:
        names = whole.namelist()
        hit = names[int(rng.integers(len(names)))]
        parts = [whole.read(name) for name in names]
        for name, part in zip(names, parts, strict=True):
            again.writestr(name, damaged(rng, part, parts) if name == hit else part)
    return out.getvalue()
