"""Titles of all axes of a figure."""

import plotly.graph_objects as go


def axis_titles(figure: go.Figure) -> str:
    layout = figure.to_dict()["layout"]
    axes = [value for key, value in layout.items() if key[1:5] == "axis"]
    axes += [value for key, value in layout.get("scene", {}).items() if key[1:] == "axis"]
    return " ".join(axis.get("title", {}).get("text", "") for axis in axes)
