"""What statements set and do."""

import numpy as np
import pytest

from tests.robot_programs.apt.samples import points, read


def test_inches_feeds_and_increments_by_hand():
    program = read(
        "UNITS/INCH\nFEDRAT/30,IPM\nFROM/0,0,1\nGODLTA/1,0,0\nUNITS/MM\nFEDRAT/60\nGODLTA/0,0,-25.4\nGODLTA/-2\n"
    )
    np.testing.assert_allclose(
        points(program), 0.0254 * np.array([[1, 0, 1], [1, 0, 0], [1, 0, -2 / 25.4]]), atol=1e-15
    )
    np.testing.assert_allclose(
        [m.speed for m in program.motions], [0.0127, 0.0254, 0.0254]
    )  # 60 in the unit stated: IPM
    assert [m.follows for m in program.motions] == [None, 0, 1]
    assert read("FEDRAT/0.2,MMPR\nGOTO/0,0,0").motions[0].speed is None
    assert read("FEDRAT/PERMIN,120\nGOTO/0,0,0").motions[0].speed == pytest.approx(0.002)
    assert read("UNITS/INCH\nFEDRAT/6\nGOTO/0,0,0").motions[0].speed == pytest.approx(0.00254)


@pytest.mark.parametrize("word", ["UNIT", "UNITS"])
def test_either_word_sets_the_unit(word):
    np.testing.assert_allclose(points(read(f"{word}/INCH\nGOTO/1,2,3\n")), [[0.0254, 0.0508, 0.0762]], atol=1e-15)
    np.testing.assert_allclose(points(read(f"{word}/MM\nGOTO/1,2,3\n")), [[0.001, 0.002, 0.003]], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("GOTO/P1", "path.apt:1: GOTO has not three or six numbers"),
        ("GOTO/1,2,3,0,0,1,0,0,1", "GOTO has not three or six numbers"),
        ("GOTO/1,,3", "GOTO has not three or six numbers"),
        ("GOTO/1,2,1E999", "GOTO has not three or six numbers"),
        ("GOTO", "GOTO has not three or six numbers"),
        ("GOTO/1,2,3,0,0,0", "the tool axis has length 0 instead of 1"),
        ("GODLTA/1,2,3", "GODLTA counts from a place that is not known"),
        ("TLLFT,GOFWD/L1,PAST,L2", "TLLFT is not read"),
        ("GOTO/1,2,3\nCLEARP/XYPLAN,30\nGOCLER\nGODLTA/1", "GOCLER is not read; the motion stays as it is"),
        ("INDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,(LINE/0,0,0,0,5,0)", "begins at a place that is not known"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,6),ON,(LINE/0,0,0,0,6,0)", "does not lie on its circle"),
        ("GOTO/5,0,0\nINDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,(LINE/0,0,0,0,5,0)", "do not lie on one circle"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,2,INTOF,(LINE/0,0,0,0,5,0)", "another meeting"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,2,INTOF,(LINE/0,0,0,5,0,0)", "a full circle"),
        ("GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),TANTO,(LINE/0,0,0,5,0,0)", "only arcs between points"),
        ("FROBNI/ON\nFROBNI/OFF", "path.apt:1: 'FROBNI' is not known; it is taken to move nothing"),
    ],
)
def test_what_is_not_read_is_said_by_line(text, said):
    assert said in str(read(text).diagnostics[0])
    assert len(read(text).diagnostics) == 1 + ("GODLTA/1\n" in f"{text}\n")


def test_a_clearance_surface_moves_nothing():
    """CLRSRF defines where a later RETRCT goes (ICAM, the CLRSRF command)."""
    program = read("CLRSRF/0,0,1,50\nGOTO/1,2,3")
    np.testing.assert_allclose(points(program), [[0.001, 0.002, 0.003]])
    assert not program.diagnostics
