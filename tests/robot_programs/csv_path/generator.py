"""Random paths in CSV, as programs and spreadsheets write them."""

import numpy as np

from robot_programs.core.program import Motion, Program, Target, Waypoint
from taskcal.geometry import se3

_HEADERS = (
    ["x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"],
    ["x_mm", "y_mm", "z_mm", "i", "j", "k"],
    [f"J{i}_deg" for i in range(1, 7)],
)


def generate(rng: np.random.Generator) -> bytes:
    """A path of poses, of tool axes or of joint positions."""
    delimiter = str(rng.choice([",", ";", "\t"]))
    header = list(_HEADERS[rng.integers(3)])
    n, digits = int(rng.integers(1, 6)), int(rng.integers(9))
    if header[0] == "J1_deg":
        values = rng.uniform(-180, 180, (n, 6))
    else:
        direction = rng.normal(size=(n, len(header) - 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        values = np.concatenate([rng.uniform(-2000, 2000, (n, 3)), direction], axis=1)
    rows = [[f"{v:.{digits if c < 3 else max(digits, 4)}f}" for c, v in enumerate(row)] for row in values]
    if rng.random() < 0.5:
        header, rows = ["name", *header], [[f"p{i} é", *row] for i, row in enumerate(rows)]
    order = rng.permutation(len(header))
    space, quote = str(rng.choice(["", " "])), str(rng.choice(["", '"']))
    lines = [delimiter.join(quote + space + row[i] + space + quote for i in order) for row in [header, *rows]]
    for _ in range(int(rng.integers(3))):
        lines.insert(int(rng.integers(len(lines) + 1)), str(rng.choice(["", "# note, with 1;2 numbers"])))
    newline = str(rng.choice(["\n", "\r\n"]))
    text = newline.join(lines) + str(rng.choice(["", newline]))
    return text.encode(str(rng.choice(["utf-8", "utf-8-sig", "latin-1"])))


def nearby_waypoints(rng: np.random.Generator, program: Program, most: int) -> dict[int, tuple[Waypoint, ...]]:
    """New waypoints near the ends of some motions."""
    return {
        number: tuple(_waypoint(rng, move) for _ in range(int(rng.integers(1, most + 1))))
        for number, move in enumerate(program.motions)
        if rng.random() < 0.5
    }


def _waypoint(rng: np.random.Generator, move: Motion) -> Waypoint:
    via = None if move.via is None else _near(rng, move, move.via)
    near = _near(rng, move, move.end)
    return Waypoint(kind=near.kind, q=near.q, T=near.T, via=via)


def _near(rng: np.random.Generator, move: Motion, target: Target) -> Waypoint:
    if target.T is None:
        assert target.q is not None
        return Waypoint(kind="axes", q=target.q + rng.uniform(1e-3, 0.1, len(target.q)), T=None)
    shift = se3.pose(se3.exp(rng.uniform(1e-3, 0.1, 3)), rng.uniform(1e-5, 0.01, 3))
    return Waypoint(kind=move.kind, q=np.zeros(6), T=target.T @ shift)
