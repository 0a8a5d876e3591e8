"""Hostile RAPID modules: each has its MODULE and ENDMODULE, and between them what a megabyte of costs time or memory."""

from collections.abc import Callable, Iterator
from typing import BinaryIO

BLOCK = 1_000_000

DECLARED = {
    "words": ("", "alpha beta gamma delta epsilon\n"), "numbers": ("", "1," * 40 + "\n"),
    "wide rows": ("", "1.5," * 240_000 + "\n"), "a list of numbers": ("VAR num a{1}:=[", "1," * 40 + "\n"),
    "nested lists": ("VAR num a{1}:=[", "[[[[1]]]]," * 8 + "\n"), "data": ("", "VAR num a;" * 8 + "\n"),
    "procedures": ("", "PROC a()ENDPROC " * 5 + "\n"), "parameters": ("PROC a(", "num x," * 12 + "\n"),
    "components": ("RECORD a ", "num x;" * 12 + "\n"), "open modules": ("", "MODULE " * 8 + "\n"),
}  # fmt: skip
"""What begins a module, and what comes over and over behind it."""

DONE = {
    "words in a procedure": ("", "a " * 40 + "\n"), "arguments in lines": ("F ", "1," * 20 + "\n"),
    "arguments in a line": ("", "F " + "1.5," * 200_000 + "1;\n"), "a sum": ("a:=", "1+" * 40 + "\n"),
    "calls": ("", "a;" * 40 + "\n"), "assignments": ("", "a:=1;" * 16 + "\n"), "conditions": ("", "IF a b;" * 10 + "\n"),
    "what is no statement": ("", "1;" * 40 + "\n"), "what closes nothing": ("", "ENDIF " * 16 + "\n"),
    "placeholders": ("", "<a>" * 20 + "\n"), "cases": ("TEST a ", "CASE 1:" * 10 + "\n"), "handlers": ("", "ERROR " * 12 + "\n"),
    "motions without arguments": ("", "MoveL;" * 12 + "\n"), "options": ("F ", "\\a" * 40 + "\n"),
    "comments": ("", "! a comment and no more\n"), "strings": ("", '"a""b" ' * 10 + "\n"), "semicolons": ("", ";" * 80 + "\n"),
}  # fmt: skip
"""The same of a procedure."""


def modules(size: int) -> Iterator[tuple[str, Callable[[BinaryIO], object]]]:
    """What is wrong with each module, and what writes it up to a size."""
    for around, pieces in (("", DECLARED), ("PROC main()\n", DONE)):
        for name, (begin, piece) in pieces.items():

            def write(stream: BinaryIO, begin: str = around + begin, piece: str = piece) -> None:
                stream.write(f"MODULE M\n{begin}".encode())
                block = piece.encode() * max(1, BLOCK // len(piece))
                for _ in range(max(1, size // len(block))):
                    stream.write(block)
                stream.write(b"\nENDMODULE\n")

            yield f"a module of {name}", write
