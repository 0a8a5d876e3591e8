"""Which programs ``taskcal correct`` wrote: known again by their bytes, wherever they lie, so that none is corrected twice.

A corrected program bears no mark, for all but its targets stays as it was. A digest of what was written lies in the user's
state folder instead, with the name of the program that it was made from.
"""

import json
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from taskcal.cli.state_folder import state_folder
from taskcal.errors import FileError
from taskcal.files import write_whole

if TYPE_CHECKING:
    from taskcal.correction.correction import Correction
    from taskcal.programs.source import Source

RECORDS = 5000
"""Files that are remembered, the last ones written."""


def check_not_corrected(sources: "Iterable[Source]") -> None:
    """See that no file of a program is as `taskcal correct` wrote it.

    Raises:
        FileError: one is, with the file that it was made from.
    """
    for source in sources:
        if origin := _origin_of(source.encode()):
            raise FileError(
                source.path,
                f"is as taskcal correct wrote it from '{origin}', and would be corrected twice; correct that file, or say with "
                "--again that this is meant",
            )


def remember_corrected(correction: "Correction") -> None:
    """Note the files in which a correction changed something; where no note can be kept, they will not be known."""
    given = {source.path: source.encode() for source in correction.program.sources}
    for source in correction.sources:
        content = source.encode()
        if content in given.values():
            continue
        origin = source.path if source.path in given else correction.program.sources[0].path
        place = _record_of(content)
        with suppress(OSError, FileError):
            place.parent.mkdir(parents=True, exist_ok=True)
            write_whole(place, json.dumps({"program": str(origin.resolve())}))
            _forget_the_oldest(place.parent)


def _origin_of(content: bytes) -> str:
    """The file that a corrected one was made from; empty for any other."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        return str(json.loads(_record_of(content).read_text(encoding="utf-8"))["program"])
    return ""


def _record_of(content: bytes) -> Path:
    import hashlib

    return state_folder() / "corrected" / f"{hashlib.sha256(content).hexdigest()}.json"


def _forget_the_oldest(folder: Path) -> None:
    records = list(folder.glob("*.json"))
    if len(records) > RECORDS:
        for record in sorted(records, key=lambda path: path.stat().st_mtime)[:-RECORDS]:
            record.unlink(missing_ok=True)
