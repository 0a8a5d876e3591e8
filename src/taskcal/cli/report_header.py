"""The header of a report: whom it is for, which robot it is of, and who measured with what, from a TOML file."""

import datetime
from pathlib import Path
from typing import Annotated

from pydantic import Field

from taskcal.toml_file import Finite, Section, read_toml

Line = Annotated[str, Field(strict=True, min_length=1, max_length=300)]


class ReportHeader(Section):
    """The fields; each is shown where it is given."""

    customer: Line | None = None
    order: Line | None = None
    serial_number: Line | None = None
    """Of the robot."""
    place: Line | None = None
    date: datetime.date | None = None
    """Of the measurement."""
    operator: Line | None = None
    instrument: Line | None = None
    temperature_C: Finite | None = None
    remark: Line | None = None

    def labelled(self) -> list[tuple[str, str]]:
        """Labels and values of the fields that are given."""
        names = {"serial_number": "serial number", "temperature_C": "temperature"}
        units = {"temperature_C": " °C"}
        return [
            (names.get(key, key), f"{value}{units.get(key, '')}")
            for key, value in self.model_dump().items()
            if value is not None
        ]


def read_header(path: Path) -> list[tuple[str, str]]:
    """Labels and values for a report's head.

    Raises:
        FileError: the file cannot be read, or a field is not known or not a text, a number or a date.
    """
    return read_toml(path, ReportHeader).labelled()
