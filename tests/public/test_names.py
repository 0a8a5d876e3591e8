"""The public names: few at the top, each standing once, none shadowed."""

import ast
import pkgutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import taskcal

ROOT = Path(taskcal.__file__).parent
STUBS = sorted(ROOT.rglob("__init__.pyi"))
NAMESPACES = sorted(set(dir(taskcal)) - set(taskcal.__all__) - {"__version__"})

PROMISED = (
    "load_robot", "ErrorModel", "sensitivity", "identifiability", "read_campaign", "identify", "validate", "load_task", "plan",
    "select", "study", "simulate", "correct", "read_program", "load_calibration", "explain", "Compliance", "Campaign",
    "Calibration", "Validation", "Workspace", "Orientation", "Station", "FileError", "TaskcalError",
)  # fmt: skip
"""What users and their scripts call, and what a user must build."""


def package_of(stub: Path) -> str:
    return ".".join(stub.parent.relative_to(ROOT.parent).parts)


def test_public_api_exports_35_to_50_names() -> None:
    """The public API exports 35 to 50 names, among them all promised ones."""
    assert set(PROMISED) <= set(taskcal.__all__)
    assert 35 <= len(taskcal.__all__) <= 50


def test_every_name_of_a_namespace_is_what_its_stub_says() -> None:
    for namespace in NAMESPACES:
        module = getattr(taskcal, namespace)
        assert isinstance(module, ModuleType)
        public = [name for name in dir(module) if not name.startswith("_")]
        assert public, namespace
        for name in public:
            assert getattr(module, name) is getattr(module, name), (namespace, name)


SHARED = {"TaskcalError": "InputError"}
"""Classes that the library of programs raises too, by what it calls them."""


def test_every_name_at_the_top_loads() -> None:
    for name in taskcal.__all__:
        assert getattr(taskcal, name).__name__ == SHARED.get(name, name)
    assert set(taskcal.__all__) < set(dir(taskcal))


def test_no_function_is_shadowed_by_a_module_of_its_name() -> None:
    """An import of `taskcal.x.y` sets y in `taskcal.x`: a public function y there would turn into the module."""
    shadowed = []
    for stub in STUBS:
        modules = {module.name for module in pkgutil.iter_modules([str(stub.parent)])}
        shadowed += [(package_of(stub), name) for name in modules & set(import_module(package_of(stub)).__all__)]
    assert shadowed == []


def test_a_stub_names_each_once_and_re_exports_it() -> None:
    for stub in STUBS:
        body = ast.parse(stub.read_text(encoding="utf-8")).body
        names = [alias for line in body if isinstance(line, ast.ImportFrom) for alias in line.names]
        assert all(alias.asname == alias.name for alias in names), stub
        assert len({alias.name for alias in names}) == len(names), stub


def test_importing_the_package_loads_no_stage() -> None:
    code = "import taskcal, sys; print(sorted(m for m in sys.modules if m.startswith(('taskcal', 'robot_programs', 'numpy'))))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['taskcal', 'taskcal_groundwork', 'taskcal_groundwork.public_names']"


BESIDE = ("taskcal_devices", "taskcal_studio", "taskcal_demo")


def test_importing_the_whole_core_loads_nothing_that_stands_beside_it() -> None:
    """Every module of Taskcal, the command line's among them, which begins the studio and finds devices by name when asked."""
    modules = sorted(
        ".".join(path.relative_to(ROOT.parent).with_suffix("").parts)
        for path in ROOT.rglob("*.py")
        if path.name not in ("__init__.py", "__main__.py")
    )
    assert len(modules) > 200
    code = f"import sys, {', '.join(modules)}; print([m for m in sys.modules if m.startswith({BESIDE!r})])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
