"""Routines and those that call them."""

from robot_programs.krl.read import read_krl
from tests.robot_programs.krl.samples import source
from tests.robot_programs.krl.small_programs import FRAMES, POSE, read, texts


def test_frames_pass_from_a_caller_to_what_it_calls():
    more = f"DEF SUB( )\nLIN {POSE}\nEND\n"
    program = read(f"{FRAMES}SUB( )\nLIN {POSE}", more=more)
    assert [(m.routine, m.follows) for m in program.moves] == [("PART", 1), ("SUB", None)]
    program = read(f"SUB( )\n{FRAMES}SUB( )", more=more)
    assert not program.moves
    assert "$TOOL is not set before it" in texts(program)[0]
    program = read(f"{FRAMES}SUB( )\nLIN {POSE}", more="DEF SUB( )\n$BASE=BASE_DATA[1]\nEND\n")
    assert [m.part.name for m in program.moves] == ["BASE_DATA[1]"]
    program = read(f"{FRAMES}LIN {POSE}\nSUB( )", more=f"DEF SUB( )\nLIN {POSE}\nSUB( )\nEND\n")
    assert "SUB is called where that is not followed" in texts(program)[0]


def test_routines_of_one_name_in_two_files_count_as_one():
    one, two = (
        source(f"{name}.src", f"DEF {name}( )\n{FRAMES}SUB( )\nLIN {POSE}\nEND\nDEF SUB( )\n{line}\nEND\n")
        for name, line in (("one", "HALT"), ("two", "$BASE=$NULLFRAME"))
    )
    assert [m.routine for m in read_krl([one]).moves] == ["ONE"]
    assert not read_krl([one, two]).moves
