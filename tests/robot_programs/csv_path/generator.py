"""Random paths in CSV, as programs and spreadsheets write them."""

import numpy as np

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
