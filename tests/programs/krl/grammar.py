"""Random KRL programs: declarations, frames and motions in any spelling that KRL allows."""

from dataclasses import dataclass
from pathlib import Path

from hypothesis import strategies as st

from taskcal.programs.source import Source

_WORDS = ["", " ", "  ", "\t"]
_COMMENTS = ["", "", " ; to the part", ";FOLD x;%{PE}", " ; \u00fcber den Tisch \u2013 lang", '; "{X 1" C_DIS']


@dataclass(frozen=True)
class Written:
    """A random program's files."""

    sources: tuple[Source, ...]
    resolvable: int
    """Motions whose target, tool and frame the text tells."""


@st.composite
def _cased(draw: st.DrawFn, word: str) -> str:
    return draw(st.sampled_from([word, word.lower(), word.capitalize()]))


def _number(low: float, high: float) -> st.SearchStrategy[str]:
    places = st.integers(0, 6)
    value = st.floats(low, high, allow_nan=False)
    return st.builds(lambda v, n: f"{v:.{n}f}" if n else f"{round(v)}", value, places)


@st.composite
def pose_text(draw: st.DrawFn, *, kind: str = "", status: bool = True) -> str:
    """A complete position in braces."""
    fields = [f"{n} {draw(_number(-900, 900))}" for n in "XYZ"]
    fields += [f"{n} {draw(_number(-180, 180))}" for n in "ABC"]
    if status:
        fields += [f"S {draw(st.integers(0, 7))}", f"T {draw(st.integers(0, 63))}"]
    if draw(st.booleans()):
        fields += [f"E{i} 0.0" for i in range(1, 7)]
    if draw(st.booleans()):
        fields = draw(st.permutations(fields))
    gap = draw(st.sampled_from([",", ", ", " ,"]))
    prefix = f"{kind}: " if kind and draw(st.booleans()) else ""
    return f"{{{prefix}{gap.join(fields)}}}"


@st.composite
def axes_text(draw: st.DrawFn) -> str:
    """A complete axis position in braces."""
    return "{" + ",".join(f"A{i} {draw(_number(-120, 30))}" for i in range(1, 7)) + "}"


@st.composite
def motion_text(draw: st.DrawFn, points: list[str]) -> str:
    """A motion instruction that can be resolved."""
    word = draw(st.sampled_from(["PTP", "LIN", "CIRC", "SPTP", "SLIN", "SCIRC"]))
    joint = word.endswith("PTP")
    inline = pose_text(kind="E6POS", status=joint)
    operand = st.one_of(inline, st.sampled_from(points)) if points else inline
    if points:
        operand = st.one_of(operand, st.sampled_from(points).map(lambda p: p + ":{X 1,Y 0,Z -2.5,A 0,B 0,C 3}"))
    if joint:
        operand = st.one_of(operand, axes_text())
    target = draw(operand)
    if word.endswith("CIRC"):
        target = f"{draw(operand)}{draw(st.sampled_from([',', ', ']))}{target}"
    passing = draw(st.sampled_from(["", "", " C_PTP" if joint else " C_DIS"]))
    return f"{draw(_cased(word))} {target}{passing}"


_PASSIVE = st.sampled_from(
    ["WAIT SEC 0.5", "$OUT[3]=TRUE", "BAS(#VEL_PTP,50)", "", "; nothing", "HALT", "I=I+1", "$ADVANCE=3", "DECL INT I2"]
)


@st.composite
def programs(draw: st.DrawFn) -> Written:
    """Programs of a ``.src`` and its ``.dat``, with frames set before the first motion."""
    count = draw(st.integers(0, 4))
    points = [f"XP{i + 1}" for i in range(count)]
    space = draw(st.sampled_from(_WORDS[1:]))
    dat = ["&ACCESS RVP", "DEFDAT  PART PUBLIC", "EXT  BAS (BAS_COMMAND  :IN,REAL  :IN )"]
    dat += [f"DECL{space}E6POS {p}={draw(pose_text())}{draw(st.sampled_from(_COMMENTS))}" for p in points]
    dat += ["ENDDAT"]
    tool, base = draw(pose_text(status=False)), draw(pose_text(status=False))
    src = [
        "&ACCESS RVP",
        "&REL 3",
        "DEF PART( )",
        "BAS (#INITMOV,0 )",
        f"$TOOL={tool}",
        f"$BASE = {base}",
        "$VEL.CP=0.1",
    ]
    resolvable = 0
    for _ in range(draw(st.integers(1, 8))):
        indent = draw(st.sampled_from(_WORDS))
        if draw(st.booleans()):
            line, resolvable = draw(motion_text(points)), resolvable + 1
        else:
            line = draw(_PASSIVE)
        src.append(indent + line + draw(st.sampled_from(_COMMENTS)))
    src.append("END")
    newline = draw(st.sampled_from(["\r\n", "\n"]))
    ends = newline if draw(st.booleans()) else ""
    encoding = draw(st.sampled_from(["utf-8", "cp1252"]))
    sources = [
        Source.of(Path(name), (newline.join(lines) + ends).encode(encoding))
        for name, lines in (("part.src", src), ("PART.DAT", dat))
    ]
    return Written(sources=tuple(sources), resolvable=resolvable)


@st.composite
def damaged(draw: st.DrawFn, data: bytes) -> bytes:
    """Bytes with a few of them changed, inserted or left out."""
    out = bytearray(data)
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, max(len(out) - 1, 0)))
        match draw(st.sampled_from("cidx")):
            case "c" if out:
                out[at] = draw(st.sampled_from(list(b"{}[]():,;#\"'=&.-+0 XE\r\n\xff")))
            case "i":
                out[at:at] = draw(
                    st.sampled_from([b"{", b"}", b"\n", b"PTP ", b"LOOP\n", b",", b"1e999", b"\xc3", b"IF "])
                )
            case "d":
                del out[at : at + draw(st.integers(1, 20))]
            case _:
                out[at:at] = out[at : at + draw(st.integers(1, 60))]
    return bytes(out)
