"""KRL as controllers and postprocessors write it."""

from pathlib import Path

import numpy as np

from robot_programs.core.source import Source
from robot_programs.krl.read import KrlProgram, read_krl
from taskcal.robot.catalogue import load_robot

HANDLING_SRC = """\
&ACCESS RVP
&REL 7
&PARAM TEMPLATE = C:\\KRC\\Roboter\\Template\\vorgabe
&PARAM EDITMASK = *
DEF HANDLING( )
;FOLD INI;%{PE}
  ;FOLD BASISTECH INI
    GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )
    INTERRUPT ON 3
    BAS (#INITMOV,0 )
  ;ENDFOLD (BASISTECH INI)
;ENDFOLD (INI)

;FOLD PTP HOME Vel= 100 % DEFAULT;%{PE}%MKUKATPBASIS,%CMOVE,%VPTP,%P 1:PTP, 2:HOME, 3:, 5:100, 7:DEFAULT
$BWDSTART = FALSE
PDAT_ACT=PDEFAULT
FDAT_ACT=FHOME
BAS (#PTP_PARAMS,100 )
$H_POS=XHOME
PTP XHOME
;ENDFOLD
;FOLD PTP P1 CONT Vel=100 % PDAT1 Tool[1]:Gripper Base[2]:Table;%{PE}%R 8.3.22,%MKUKATPBASIS,%CMOVE,%VPTP,%P 1:PTP, 2:P1
$BWDSTART=FALSE
PDAT_ACT=PPDAT1
FDAT_ACT=FP1
BAS(#PTP_PARAMS,100)
PTP XP1 C_PTP
;ENDFOLD
;FOLD LIN P2 Vel=0.5 m/s CPDAT1 Tool[1]:Gripper Base[2]:Table;%{PE}%R 8.3.22,%MKUKATPBASIS,%CMOVE,%VLIN,%P 1:LIN, 2:P2
$BWDSTART=FALSE
LDAT_ACT=LCPDAT1
FDAT_ACT=FP2
BAS(#CP_PARAMS,0.5)
LIN XP2
;ENDFOLD
   lin xp2:{X 0,Y 0,Z 50}  ; 50 mm beside, in the tool's own direction
;FOLD CIRC P3 P4 CONT Vel=0.2 m/s CPDAT2 Tool[1] Base[2];%{PE}
$BWDSTART=FALSE
LDAT_ACT=LCPDAT1
FDAT_ACT=FP2
BAS(#CP_PARAMS,0.2)
CIRC XP3, XP4 C_DIS
;ENDFOLD
;FOLD SLIN P5 Vel=2 m/s CPDAT3 Tool[1] Base[2];%{PE}
SLIN XP5 WITH $VEL=SVEL_CP(2.0,,LCPDAT1), $TOOL=STOOL2(FP2), $BASE=SBASE(FP2.BASE_NO), $IPO_MODE=SIPO_MODE(FP2.IPO_FRAME)
;ENDFOLD
GRIPPER_OPEN( )
LIN XP1
LIN_REL {Z 20}
END
"""

HANDLING_DAT = """\
&ACCESS RVP
DEFDAT  HANDLING
;FOLD EXTERNAL DECLARATIONS;%{PE}%MKUKATPBASIS,%CEXT,%VCOMMON,%P
EXT  BAS (BAS_COMMAND  :IN,REAL  :IN )
DECL INT SUCCESS
;ENDFOLD (EXTERNAL DECLARATIONS)
DECL BASIS_SUGG_T LAST_BASIS={POINT1[] "P5                      ",POINT2[] "P5                      "}
DECL E6POS XP1={X 812.512573,Y -120.250000,Z 240.0,A 178.5,B 2.25,C -179.125,S 2,T 3,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}
DECL PDAT PPDAT1={VEL 100.000,ACC 100.000,APO_DIST 100.000,APO_MODE #CPTP}
DECL E6POS XP2={X 812.512573,Y -120.25,Z 140.0,A 178.5,B 2.25,C -179.125,S 2,T 3,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL FDAT FP2={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}
DECL LDAT LCPDAT1={VEL 2.00000,ACC 100.000,APO_DIST 50.0,APO_FAC 50.0,ORI_TYP #VAR}
DECL E6POS XP3={X 850.0,Y -60.0,Z 140.0,A 178.5,B 2.25,C -179.125,S 2,T 3,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL E6POS XP4={X 900.0,Y -120.0,Z 140.0,A 178.5,B 2.25,C -179.125,S 2,T 3,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL E6POS XP5={X 900.0,Y -20.0,Z 240.0,A 178.5,B 2.25,C -179.125,S 2,T 35,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
ENDDAT
"""

CONFIG_DAT = """\
&ACCESS R
DEFDAT  $CONFIG
;FOLD FRAMES
DECL FRAME TOOL_DATA[16]
TOOL_DATA[1]={X 12.5,Y -3.25,Z 180.0,A 0.0,B 0.0,C 0.0}
TOOL_DATA[2]={X 0.0,Y 0.0,Z 250.0,A 30.0,B 0.0,C 0.0}
FRAME BASE_DATA[32]
BASE_DATA[1]={X 900.0,Y 0.0,Z 400.0,A 0.0,B 0.0,C 0.0}
BASE_DATA[2]={X 400.0,Y 150.0,Z 300.0,A 15.0,B 0.5,C -0.25}
;ENDFOLD
DECL E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 30.0,A6 0.0,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL FDAT FHOME={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}
ENDDAT
"""

MILLING_SRC = """\
&ACCESS RVP
DEF MILLING ( )
  ; Fräsen der Tasche
  BAS(#INITMOV,0)
  $TOOL = {X 120.0, Y 0.0, Z 210.0, A 0.0, B 90.0, C 0.0}
  $BASE = BASE_DATA[1]
  $VEL.CP = 0.05
  PTP {A1 5,A2 -80,A3 100,A4 0,A5 45,A6 0}
  PTP {E6POS: X 100.0, Y -50.0, Z 150.0, A 180.0, B 0.0, C 180.0, S 'B110', T 'B110010'} C_PTP
  LIN {X 100.0,Y -50.0,Z 100.0,A 180.0,B 0.0,C 180.0} C_DIS
  LIN {X 150.0,Y -50.0,Z 100.0,A 180.0,B 0.0,C 180.0,E1 0.0} C_DIS
\tCIRC {X 175.0,Y -25.0,Z 100.0},{X 150.0,Y 0.0,Z 100.0,A 180.0,B 0.0,C 180.0} C_DIS
  CIRC {X 175.0,Y -25.0,Z 100.0},{X 150.0,Y 0.0,Z 100.0,A 180.0,B 0.0,C 180.0}, CA 180
  LIN {X 100.0,Z 100.0}
  FOR I = 1 TO 3
    LIN {X 100.0,Y -50.0,Z 100.0,A 180.0,B 0.0,C 180.0}
  ENDFOR
END
"""


def source(name: str, text: str, newline: str = "\r\n") -> Source:
    return Source.of(Path(name), text.replace("\n", newline).encode("utf-8"))


def handling(newline: str = "\r\n") -> list[Source]:
    return [
        source("handling.src", HANDLING_SRC, newline),
        source("handling.dat", HANDLING_DAT, newline),
        source("$config.dat", CONFIG_DAT, newline),
    ]


def milling(newline: str = "\r\n") -> list[Source]:
    return [source("MILLING.SRC", MILLING_SRC, newline), source("$CONFIG.DAT", CONFIG_DAT, newline)]


FRAMES = "$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}\n$BASE=$NULLFRAME\n"


POSE = "{X 900,Y 0,Z 800,A 0,B 90,C 0}"


def read(body: str, dat: str = "", config: str = CONFIG_DAT, more: str = "") -> KrlProgram:
    sources = [source("part.src", f"DEF PART( )\n{body}\nEND\n{more}")]
    if dat:
        sources.append(source("part.dat", f"DEFDAT PART\n{dat}\nENDDAT\n"))
    return read_krl([*sources, source("$config.dat", config)])


def texts(program: KrlProgram) -> list[str]:
    return [str(diagnostic) for diagnostic in program.diagnostics]


ROBOT = load_robot("kuka-kr16-2")

Q = np.radians([5.0, -70.0, 95.0, 10.0, -30.0, -20.0])
"""Joint positions of all of them: they decide status and turn only."""
