"""Sphinx configuration."""

import sys
from pathlib import Path

import taskcal

sys.path.insert(0, str(Path(__file__).parent))

project = "Taskcal"
release = taskcal.__version__
author = "Taskcal contributors"
copyright = "Taskcal contributors"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "api_pages",
    "catalogue_table",
    "command_pages",
    "effect_table",
    "home_picture",
    "layer_picture",
    "validation_table",
]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_inherit_docstrings = False
add_module_names = False
nitpicky = True  # a name that a docstring refers to is in the reference
default_role = "py:obj"  # a name in single backticks is linked where it has a page
nitpick_ignore_regex = [("py:obj", ".*")]
nitpick_ignore = [  # one class by two names: the library of programs raises it as InputError
    ("py:exc", "TaskcalError"),
    ("py:exc", "InputError"),
    ("py:class", "taskcal_groundwork.errors.InputError"),
]

html_theme = "furo"
html_use_index = False  # of 1300 entries; search and the list of names find them
html_title = f"Taskcal {release}"
html_static_path = ["_static"] if (Path(__file__).parent / "_static").is_dir() else []
templates_path = ["_templates"]
html_sidebars = {
    "**": [f"sidebar/{part}.html" for part in ("brand", "search", "scroll-start", "navigation", "scroll-end")]
}
html_sidebars["**"].append("versions.html")
html_css_files = ["taskcal.css"]
html_js_files = [("scrollable.js", {"defer": "defer"})]


def _prepare(_app, what, _name, _object, _options, lines):
    """Keep Sphinx from reading |x| as a substitution, and what stands before a colon as a type."""
    lines[:] = [line.replace("|", r"\|") for line in lines]
    if what in ("attribute", "property") and lines:
        lines.insert(0, "\\")  # an escaped line end, which prints nothing
    for i, line in enumerate(lines[:-1]):
        if line.strip() == "Returns:":
            lines[i + 1] = lines[i + 1].replace(": ", " – ", 1)


def setup(app):
    """Connect the above, ahead of napoleon."""
    app.connect("autodoc-process-docstring", _prepare, priority=400)
