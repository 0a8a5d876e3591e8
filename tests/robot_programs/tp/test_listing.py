"""The parts of a listing."""

from robot_programs.tp.listing import Listing
from tests.robot_programs.tp.samples import POSITIONS, listing

ARC = "C P[3]    \r\n    :  P[4] 500mm/sec FINE"


def test_instructions_are_found_over_several_lines_with_their_places():
    source = listing(["  UFRAME_NUM=1", ARC, "  !note"], POSITIONS)
    found = Listing(source.text)
    assert found.name == "MILL"
    assert len(found.instructions) == 3
    arc = found.instructions[1]
    assert source.text[slice(*arc.number)] == "2"
    assert source.text[arc.start : arc.end].startswith("   2:C P[3]")
    assert source.text[arc.end - 1] == ";"
    # what begins the second line is blank, so that a place in the text is one in the file
    assert arc.text.index("P[4]") + arc.body == source.text.index("P[4]")
    assert ":" not in arc.text


def test_an_instruction_without_a_semicolon_ends_where_the_next_number_begins():
    text = "/MN\n   1:L P[1] 10mm/sec FINE\n   2:  CALL A ;\n/POS\n/END\n"
    first, second = Listing(text).instructions
    assert first.text.strip() == "L P[1] 10mm/sec FINE"
    assert second.text == "  CALL A ;"


def test_sections_end_where_the_next_begins():
    found = Listing("/PROG  A\n/MN\n   1:  END ;\n/POS\nP[1]{\n};\n/END\n")
    assert set(found.sections) == {"PROG", "MN", "POS", "END"}
    assert list(found.positions) == [1]
    assert found.fault() is None


def test_a_position_that_is_not_closed_or_listed_twice_is_told():
    text = "/MN\n/POS\nP[1]{\n   GP1:\nP[2]{\n};\n/END\n"
    fault = Listing(text).fault()
    assert fault is not None
    assert text[fault[0] : fault[0] + 4] == "P[2]"
    assert "not closed" in fault[1]
    fault = Listing("/MN\n/POS\nP[1]{\n};\nP[1]{\n};\n/END\n").fault()
    assert fault is not None
    assert "P[1] is listed a second time" in fault[1]
