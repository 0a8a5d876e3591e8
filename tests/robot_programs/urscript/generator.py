"""Random URScript programs, in the spellings of PolyScope, of post-processors and of people."""

from pathlib import Path

import numpy as np

from robot_programs.core.source import Source

PASSIVE = (
    "# note; movel(p[1, 2, 3, 0, 0, 0])", '$ 3 "Waypoint_1" "breakAfter"', "sleep(0.5)", "sync()", "set_digital_out(1, True)", "",
    'textmsg("at ", n)', "n = n + 1", "global m = [1, 2.5, True]", "rq_close()", "set_payload(0.5, [0, 0, 0.1])", "run beside()",
    "local s = get_actual_tcp_pose()", "stopl(2.0)", "popup('#', blocking=False)",
)  # fmt: skip
TROUBLE = (
    "movel(get_actual_tcp_pose(), v=0.1)", "servoj([0, 0, 0, 0, 0, 0], t=0.1)", "movel(nowhere)", "set_tcp(other)", "n = n / 2",
    "movel(p[0.1, 0.2], v=1)", "movec(here, here, mode=1)", "halt", "x = = 2", "force_mode(p[0,0,0,0,0,0], [1], [2], 2, [3])",
)  # fmt: skip


def generate(rng: np.random.Generator, trouble: bool = True) -> tuple[Source, ...]:
    """A program."""
    one = lambda choices: choices[int(rng.integers(len(choices)))]  # noqa: E731
    digits = int(rng.integers(4, 13))

    def number(value: float) -> str:
        text = f"{value:.{digits}f}"
        return one([text, text.replace("0.", ".", 1) if text.lstrip("-").startswith("0.") else text])

    def pose() -> str:
        return f"p[{', '.join(map(number, (*rng.uniform(-0.5, 0.5, 3), *rng.uniform(-2, 2, 3))))}]"

    def joints() -> str:
        values = [one([number(angle), f"d2r({np.degrees(angle):.2f})"]) for angle in rng.uniform(-2, 2, 6)]
        return f"[{one([',', ', ']).join(values)}]"

    def motion() -> str:
        target = one(
            [
                pose(),
                "here",
                "there",
                f"pose_trans(plane, {pose()})",
                "pose_add(here, p[0, 0, 0.1, 0, 0, 0])",
                "list[1]",
            ]
        )
        rest = one(
            ["", ", a=1.2, v=0.25", ", 1.2, 0.25, 0, 0.01", f", r={number(rng.uniform(0, 0.1))}", ", v=0.1, r=blend"]
        )
        match int(rng.integers(6)):
            case 0:
                return f"movej({one([joints(), 'home'])}, a=1.4, v=1.05)"
            case 1:
                return f"movej(get_inverse_kin({target}, qnear={one([joints(), 'home'])}){rest})"
            case 2:
                return f"movec({pose()}, {target}, a=1.2, v=0.25, r=0.01)"
            case 3:
                return f"goto({one(['here', 'there', pose()])})"
            case _:
                return f"{one(['movel', 'movel', 'movej'])}({target}{rest})"

    lines: list[str] = []
    for _ in range(int(rng.integers(1, 12))):
        lines.append(motion() if rng.random() < 0.6 else one(PASSIVE if not trouble or rng.random() < 0.6 else TROUBLE))
    for _ in range(int(rng.integers(3))):
        first, last = sorted(rng.integers(0, len(lines) + 1, 2))
        head = one(["while n < 3:\nn = n + 1", "while (True):", "if (read_port_bit(1)):", "if n == 0:"])
        tail = "elif n > 5:\nhalt\nelse:\nn = 7\nend" if head.startswith("if") and rng.random() < 0.5 else "end"
        lines[first:last] = ["\n".join([head, *lines[first:last], tail])]
    begin = [
        "set_tcp(p[0, 0, 0.1, 0, 0, 0])", f"here = {pose()}", f"global there={pose()}", f"plane = {pose()}", "blend = 0.005",
        f"home = {joints()}", "n = 0", f"list = [{pose()}, {pose()}]", "thread beside():\nm = 2\nend",
        "def goto(target, v=0.1):\nmovel(target, v=v)\nend",
    ]  # fmt: skip
    indent = one(["  ", "\t", ""])
    text = "\n".join(["def prog():", *(f"{indent}{line}" for line in [*begin, *lines]), "end", one(["", "prog()"]), ""])
    newline = str(one(["\n", "\r\n"]))
    data = text.replace("\n", newline).encode(one(["utf-8", "latin-1"]))
    return (Source.of(Path("prog.script"), data),)
