"""What UFL and FFCx look for in a form most often, found once: its terminals, the hash and the place of each node.

A form is made of others some dozens of times before it is compiled, and for each of them UFL visits every node of every
integrand to find the constants in it. Its signature visits what several integrands share once for each of them. On the
way to the compiled forms of a spatial beam that is a third of the time. FFCx compares an operand with every node of a
form to find its place. What is found here is the same.
"""

from __future__ import annotations

import hashlib
import weakref
from functools import partial
from typing import Any

import ufl
from ffcx.ir.analysis.valuenumbering import ValueNumberer
from ufl.algorithms import analysis, signature
from ufl.argument import BaseArgument
from ufl.coefficient import BaseCoefficient
from ufl.core.base_form_operator import BaseFormOperator
from ufl.core.expr import Expr
from ufl.core.terminal import Terminal
from ufl.integral import Integral
from ufl.utils.counted import Counted

_extract_type: Any = analysis.extract_type
#: Identity of an expression that is in use ↦ (reference to it, its terminals).
_known: dict[int, tuple[Any, list[Any] | None]] = {}


def extract_type(a: Any, ufl_types: Any) -> set[Any]:
    """Return the objects of some classes in a form, an integral or an expression, as UFL's function of this name."""
    types = tuple(ufl_types) if isinstance(ufl_types, list | tuple) else (ufl_types,)
    leaves = (Terminal, BaseArgument, BaseCoefficient, Counted)  # without operands, operators on forms apart
    if all(issubclass(t, leaves) for t in types) and isinstance(a, ufl.Form | Integral | Expr):
        parts = a.integrals() if isinstance(a, ufl.Form) else [a]
        found = [terminals(part.integrand() if isinstance(part, Integral) else part) for part in parts]
        if None not in found:
            return {o for each in found for o in each or () if isinstance(o, types)}
    return set(_extract_type(a, ufl_types))


def terminals(root: Any) -> list[Any] | None:
    """Return the terminals of an expression; None where it has an operator on forms, whose slots have some as well."""
    if (known := _known.get(key := id(root))) is not None:
        return known[1]
    seen, left, leaves, classes = set[int](), [root], list[Any](), set[type]()
    while left:
        node = left.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        classes.add(type(node))
        operands = node.ufl_operands
        if operands:
            left.extend(operands)
        else:
            leaves.append(node)
    out = None if any(issubclass(kind, BaseFormOperator) for kind in classes) else leaves
    _known[key] = weakref.ref(root, partial(_forget, _known, key)), out
    return out


def _forget(known: dict[int, Any], key: int, _: Any) -> None:
    """Forget an expression that has gone; given what it is in, as modules may go before it where Python ends."""
    known.pop(key, None)


def compute_expression_hashdata(expression: Any, terminal_hashdata: dict[Any, Any]) -> bytes:
    """Return the hash of an expression as UFL's function of this name does.

    Args:
        expression: what is hashed.
        terminal_hashdata: terminal ↦ what it counts as, the same for all integrands of a form: it keeps their hashes.
    """
    hashes, left = terminal_hashdata.setdefault("nodes", dict[Any, bytes]()), [expression]
    while left:
        node = left[-1]
        missing = [operand for operand in node.ufl_operands if operand not in hashes]
        if missing:
            left.extend(missing)
            continue
        left.pop()
        own = [terminal_hashdata[node]] if node._ufl_is_terminal_ else [node._ufl_typecode_]
        data = [*own, *(hashes[operand] for operand in node.ufl_operands)]
        hashes[node] = hashlib.sha512(str(data).encode("utf-8")).digest()
    return bytes(hashes[expression])


def get_node_symbols(numberer: ValueNumberer, node: Any) -> Any:
    """Return the symbols of a node that has some, as FFCx's method of this name."""
    return numberer.V_symbols[numberer.G.e2i[node]]


def install() -> None:
    """Let UFL find terminals and hash expressions, and FFCx find nodes, by the functions above."""
    analysis.extract_type = extract_type
    signature.compute_expression_hashdata = compute_expression_hashdata
    ValueNumberer.get_node_symbols = get_node_symbols
