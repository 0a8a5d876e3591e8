"""Readers of robot programs, for what is tried with every file; their random damage is `tests.robot_programs.fuzz`."""

import numpy as np

from robot_programs.reading import read_program
from tests.readers.damage import Files
from tests.readers.reader import Reader
from tests.robot_programs.fuzz import LANGUAGES, language


def _reader(name: str) -> Reader:
    tested = language(name)

    def files() -> Files:
        return [(source.path.name, source.encode()) for source in tested.generate(np.random.default_rng(0))[:1]]

    needs_robot = name not in ("rapid", "krl")
    return Reader(files=files, read=lambda path: read_program(path, robot=tested.robot if needs_robot else None))


PROGRAM_READERS = {name: _reader(name) for name in LANGUAGES}
