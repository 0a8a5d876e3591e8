"""Small mistakes that could have been made in a module: one sign, number, comparison, condition or loop other than it is.

The changes are Cosmic Ray's, and those of `operators`. Of those that differ only in how absurd they are (a product turned into a
shift of bits), one is taken: all of them fail at the first run, and would raise the share of mistakes that are noticed without
saying anything.
"""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cosmic_ray.operators.operator import Operator

_BINARY = ["Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "FloorDiv_Mul", "Mod_Mul", "Pow_Mul"]
_OF_SETS_AND_BITS = ["BitOr_BitAnd", "BitAnd_BitOr", "LShift_RShift"]
_COMPARISONS = ["Eq_NotEq", "NotEq_Eq", "Is_IsNot", "IsNot_Is"]
_ORDERS = ["Lt_LtE", "LtE_Lt", "Gt_GtE", "GtE_Gt", "Lt_GtE", "LtE_Gt", "Gt_LtE", "GtE_Lt"]
OPERATORS = [
    *(f"core/ReplaceBinaryOperator_{name}" for name in (*_BINARY, *_OF_SETS_AND_BITS)),
    *(f"core/ReplaceComparisonOperator_{name}" for name in (*_COMPARISONS, *_ORDERS)),
    *(f"core/ReplaceUnaryOperator_Delete_{name}" for name in ("USub", "Not", "Invert")),
    *(f"core/Replace{name}" for name in ("TrueWithFalse", "FalseWithTrue", "AndWithOr", "OrWithAnd")),
    *(f"core/{name}" for name in ("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ZeroIterationForLoop")),
    *(f"core/{name}" for name in ("AddNot", "NumberReplacer")),
    *(f"own/{name}" for name in ("DropTranspose", "DropCall", "OtherFunction", "ExchangeFactors")),
]


@dataclass(frozen=True)
class Mutation:
    """One change of one module; `occurrence` counts the places where the operator could act."""

    path: Path
    operator: str
    occurrence: int
    line: int

    def mutated(self, root: Path) -> str:
        """Text of the module with the change."""
        from cosmic_ray.mutating import mutate_code

        text = mutate_code((root / self.path).read_text(encoding="utf-8"), _operator(self.operator), self.occurrence)
        if text is None:
            raise LookupError(f"{self.path} has no occurrence {self.occurrence} of {self.operator}")
        return text


def mutations(root: Path, path: Path) -> Iterator[Mutation]:
    """All changes of a module that a run could notice; not those of annotations and decorators.

    Args:
        root: folder of the repository.
        path: the module, from there.
    """
    from cosmic_ray.ast import ast_nodes, get_ast

    text = (root / path).read_text(encoding="utf-8")
    silent = list(silent_ranges(text))
    nodes = list(ast_nodes(get_ast(text)))
    for operator in OPERATORS:
        positions = [(*start, *end) for node in nodes for start, end in _operator(operator).mutation_positions(node)]
        for occurrence, (line, column, *_) in enumerate(positions):
            if not any(begin <= (line, column) < end for begin, end in silent):
                yield Mutation(path, operator, occurrence, line)


def _operator(name: str) -> "Operator":
    from cosmic_ray.plugins import get_operator

    from tests.mutants.operators import OWN

    return OWN[name]() if name in OWN else get_operator(name)()


def is_python(text: str) -> bool:
    """Whether a module can be read: one that cannot, as where a dictionary's `**` became `*`, is noticed by any run."""
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True


def silent_ranges(text: str) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Beginning and end, line and column, of what a run does not notice.

    Annotations, decorators, imports, the star before arguments that have to be named, and whether `zip` is strict, which is a
    check of its own; and whether types are being checked.
    """
    for line, content in enumerate(text.splitlines(), 1):
        for star in re.finditer(r"\*(?=,)", content):
            yield (line, star.start()), (line, star.end())
    for node in ast.walk(ast.parse(text)):
        parts = [
            node if isinstance(node, ast.Name) and node.id == "TYPE_CHECKING" else None,
            *getattr(node, "decorator_list", []),
            getattr(node, "annotation", None),
            getattr(node, "returns", None),
            *(keyword.value for keyword in getattr(node, "keywords", []) if keyword.arg == "strict"),
        ]
        for part in [node] if isinstance(node, ast.ImportFrom) else parts:
            if part is not None:
                yield (part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)
