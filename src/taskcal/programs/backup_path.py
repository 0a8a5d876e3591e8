"""What is taken for a backup: a folder, or a zip file."""

from pathlib import Path

ZIP = ".zip"
"""Suffix of a zip file; letter case does not matter."""


def is_backup(path: Path) -> bool:
    """Whether a path is a folder or a zip file."""
    return path.suffix.lower() == ZIP or path.is_dir()
