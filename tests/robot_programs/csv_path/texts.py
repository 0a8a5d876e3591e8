"""Paths from their text."""

from pathlib import Path

import numpy as np

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.csv_path.read import CsvProgram, read_csv_path
from taskcal.robot.catalogue import load_robot

TOOL = Frame(name="mill", T=np.eye(4))


ROBOT = load_robot("abb-irb120")


def read(text: str | bytes, **given_: object) -> CsvProgram:
    data = text if isinstance(text, bytes) else text.encode()
    return read_csv_path([Source.of(Path("path.csv"), data)], **{"tool": TOOL, **given_})


ARC = """move;x_mm;y_mm;z_mm;qx;qy;qz;qw
joint;0;0;0;0;0;0;1
via;10;10;0;0;0;0;1
circular;20;0;0;0;0;0;1
linear;30;0;0;0;0;0;1
"""
