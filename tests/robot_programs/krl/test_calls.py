"""Calls of KRL routines, and what runs beside the lines: a call leaves what the routine's lines would leave in its place."""

import pytest

from robot_programs.krl.read import read_krl
from tests.robot_programs.krl.samples import CONFIG_DAT, FRAMES, POSE, read, source, texts

SETTINGS = """\
DEF SETTINGS (NBASE :IN,NTOOL :IN,SPEED :IN)
INT NBASE,NTOOL
REAL SPEED
FDAT_ACT=FDEFAULT
FDAT_ACT.BASE_NO=NBASE
FDAT_ACT.TOOL_NO=NTOOL
BAS(#FRAMES)
$VEL.CP=SPEED/1000.0
IF NBASE==0 THEN
$BASE=$NULLFRAME
ENDIF
END
"""
DEFAULT = "DECL FDAT FDEFAULT={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}"
HIGH = POSE.replace("Z 800", "Z 900")


def test_a_routine_sets_what_its_parameters_say():
    body = f"INT N\nN=1\nSETTINGS(N+1,1,50.5)\nLIN {POSE}\nSETTINGS(0,2,200.5)\nLIN {POSE}"
    program = read(body, dat=DEFAULT.replace("DECL", "DECL GLOBAL"), more=SETTINGS)
    assert not texts(program)
    assert [(m.tool.name, m.part.name, m.speed) for m in program.motions] == [
        ("TOOL_DATA[1]", "BASE_DATA[2]", 0.0505),
        ("TOOL_DATA[2]", "$NULLFRAME", 0.2005),
    ]


def test_variable_given_by_value_in_a_condition_stays_known():
    more = "DEFFCT BOOL NEAR(P :IN)\nDECL E6POS P\nP.Z=0\nRETURN $IN[1]\nENDFCT\n"
    body = f"DECL E6POS P\n{FRAMES}P={POSE}\nIF NEAR(P) THEN\nHALT\nENDIF\nLIN P"
    assert len(read(body, more=more).motions) == 1
    assert not read(body, more=more.replace(" :IN", "")).motions


def test_relative_point_counts_across_calls():
    """A point that counts from the motion before counts across calls."""
    program = read(f"{FRAMES}LIN {POSE}\nUP( )\nLIN {{Z 850}}", more="DEF UP( )\nLIN_REL {Z 100}\nEND\n")
    assert [round(float(move.end.T[2, 3]), 9) for move in program.motions] == [0.8, 0.85, 0.9]
    assert [move.follows for move in program.motions] == [None, 2, 0]


@pytest.mark.parametrize(("mode", "known"), [("IN", True), ("OUT", False), ("", False)])
def test_what_is_given_by_value_stays(mode, known):
    routine = f"DEF TAKE(P{' :' + mode if mode else ''})\nDECL E6POS P\nP.Z=0\nEND\n"
    program = read(f"{FRAMES}TAKE(XP1)\nLIN XP1", dat=f"DECL E6POS XP1={POSE}", more=routine)
    assert len(program.motions) == known


@pytest.mark.parametrize(
    ("call", "routine", "known"),
    [
        ("SUB(XG)", "XG.Z=0\nLIN P\nP.X=1", False),
        ("SUB(XG)", "P.Z=P.Z+50\nLIN XG", False),
        ("TWO(XG,XG)", "P.Z=0\nLIN Q", False),
        ("TWO(XG,XH)", "P.Z=0\nLIN Q", True),
        ("SUB(XG)", "LIN P", True),
    ],
)
def test_what_has_two_names_in_a_routine_is_not_known_by_the_other(call, routine, known):
    """What is passed by reference is the caller's variable, which may be set by its own name, or by another parameter."""
    more = f"DEF SUB(P :OUT)\nDECL E6POS P\n{routine}\nEND\nDEF TWO(P :OUT,Q :OUT)\nDECL E6POS P,Q\n{routine}\nEND\n"
    dat = f"DECL GLOBAL E6POS XG={POSE}\nDECL GLOBAL E6POS XH={POSE}"
    own = "SUB" if call.startswith("SUB") else "TWO"
    program = read(f"{FRAMES}XG={POSE}\nXH={POSE}\n{call}", dat=dat, more=more)
    assert sum(move.routine == own for move in program.motions) == known


@pytest.mark.parametrize(
    "line", ["IF LIFT( ) THAN\nENDFOR", "BAS(#VEL_PTP,LIFT( ))", "OK=LIFT( ) 5", "FOR LIFT( )\nENDFOR"]
)
def test_a_function_in_a_line_that_is_not_understood_is_called(line):
    """It is no program of its own: what holds where it begins is not known, and what it sets is not known behind it."""
    function = f"DEFFCT BOOL LIFT( )\n$BASE=BASE_DATA[1]\nLIN {HIGH}\nRETURN TRUE\nENDFCT\n"
    program = read(f"BOOL OK\n{FRAMES}LIN {POSE}\n{line}\nLIN {POSE}", more=function)
    assert [move.place.line for move in program.motions] == [5] * (len(program.motions))
    assert any("LIFT" in text or "not match" in text for text in texts(program))


def test_a_routine_that_calls_itself_ends():
    program = read(
        f"{FRAMES}AGAIN(3)\nLIN {POSE}",
        more=f"DEF AGAIN(N :IN)\nINT N\n$BASE=BASE_DATA[1]\nLIN {POSE}\nAGAIN(N-1)\nAGAIN(N-2)\nEND\n",
    )
    assert not program.motions
    assert [text.partition(": ")[2] for text in texts(program)] == [
        "LIN stays as it is: AGAIN sets it",
        "LIN stays as it is: AGAIN is called where that is not followed",
    ]  # fmt: skip


# Routines and those that call them.


def test_routines_of_one_name_in_two_files_count_as_one():
    one, two = (
        source(f"{name}.src", f"DEF {name}( )\n{FRAMES}SUB( )\nLIN {POSE}\nEND\nDEF SUB( )\n{line}\nEND\n")
        for name, line in (("one", "HALT"), ("two", "$BASE=$NULLFRAME"))
    )
    assert [m.routine for m in read_krl([one]).motions] == ["ONE"]
    assert not read_krl([one, two]).motions


# Actions that run beside the lines: from where they start to where they end, nothing that they set can be trusted.


DECLARED = "INTERRUPT DECL 5 WHEN $IN[1] DO FOUND( )\n"
FOUND = "DEF FOUND( )\n$BASE=BASE_DATA[1]\nEND\n"
LINE = f"LIN {POSE}\n"
AT_X = "LIN {X X,Y 0,Z 800,A 0,B 90,C 0}\n"


def lines(body: str, more: str = FOUND, dat: str = "") -> list[int]:
    """Lines of the body whose motions are read, counted from 0."""
    return [move.place.line - 2 for move in read(body, more=more, dat=dat).motions]


RESUMED = f"DEF FOUND( )\n$BASE=BASE_DATA[1]\nRESUME\nEND\nDEF SEARCH( )\nINTERRUPT ON 5\nLOOP\n{LINE}ENDLOOP\nEND\n"
HANDED = f"DECL E6POS P\n{DECLARED.replace('( )', '(P)')}{FRAMES}INTERRUPT ON 5\nP={POSE}\nLIN P\nINTERRUPT OFF 5\nP={POSE}\nLIN P"
TRIGGER = f"{FRAMES}TRIGGER WHEN DISTANCE=0 DELAY=0 DO ACT\n{LINE}$BASE=$NULLFRAME\n{LINE}"


@pytest.mark.parametrize("number", [" 5", ""])
def test_interrupt_that_sets_base_counts_from_on_to_next_base(number):
    body = f"{DECLARED}{FRAMES}{LINE}INTERRUPT ON{number}\n{FRAMES}{LINE}INTERRUPT OFF{number}\n{LINE}{FRAMES}{LINE}"
    assert lines(body) == [3, 12]
    refused = texts(read(body, more=FOUND))
    assert [text.partition(":")[2].partition(":")[0] for text in refused] == ["9", "11"]
    assert "$BASE may be set at any time by FOUND, which the interrupt of part.src:2 calls" in refused[0]


@pytest.mark.parametrize(
    ("body", "more", "wanted"),
    [
        (f"{DECLARED}INTERRUPT ON 5\n{FRAMES}{LINE}", FOUND.replace("$BASE=", "$TOOL=TOOL_DATA[1]\n$BASE="), []),
        (f"{DECLARED}INTERRUPT ON 5\n{FRAMES}{LINE}", FOUND.replace("$BASE", "$OUT[1]"), [4]),
        (f"{DECLARED}INTERRUPT ON 5\n{FRAMES}$IPO_MODE=#BASE\n{LINE}", "DEF FOUND( )\n$IPO_MODE=#TCP\nEND\n", []),
        (f"{DECLARED}INTERRUPT ON 6\n{FRAMES}{LINE}", FOUND, [4]),
        (f"{DECLARED}INTERRUPT ON 5\nINTERRUPT DISABLE 5\n{FRAMES}{LINE}INTERRUPT ENABLE 5\n{LINE}", FOUND, [5]),
        (f"{DECLARED}INTERRUPT ON 5\n{FRAMES}PTP {{A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}}", FOUND, [4]),
        (f"{DECLARED}{FRAMES}WHILE $IN[7]\n{LINE}INTERRUPT ON 5\nENDWHILE\n{LINE}", FOUND, []),
        (f"INTERRUPT WITH BRAKE DECL 5 WHEN $IN[1] DO FOUND\nINTERRUPT ON 5\n{FRAMES}{LINE}", FOUND, []),
        (f"INTERRUPT DECL 5 WHEN $IN[1] DO $BASE=BASE_DATA[1]\nINTERRUPT ON 5\n{FRAMES}{LINE}", "", []),
        (f"GO( )\n{FRAMES}{LINE}", f"{FOUND}DEF GO( )\nGLOBAL {DECLARED}INTERRUPT ON 5\nEND\n", []),
        (f"GO( )\n{FRAMES}{LINE}", f"{FOUND}DEF GO( )\n{DECLARED}INTERRUPT ON 5\nEND\n", [3]),
        (f"{DECLARED}GO( )\n{FRAMES}{LINE}", f"{FOUND}DEF GO( )\nINTERRUPT ON 5\nEND\n", []),
        (
            f"{DECLARED}INTERRUPT ON 5\n{FRAMES}{LINE}",
            f"DEF FOUND( )\nSET( )\nEND\n{FOUND.replace('FOUND', 'SET')}",
            [],
        ),
        # a routine that is resumed leaves what the interrupt set
        (f"{DECLARED}{FRAMES}SEARCH( )\n$BASE=$NULLFRAME\n{LINE}", RESUMED, []),
        (f"{DECLARED}{FRAMES}SEARCH( )\nINTERRUPT OFF 5\n$BASE=$NULLFRAME\n{LINE}", RESUMED, [6]),
        # a variable that it is given, by reference or by value
        (HANDED, "DEF FOUND(Q :OUT)\nDECL E6POS Q\nQ.Z=5\nEND\n", [9]),
        (HANDED, "DEF FOUND(Q :IN)\nDECL E6POS Q\nQ.Z=5\nEND\n", [6, 9]),
        # a distance counts from nowhere where it moves
        (f"{DECLARED}{FRAMES}INTERRUPT ON 5\n{LINE}LIN_REL {{Z 5}}", "DEF FOUND( )\nPTP {A1 5}\nEND\n", [4]),
        (f"{DECLARED}{FRAMES}INTERRUPT ON 5\n{LINE}LIN_REL {{Z 5}}", "DEF FOUND( )\nBRAKE\nEND\n", [4, 5]),
        # a trigger sets the base at a time that is unknown
        (TRIGGER.replace("ACT", "FOUND( ) PRIO=-1"), FOUND, []),
        (TRIGGER.replace("ACT", "$OUT[1]=TRUE"), FOUND, [3, 5]),
    ],
)
def test_interrupts_count_where_they_are_on(body, more, wanted):
    assert lines(body, more) == wanted


def test_interrupt_number_of_a_data_list_is_known():
    body = f"{DECLARED.replace('5', 'N')}INTERRUPT ON N\n{FRAMES}{LINE}INTERRUPT OFF N\n{FRAMES}{LINE}"
    assert lines(body, dat="DECL CONST INT N=5") == [8]
    assert lines(f"N=6\n{body}", dat="DECL INT N=5") == []


def test_interrupt_that_changes_base_data_makes_it_unknown():
    body = f"{DECLARED}INTERRUPT ON 5\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[1]\n{LINE}"
    program = read(body, more="DEF FOUND( )\nBASE_DATA[1].X=5\nEND\n")
    assert not program.motions
    assert "BASE_DATA[1] is changed by the program, at part.src:10" in texts(program)[0]


def test_submit_program_that_changes_base_data_makes_it_unknown():
    part = f"DEF PART( )\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[1]\n{LINE}END\n"
    submit = "DEF SPS( )\nBASE_DATA[1].X=5\nEND\n"
    sources = [source("part.src", part), source("$config.dat", CONFIG_DAT)]
    assert not read_krl([*sources, source("sps.sub", submit)]).motions
    assert len(read_krl([*sources, source("other.src", submit)]).motions) == 1


def test_trigger_may_set_a_variable_at_any_time():
    body = f"DECL REAL X\nX=900\n{FRAMES}TRIGGER WHEN DISTANCE=0 DELAY=0 DO X=800\n{AT_X}"
    assert "X may be set at any time by the TRIGGER of part.src:6" in texts(read(body))[0]


@pytest.mark.parametrize("dat", ["", "DECL REAL X=900.0"])
def test_analog_signal_is_unknown_until_assigned_after_off(dat):
    """Followed analog signal is unknown until assigned after off."""
    declared = "" if dat else "DECL REAL X\n"
    body = f"{FRAMES}X=900\nANIN ON X=1.0*SENSOR+0.5\nX=900\n{AT_X}ANIN OFF SENSOR\n{AT_X}X=900\n{AT_X}"
    (first,) = texts(read(declared + body, dat=dat))[:1]
    assert f"X may be set at any time by the ANIN of part.src:{6 - bool(dat)}" in first
    assert lines(declared + body, dat=dat) == [10 - bool(dat)]
    assert lines(declared + body.replace("OFF SENSOR", "OFF OTHER"), dat=dat) == []


def test_followed_analog_signal_overrides_the_data_list():
    program = read(f"{FRAMES}ANIN ON X=1.0*SENSOR\n{AT_X}", dat="DECL REAL X=900.0")
    assert not program.motions


def test_what_the_files_miss_of_interrupts_is_named():
    body = f"{DECLARED}{FRAMES}INTERRUPT ON 5\nINTERRUPT ON 7\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO MARK( )\n{LINE}"
    program = read(body)
    assert len(program.motions) == 1
    said = " ".join(texts(program))
    assert "FOUND is not in the files given; the INTERRUPT that calls it" in said
    assert "interrupt 7 is declared in none of the files given" in said
    assert "MARK is not in the files given; the TRIGGER that calls it" in said


def test_interrupt_of_the_controller_itself_is_known():
    body = f"GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )\nINTERRUPT ON 3\n{FRAMES}{LINE}"
    program = read(body)
    assert (len(program.motions), texts(program)) == (1, [])
