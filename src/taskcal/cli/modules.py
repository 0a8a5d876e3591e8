"""Modules that bring effects of one's own, named before the command: ``taskcal --import my_effects identify …``."""

import sys
from importlib import import_module
from pathlib import Path

import typer

OPTION = "--import"


def import_modules(names: list[str]) -> None:
    """Import modules by name, or files that end in ``.py``.

    Only what the user names is run, never what a calibration names. A file's folder is searched last, so that nothing in it
    stands in for a module that Python knows.

    Raises:
        typer.BadParameter: there is no such module or file, another module has its name, or it fails.
    """
    for name in names:
        path = Path(name) if name.endswith(".py") else None
        if path is not None:
            if not path.is_file():
                raise typer.BadParameter(f"there is no file {name}", param_hint=OPTION)
            sys.path.append(str(path.resolve().parent))
        module_name = name if path is None else path.stem
        try:
            module = import_module(module_name)
        except ModuleNotFoundError as error:
            if error.name != module_name:
                raise typer.BadParameter(
                    f"{name} imports {error.name}, which is not installed", param_hint=OPTION
                ) from error
            raise typer.BadParameter(
                f"there is no module {name}; install it, or give its file, such as {name}.py", param_hint=OPTION
            ) from error
        except Exception as error:
            raise typer.BadParameter(f"{name} fails: {type(error).__name__}: {error}", param_hint=OPTION) from error
        if path is not None and not _is(module.__file__, path):
            raise typer.BadParameter(
                f"another module is called {path.stem} ({module.__file__ or 'built in'}); rename the file",
                param_hint=OPTION,
            )


def _is(file: str | None, path: Path) -> bool:
    return file is not None and Path(file).resolve() == path.resolve()
