"""Public names: each stands once, in the stub beside its package's ``__init__``, and is loaded when it is first used."""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def names_in_stub(package: str, file: str) -> dict[str, str]:
    """Names that a package's stub re-exports, and the module that each comes from; its own name for one of its modules.

    Args:
        package: its name.
        file: its ``__init__.py``; the stub stands beside it.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [statement for statement in stub.body if isinstance(statement, ast.ImportFrom)]
    return {alias.name: statement.module or package for statement in imports for alias in statement.names}


def load_lazily(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` (PEP 562) of a package whose names stand in its stub.

    Args:
        package: its name.
        file: its ``__init__.py``.
    """
    home = names_in_stub(package, file)

    def load(name: str) -> Any:
        if name == "__version__" and "." not in package:
            from importlib.metadata import version

            return version(package)
        if name not in home:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        if home[name] == package:
            return import_module(f"{package}.{name}")
        return getattr(import_module(home[name]), name)

    return load, lambda: sorted(home), sorted(name for name, module in home.items() if module != package)
