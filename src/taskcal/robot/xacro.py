"""Xacro, the macro language in which ROS packages write URDF, carried out by xacrodoc in a process of its own."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from taskcal.errors import FileError, shown
from taskcal.xml_file import read_xml

SECONDS = 10.0
"""After which the macros are given up; those of a robot with cell and gripper take one or two."""

MEMORY = 1_000_000_000
"""Bytes of address space that they may take."""

_CHILD = f"""
import sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, ({MEMORY}, {MEMORY}))
except ImportError:
    pass
from xacrodoc import XacroDoc, packages
for folder in sys.argv[2:]:
    packages.look_in(folder)
sys.stdout.buffer.write(XacroDoc.from_file(sys.argv[1]).to_urdf_string(pretty=False).encode())
"""


def expand_xacro(path: Path) -> bytes:
    """The URDF that a xacro file stands for.

    Packages are found above the file, and beside the package that it is in. A xacro file calculates and includes others: it
    is a program, if a small one, that runs with bounded time and memory.

    Raises:
        FileError: it is not XML, xacrodoc is not installed, or the macros fail.
    """
    read_xml(path)
    if find_spec("xacrodoc") is None:
        raise FileError(
            path,
            "is a xacro file, which takes the package xacrodoc: pip install 'taskcal[urdf]'; or expand it with ROS, xacro "
            f"{shown(path.name)} > {shown(path.name.split('.')[0])}.urdf",
        )
    package = next((folder for folder in path.resolve().parents if (folder / "package.xml").is_file()), None)
    beside = [] if package is None else [str(package.parent)]
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", _CHILD, str(path.resolve()), *beside],
            capture_output=True,
            timeout=SECONDS,
            check=False,
            cwd=path.resolve().parent,  # included files are named from there
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired as error:
        raise FileError(path, f"has macros that do not come to an end within {SECONDS:g} s") from error
    if done.returncode:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise FileError(path, f"its macros fail: {shown(said[-1] if said else 'no reason given', 300)}")
    return done.stdout
