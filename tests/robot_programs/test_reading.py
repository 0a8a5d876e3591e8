"""Which language a program is read as."""

import gzip
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import taskcal
from robot_programs.core.program import Frame
from robot_programs.languages import LANGUAGES, language_of
from robot_programs.reading import read_program
from taskcal.errors import FileError, TaskcalError

JOINTS = "id,J1_deg,J2_deg\n0,10,20\n"


def test_every_suffix_has_one_language_whatever_its_letter_case():
    every = [suffix for language in LANGUAGES for suffix in language.suffixes]
    assert len(set(every)) == len(every)
    for language in LANGUAGES:
        assert set(language.composed) <= set(language.suffixes)
        for suffix in language.suffixes:
            assert language_of(Path(f"a.b{suffix.upper()}")) is language


@pytest.mark.parametrize(
    ("beside", "said"),
    [
        (["job.script", "job.txt"], r"pass its text, job\.script, which stands beside it$"),
        (["job.txt"], r"pass its text, job\.txt, which stands beside it, renamed to \.script$"),
        (["other.script"], r"pass its text, job\.script, which PolyScope writes beside it when the program is saved$"),
    ],
)
@pytest.mark.parametrize("suffix", [".urp", ".URP"])
def test_a_program_of_polyscope_names_the_text_beside_it(beside, said, suffix, tmp_path):
    path = tmp_path / f"job{suffix}"
    path.write_bytes(gzip.compress(b"<URProgram/>"))
    for name in beside:
        (tmp_path / name).write_text("def job():\nend\n")
    with pytest.raises(FileError, match=said):
        read_program(path)


def test_a_file_is_read_by_its_suffix(tmp_path):
    (tmp_path / "PATH.CSV").write_text(JOINTS)
    program = taskcal.read_program(tmp_path / "PATH.CSV")
    np.testing.assert_allclose(program.motions[0].end.q, np.radians([10.0, 20.0]))


def test_what_cannot_be_read_says_what_would_work(tmp_path):
    (tmp_path / "a.csv").write_text(JOINTS)
    with pytest.raises(TaskcalError, match="no program was given; name its files"):
        read_program()
    with pytest.raises(
        FileError, match=r"a\.nc: has no suffix of a robot program; known are RAPID: \.mod .* CSV: \.csv"
    ):
        read_program("a.nc")
    with pytest.raises(FileError, match=r"none\.csv: cannot be read: "):
        read_program(tmp_path / "none.csv")
    with pytest.raises(
        TaskcalError, match=r"a\.mod is RAPID and b\.src is KRL; the files of a program have one language"
    ):
        read_program("a.mod", "b.src")
    with pytest.raises(FileError, match=r"a\.csv: is given twice"):
        read_program(tmp_path / "a.csv", tmp_path / "a.csv")
    with pytest.raises(
        TaskcalError, match=r"a\.src is KRL, which says its own tools and frames; leave out tool and part"
    ):
        read_program("a.src", tool=Frame(name="t", T=np.eye(4)))


ALONE = """\
import sys
sys.modules |= dict.fromkeys(["taskcal", "scipy", "numba", "pandas", "pydantic"])  # whoever imports one of them fails
from importlib import import_module
from pkgutil import walk_packages
import robot_programs
print(len([import_module(found.name) for found in walk_packages(robot_programs.__path__, "robot_programs.")]))
print(robot_programs.read_program(sys.argv[1]))
"""


def test_robot_programs_is_read_without_taskcal(tmp_path):
    (tmp_path / "path.csv").write_text(JOINTS)
    code = [sys.executable, "-c", ALONE, str(tmp_path / "path.csv")]
    modules, program = subprocess.run(code, check=True, capture_output=True, text=True).stdout.splitlines()
    assert int(modules) > 30
    assert program.endswith("path.csv: 1 motions)")
