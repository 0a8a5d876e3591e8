"""Mistakes of a computation that Cosmic Ray does not make: a transpose, an inverse or a size forgotten, factors exchanged."""

from collections.abc import Iterable

from cosmic_ray.operators.operator import Example, Operator
from parso.python.tree import Leaf, Node

FORGOTTEN = frozenset({"abs", "argsort", "degrees", "inv", "inverse", "radians", "sqrt"})
"""Functions of one argument whose result may be taken for another of the same shape."""
OTHER = {"max": "min", "maximum": "minimum", "argmax": "argmin", "all": "any", "sin": "cos", "nanmax": "nanmin"}
OTHER |= {other: name for name, other in OTHER.items()}


class DropTranspose(Operator):
    """`A.T` becomes `A`."""

    def mutation_positions(self, node: Node) -> Iterable[tuple[object, object]]:
        if node.type == "trailer" and node.get_code(include_prefix=False) == ".T":
            yield node.start_pos, node.end_pos

    def mutate(self, node: Node, index: int) -> Node:
        return _blank(node)

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (Example("A.T @ b", "A @ b"),)


class DropCall(Operator):
    """`np.abs(x)` becomes `(x)`."""

    def mutation_positions(self, node: Node) -> Iterable[tuple[object, object]]:
        if _called(node):
            yield node.start_pos, node.end_pos

    def mutate(self, node: Node, index: int) -> Node:
        for part in _called(node):
            _blank(part)
        return node

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (Example("np.abs(x).max()", "(x).max()"), Example("se3.inverse(T) @ p", "(T) @ p"))


class OtherFunction(Operator):
    """`max(x)` becomes `min(x)`."""

    def mutation_positions(self, node: Node) -> Iterable[tuple[object, object]]:
        if node.type == "name" and node.value in OTHER and _is_call(node):
            yield node.start_pos, node.end_pos

    def mutate(self, node: Leaf, index: int) -> Leaf:
        node.value = OTHER[node.value]
        return node

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (Example("a.max(axis=1)", "a.min(axis=1)"), Example("max(a, b)", "min(a, b)"))


class ExchangeFactors(Operator):
    """`A @ B` becomes `B @ A`."""

    def mutation_positions(self, node: Node) -> Iterable[tuple[object, object]]:
        if node.type == "term" and node.children[1].value == "@":
            yield node.start_pos, node.end_pos

    def mutate(self, node: Node, index: int) -> Node:
        first, _, second = node.children[:3]
        before, after = first.get_first_leaf(), second.get_first_leaf()
        before.prefix, after.prefix = after.prefix, before.prefix
        node.children[0], node.children[2] = second, first
        return node

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (Example("A @ B", "B @ A"),)


OWN = {f"own/{operator.__name__}": operator for operator in (DropTranspose, DropCall, OtherFunction, ExchangeFactors)}


def _called(node: Node) -> list[Node]:
    """Parts of a name that is called with one argument, where it is one that may be forgotten."""
    if node.type not in ("atom_expr", "power"):
        return []
    for k, part in enumerate(node.children):
        if part.type == "trailer" and part.children[0].value == "(":
            alone = len(part.children) == 3 and part.children[1].type not in ("arglist", "argument")
            *above, name = "".join(one.get_code(include_prefix=False) for one in node.children[:k]).split(".")
            plain = all(one.isidentifier() for one in above)
            return node.children[:k] if alone and plain and name in FORGOTTEN else []
    return []


def _is_call(name: Leaf) -> bool:
    behind = name.get_next_leaf()
    before = name.get_previous_leaf()
    return behind is not None and behind.value == "(" and (before is None or before.value not in ("def", "class"))


def _blank(node: Node) -> Node:
    leaf, last = node.get_first_leaf(), node.get_last_leaf()
    while True:
        leaf.value = ""
        if leaf is last:
            return node
        leaf = leaf.get_next_leaf()
