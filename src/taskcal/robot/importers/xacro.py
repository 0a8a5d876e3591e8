"""Xacro, the macro language in which ROS packages write URDF, carried out by xacrodoc in a process of its own.

A xacro file is a program: its expressions are Python's, it includes other files, loads YAML and reads the environment. So a file
is expanded inside a fence, unless the caller trusts it: expressions are checked by their syntax tree before they are evaluated,
the process has no environment to read, and an audit hook ends it where it opens or lists anything outside the file's own folder,
or starts, imports or connects to anything. Each of the two holds without the other as far as it can: no sandbox of Python's
expressions alone is known to be tight, and a hook alone does not stop what never asks the operating system.
"""

import ast
import os
import re
import subprocess
import sys
import types
from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from taskcal.errors import FileError, shown
from taskcal.io.xml_file import LARGEST_MB, read_xml

SECONDS = 10.0
"""After which the macros are given up; those of a robot with cell and gripper take one or two."""

MEMORY = 1_000_000_000
"""Bytes of address space that they may take."""

REFUSED = 3
"""Exit status of a process that the fence ended; its standard error names what was refused."""

MAX_PACKAGE_DEPTH = 6
"""Folders below a xacro file's own in which packages are looked for; a ROS workspace has them in the second or third."""

_trusted: ContextVar[bool] = ContextVar("_trusted", default=False)


@contextmanager
def trusting_xacro() -> Generator[None]:
    """Expand xacro files without the fence inside this context: they may read any file, the environment, and run any code."""
    before = _trusted.set(True)
    try:
        yield
    finally:
        _trusted.reset(before)


def expand_xacro(path: Path) -> bytes:
    """The URDF that a xacro file stands for.

    Time and memory are bounded. Nothing outside the file's own folder is read, links resolved, nor anything hidden in it;
    packages are found in that folder, and above it by their own ``package.xml``. Inside `trusting_xacro` the file may read
    everything, and packages are found beside the package that it is in, too (``--trust-xacro`` of the command line).

    Raises:
        FileError: it is not XML, xacrodoc is not installed, the macros fail, or they ask for what is refused.
    """
    read_xml(path)
    if find_spec("xacrodoc") is None:
        raise FileError(
            path,
            "is a xacro file, which takes the package xacrodoc: pip install 'taskcal[urdf]'; or expand it with ROS, xacro "
            f"{shown(path.name)} > {shown(path.name.split('.')[0])}.urdf",
        )
    own = path.resolve()
    trusted = _trusted.get()
    kept = {name: os.environ[name] for name in ("SYSTEMROOT", "PYTHONHOME") if name in os.environ}
    modules = {"PYTHONPATH": os.pathsep.join(place for place in sys.path if place)}
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__, str(own), *(["trusted"] if trusted else [])],
            capture_output=True,
            timeout=SECONDS,
            check=False,
            cwd=own.parent,  # included files are named from there
            env={**(os.environ if trusted else kept), **modules},
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired as error:
        raise FileError(path, f"has macros that do not come to an end within {SECONDS:g} s") from error
    said = done.stderr.decode("utf-8", "replace").strip().splitlines() or ["no reason given"]
    if done.returncode == REFUSED:
        raise FileError(
            path,
            f"{shown(said[-1], 400)}; put what it needs into its own folder, or, if you trust whoever wrote it as you trust a "
            "program, give --trust-xacro",
        )
    if done.returncode:
        raise FileError(path, f"xacro macro expansion failed: {shown(said[-1], 300)}")
    return done.stdout


def _expand(path: Path, *, trusted: bool) -> None:
    """Write the URDF of a xacro file to standard output; the whole life of the process that `expand_xacro` starts."""
    try:
        resource: Any = import_module("resource")
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    except ImportError:  # Windows
        pass
    try:
        xacrodoc: Any = import_module("xacrodoc")
        packages: Any = import_module("xacrodoc.packages")
        if trusted:
            package = next((folder for folder in path.parents if (folder / "package.xml").is_file()), None)
            if package is not None:
                packages.look_in(str(package.parent))
        else:
            _fence(path.parent)
        document = xacrodoc.XacroDoc.from_file(str(path), walk_up=trusted, resolve_packages=trusted)
        content = document.to_urdf_string(pretty=False).encode()
    except MemoryError:
        _end(1, f"they take more than {MEMORY // 1_000_000} MB")
    except Exception as error:
        reason = next((line for line in str(error).splitlines() if line.strip()), "")
        _end(1, f"{type(error).__name__}: {reason}")
    if len(content) > LARGEST_MB * 1e6:
        _end(1, f"they make more than {LARGEST_MB:g} MB of URDF")
    sys.stdout.buffer.write(content)


def _end(status: int, reason: str) -> NoReturn:
    """End this process at once, so that no macro can catch it."""
    sys.stdout.flush()
    os.write(2, f"\n{' '.join(reason.split())}".encode("utf-8", "replace"))
    os._exit(status)


def _refuse(reason: str) -> NoReturn:
    _end(REFUSED, reason)


def _fence(own: Path) -> None:
    """Confine this process to a folder, and what it evaluates to arithmetic, text, lists and YAML of that folder."""
    xacro: Any = import_module("xacro")
    arguments: Any = import_module("xacro.substitution_args")
    packages: Any = import_module("xacrodoc.packages")
    for name in ("yaml", "glob", "xml.dom.expatbuilder", "encodings.idna", "encodings.latin_1", "encodings.ascii"):
        import_module(name)  # whatever is imported later is refused
    evaluate: Callable[..., Any] = xacro.safe_eval

    def evaluate_harmless(text: str, names: dict[str, Any], local: Any = None) -> Any:
        _see_harmless(text)
        return evaluate(text, names, local)

    def evaluate_argument(text: str, context: dict[str, Any]) -> str:
        given = {name: arguments.convert_value(value, "auto") for name, value in context.get("arg", {}).items()}
        plain = {name: value for name, value in arguments._eval_dict.items() if not name.startswith("_")}
        return str(evaluate_harmless(text, {**plain, **given, "arg": given.__getitem__}))

    def environment(*_: object) -> NoReturn:
        _refuse("reads the environment, $(env …) or $(optenv …)")

    find = _find_packages(own)
    for module, name, harmless in (
        (xacro, "safe_eval", evaluate_harmless),
        (arguments, "_eval", evaluate_argument),
        (arguments, "_env", environment),
        (arguments, "_optenv", environment),
        (packages, "get_path", find),
    ):
        getattr(module, name)  # another release of xacro, which has no such function, is not fenced by this
        setattr(module, name, harmless)
    arguments._eval_dict.update({"env": environment, "optenv": environment, "find": find})
    python = xacro._global_symbols["python"]
    dict.__setitem__(python, "type", lambda value: type(value))  # that of one argument, which makes no classes
    dict.pop(python, "vars")
    # whoever waits for this process keeps all that it prints; the file is open until it ends
    sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    sys.addaudithook(_watch(own))


FRAMES = (
    types.FrameType,
    types.GeneratorType,
    types.CoroutineType,
    types.AsyncGeneratorType,
    types.CodeType,
    types.TracebackType,
)
"""Whose attributes lead from an expression to the modules around it."""

UNSAFE_ATTRIBUTES = frozenset(
    [name for kind in FRAMES for name in dir(kind) if "_" in name] + ["format", "format_map", "mro"]
)
"""``str.format`` reads attributes that its text names, so that no syntax tree shows them."""


def _see_harmless(text: str) -> None:
    """End the process where an expression names what leads out of it, in comprehensions and lambdas as well."""
    for node in ast.walk(ast.parse(text.strip(), mode="eval")):
        name = getattr(node, "attr", None) or getattr(node, "id", None) or getattr(node, "arg", None)
        if not isinstance(name, str):
            continue
        attribute = isinstance(node, ast.Attribute)
        if name.startswith("_" if attribute else "__") or (attribute and name in UNSAFE_ATTRIBUTES):
            _refuse(f"evaluates an expression with '{name}', which leads out of the file")


def _find_packages(own: Path) -> Callable[[str], str]:
    """A function that finds packages by name in a folder and, by their own description alone, around it."""
    around = {_package_name(folder): folder for folder in own.parents if (folder / "package.xml").is_file()}

    def find(package: str) -> str:
        for place, inner, files in os.walk(own):
            folder = Path(place)
            if "package.xml" in files and _package_name(folder) == package:
                return folder.as_posix()
            deep = len(folder.relative_to(own).parts) >= MAX_PACKAGE_DEPTH
            inner[:] = [] if deep else sorted(name for name in inner if not name.startswith("."))
        if package in around:
            return around[package].as_posix()
        _refuse(f"includes from the package '{package}', which is not in the file's own folder")

    return find


def _package_name(folder: Path) -> str:
    """The package's name in its ``package.xml``."""
    with (folder / "package.xml").open(encoding="utf-8", errors="replace") as file:
        name = re.search(r"<name>\s*(.*?)\s*</name>", file.read(100_000))
    return folder.name if name is None else name[1]


REFUSED_EVENTS = re.compile(
    r"(os|shutil|subprocess|pty|signal|socket|ssl|ctypes|mmap|sqlite3|urllib|http|ftplib|smtplib|poplib|imaplib|nntplib"
    r"|telnetlib|webbrowser|winreg|msvcrt|_winapi|syslog|fcntl|resource|pickle|marshal|code|tempfile|cpython|gc|pathlib)\."
    r"|sys\.(addaudithook|_current_frames|set|unraisable)|builtins\.(input|breakpoint)"
)
"""Audit events that no macro needs, by the names of https://docs.python.org/3/library/audit_events.html."""


def _watch(own: Path) -> Callable[[str, tuple[Any, ...]], None]:
    """An audit hook that lets a process read one folder and do nothing else."""
    checking = False

    def see_inside(place: Any, what: str) -> None:
        nonlocal checking
        if isinstance(place, int):  # a file that is open already
            return
        checking = True  # resolving links looks at folders, which is an event itself
        try:
            named = os.fsdecode("." if place is None else place)
            real = Path(os.path.realpath(named))
        finally:
            checking = False
        if not real.is_relative_to(own):
            _refuse(f"{what} '{named}', which lies outside the file's own folder")
        if any(part.startswith(".") for part in real.relative_to(own).parts):
            _refuse(f"{what} '{named}', which is hidden")

    def watch(event: str, given: tuple[Any, ...]) -> None:
        if checking:
            return
        if event == "open":
            place, mode, flags = given
            if (isinstance(mode, str) and set(mode) & set("wax+")) or flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
                _refuse(f"writes '{place}'")
            see_inside(place, "reads")
        elif event in ("os.listdir", "os.scandir", "os.walk", "os.fwalk"):
            see_inside(given[0], "lists")
        elif event == "glob.glob":
            see_inside(os.path.dirname(re.split(r"[*?\[]", os.fsdecode(given[0]), maxsplit=1)[0]) or ".", "lists")
        elif event == "import":
            raise ImportError(f"a macro cannot import {given[0]}")
        elif REFUSED_EVENTS.match(event):
            _refuse(f"asks for {event}")

    return watch


if __name__ == "__main__":
    _expand(Path(sys.argv[1]), trusted=sys.argv[2:] == ["trusted"])
