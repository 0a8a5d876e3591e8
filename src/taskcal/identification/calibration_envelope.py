"""What tells that a file is a calibration, and of which version; it takes no more than the standard library to see."""

from pathlib import Path
from typing import Any

from taskcal.errors import FileError, shown
from taskcal.text_file import read_json

FORMAT = "taskcal-calibration"
FORMAT_VERSION = 7
"""Version 1 held estimate and covariance of the parameters that were estimated, and of no others; versions 1 and 2 counted
the rows of outliers among those fitted, and named no line; before version 4 no joint had an error of its own, and no
covariance was packed; before version 5 neither the joint positions nor what rows held out showed were kept; before version 6 a
tracker had measured everything; before version 7 the covariance itself was held, not its factor."""


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
    if type(format_version) is not int or not 1 <= format_version <= FORMAT_VERSION:
        raise FileError(
            path,
            f"has format version {shown(repr(format_version))}, this Taskcal reads 1 to {FORMAT_VERSION}; identify again, or use "
            "the Taskcal that wrote it",
        )
    return data
