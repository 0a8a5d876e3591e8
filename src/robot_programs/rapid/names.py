"""Which declaration a name stands for, by RAPID's rules of scope."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

from robot_programs.core.form import Routine
from robot_programs.core.kit import Token
from robot_programs.core.program import Unresolved
from robot_programs.core.source import Source
from robot_programs.core.values import Lost
from robot_programs.rapid.syntax import DataDeclaration, ModuleText, RoutineParameter, RoutineText, key_of

# What every RAPID program can use without declaring it: types, data, instructions and functions.
#
# Source: RAPID reference manuals, 3HAC050917 (instructions, functions and data types).

Value = float | bool | str | Lost | tuple["Value", ...]
"""Of data: a number, a truth, a string; of a record or an array the values in it, as far as they are known."""

TYPES: Mapping[str, tuple[tuple[str, str], ...]] = {
    "pos": (("x", "num"), ("y", "num"), ("z", "num")),
    "orient": (("q1", "num"), ("q2", "num"), ("q3", "num"), ("q4", "num")),
    "pose": (("trans", "pos"), ("rot", "orient")),
    "confdata": (("cf1", "num"), ("cf4", "num"), ("cf6", "num"), ("cfx", "num")),
    "extjoint": tuple((f"eax_{c}", "num") for c in "abcdef"),
    "robjoint": tuple((f"rax_{i}", "num") for i in range(1, 7)),
    "robtarget": (("trans", "pos"), ("rot", "orient"), ("robconf", "confdata"), ("extax", "extjoint")),
    "jointtarget": (("robax", "robjoint"), ("extax", "extjoint")),
    "loaddata": (("mass", "num"), ("cog", "pos"), ("aom", "orient"), ("ix", "num"), ("iy", "num"), ("iz", "num")),
    "tooldata": (("robhold", "bool"), ("tframe", "pose"), ("tload", "loaddata")),
    "wobjdata": (
        ("robhold", "bool"), ("ufprog", "bool"), ("ufmec", "string"), ("uframe", "pose"), ("oframe", "pose"),
    ),
    "speeddata": (("v_tcp", "num"), ("v_ori", "num"), ("v_leax", "num"), ("v_reax", "num")),
    "zonedata": (
        ("finep", "bool"), ("pzone_tcp", "num"), ("pzone_ori", "num"), ("pzone_eax", "num"), ("zone_ori", "num"),
        ("zone_leax", "num"), ("zone_reax", "num"),
    ),
}  # fmt: skip
"""Components of the records, each with its type, in order."""

IDENTITY: Value = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
ZERO_LOAD: Value = (0.001, (0.0, 0.0, 0.001), (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
_SPEEDS = (
    5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000, 1500, 2000, 2500, 3000, 4000, 5000,
    6000, 7000,
)  # fmt: skip
# size of the path zone, zones of the reorientation in mm and degrees
_ZONES = (
    (0.0, 0.3, 0.03), (1.0, 1.0, 0.1), (5.0, 8.0, 0.8), (10.0, 15.0, 1.5), (15.0, 23.0, 2.3), (20.0, 30.0, 3.0),
    (30.0, 45.0, 4.5), (40.0, 60.0, 6.0), (50.0, 75.0, 7.5), (60.0, 90.0, 9.0), (80.0, 120.0, 12.0), (100.0, 150.0, 15.0),
    (150.0, 225.0, 23.0), (200.0, 300.0, 30.0),
)  # fmt: skip


def _zone(fine: bool, size: float, wide: float, angle: float) -> Value:
    return (fine, size, wide, wide, angle, wide, angle)


DATA: Mapping[str, tuple[str, Value]] = {
    "tool0": ("tooldata", (True, IDENTITY, ZERO_LOAD)),
    "wobj0": ("wobjdata", (False, True, "", IDENTITY, IDENTITY)),
    **{f"v{v}": ("speeddata", (float(v), 500.0, 5000.0, 1000.0)) for v in _SPEEDS},
    **{f"z{size:g}": ("zonedata", _zone(False, size or 0.3, w, a)) for size, w, a in _ZONES},
    "fine": ("zonedata", _zone(True, 0.0, 0.0, 0.0)),
    "pi": ("num", 3.141592653589793),
}
"""Type and value of data that the system declares."""

_CHANGING = """
    tpreadfk tpreadnum tpreaddnum incr decr add clear bitset bitclear getsysdata packrawbytes socketreceive socketaccept
    getdataval readanybin readcfgdata rmqgetmsgdata unpackrawbytes waittestandset strtoval testandset
"""
CHANGING = frozenset(_CHANGING.split())
"""Instructions and functions that move nothing, but change what they are given, of any type."""

_MOTIONLESS = """
    accset worldacclim velset confj confl singarea cirpathmode softact softdeact gripload mechunitload set reset setdo
    setao setgo pulsedo invertdo setalldo waittime waitdi waitdo waitai waitao waitgi waitgo waituntil waitrob
    waitsynctask tpwrite tperase tpshow uimsgbox uishow uimsgwrite uimsgwriteabort errwrite errlog errraise stop break
    systemstopaction stopmove startmove stopmovereset clkstart clkstop clkreset isignaldi isignaldo isignalai isignalao
    isignalgi isignalgo ipers ivarvalue ierror itimer idelete ienable idisable isleep iwatch motionsup triggio
    triggequip triggint triggcheckio triggspeed triggrampao open close write writebin writestrbin writeanybin rewind
    clearrawbytes load unload startload cancelload eoffson eoffsoff eoffsset pdispon pdispset pdispoff tunereset
    tuneservo pathresol actunit deactunit spystart spystop connect socketcreate socketbind socketlisten socketconnect
    socketsend socketclose gettime settime setdataval
"""
MOTIONLESS = CHANGING.union(_MOTIONLESS.split())
"""Instructions that move nothing."""

RETURNING = frozenset(
    {"timeflag", "valueattimeout", "dvalueattimeout", "breakflag", "result", "errornumber", "accuracy"}
)
"""Optional arguments of the system's instructions and functions by which these return values."""

_OTHERS = """
    acteventbuffer aliascamera aliasio aliasioreset bookerrno checkprogref clearallintr cleariobuff clearpath closedir
    copyfile copyrawbytes cornerpathwarning corrclear corrcon corrdiscon corrwrite deacteventbuffer dropsensor dropwobj
    erasemodule fricidevaluate fricidinit fricidsetfriclevels getjointdata gettrapdata hollowwristreset indreset inputdo
    iobusstart iobusstate iodisable ioenable ireadcfgdata irmqmessage loadid makedir manloadidproc matrixsolve
    matrixsolveqr matrixsvd motionprocessmodeset opendir packdnheader pathacclim pathlengthreset pathlengthstart
    pathlengthstop pathrecstart pathrecstop proccall procerrrecovery raisetouser readblock readerrdata readrawbytes
    readvararr removeallcyclicbool removecyclicbool removedir removefile renamefile resetaxisdistance resetaxismovetime
    resetppmoved resetretrycount resettorquemargin rmqemptyqueue rmqfindslot rmqgetmessage rmqgetmsgheader rmqreadwait
    rmqsendmessage rmqsendwait safetycontrollersyncrequest save savecfgdata sendevice setalldataval setdatasearch
    setleadthrough setsysdata setupcyclicbool setupsuperv siclose siconnect sigetcyclic sisetcyclic skipwarn softelbow
    speedlimaxis speedlimcheckpoint speedrefresh startmoveretry supsyncsensoroff supsyncsensoron syncmoveoff syncmoveon
    syncmoveresume syncmovesuspend syncmoveundo synctosensor testsigndefine testsignreset texttabinstall triggdatacopy
    triggdatareset triggstopproc tryint waitload waitsensor waitwobj warmstart writeblock writecfgdata writerawbytes
    writevar writevararr wzboxdef wzcyldef wzdisable wzdoset wzenable wzfree wzhomejointdef wzlimjointdef wzlimsup
    wzsphdef exitcycle
"""
INSTRUCTIONS = MOTIONLESS | frozenset(_OTHERS.split())
"""Instructions of the system that are no motions; all others are motions, or routines of a program."""

LATE = ("%", "callbyvar")
"""What calls a procedure by a name that only the running program knows."""

BY_NAME = ("setdataval", "setalldataval")
"""Instructions that change data by their names."""

OFFSETTING = ("eoffson", "eoffsset")
"""Instructions that shift the external axes."""

SOFTENING, STIFFENING = "softact", "softdeact"
"""Instructions behind which servos give way, and behind which they do not any more."""

SHIFTING = ("pdispon", "pdispset")
"""Instructions that begin a program displacement: it shifts every pose behind them."""

TURNING = ("wrist", "lockaxis4")
"""Options of SingArea with which the wrist follows its own axes along lines and arcs, not the shortest turn."""

MOVING = (
    "move", "trigg", "search", "arc", "spot", "disp", "paint", "cap", "smove", "indamove", "indcmove", "inddmove",
    "indrmove", "egm", "fcpress", "restopath", "storepath", "pathrecmove", "mtool", "mpos", "stepbwdpath", "clearpath",
)  # fmt: skip
"""How the names of the system's and its options' motion instructions begin."""

SYSTEM_MOTION = re.compile(
    r"move(j|l|c|absj|extj)(do|ao|go|sync)?|trigg(j|l|c|absj)(ios)?|search(l|c|extj)|arc(moveabsj|move[jlc](do|ao|go)?)|"
    r"arc[lc][12]?(start|end)?[12]?|arc(moveextj|[a-z]*refl?)|spot(m?[lj])|disp[lc]|paint[lc]|cap(l|c|apcsyncset)|smove[jl](do|sync)?|"
    r"ind[acdr]move|egm\w+|fcpress(1l|l|c|end)|restopath|storepath|pathrecmove(bwd|fwd)|stepbwdpath|clearpath"
)
"""The names themselves: motions that leave tools and work objects that they are given as they are."""

_FUNCTIONS = """
    abs acos argname asin atan atan2 bitand bitor bitxor bitneg bitlsh bitrsh bitcheck byetostr calcjointt calcrobt clkread
    cjointt cpos crobt ctool cwobj cdate ctime cspeedoverride dim distance dotprod eulerzyx exp getnextsym gettime
    ginput goutput isstopmoveact max min numtostr numtodnum dnumtonum dnumtostr offs orientzyx poseinv posemult posevect
    pow present reltool round trunc sin cos tan sqrt strfind strlen strmap strmatch strmemb strpart strtoval strtobyte
    testdi doutput dinput aoutput ainput valtostr opmode runmode robos robname taskrunrob vectmagn isvar ispers defframe
    defdframe mirpos oriereq readnum readstr readbin testandset uimessagebox uinumentry uilistview
    uialphaentry uinumtune uidnumentry type nororient
"""
FUNCTIONS = frozenset(_FUNCTIONS.split())
"""Functions that move nothing."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ModuleFile:
    """A file with modules."""

    source: Source
    number: int
    """Of those of the program."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Symbol:
    """Data that a name can stand for."""

    name: str
    type: str
    """In lower case."""
    declaration: DataDeclaration | None = None
    """None for what is not declared as data in the files."""
    file: ModuleFile | None = None
    scope: "Scope | None" = None
    """Where its value is to be read."""
    value: Value | None = None
    """Of predefined data, and of tools and work objects that are given beside the files."""
    obstacle: str = ""
    """Why it has no value in the text."""
    parameter_of: str = ""
    """Key of the routine whose parameter it is."""

    @property
    def may_change(self) -> bool:
        """Whether a program can assign to it, parameters aside."""
        if self.declaration is not None:
            return self.declaration.storage != "const"
        return self.value is not None and self.name.lower() not in DATA


@dataclass(frozen=True, eq=False, kw_only=True)
class Scope:
    """Meaning of names at some place: own names first, then those of the module, then those of all modules."""

    module: Mapping[str, list[Symbol]]
    shared: Mapping[str, list[Symbol]]
    own: Mapping[str, list[Symbol]] = field(default_factory=dict[str, list[Symbol]])
    types: Mapping[str, tuple[tuple[str, str], ...]]
    routines: "Mapping[str, tuple[Procedure, ...]]"
    """All routines of the files."""

    def find(self, name: str) -> Symbol | None:
        """Symbol of a name; None where nothing of that name is known.

        Raises:
            Unresolved: it is declared several times.
        """
        key = name.lower()
        for names in (self.own, self.module, self.shared):
            declared = names.get(key)
            if declared:
                if len(declared) > 1:
                    raise Unresolved(f"'{name}' is declared {len(declared)} times")
                return declared[0]
        return _predefined(name, key)

    def known(self, name: str) -> Symbol | None:
        """Symbol of a name; None where nothing of that name is known, or it is declared several times."""
        try:
            return self.find(name)
        except Unresolved:
            return None

    def holds_no_target(self, type_: str) -> bool:
        """Whether data of a type are one of the system's, and neither are a target nor hold one."""
        own = TYPES.get(type_)
        return own is not None and self.types.get(type_) is own and type_ not in ("robtarget", "jointtarget")

    def with_counter(self, counter: Token) -> "tuple[Symbol, Scope]":
        """The counter of a FOR, which declares it, and the scope inside."""
        symbol = Symbol(name=counter.text, type="num", obstacle=f"'{counter.text}' counts a loop")
        return symbol, replace(self, own={**self.own, key_of(counter): [symbol]})


@lru_cache(maxsize=1024)
def _predefined(name: str, key: str) -> Symbol | None:
    if key not in DATA:
        return None
    type_, value = DATA[key]
    return Symbol(name=name, type=type_, value=value)


@dataclass(eq=False, kw_only=True)
class Procedure(Routine):
    """A routine with its text, or what stands in a module outside of routines."""

    file: ModuleFile
    scope: Scope
    declared: tuple[Symbol, ...] = ()
    """Data declared right here."""
    given: Sequence[RoutineParameter] = ()
    """What it is given, as it says itself."""
    kind: str = ""
    """``proc``, ``func`` or ``trap``; empty of a module."""
    local: bool = False
    start: int = 0
    end: int = 0
    named_at: int = 0
    """First character of its name."""

    @property
    def named(self) -> tuple[int, int]:
        """Place of its name."""
        return self.named_at, self.named_at + len(self.name)


def procedures(
    texts: Mapping[ModuleFile, Sequence[ModuleText]], given: Iterable[Symbol] = ()
) -> Sequence[tuple[Procedure, ModuleText | RoutineText]]:
    """Every module and every routine of the files, in the order of the text, with its names and its text.

    Args:
        texts: modules of the files.
        given: data beside the files, which count where no module shares data of that name.
    """
    shared: dict[str, list[Symbol]] = {}
    types = dict(TYPES)
    routines: dict[str, tuple[Procedure, ...]] = {}
    found: list[tuple[Procedure, ModuleText | RoutineText]] = []
    for file, modules in texts.items():
        for module in modules:
            own: dict[str, list[Symbol]] = {}
            scope = Scope(module=own, shared=shared, types=types, routines=routines)
            for symbol in _declared(module.declarations, file, scope):
                key = symbol.name.lower()
                own.setdefault(key, []).append(symbol)
                if symbol.declaration is not None and not symbol.declaration.local:
                    shared.setdefault(key, []).append(symbol)
            types.update(module.records)
            declared = tuple(symbol for symbols in own.values() for symbol in symbols)
            found.append((Procedure(name=module.name.text, file=file, scope=scope, declared=declared), module))
            found += [(_procedure(routine, file, scope), routine) for routine in module.routines]
    for symbol in given:
        if symbol.name.lower() not in DATA:
            shared.setdefault(symbol.name.lower(), [symbol])
    named: dict[str, list[Procedure]] = {}
    for procedure, _ in found:
        if procedure.kind:
            named.setdefault(procedure.name.lower(), []).append(procedure)
    routines.update({key: tuple(same) for key, same in named.items()})
    return found


def _procedure(text: RoutineText, file: ModuleFile, outer: Scope) -> Procedure:
    own: dict[str, list[Symbol]] = {}
    scope, name = replace(outer, own=own), text.name.text
    for one in text.parameters:
        why = f"'{one.name.text}' is a parameter of the routine '{name}'"
        own[key_of(one.name)] = [Symbol(name=one.name.text, type=one.type, obstacle=why, parameter_of=name.lower())]
    parameters = [(own[key_of(one.name)][0], one.changed) for one in text.parameters]
    declarations = (one for one in text.passed if isinstance(one, DataDeclaration))
    declared = tuple(_declared(declarations, file, scope))
    for symbol in declared:
        own.setdefault(symbol.name.lower(), []).append(symbol)
    return Procedure(
        file=file, scope=scope, declared=declared, given=text.parameters, kind=text.kind, local=text.local, start=text.start,
        end=text.end, named_at=text.name.start, name=name,
        parameters=tuple(symbol for symbol, _ in parameters),
        returning=frozenset(symbol for symbol, changed in parameters if changed),
        variables=declared, beside=text.kind == "trap", begins=name.lower() == "main",
    )  # fmt: skip


def _declared(declarations: Iterable[DataDeclaration], file: ModuleFile, scope: Scope) -> Iterator[Symbol]:
    for declaration in declarations:
        yield Symbol(
            name=declaration.name.text, type=key_of(declaration.type), declaration=declaration, file=file, scope=scope,
            obstacle="" if declaration.value_at else f"'{declaration.name.text}' is declared without a value",
        )  # fmt: skip
