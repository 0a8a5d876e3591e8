"""A page for each public name, made from its signature and docstring, and the list of all of them."""

import ast
import inspect
import sys
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from generated import heading, write_pages
from layer_picture import contract
from sphinx.application import Sphinx
from sphinx.errors import PycodeError
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.nodes import make_refnode

import taskcal
from taskcal import errors


def public_names() -> dict[str, list[str]]:
    """Full names by namespace, those at the top first; each thing once, by its shortest name or where it comes from."""
    groups: dict[str, dict[int, str]] = {"taskcal": {id(getattr(taskcal, n)): f"taskcal.{n}" for n in taskcal.__all__}}
    for space in _namespaces():
        groups[space] = {}
        for name, thing, home in _offered(import_module(space)):
            others = [other for other in groups if id(thing) in groups[other] and other != space]
            if others and others != ["taskcal"] and home.startswith(f"{space}."):
                del groups[others[0]][id(thing)]
            elif others:
                continue
            groups[space][id(thing)] = f"{space}.{name}"
    return {space: sorted(names.values(), key=str.lower) for space, names in groups.items()}


def _namespaces() -> list[str]:
    """From what knows nothing of others to what uses all, errors and the library of programs last."""
    spaces = set(dir(taskcal)) - set(taskcal.__all__) - {"__version__"}
    ordered = [name for layer in reversed(contract()) for name in layer if name in spaces - {"errors"}]
    ordered += [*sorted(spaces - {"errors", *ordered}), "errors"]
    return [*(f"taskcal.{name}" for name in ordered), "robot_programs"]


def _offered(module: ModuleType) -> Iterable[tuple[str, Any, str]]:
    """Names of a namespace, what they are, and the modules that they come from; of ``errors`` the classes alone."""
    path = Path(str(module.__file__))
    stub = path.with_suffix(".pyi")
    body = ast.parse((stub if stub.is_file() else path).read_text(encoding="utf-8")).body
    for line in body:
        for alias in line.names if isinstance(line, ast.ImportFrom) else ():
            if alias.asname == alias.name and (module is not errors or inspect.isclass(getattr(module, alias.name))):
                yield alias.name, getattr(module, alias.name), line.module or module.__name__
        if module is errors and isinstance(line, ast.ClassDef):
            yield line.name, getattr(module, line.name), module.__name__ + "."


def pages() -> dict[str, str]:
    """The page of each name, and the list."""
    groups = public_names()
    names = [full for some in groups.values() for full in some]
    lower = [full.lower() for full in names]
    files = {  # one name for plan and Plan where a file system does not tell capitals
        full: f"{full}-function" if lower.count(full.lower()) > 1 and full.rpartition(".")[2][0].islower() else full
        for full in names
    }
    listed: list[str] = []
    for space, some in groups.items():
        about = (import_module(space).__doc__ or "").split("\n\n")[0].replace("\n", " ")
        listed += [heading(space, "-"), f"{about}\n"]
        listed += [".. list-table::\n   :widths: 35 65\n"]
        for full in some:
            listed += [f"   * - :doc:`{_short(full)} </reference/api/{files[full]}>`\n     - {_summary(full)}"]
        listed += [""]
    return {f"{files[full]}.rst": "\n".join(_page(full)) for full in names} | {"list.inc": "\n".join(listed)}


def _short(full: str) -> str:
    return full.removeprefix("taskcal.")


def _found(full: str) -> Any:
    module, _, name = full.rpartition(".")
    return getattr(import_module(module), name)


def _page(full: str) -> Iterable[str]:
    thing = _found(full)
    yield ":orphan:\n"
    yield heading(_short(full))
    yield ":doc:`/reference/names`\n"
    if inspect.isclass(thing):
        yield f".. autoclass:: {full}\n   :members:\n"
    elif inspect.ismodule(thing):
        yield f".. automodule:: {thing.__name__}\n   :members:\n"
    elif callable(thing) and hasattr(thing, "__name__"):
        yield f".. autofunction:: {full}\n"
    else:
        yield f".. py:data:: {full}\n   :value: {thing!r}\n\n   {_summary(full)}\n"


def _summary(full: str) -> str:
    """The first sentence of a docstring; of a constant that of the line after it."""
    thing = _found(full)
    stated = (inspect.getdoc(thing) or "") if hasattr(thing, "__name__") else _doc_of_constant(full, thing)
    return stated.split("\n\n")[0].replace("\n", " ").replace("|", r"\|")


def _doc_of_constant(full: str, thing: Any) -> str:
    name = full.rpartition(".")[2]
    for module in [m for m in sys.modules if m.startswith("taskcal") and getattr(sys.modules[m], name, None) is thing]:
        try:
            docs = ModuleAnalyzer.for_module(module).find_attr_docs()
        except PycodeError:
            continue
        if ("", name) in docs:
            return " ".join(docs["", name])
    return ""


def _link(app: Sphinx, env: Any, node: Any, content: Any) -> Any:
    """Link a name that a docstring has in backticks, without its namespace, where only one thing has it."""
    python = env.domains["py"]
    target = str(node.get("reftarget", "")).removesuffix("()")
    if node.get("refdomain") != "py" or node.get("reftype") != "obj" or not target.isidentifier():
        return None
    found = [full for full in python.objects if full.endswith(f".{target}") and full.count(".") < 3]
    if len(found) != 1 or python.objects[found[0]].objtype not in ("class", "function", "exception", "data"):
        return None
    where = python.objects[found[0]]
    return make_refnode(app.builder, node["refdoc"], where.docname, where.node_id, content)


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before Sphinx looks for them."""
    app.connect("missing-reference", _link)
    app.connect("config-inited", lambda *_: write_pages("reference/api", pages()))
    return {"parallel_read_safe": True}
