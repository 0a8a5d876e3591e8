"""A figure as JSON, in which no name from a file acts as more than text."""

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import plotly.graph_objects as go

_LINK = re.compile(r"((?:^|[^\\])(?:\\\\)*)(?:<|\\u003[cC])(?=(?:/|\\u002[fF])?[aA]\b)")
"""The beginning of a link or its end, written out or as JSON's escape, but not where the escape is itself escaped."""


def figure_json(figure: "go.Figure") -> str:
    """The figure, for the library that draws it.

    Plotly takes some HTML in labels: emphasis, line feeds and links. None of ours is a link; one in the name of a target or a file
    would lead whoever clicks on it elsewhere.
    """
    return _LINK.sub(r"\1&lt;", str(figure.to_json()))
