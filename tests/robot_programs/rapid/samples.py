"""RAPID as controllers and postprocessors write it."""

from pathlib import Path

import numpy as np
from pytransform3d.rotations import matrix_from_quaternion

from robot_programs.core.program import Program, Waypoint
from robot_programs.core.source import Source
from robot_programs.rapid.read import read_rapid
from taskcal.robot.catalogue import load_robot

S4C = """\
%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE GRIND
  ! Grinding cell, part in the gripper
  PERS tooldata tBelt:=[FALSE,[[1450.5,-220,910],[0.707107,0,0.707107,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wGrip:=[TRUE,TRUE,"",[[0,0,180],[1,0,0,0]],[[10,0,0],[0,1,0,0]]];
  CONST robtarget pIn:=[[12.5,-40,3],[0.5,0.5,-0.5,0.5],[0,-1,1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pOut:=[[62.5,-40,3],[0.5,0.5,-0.5,0.5],
    [0,-1,1,0],  ! as taught
    [9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR robtarget pLater;
  VAR num nParts:=0;

  PROC main()
    ConfL\\On;
    MoveAbsJ [[0,-20,30,0,45,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]\\NoEOffs,v1000,fine,tBelt\\WObj:=wGrip;
    WHILE nParts<10 DO
      MoveJ Offs(pIn,0,0,-50),v800,z50,tBelt\\WObj:=wGrip;
      MoveL pIn,v200,fine,tBelt\\WObj:=wGrip;
      SetDO doBelt,1;
      MoveL pOut,v20,z1,tBelt\\WObj:=wGrip;
      MoveL RelTool(pOut,0,0,-50\\Rz:=15),v800,z50,tBelt\\WObj:=wGrip;
      Incr nParts;
    ENDWHILE
    pLater:=CRobT();
    MoveL pLater,v100,fine,tBelt\\WObj:=wGrip;
  ENDPROC
ENDMODULE
"""

IRC5_FRAMES = """\
MODULE CalibData(SYSMODULE,NOSTEPIN)
    TASK PERS tooldata tSpindle:=[TRUE,[[250,30,120],[0.70710678,0,0.70710678,0]],[38.2,[90,0,110],[1,0,0,0],1.2,1.4,0.8]];
    TASK PERS wobjdata wPart:=[FALSE,TRUE,"",[[1500,-200,600],[0.9961947,0,0,0.0871557]],[[5,5,0],[1,0,0,0]]];
    TASK PERS wobjdata wTurn:=[FALSE,FALSE,"STN1",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    CONST zonedata zCut:=[FALSE,0.05,0.1,0.1,0.01,0.1,0.01];
ENDMODULE
"""

IRC5 = """\
MODULE Path_10
    !***********************************************************
    ! Generated path
    !***********************************************************
    CONST speeddata vCut:=[33.3,500,5000,1000];
    CONST robtarget Target_10:=[[0,0,50],[0,0,1,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    LOCAL CONST robtarget Line{3}:=[
        [[0,0,0],[0,0,1,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],
        [[100,0,0],[0,0,1,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],
        [[100,80,0],[0,0,1,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];
    CONST robtarget Arc_via:=[[50,100,0],[0,0,1,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget Arc_end:=[[0,80,0],[0,0,1,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

    PROC Path_10()
        MoveJ Target_10,v1000,z100,tSpindle\\WObj:=wPart;
        MoveL Line{1},v100,fine,tSpindle\\WObj:=wPart;
        MoveL Line{2},vCut,zCut,tSpindle\\WObj:=wPart;
        movel Line{3} , vCut , zCut , tSpindle \\WObj:=wPart;
        MoveC Arc_via,Arc_end,vCut,fine,tSpindle\\WObj:=wPart;
        MoveL Target_10,v1000,z100,tSpindle\\WObj:=wTurn;
        TriggL Target_10,v1000,gunOn,z10,tSpindle\\WObj:=wPart;
        MoveL Target_10,v1000\\T:=2,fine,tSpindle\\WObj:=wPart;
        FOR i FROM 1 TO 3 DO
            MoveL Line{i},v100,z1,tSpindle\\WObj:=wPart;
        ENDFOR
        MoveL Target_20,v1000,fine,tSpindle\\WObj:=wPart;
    ENDPROC
ENDMODULE
"""


def source(text: str, name: str = "part.mod") -> Source:
    return Source.of(Path(name), text.encode())


def module(body: str, declarations: str = "") -> Source:
    """A module with one routine, without line breaks in front of its first statement."""
    return source(f"MODULE m\n{declarations}\nPROC main()\n{body}\nENDPROC\nENDMODULE\n")


P = "CONST robtarget {}:=[[{},0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
"""A target at some x."""

POINTS = "".join(P.format(f"p{k}", 10 * k) for k in range(1, 10))


def reasons(program) -> list[str]:
    return [str(diagnostic) for diagnostic in program.diagnostics]


def pose(xyz_mm, wxyz) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = matrix_from_quaternion(np.array(wxyz))
    T[:3, 3] = np.array(xyz_mm) / 1e3
    return T


NINE = "[9E9,9E9,9E9,9E9,9E9,9E9]"


ROBOT = load_robot("abb-irb6660-205-1.9")


Q = np.radians([10.0, 20.0, 15.0, -100.0, 40.0, 200.0])  # quadrants 0, -2, 2


def shifted(program: Program, *numbers: int, mm=(1.0, 0.0, 0.0), q=Q) -> dict[int, tuple[Waypoint, ...]]:
    """Motions that end a little beside."""
    out = {}
    for i in numbers:
        T = program.motions[i].end.T.copy()
        T[:3, 3] += np.array(mm) / 1e3
        out[i] = (Waypoint(kind=program.motions[i].kind, q=q, T=T, via=None),)
    return out


def rewritten(source_: Source, *numbers: int, **how) -> str:
    program = read_rapid([source_])
    return program.rewrite(ROBOT, shifted(program, *numbers, **how))[0].text
