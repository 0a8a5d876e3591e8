"""Text that stands for several motions is written out, and does what it did."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.source import Source
from robot_programs.urscript.read import read_urscript

HEAD = "def p():\n  set_tcp(p[0, 0, 0.1, 0, 0, 0])\n  corner = p[0.4, 0.1, 0.2, 0, 3.14, 0]\n"
GRID = """  i = 0
  while i < 2:  # rows
    j = 0
    while j < 3:
      spot = pose_trans(corner, p[i * 0.05, j * 0.04, 0, 0, 0, 0])
      movel(pose_trans(spot, p[0, 0, -0.1, 0, 0, 0]))
      movel(spot, r=0.01)
      j = j + 1
    end
    i = i + 1
  end
  movel(corner)
"""
PICK = """  def above(spot):
    return pose_trans(spot, p[0, 0, -0.1, 0, 0, 0])
  end
  def pick(spot):
    movel(above(spot))
    movel(spot)
  end
  pick(corner)
  pick(pose_add(corner, p[0.1, 0, 0, 0, 0, 0]))
  n = 0
  while n < 2:
    pick(pose_add(corner, p[0, 0.1 + 0.05 * n, 0, 0, 0, 0]))
    n = n + 1
  end
"""
LEAVES = (
    "  i = 0\n  while i < 3:\n    movel(pose_trans(corner, p[i * 0.05, 0, 0, 0, 0, 0]))\n    i = i + 1\n    {}\n  end\n"
)


def read(text):
    return read_urscript([Source.of(Path("p.script"), f"{HEAD}{text}end\n".encode())])


def poses(program):
    """Where motions go in the order in which they are made."""
    after = {move.follows: move for move in program.motions}
    out, at = [], None
    while at in after:
        out.append(after[at].part.T @ after[at].end.T)
        at = program.motions.index(after[at])
    return np.array(out)


@pytest.mark.parametrize(("text", "count"), [(GRID, 13), (PICK, 8)])
def test_written_out_program_goes_where_it_went(text, count):
    program = read(text)
    wanted, lines = poses(program), {move.place.line for move in program.motions}
    assert len(wanted) == count
    for _ in range(4):
        shared = [i for i, move in enumerate(program.motions) if move.texts_motions > 1]
        sources = program.written_out(shared) if shared else None
        if sources is None:
            break
        program = program.reread(sources)
    assert not shared
    np.testing.assert_allclose(poses(program), wanted, atol=1e-12)
    assert {move.place.line for move in program.motions} == lines


@pytest.mark.parametrize("line", ["if get_digital_in(1):\n      break\n    end", "thread t():\n      sync()\n    end"])
def test_loop_that_is_left_or_declares_stays(line):
    program = read(LEAVES.format(line))
    assert program.written_out(range(len(program.motions))) is None
