"""A first look at files that a command is to read, before the libraries that read them are imported: wrong ones end here."""

import os
from pathlib import Path

from taskcal.errors import FileError

LARGEST = 100_000
"""Bytes of a calibration up to which it is parsed whole here; a real one that is larger begins as it should."""


def look_at(path: Path | None) -> Path | None:
    """The path of a file that is there.

    Raises:
        FileError: there is nothing there, or nothing that may be looked at.
    """
    if path is not None:
        try:
            os.stat(path)
        except OSError as error:
            raise FileError(path, f"cannot be read: {error.strerror or error}") from error
        except ValueError:
            pass  # a NUL character: its reader names it
    return path


def look_at_calibration(path: Path) -> Path:
    """The path of a file that may be a calibration.

    Raises:
        FileError: there is none, or it is something else.
    """
    from taskcal.identification.calibration_envelope import read_envelope

    look_at(path)
    if not path.is_file():
        return path
    with path.open("rb") as stream:
        begins = stream.read(200).lstrip()[:1]
    if begins != b"{" or path.stat().st_size < LARGEST:
        read_envelope(path)
    return path


def look_at_calibrations(paths: list[Path]) -> list[Path]:
    """The paths of files that may be calibrations.

    Raises:
        FileError: one is not there, or something else.
    """
    return [look_at_calibration(path) for path in paths]
