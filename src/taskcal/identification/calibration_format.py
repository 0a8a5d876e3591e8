"""What tells that a file is a calibration, and of which version; it takes no more than the standard library to see."""

from pathlib import Path
from typing import Any

from taskcal.io.json_file import read_versioned

FORMAT = "taskcal-calibration"
FORMAT_VERSION = 10


def read_envelope(path: Path) -> dict[str, Any]:
    """The content of a calibration's file, of which only format and version are looked at.

    Raises:
        FileError: it cannot be read, is cut off, or is something else.
    """
    return read_versioned(path, "calibration", FORMAT, FORMAT_VERSION, "identify", cut_off="save the calibration again")
