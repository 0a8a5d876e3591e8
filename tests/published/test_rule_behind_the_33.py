"""Which computation leaves the published 33: a hypothesis about the authors' program, tested.

The rule: a column of the stacked sensitivities that has no length, or repeats an earlier one up to its sign and scale,
is dropped. Of the four chains only that with the misprint and without an exact parallelogram gives the published twelve.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.published.printed_chain import PrintedChain
from tests.published.test_irb6660 import LEFT_OUT, model, one, several

__all__ = ["model", "one", "several"]

ELIMINATION = Path(__file__).parents[2] / "docs/theory/elimination.md"
PARALLELOGRAM = (0.5, 0.7, 0.5)
SAME = 1e-6
"""Distance of unit columns that counts as none; central differences leave 10⁻⁹."""


def dropped(S, symbols):
    """What has no effect or repeats an earlier column."""
    length = np.linalg.norm(S, axis=0)
    nil = length < SAME * length.max()
    unit = S / np.where(nil, 1.0, length)
    alike = np.abs(np.abs(unit.T @ unit) - 1.0) < SAME**2 / 2.0
    out = set()
    for k, symbol in enumerate(symbols):
        distance = [min(np.linalg.norm(unit[:, k] - s * unit[:, j]) for s in (1, -1)) for j in range(k) if alike[j, k]]
        if nil[k] or any(d < SAME for d in distance):
            out.add(symbol)
    return out


@pytest.fixture(scope="module")
def symbols(model):
    return [p.symbol for p in model.parameters]


@pytest.mark.parametrize("poses", ["one", "several"])
def test_without_the_misprint_the_printed_chain_is_the_product_s(model, poses, request):
    q = request.getfixturevalue(poses)
    chain = PrintedChain(misprint=False, loop=PARALLELOGRAM)
    np.testing.assert_allclose(chain.poses(q, np.zeros(45)), model.poses(q), atol=1e-12)
    expected = model.jacobian(q, angular=False).reshape(-1, 45)
    np.testing.assert_allclose(chain.sensitivity(q), expected, atol=1e-8)


def test_the_printed_matrix_is_no_rotation(one):
    T = PrintedChain(misprint=True, loop=PARALLELOGRAM).poses(one, np.zeros(45))
    np.testing.assert_allclose(np.linalg.det(T[:, :3, :3]), -np.cos(2.0 * one[:, 4]), atol=1e-12)


@pytest.mark.parametrize("poses", ["one", "several"])
@pytest.mark.parametrize("loop", [(0.5, 0.7001, 0.5), (0.5, 0.7, 0.501), (0.49, 0.72, 0.5)])
def test_printed_chain_drops_the_published_twelve(symbols, loop, poses, request):
    """As printed and without an exact parallelogram the published twelve are dropped."""
    q = request.getfixturevalue(poses)
    assert dropped(PrintedChain(misprint=True, loop=loop).sensitivity(q), symbols) == set(LEFT_OUT)


@pytest.mark.parametrize("poses", ["one", "several"])
@pytest.mark.parametrize(
    ("misprint", "loop", "more"),
    [
        (False, PARALLELOGRAM, {"alf5", "L3"}),
        (True, PARALLELOGRAM, {"L3"}),
        (False, (0.5, 0.7001, 0.5), {"alf5"}),
    ],
)
def test_every_other_chain_drops_more(symbols, misprint, loop, more, poses, request):
    S = PrintedChain(misprint=misprint, loop=loop).sensitivity(request.getfixturevalue(poses))
    assert dropped(S, symbols) == set(LEFT_OUT) | more


def test_the_theory_page_has_these_counts(symbols, one):
    page = ELIMINATION.read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| (as printed|a rotation) \| (exact|not exact) \| (\d+) \| (\d+) \|", page, flags=re.MULTILINE
    )
    assert len(rows) == 4
    for matrix, parallelogram, repeats, kept in rows:
        loop = PARALLELOGRAM if parallelogram == "exact" else (0.5, 0.7001, 0.5)
        out = dropped(PrintedChain(misprint=matrix == "as printed", loop=loop).sensitivity(one), symbols)
        assert (int(repeats), int(kept)) == (len(out) - 3, 45 - len(out))
