"""What a page says of the remainder."""

from taskcal.identification.calibration import Calibration
from taskcal.identification.residual_analysis import ResidualAnalysis
from taskcal.report.calibration import residual_analysis_section
from taskcal.report.content import Chart, Table


def test_the_section_says_what_is_proven(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    _, found = fitted
    section = residual_analysis_section(found, "80 poses")
    words = str([getattr(block, "items", ()) for block in section.blocks])
    assert "position of J3, by the turn of J3" in words
    assert "move as one body" in words
    assert sum(isinstance(block, Chart) for block in section.blocks) == 2
    table = next(block for block in section.blocks if isinstance(block, Table))
    assert len(table) == len(found.explained)
