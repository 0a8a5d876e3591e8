"""Words of APT, by what they mean for the motions around them."""

_NO_MOTION = """
    PARTNO PPRINT INSERT LETTER REMARK FINI END CLPRNT NOPOST MACHIN MULTAX AUTOPS CHANNEL SWITCH PIVOTZ
    CUTTER TLDATA END-OF-PATH PAINT DISPLY PLOT INTOL OUTTOL TOLER CUTCOM CLEARP CLRSRF SAFETY
    CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH PSIS CUT DNTCUT ISN HEADER THICK VERIFY
    SPINDL COOLNT DELAY DWELL STOP OPSTOP OPSKIP SEQNO AUXFUN PREFUN REWIND CLAMP HEAD TMARK LEADER RESERV SELCTL SELECTL
"""
HARMLESS = frozenset(_NO_MOTION.split())
"""They move nothing, or say how to move, not where."""

_GO = "MOVARC ARCSLP TLON TLLFT TLRGT GO GOFWD GOBACK GOLFT GORGT GOUP GODOWN RETRCT GOCLER POCKET PROFIL CALL"
UNREAD_MOTIONS = frozenset(_GO.split())
"""Motions whose path is not written as numbers, or not in a form that is certain."""

BLOCKING = {
    "ORIGIN": "ORIGIN moves the coordinates",
    "TRANS": "TRANS moves the coordinates",
    "TRACUT": "TRACUT transforms the motions",
    "REFSYS": "REFSYS changes the coordinates",
    "ROTABL": "ROTABL turns the table",
    "ROTATE": "ROTATE turns the table",
    "ROTHED": "ROTHED turns the head",
    "MIRROR": "MIRROR reflects the motions",
    "INDEX": "COPY repeats motions elsewhere",
    "COPY": "COPY repeats motions elsewhere",
    "MACRO": "a macro is run from elsewhere",
    "LOOPST": "a loop runs motions again",
    "JUMPTO": "JUMPTO changes the order of motions",
    "IF": "IF changes the order of motions",
}
"""What makes motions uncertain from a statement on until it is cleared, and why."""

CLEARING = {"TERMAC": "MACRO", "LOOPND": "LOOPST"}
"""Words that end what others began."""

ENDING = {"NOMORE", "OFF"}
"""Arguments that end what their word began."""

INCH = 0.0254
UNITS = {"MM": 1e-3, "CM": 1e-2, "INCH": INCH, "INCHES": INCH, "IN": INCH}
"""Metres."""

FEEDS = {"MMPM": 1e-3 / 60.0, "IPM": INCH / 60.0, "MMPR": None, "IPR": None, "PERREV": None}
"""Metres per second; none per revolution of the spindle."""
