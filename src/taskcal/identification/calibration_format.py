"""What tells that a file is a calibration, and of which version; it takes no more than the standard library to see."""

from pathlib import Path
from typing import Any

from taskcal.errors import FileError, shown
from taskcal.io.text_file import read_json

FORMAT = "taskcal-calibration"
FORMAT_VERSION = 8


def read_envelope(path: Path) -> dict[str, Any]:
    """The content of a calibration's file, of which only format and version are looked at.

    Raises:
        FileError: it cannot be read, is cut off, or is something else.
    """
    data = read_json(path, "calibration", "save the calibration again")
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise FileError(
            path, f"is JSON, but not a calibration: 'format' is not '{FORMAT}'; write one with taskcal identify"
        )
    format_version = data.get("format_version")
    if type(format_version) is not int or format_version != FORMAT_VERSION:
        raise FileError(
            path,
            f"has format version {shown(repr(format_version))}, this Taskcal reads {FORMAT_VERSION}; identify again, or use the "
            "Taskcal that wrote it",
        )
    return data
