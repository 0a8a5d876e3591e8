"""Random RAPID programs together with what they mean."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from robot_programs.core.source import Source

IDLE = ["SetDO doGun , 1 ;", "WaitTime 0.5 ;", "reg1 := reg1 + 1 ;", "ConfJ \\ On ;", 'TPWrite "a ! b ""c"";" ;', ";"]
NINE = "[ 9E9 , 9E9 , 9e+09 , 9E9 , 9E+09 , 9E9 ]"


@dataclass(frozen=True)
class Meant:
    """What a generated motion means."""

    kind: str
    T: np.ndarray | None
    """Of its end in the part's frame."""
    q: np.ndarray | None
    tool: np.ndarray
    part: np.ndarray
    stops: bool


@dataclass(frozen=True)
class Generated:
    """A program with its meaning, and the declarations that its motions share."""

    sources: tuple[Source, ...]
    motions: tuple[Meant, ...]


@dataclass
class _Maker:
    rng: np.random.Generator
    declarations: list[str] = field(default_factory=list)
    targets: list[tuple[str, np.ndarray]] = field(default_factory=list)
    axes: list[tuple[str, np.ndarray]] = field(default_factory=list)
    motions: list[Meant] = field(default_factory=list)

    def number(self, value: float) -> str:
        return f"{value:.{int(self.rng.integers(1, 5))}f}"

    def pose(self) -> tuple[str, np.ndarray]:
        """Text of position and orientation, and the transform."""
        xyz = [self.number(v) for v in self.rng.uniform(-1500, 1500, 3)]
        q = self.rng.normal(size=4)
        wxyz = [f"{v:.8f}" for v in q / np.linalg.norm(q)]
        w, *v = (float(t) for t in wxyz)
        T = np.eye(4)
        T[:3, :3] = Rotation.from_quat([*v, w]).as_matrix()
        T[:3, 3] = np.array([float(t) for t in xyz]) / 1e3
        return f"[ {' , '.join(xyz)} ] , [ {' , '.join(wxyz)} ]", T

    def target(self) -> tuple[str, np.ndarray]:
        text, T = self.pose()
        cf = " , ".join(str(v) for v in [*self.rng.integers(-2, 3, 3), self.rng.integers(0, 2)])
        return f"[ {text} , [ {cf} ] , {NINE} ]", T

    def joints(self) -> tuple[str, np.ndarray]:
        texts = [self.number(v) for v in self.rng.uniform(-100, 100, 6)]
        return f"[ [ {' , '.join(texts)} ] , {NINE} ]", np.radians([float(t) for t in texts])

    def declare(self) -> None:
        for k in range(int(self.rng.integers(2, 6))):
            text, T = self.target()
            storage = self.rng.choice(["CONST", "PERS", "LOCAL CONST", "TASK PERS", "LOCAL VAR"])
            self.declarations.append(f"{storage} robtarget p{k}0 := {text} ;")
            self.targets.append((f"p{k}0", T))
        size = int(self.rng.integers(1, 4))
        elements = [self.target() for _ in range(size)]
        self.declarations.append(f"CONST robtarget row {{ {size} }} := [ {' , '.join(t for t, _ in elements)} ] ;")
        self.targets += [(f"row {{ {i + 1} }}", T) for i, (_, T) in enumerate(elements)]
        text, q = self.joints()
        self.declarations.append(f"CONST jointtarget jHome := {text} ;")
        self.axes.append(("jHome", q))

    def destination(self) -> tuple[str, np.ndarray]:
        """A target argument."""
        text, T = self.targets[int(self.rng.integers(len(self.targets)))] if self.rng.random() < 0.8 else self.target()
        shape = self.rng.random()
        if shape < 0.15:
            shift = [self.number(v) for v in self.rng.uniform(-90, 90, 3)]
            T = T.copy()
            T[:3, 3] += np.array([float(v) for v in shift]) / 1e3
            return f"Offs ( {text} , {' , '.join(shift)} )", T
        if shape < 0.3:
            numbers = [self.number(v) for v in self.rng.uniform(-90, 90, 6)]
            values = np.array([float(v) for v in numbers])
            T = T.copy()
            T[:3, 3] += T[:3, :3] @ values[:3] / 1e3
            T[:3, :3] = T[:3, :3] @ Rotation.from_euler("XYZ", values[3:], degrees=True).as_matrix()
            turn = " ".join(f"\\ R{axis} := {v}" for axis, v in zip("xyz", numbers[3:], strict=True))
            return f"RelTool ( {text} , {' , '.join(numbers[:3])} {turn} )", T
        return text, T

    def motion(self, frames: dict) -> str:
        kind = str(self.rng.choice(["joint", "linear", "linear", "circular", "axes"]))
        tool, part = str(self.rng.choice(["tool0", "tA"])), str(self.rng.choice(["wobj0", "wA"]))
        zone = str(self.rng.choice(["fine", "z10", "z0", "z200"]))
        ending = f"{self.rng.choice(['v100', 'v1000', 'vmax', 'vOwn'])} , {zone} , {tool}"
        if part != "wobj0" or self.rng.random() < 0.5:
            ending += f" \\ WObj := {part}"
        conc = "\\ Conc , " if self.rng.random() < 0.1 else ""
        meant = {"tool": frames[tool], "part": frames[part], "stops": zone == "fine"}
        if kind == "axes":
            text, q = self.axes[0] if self.rng.random() < 0.5 else self.joints()
            self.motions.append(Meant(kind=kind, T=None, q=q, **meant))
            return f"MoveAbsJ {conc}{text} \\ NoEOffs , {ending} ;"
        via = f"{self.destination()[0]} , " if kind == "circular" else ""
        text, T = self.destination()
        self.motions.append(Meant(kind=kind, T=T, q=None, **meant))
        name = {"joint": "MoveJ", "linear": "MoveL", "circular": "MoveC"}[kind]
        match int(self.rng.integers(12)):
            case 0:
                name, ending = (
                    name.replace("Move", "Trigg"),
                    ending.replace(f" {zone} ,", f" gunOn \\ T2 := gunOff , {zone} ,", 1),
                )
            case 1:
                name, ending = f"{name}DO", f"{ending} , doGun , 1"
            case _:
                pass
        return f"{name} {conc}{via}{text} , {ending} ;"

    def handing_over(self, frames: dict) -> list[str]:
        """Routines that give targets to others, and loops that go through arrays: one text for several motions."""
        tool, part = str(self.rng.choice(["tool0", "tA"])), str(self.rng.choice(["wobj0", "wA"]))
        ends = f"v100 , fine , t \\ WObj := {part}"
        given = [self.targets[int(i)] for i in self.rng.permutation(len(self.targets))[: int(self.rng.integers(1, 4))]]
        calls = [f"far {text} , {tool} ;" for text, _ in given]
        shift = self.number(float(self.rng.uniform(-50, 50)))
        meant = {"q": None, "tool": frames[tool], "part": frames[part], "stops": True}
        for _, T in given:
            above = T.copy()
            above[2, 3] += float(shift) / 1e3
            self.motions.append(Meant(kind="joint", T=above, **meant))
        self.motions += [Meant(kind="linear", T=T, **meant) for _, T in given]
        row = [T for text, T in self.targets if text.startswith("row")]
        loop = [
            "FOR k FROM 1 TO Dim ( row , 1 ) DO",
            f"MoveL row {{ k }} , v100 , fine , {tool} \\ WObj := {part} ;",
            "ENDFOR",
        ]
        self.motions += [Meant(kind="linear", T=T, **meant) for T in row]
        inner = [f"MoveJ Offs ( p , 0 , 0 , z ) , {ends} ;", f"MoveL p , {ends} ;"]
        near = ["PROC near ( robtarget p , num z , PERS tooldata t )", *inner, "ENDPROC"]
        far = [
            "PROC far ( robtarget p , PERS tooldata t )",
            "VAR num z ;",
            f"z := {shift} ;",
            "near p , z , t ;",
            "ENDPROC",
        ]
        return [*near, *far, "PROC callers ( )", *calls, *loop, "ENDPROC"]

    def block(self, frames: dict, depth: int) -> list[str]:
        lines: list[str] = []
        for _ in range(int(self.rng.integers(1, 5))):
            choice = self.rng.random()
            if choice < 0.5 or depth == 0:
                lines.append(self.motion(frames))
            elif choice < 0.7:
                lines.append(str(self.rng.choice(IDLE)))
            else:
                lines += self.nested(frames, depth - 1)
        return lines

    def nested(self, frames: dict, depth: int) -> list[str]:
        shape = int(self.rng.integers(5))
        if shape == 4:
            return ["IF ( reg1 = 3 )", self.motion(frames), *self.block(frames, depth)]
        inner = self.block(frames, depth)
        match shape:
            case 0:
                return ["IF reg1 > 3 AND NOT bDone THEN", *inner, "ELSE", *self.block(frames, depth), "ENDIF"]
            case 1:
                return ["WHILE reg1 <> 3 DO", *inner, "ENDWHILE"]
            case 2:
                return ["FOR i FROM 1 TO 5 STEP 2 DO", *inner, "ENDFOR"]
            case _:
                return ["TEST reg1", "CASE 1 , 2 :", *inner, "DEFAULT :", *self.block(frames, depth), "ENDTEST"]


def generate(rng: np.random.Generator) -> Generated:
    """A random program of two files, with the frames in the second one."""
    maker = _Maker(rng)
    maker.declare()
    tool_text, tool = maker.pose()
    user_text, user = maker.pose()
    inner_text, inner = maker.pose()
    frames = {"tool0": np.eye(4), "wobj0": np.eye(4), "tA": tool, "wA": user @ inner}
    body: list[str] = []
    for k in range(int(rng.integers(1, 4))):
        local = "LOCAL " if rng.random() < 0.3 else ""
        parameters = "( num n , \\ switch on | \\ switch off )" if rng.random() < 0.3 else "( )"
        body += [f"{local}PROC r{k} {parameters}", *maker.block(frames, 2), "ENDPROC"]
    if rng.random() < 0.5:
        body += maker.handing_over(frames)
    main = [f"MODULE Part{rng.choice(['', ' ( SYSMODULE , NOVIEW )'])}", *maker.declarations, *body, "ENDMODULE"]
    load = "[ 2.5 , [ 0 , 0 , 90 ] , [ 1 , 0 , 0 , 0 ] , 0 , 0 , 0 ]"
    data = [
        "MODULE Frames",
        f"PERS tooldata tA := [ TRUE , [ {tool_text} ] , {load} ] ;",
        f'PERS wobjdata wA := [ FALSE , TRUE , "" , [ {user_text} ] , [ {inner_text} ] ] ;',
        "CONST speeddata vOwn := [ 37.5 , 500 , 5000 , 1000 ] ;",
        "ENDMODULE",
    ]
    newline = str(rng.choice(["\n", "\r\n"]))
    header = f"%%%{newline}  VERSION:1{newline}  LANGUAGE:ENGLISH{newline}%%%{newline}" if rng.random() < 0.5 else ""
    encoding = str(rng.choice(["utf-8", "latin-1", "utf-8-sig"]))
    sources = tuple(
        Source.of(Path(name), (header + laid_out(rng, lines, newline)).encode(encoding))
        for name, lines in (("part.mod", main), ("frames.sys", data))
    )
    return Generated(sources=sources, motions=tuple(maker.motions))


def laid_out(rng: np.random.Generator, lines: list[str], newline: str) -> str:
    """Words with random white space, comments and letter case between and in them."""
    parts: list[str] = []
    before = ""
    for word in (word for line in lines for word in [*_words(line), "\n"]):
        if word == "\n":
            parts.append(newline + " " * int(rng.integers(0, 5)))
            before = " "
            continue
        needed = bool(before) and _joins(before[-1]) and _joins(word[0])
        parts.append(_space(rng, newline, needed))
        parts.append(_case(rng, word))
        before = word
    return "".join(parts) + newline


def _words(line: str) -> list[str]:
    if '"' not in line:
        return line.split(" ")
    head, _, rest = line.partition(' "')
    string, _, tail = rest.rpartition('" ')
    return [*head.split(" "), f'"{string}"', *tail.split(" ")]


def _joins(character: str) -> bool:
    return character.isalnum() or character in '_."<>=:%'


def _space(rng: np.random.Generator, newline: str, needed: bool) -> str:
    choice = rng.random()
    if choice < 0.04:
        return f"  ! {rng.choice(['é à', 'MoveL p1;', '[1,2', '%%% 9E9'])}{newline}\t"
    if choice < 0.08:
        return f"{newline}   "
    if choice < 0.3:
        return str(rng.choice([" ", "\t", "  "]))
    return " " if needed else ""


def _case(rng: np.random.Generator, word: str) -> str:
    if not word.isidentifier() or rng.random() < 0.7:
        return word
    return str(rng.choice([word.lower(), word.upper(), word.capitalize()]))
