"""Files of JSON: no key twice, of one version, and sealed, so that a change after they were written is noticed and named."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taskcal.errors import FileError, listed, shown
from taskcal.io.text_file import read_text


def parse_json(text: str, path: str | Path) -> Any:
    """What a text of JSON says.

    Args:
        text: of the file.
        path: of the file, for messages.

    Raises:
        FileError: an object has a key twice, of which JSON does not say which counts.
        ValueError: it is not JSON.
        RecursionError: it is nested too deeply.
    """

    def of_pairs(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        out = dict(pairs)
        if len(out) < len(pairs):
            keys = [key for key, _ in pairs]
            twice = next(key for key in keys if keys.count(key) > 1)
            raise FileError(path, f"states the key '{shown(twice)}' twice; remove one of the two")
        return out

    return json.loads(text, object_pairs_hook=of_pairs)


# The seal of a file: a digest for each key, so that whoever reads it can say which were changed since it was written. It finds
# mistakes of hands, editors and disks; it is no signature, for whoever changes a value can change its digest.

SEAL = "seal"
"""Key of the seal."""

DIGEST_DIGITS = 16
"""Hexadecimal, of SHA-256: 64 bits, so that two values agree by chance once in 10¹⁹."""

ON_PURPOSE = (
    "if it was edited on purpose, commands read it with --unsealed (Python with unsealed=True); the studio does not, as it makes "
    "one anew from the campaign"
)
"""What to do about a file whose reader can accept it."""

MAX_NAMED = 6
"""Changed keys that a message names."""


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """Content for a file of JSON, with its seal."""
    return {**content, SEAL: {key: _digest(value) for key, value in content.items()}}


def chained(content: Mapping[str, Any], before: str) -> dict[str, Any]:
    """Content for a line of JSON in a file that is appended to, with a seal that goes on from the line before.

    Args:
        content: of the line.
        before: seal of the line before; empty for the first.
    """
    return {**content, SEAL: _digest([before, content])}


def unchain(path: str | Path, lines: Sequence[str], remedy: str) -> tuple[dict[str, Any], ...]:
    """The content of every line of a file whose lines are `chained`, with its seal.

    Args:
        path: of the file, for messages.
        lines: whole ones.
        remedy: what to do about a file that was edited.

    Raises:
        FileError: a line is not as it was written, or one before it was changed, added or removed.
    """
    out, before = list[dict[str, Any]](), ""
    for number, line in enumerate(lines, 1):
        try:
            data = parse_json(line, path)
        except (ValueError, RecursionError):
            data = None
        if not isinstance(data, dict) or data != chained({k: v for k, v in data.items() if k != SEAL}, before):
            raise FileError(path, f"was edited after it was written, here or before; {remedy}", line=number)
        before = data[SEAL]
        out.append(data)
    return tuple(out)


def digest_of(text: str) -> str:
    """Digest of a text that another file seals."""
    return _digest(text)


def without_seal(data: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """The content without its seal, and each key that does not agree with it: how it differs, in words."""
    content = {key: value for key, value in data.items() if key != SEAL}
    seal = data.get(SEAL)
    if not isinstance(seal, dict):
        return content, {SEAL: "removed" if seal is None else "changed"}
    removed = {key: "removed" for key in seal if key not in content}
    changed = {key: "changed" for key in content if key in seal and _digest(content[key]) != seal[key]}
    added = {key: "added" for key in content if key not in seal}
    return content, {**changed, **removed, **added}


def unseal(
    path: str | Path, data: Mapping[str, Any], remedy: str, *, accept: bool = False
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The content of a sealed file without its seal, and the keys that were edited since it was written.

    Args:
        path: of the file, for messages.
        data: all that it holds.
        remedy: what to do about an edited one.
        accept: whether an edited one is read all the same.

    Raises:
        FileError: it was edited, and that is not accepted; the message names the keys.
    """
    content, changes = without_seal(data)
    if changes and not accept:
        raise FileError(path, f"was edited after it was written: {list_changes(changes)}; {remedy}")
    return content, tuple(changes)


def list_changes(changes: Mapping[str, str]) -> str:
    """Changed keys in words: ``'estimate' changed, 'q' removed``."""
    return listed((f"'{shown(key)}' {how}" for key, how in changes.items()), MAX_NAMED)


def note_of_edits(file: str, edited: Sequence[str]) -> str:
    """A file's name, with the keys that were edited in it, if any."""
    if not edited:
        return file
    return f"{file} (edited: {listed(map(shown, edited), MAX_NAMED)})"


@dataclass(frozen=True, kw_only=True)
class SealedFile:
    """A kind of file that is read as it was written: it states its format and the version of it, and is sealed."""

    what: str
    """It is, for messages, such as ``calibration``."""
    marker: str
    """That it has as ``format``."""
    version: int
    """Of the format, the only one that is read."""
    command: str
    """Of taskcal that writes one."""
    cut_off: str = ""
    """What to do about a file that is not whole; to repeat the command by default."""
    plain: bool = False
    """Whether its text is ASCII, other letters as JSON escapes them."""

    def seal(self, stated: Mapping[str, Any]) -> dict[str, Any]:
        """All that a file holds, by what it states."""
        return sealed({"format": self.marker, "format_version": self.version, **stated})

    def text(self, stated: Mapping[str, Any]) -> str:
        """Text of a file, by what it states.

        Raises:
            ValueError: a number in it is not finite.
        """
        return json.dumps(self.seal(stated), indent=1, ensure_ascii=self.plain, allow_nan=False) + "\n"

    def read(self, path: str | Path, *, accept: bool = False) -> tuple[dict[str, Any], tuple[str, ...]]:
        """What a file holds without its seal, and the keys that were edited since it was written.

        Args:
            path: of the file.
            accept: whether an edited one is read all the same.

        Raises:
            FileError: as of `look_at`, or it was edited, and that is not accepted; the message names the keys.
        """
        remedy = f"restore it, or {self.command} again; {ON_PURPOSE}"
        return unseal(path, self.look_at(path), remedy, accept=accept)

    def look_at(self, path: str | Path) -> dict[str, Any]:
        """All that a file holds, of which only format and version are looked at.

        Raises:
            FileError: it cannot be read, is not JSON, states a key twice, or is of another format or version.
        """
        what, again = self.what, f"{self.command} again"
        text = read_text(path, otherwise=f"is not a {what}: it is not UTF-8 text")
        try:
            data = parse_json(text, path)
        except RecursionError as error:
            raise FileError(path, f"is not a {what}: its JSON is nested too deeply") from error
        except json.JSONDecodeError as error:
            if text.strip() and text.lstrip()[0] not in "{[":
                raise FileError(
                    path, f"is not JSON, and no {what}; give a file that taskcal {self.command} wrote"
                ) from error
            message = f"is not a whole JSON file; it may have been cut off: {self.cut_off or again}"
            raise FileError(path, message, line=error.lineno) from error
        except ValueError as error:
            raise FileError(path, f"is not a {what}: a number has too many digits") from error
        if not isinstance(data, dict) or data.get("format") != self.marker:
            raise FileError(
                path,
                f"is JSON, but not a {what}: 'format' is not '{self.marker}'; write one with taskcal {self.command}",
            )
        stated = data.get("format_version")
        if type(stated) is not int or stated != self.version:
            raise FileError(
                path,
                f"has format version {shown(repr(stated))}, this Taskcal reads {self.version}; {again}, or use the Taskcal that "
                "wrote it",
            )
        return data


def _digest(value: Any) -> str:
    """Digest of a value's canonical form: keys in order, no spaces, ASCII, numbers as Python writes them."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("ascii")).hexdigest()[:DIGEST_DIGITS]
