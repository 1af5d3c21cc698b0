"""One kernel as one function of C: statements and expressions in their order, under their names."""

import ast
import builtins
import inspect
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from bowden.core.kernel_content import Parts, is_kernel, meant
from bowden.core.nested import is_named
from bowden.core.primitives import _tanh, cos, exp, floor, half_to, log, power, sin, sqrt, tanh
from bowden.export.kinds import (
    Kind,
    Row,
    Several,
    Struct,
    annotated,
    comments,
    field_kinds,
    hints_of,
    identifier,
    is_number,
    joined,
    kind_of,
    said,
)
from bowden.export.source import KernelSource

if TYPE_CHECKING:
    from bowden.export.unit import Unit

CHOICE, OR, AND, BITS, EQUAL, LESS, SUM, PRODUCT, UNARY, ATOM = range(10)
"""How strongly an operator of C binds; those of bits stand in brackets beside one another."""

_OPERATORS: dict[type[ast.AST], tuple[str, int]] = {
    ast.Add: ("+", SUM),
    ast.Sub: ("-", SUM),
    ast.Mult: ("*", PRODUCT),
    ast.Div: ("/", PRODUCT),
    ast.BitAnd: ("&", BITS),
    ast.BitOr: ("|", BITS),
    ast.BitXor: ("^", BITS),
    ast.LShift: ("<<", BITS),
    ast.RShift: (">>", BITS),
    ast.Eq: ("==", EQUAL),
    ast.NotEq: ("!=", EQUAL),
    ast.Lt: ("<", LESS),
    ast.LtE: ("<=", LESS),
    ast.Gt: (">", LESS),
    ast.GtE: (">=", LESS),
}
_LIBM: dict[Any, str] = {exp: "exp", sin: "sin", cos: "cos", log: "log", power: "pow", sqrt: "sqrt", floor: "floor"}
_LIBM |= {math.copysign: "copysign", abs: "fabs"}
_TRUTHS: dict[Any, str] = {math.isnan: "isnan", math.isfinite: "isfinite", math.isinf: "isinf"}


@dataclass(frozen=True)
class Expression:
    """A piece of C."""

    text: str
    kind: Kind
    level: int = ATOM
    place: bool = False
    """Whether it stands in memory, so that it has an address."""
    pointer: bool = False
    """Whether the text is a pointer to it."""
    fixed: bool = False
    """Whether what stands there stays as it is."""

    @property
    def value(self) -> str:
        """Its text as a value."""
        return f"*{self.text}" if self.pointer else self.text

    def within(self, level: int) -> str:
        """Its text as an operand."""
        own = UNARY if self.pointer else self.level
        return self.value if own >= level else f"({self.value})"

    def field(self, name: str, kind: Kind) -> "Expression":
        """A part of it."""
        text = f"{self.text}->{name}" if self.pointer else f"{self.within(ATOM)}.{name}"
        return Expression(text, kind, place=True, fixed=self.fixed or not self.place)


@dataclass(frozen=True)
class Local:
    """How a local is declared."""

    block: int
    """Number of the block that all that names it stands in."""
    first: ast.stmt
    """The statement of that block that names it first."""
    assigned: int
    """How often."""


class Function:
    """A kernel for arguments of certain kinds.

    Args:
        unit: that it becomes a part of.
        function: the kernel.
        kinds: of its arguments.
        name: in C.
        parts: what stands for the placeholders that it reaches.
    """

    def __init__(self, unit: "Unit", function: FunctionType, kinds: tuple[Kind, ...], name: str, parts: Parts) -> None:
        self.unit, self.function, self.name, self.parts = unit, function, name, parts
        self.source = KernelSource(function)
        self.kinds: dict[str, Kind] = dict(zip(inspect.signature(function).parameters, kinds, strict=True))
        self.parameters = tuple(self.kinds)
        self.result: Kind = None
        self.locals: dict[str, Local] = {}
        self.declared: set[str] = set()
        self.pointers: set[str] = set()
        """Locals that are another name of what stands elsewhere."""
        self._commented = 0
        self._blocks: dict[int, int] = {}
        self._look(self.source.body)

    def written(self) -> str:
        """The whole function."""
        lines = self._block(self.source.body, 1, 0)
        if not _ends(self.source.body):
            raise self.source.refused(
                self.source.body[-1],
                f"{self.function.__name__}, which has a way without a result,",
                "add a return at its end",
            )
        given = ", ".join(self._parameter(name) for name in self.parameters) or "void"
        head = f"static inline {self.unit.type(self.result)} {self.name}({given})"
        unused = [name for name in self.parameters if name not in self._named()]
        return "\n".join(
            [*self._docstring(), head, "{", *(f"    (void){identifier(name)};" for name in unused), *lines, "}"]
        )

    def _named(self) -> set[str]:
        return {node.id for one in self.source.body for node in ast.walk(one) if isinstance(node, ast.Name)}

    def _docstring(self) -> list[str]:
        where, lines = self.function.__module__, self.source.said.split("\n")
        short = f"{where}: {lines[0]}".rstrip(": ")
        return comments([short, *lines[1:]] if len(short) < 112 else [f"{where}:", *lines])

    def _parameter(self, name: str) -> str:
        kind, called = self.kinds[name], identifier(name)
        changed = name in self.locals and self.locals[name].assigned
        if is_number(kind):
            return f"{'' if changed else 'const '}{self.unit.type(kind)} {called}"
        return f"const {self.unit.type(kind)} *{called}"

    # ---- where locals are named ----

    def _look(self, body: list[ast.stmt]) -> None:
        """Find out for each local which block it belongs to, and how often it is assigned."""
        nodes = [node for one in body for node in ast.walk(one)]
        counters = {one.target.id for one in nodes if isinstance(one, ast.For) and isinstance(one.target, ast.Name)}
        stored = {one.id for one in nodes if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)} - counters
        seen: dict[str, list[tuple[tuple[int, ast.stmt], ...]]] = {name: [] for name in stored}
        assigned = dict.fromkeys(stored, 0)

        def walk(block: list[ast.stmt], way: tuple[tuple[int, ast.stmt], ...], counting: frozenset[str]) -> None:
            number = self._blocks.setdefault(id(block), len(self._blocks))
            for one in block:
                here = (*way, (number, one))
                inner = [part for part in (getattr(one, "body", None), getattr(one, "orelse", None)) if part]
                own = [part for part in ast.iter_child_nodes(one) if not (isinstance(part, ast.stmt) and inner)]
                counts = counting | (
                    {one.target.id} if isinstance(one, ast.For) and isinstance(one.target, ast.Name) else set()
                )
                for node in (node for part in own for node in ast.walk(part) if isinstance(node, ast.Name)):
                    if node.id in counters and node.id not in counts:
                        raise self.source.refused(node, f"{node.id}, which also counts a loop,", "give it another name")
                    if node.id in stored:
                        seen[node.id].append(here)
                        if isinstance(node.ctx, ast.Store):
                            assigned[node.id] += 2 if isinstance(one, ast.AugAssign) else 1
                for part in inner:
                    walk(part, here, counts)

        walk(body, (), frozenset())
        for name, ways in seen.items():
            depth = 0
            while all(len(way) > depth + 1 and way[depth] == ways[0][depth] for way in ways):
                depth += 1
            block, first = ways[0][depth]
            self.locals[name] = Local(block, first, assigned[name])

    # ---- statements ----

    def _block(self, body: list[ast.stmt], indent: int, number: int) -> list[str]:
        lines: list[str] = []
        for before_it, one in zip([None, *body], body, strict=False):
            made: list[str] = []
            comments = self._comments(one.lineno, indent)
            if before_it and (self.source.is_blank_after(before_it) or comments):
                lines.append("")
            before = set(self.declared)
            self._statement(one, indent, number, made)
            late = [
                name
                for name, local in self.locals.items()
                if local.block == number and local.first is one and name not in self.declared and name in self.kinds
            ]
            if any(name not in self.parameters for name in late):
                comments += [
                    f"{'    ' * indent}{self.unit.type(self.kinds[name])} {identifier(name)};"
                    for name in sorted(late)
                    if name not in self.parameters
                ]
            self.declared |= set(late) | before
            lines += comments + made
        return lines

    def _comments(self, line: int, indent: int) -> list[str]:
        found = [text for at, text in sorted(self.source.comments.items()) if self._commented < at < line]
        self._commented = max(self._commented, line)
        return comments([one for one in found if not one.startswith(("noqa", "type:"))], "    " * indent)

    def _statement(self, one: ast.stmt, indent: int, number: int, lines: list[str]) -> None:
        pad = "    " * indent
        if isinstance(one, ast.Assign) and len(one.targets) == 1:
            self._assign(one.targets[0], one.value, pad, number, lines)
        elif isinstance(one, ast.AnnAssign) and one.value is not None:
            self._assign(one.target, one.value, pad, number, lines)
        elif isinstance(one, ast.AugAssign):
            target = one.target
            if not isinstance(target, ast.Name):
                raise self.source.outside(target)
            value = ast.copy_location(
                ast.BinOp(ast.copy_location(ast.Name(target.id, ast.Load()), one), one.op, one.value), one
            )
            self._assign(target, value, pad, number, lines)
        elif isinstance(one, ast.If):
            lines.append(f"{pad}if ({self._truth(one.test)}) {{")
            lines += self._block(one.body, indent + 1, self._blocks[id(one.body)])
            other = one.orelse
            while (
                len(other) == 1 and isinstance(other[0], ast.If) and not self._opens(other[0], self._blocks[id(other)])
            ):
                test = other[0]
                lines += [
                    f"{pad}}} else if ({self._truth(test.test)}) {{",
                    *self._comments(test.body[0].lineno, indent + 1),
                ]
                lines += self._block(test.body, indent + 1, self._blocks[id(test.body)])
                other = test.orelse
            if other:
                lines += [f"{pad}}} else {{", *self._block(other, indent + 1, self._blocks[id(other)])]
            lines.append(f"{pad}}}")
        elif isinstance(one, ast.For):
            self._loop(one, indent, lines)
        elif isinstance(one, ast.Return) and one.value is not None:
            self._return(one, pad, lines)
        elif not (isinstance(one, ast.Pass) or (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))):
            raise self.source.outside(one)

    def _opens(self, one: ast.stmt, number: int) -> bool:
        """Whether a local has to be declared before a statement."""
        return any(local.block == number and local.first is one for local in self.locals.values())

    def _assign(self, target: ast.expr, value: ast.expr, pad: str, number: int, lines: list[str]) -> None:
        if isinstance(target, ast.Name):
            self._set(target, self._expression(value), pad, number, lines)
            return
        if not isinstance(target, ast.Tuple):
            raise self.source.outside(target)
        names = [one for one in target.elts if isinstance(one, ast.Name)]
        if len(names) < len(target.elts):
            raise self.source.outside(target)
        if isinstance(value, ast.Tuple):
            if len(value.elts) != len(names):
                raise self.source.refused(target, "an assignment of another number of values", "name each of them")
            left = list(zip(names, value.elts, strict=True))
            while left:  # what none of the others reads comes first
                reads = [{node.id for node in ast.walk(one) if isinstance(node, ast.Name)} for _, one in left]
                free = [
                    k
                    for k, (name, _) in enumerate(left)
                    if not any(name.id in read for other, read in enumerate(reads) if other != k)
                ]
                if not free:
                    what = f"an assignment that exchanges {' and '.join(name.id for name, _ in left)}"
                    raise self.source.refused(target, what, "assign on lines of their own")
                name, one = left.pop(free[0])
                self._set(name, self._expression(one), pad, number, lines)
            return
        whole = self._expression(value)
        kind = whole.kind
        fields = kind.fields if isinstance(kind, Several | Struct) else ()
        if len(fields) != len(names):
            raise self.source.refused(value, f"{ast.unparse(value)[:40]} as {len(names)} values", "name each of them")
        if not whole.place:
            both = "_".join(identifier(one.id) for one in names)
            lines.append(f"{pad}const {self.unit.type(kind)} {both} = {whole.value};")
            whole = Expression(both, kind, place=True, fixed=True)
        for one, (field, inner) in zip(names, fields, strict=True):
            self._set(one, whole.field(identifier(field), inner), pad, number, lines)

    def _set(self, target: ast.Name, value: Expression, pad: str, number: int, lines: list[str]) -> None:
        name = target.id
        if isinstance(value.kind, Several):
            raise self.source.refused(
                target, f"{name}, which is several values,", "give each value a name: a, b = f(x)"
            )
        known = self.kinds.get(name)
        if known is None:
            self.kinds[name] = value.kind
        elif known != value.kind and not (known is float and value.kind is int):
            given = f"{name}, which is first {said(known)} and then {said(value.kind)},"
            raise self.source.refused(target, given, "give the second one another name")
        local = self.locals[name]
        text, type_ = value.value, self.unit.type(self.kinds[name])
        if name not in self.declared and name not in self.parameters and local.block == number:
            text = text.removeprefix(f"({type_})") if text.startswith(f"({type_}){{") else text
            if local.assigned == 1 and value.fixed and not is_number(value.kind):
                lines.append(f"{pad}const {type_} *{identifier(name)} = {self._address(value)};")
                self.declared.add(name)
                self.pointers.add(name)
                return
            lines.append(f"{pad}{'const ' if local.assigned == 1 else ''}{type_} {identifier(name)} = {text};")
            self.declared.add(name)
        elif name in self.parameters and not is_number(known):
            raise self.source.refused(target, f"{name}, an argument that is set anew,", "give it another name")
        else:
            lines.append(f"{pad}{identifier(name)} = {text};")

    def _loop(self, one: ast.For, indent: int, lines: list[str]) -> None:
        call, target = one.iter, one.target
        ranged = isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"
        if not (ranged and isinstance(call, ast.Call) and len(call.args) in (1, 2) and isinstance(target, ast.Name)):
            raise self.source.refused(
                one, f"a loop over {ast.unparse(call)[:40]}", "write for i in range(n), n a whole number that is fixed"
            )
        if one.orelse:
            raise self.source.refused(one, "an else of a loop", "put it behind the loop")
        ends = [self._expression(end) for end in call.args]
        if any(end.kind is not int for end in ends):
            raise self.source.refused(
                one, f"a loop over {ast.unparse(call)[:40]}", "count up to a whole number that is fixed"
            )
        self.kinds[target.id] = int
        i, begin = identifier(target.id), ends[0].text if ends[1:] else "0"
        pad = "    " * indent
        lines.append(f"{pad}for (int {i} = {begin}; {i} < {ends[-1].within(SUM)}; ++{i}) {{")
        lines += self._block(one.body, indent + 1, self._blocks[id(one.body)])
        lines.append(f"{pad}}}")

    def _return(self, one: ast.Return, pad: str, lines: list[str]) -> None:
        value = one.value
        assert value is not None
        if isinstance(value, ast.Tuple):
            parts = [self._expression(part) for part in value.elts]
            names = [_name_of(part) for part in value.elts]
            hint = hints_of(self.function).get("return")
            wanted = [annotated(part) for part in getattr(hint, "__args__", ())] or [None] * len(parts)
            kinds = [want if is_number(want) and want else part.kind for want, part in zip(wanted, parts, strict=True)]
            known = self.result
            if known is None:
                fields = [name or f"item{k}" for k, name in enumerate(names)]
                if len(set(fields)) < len(fields):
                    fields = [f"item{k}" for k in range(len(names))]
                self.result = Several(self.name, tuple(zip(fields, kinds, strict=True)))
            elif not isinstance(known, Several) or [kind for _, kind in known.fields] != kinds:
                raise self.source.refused(
                    one, "a result of another kind than the one before", "return the same kinds everywhere"
                )
            made = [(field, part) for (field, _), part in zip(self.result.fields, parts, strict=True)]
            lines.append(f"{pad}return {self._literal(self.result, made)};")
            return
        made_of = self._expression(value)
        wanted_kind = annotated(hints_of(self.function).get("return"))
        kind = wanted_kind if is_number(wanted_kind) and wanted_kind and is_number(made_of.kind) else made_of.kind
        if joined(made_of.kind, kind) != kind or (self.result is not None and self.result != kind):
            raise self.source.refused(
                one,
                f"a result that is {said(made_of.kind)}",
                "return the kind that is annotated",
                said(self.result or kind),
            )
        self.result = kind
        lines.append(f"{pad}return {made_of.value};")

    # ---- expressions ----

    def _truth(self, node: ast.expr) -> str:
        """A condition."""
        found = self._expression(node)
        if not is_number(found.kind):
            raise self.source.refused(node, f"{ast.unparse(node)[:40]} as a condition", "compare numbers")
        if found.kind is bool:
            return found.value
        return f"{found.within(LESS)} != {self.unit.style.number(0.0) if found.kind is float else '0'}"

    def _expression(self, node: ast.expr) -> Expression:
        method = getattr(self, f"_on_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.source.outside(node)
        found: Expression = method(node)
        return found

    def _on_constant(self, node: ast.Constant) -> Expression:
        value = node.value
        if not isinstance(value, bool | int | float):
            raise self.source.refused(node, f"{value!r}", "use numbers; an IntEnum has names for them")
        return self.unit.number(value)

    def _on_name(self, node: ast.Name) -> Expression:
        name = node.id
        if name in self.kinds:
            kind, local = self.kinds[name], self.locals.get(name)
            by_pointer = (name in self.parameters and not is_number(kind)) or name in self.pointers
            return Expression(
                identifier(name), kind, place=True, pointer=by_pointer, fixed=local is None or local.assigned == 1
            )
        if name in self.locals:
            raise self.source.refused(node, f"{name}, which is read before it is set,", "set it first")
        return self._global(node, self._looked_up(node))

    def _global(self, node: ast.expr, value: Any) -> Expression:
        if isinstance(value, IntEnum):
            return self.unit.member(value)
        if kind_of(value) is None:
            raise self.source.refused(
                node, f"{ast.unparse(node)}, {type(value).__name__},", "use numbers, tuples of them and kernels"
            )
        if isinstance(node, ast.Name):
            return self.unit.constant(self.source.file, node.id, value)
        if isinstance(node, ast.Attribute) and isinstance(owner := self._looked_up(node.value), ModuleType):
            if owner in (math, np):
                return self.unit.number(float(value))
            return self.unit.constant(owner.__file__ or "", node.attr, value)
        return self.unit.number(value)

    def _looked_up(self, node: ast.expr) -> Any:
        """What a name outside the function stands for."""
        if isinstance(node, ast.Attribute):
            owner = self._looked_up(node.value)
            if not hasattr(owner, node.attr):
                raise self.source.refused(node, ast.unparse(node), "correct the name")
            return getattr(owner, node.attr)
        if not isinstance(node, ast.Name):
            raise self.source.outside(node)
        if node.id in self.function.__globals__:
            return meant(self.function, node.id, dict(self.parts))
        free = dict(zip(self.function.__code__.co_freevars, self.function.__closure__ or (), strict=True))
        if node.id in free:
            return free[node.id].cell_contents
        if hasattr(builtins, node.id):
            return getattr(builtins, node.id)
        raise self.source.refused(node, f"{node.id}, which is not defined,", "correct the name")

    def _is_local(self, node: ast.expr) -> bool:
        """Whether an attribute is of a value, and not of a module or class."""
        while isinstance(node, ast.Attribute):
            node = node.value
        return not isinstance(node, ast.Name) or node.id in self.kinds or node.id in self.locals

    def _on_attribute(self, node: ast.Attribute) -> Expression:
        if not self._is_local(node):
            try:
                owner = self._looked_up(node.value)
            except AttributeError:
                owner = None
            if not is_named(owner):
                return self._global(node, self._looked_up(node))
        whole = self._expression(node.value)
        if node.attr == "value" and isinstance(whole.kind, type) and issubclass(whole.kind, IntEnum):
            return Expression(f"(int64_t){whole.within(UNARY)}", int, UNARY)
        kinds = dict(whole.kind.fields) if isinstance(whole.kind, Struct) else {}
        if node.attr not in kinds:
            raise self.source.refused(node, ast.unparse(node), "name a field of a NamedTuple", ", ".join(kinds))
        return whole.field(identifier(node.attr), kinds[node.attr])

    def _on_subscript(self, node: ast.Subscript) -> Expression:
        whole, at = self._expression(node.value), self._expression(node.slice)
        if at.kind is not int or not isinstance(whole.kind, Row):
            raise self.source.refused(
                node, ast.unparse(node), "take one number of a tuple of numbers, by a whole number"
            )
        return Expression(f"{whole.field('at', None).text}[{at.text}]", whole.kind.of, place=True, fixed=whole.fixed)

    def _on_unaryop(self, node: ast.UnaryOp) -> Expression:
        inner = self._expression(node.operand)
        if not is_number(inner.kind):
            raise self.source.outside(node)
        if isinstance(node.op, ast.Not):
            return Expression(
                f"!{self._operand(inner, ATOM)}" if inner.kind is bool else f"!({self._truth(node.operand)})",
                bool,
                UNARY,
            )
        if isinstance(node.op, ast.USub):
            text = inner.within(UNARY)
            kind = float if inner.kind is float else int
            return Expression(f"-({text})" if text.startswith("-") else f"-{text}", kind, UNARY)
        if isinstance(node.op, ast.UAdd):
            return inner
        if isinstance(node.op, ast.Invert) and inner.kind is int:
            return Expression(f"~{inner.within(UNARY)}", int, UNARY)
        raise self.source.outside(node)

    def _operand(self, one: Expression, level: int) -> str:
        """An operand of arithmetic or of a comparison with another kind."""
        if isinstance(one.kind, type) and issubclass(one.kind, IntEnum):
            return f"(int){one.within(UNARY)}"
        return one.within(level)

    def _on_binop(self, node: ast.BinOp) -> Expression:
        if type(node.op) not in _OPERATORS:
            raise self.source.outside(node.op if type(node.op) in _OPERATORS else _at(node.op, node))
        if shifted := self._shifted(node):
            return shifted
        left, right = self._expression(node.left), self._expression(node.right)
        for one in (left, right):
            if not is_number(one.kind):
                raise self.source.refused(node, f"{ast.unparse(node)[:40]} of {said(one.kind)}", "compute with numbers")
        sign, level = _OPERATORS[type(node.op)]
        if level == BITS:
            return self._on_bits(node, left, right)
        kind = float if float in (left.kind, right.kind) or sign == "/" else int
        first = self._operand(left, level)
        if sign == "/" and float not in (left.kind, right.kind):
            first = f"({self.unit.style.real}){self._operand(left, UNARY)}"
        return Expression(f"{first} {sign} {self._operand(right, level + 1)}", kind, level)

    def _on_bits(self, node: ast.BinOp, left: Expression, right: Expression) -> Expression:
        if float in (left.kind, right.kind):
            raise self.source.refused(node, f"{ast.unparse(node)[:40]} of float", "use whole numbers for sets of bits")
        sign, _ = _OPERATORS[type(node.op)]
        first = f"(int64_t){left.within(UNARY)}" if left.kind is not int or sign == "<<" else left.within(SUM)
        return Expression(f"{first} {sign} {self._operand(right, SUM)}", int, BITS)

    def _shifted(self, node: ast.BinOp) -> Expression | None:
        """``(newest,) + past[:-1]``, a row that moves on by one place."""
        new, old = node.left, node.right
        if not (isinstance(node.op, ast.Add) and isinstance(new, ast.Tuple) and len(new.elts) == 1):
            return None
        if not (isinstance(old, ast.Subscript) and ast.unparse(old.slice) == ":-1"):
            raise self.source.outside(old)
        newest, past = self._expression(new.elts[0]), self._expression(old.value)
        if not isinstance(past.kind, Row) or newest.kind != past.kind.of:
            raise self.source.outside(node)
        return Expression(f"{self.unit.shifted(past.kind)}({newest.value}, {self._address(past)})", past.kind)

    def _on_compare(self, node: ast.Compare) -> Expression:
        parts = [self._expression(one) for one in (node.left, *node.comparators)]
        found = []
        for left, operator, right in zip(parts, node.ops, parts[1:], strict=False):
            if type(operator) not in _OPERATORS:
                raise self.source.outside(_at(operator, node))
            if not (is_number(left.kind) and is_number(right.kind)):
                raise self.source.refused(node, ast.unparse(node)[:40], "compare numbers")
            sign, level = _OPERATORS[type(operator)]
            same = left.kind == right.kind
            texts = [one.within(SUM) if same else self._operand(one, SUM) for one in (left, right)]
            found.append(Expression(f"{texts[0]} {sign} {texts[1]}", bool, level))
        if len(found) == 1:
            return found[0]
        return Expression(" && ".join(one.within(EQUAL) for one in found), bool, AND)

    def _on_boolop(self, node: ast.BoolOp) -> Expression:
        level, sign = (AND, "&&") if isinstance(node.op, ast.And) else (OR, "||")
        parts = [self._expression(one) for one in node.values]
        for one, part in zip(node.values, parts, strict=True):
            if part.kind is not bool:
                raise self.source.refused(
                    one, f"{ast.unparse(one)[:40]}, {said(part.kind)}, beside and/or", "compare it: x != 0.0", "bool"
                )
        texts = [part.within(level if part.level == level else EQUAL) for part in parts]
        return Expression(f" {sign} ".join(texts), bool, level)

    def _on_ifexp(self, node: ast.IfExp) -> Expression:
        return self._choice(node, node.test, node.body, node.orelse)

    def _choice(self, node: ast.expr, test: ast.expr, a: ast.expr, b: ast.expr) -> Expression:
        asked, left, right = self._expression(test), self._expression(a), self._expression(b)
        kind = joined(left.kind, right.kind)
        if kind is None:
            raise self.source.refused(
                node, f"a choice between {said(left.kind)} and {said(right.kind)}", "let both sides be of one kind"
            )
        condition = asked.within(OR) if asked.kind is bool else self._truth(test)
        return Expression(f"{condition} ? {left.within(OR)} : {right.within(CHOICE)}", kind, CHOICE)

    def _on_tuple(self, node: ast.Tuple) -> Expression:
        parts = [self._expression(one) for one in node.elts]
        if not parts or len({part.kind for part in parts}) > 1:
            raise self.source.refused(node, ast.unparse(node)[:40], "use a NamedTuple")
        kind = Row(parts[0].kind, len(parts))
        return Expression(f"({self.unit.type(kind)}){{{{{', '.join(part.value for part in parts)}}}}}", kind)

    # ---- calls ----

    def _on_call(self, node: ast.Call) -> Expression:
        if self._is_local(node.func):
            word = ast.unparse(node.func)
            do = "call its class with all fields" if word.endswith("._replace") else "call kernels by their names"
            raise self.source.refused(node, f"{word}()", do)
        called = self._looked_up(node.func)
        if any(one.arg is None for one in node.keywords):
            raise self.source.refused(node, "two stars in a call", "name the values one by one")
        if isinstance(called, type) and issubclass(called, tuple) and hasattr(called, "_fields"):
            return self._construct(node, called)
        called = _tanh if called is tanh else called
        if is_kernel(called) or called is half_to:
            return self._called(node, called)
        known = any(called is one for one in (*_LIBM, *_TRUTHS, min, max, float, bool, int))
        given = self._arguments(node) if known and not node.keywords else []
        if given and all(is_number(one.kind) for one in given):
            texts = ", ".join(one.value for one in given)
            if called in (float, bool, int) and len(given) == 1:
                return self._converted(node, called, given[0])
            if called in (min, max) and len(given) > 1:
                return self._extreme(called.__name__, given)
            if name := _LIBM.get(called):
                return Expression(f"{self.unit.style.libm(name)}({texts})", float)
            if (name := _TRUTHS.get(called)) and len(given) == 1:
                return Expression(f"{name}({texts})", bool)
        raise self.source.refused(
            node, f"{ast.unparse(node.func)}()", self._instead(called), "a kernel, or a function of the subset"
        )

    def _instead(self, called: Any) -> str:
        if isinstance(called, FunctionType):
            return f"mark {called.__name__} with @kernel"
        if called is np.where:
            return "use a if condition else b"
        name = getattr(called, "__name__", "")
        known = {"sqrt", "exp", "sin", "cos", "log", "tanh", "floor"}
        if name in known:
            return f"import {name} from bowden.core.kernel"
        return {"pow": "import power from bowden.core.kernel", "fabs": "use abs(x)", "sum": "add the terms up"}.get(
            name, "write it with what docs/kernels.md names"
        )

    def _converted(self, node: ast.Call, called: type, one: Expression) -> Expression:
        if called is bool:
            return Expression(self._truth(node.args[0]), bool, EQUAL)
        if called is int and one.kind is float:
            raise self.source.refused(node, "int() of a float", "use floor of bowden.core.kernel, which gives a float")
        type_ = self.unit.type(called)
        return one if one.kind is called else Expression(f"({type_}){one.within(UNARY)}", called, UNARY)

    def _extreme(self, name: str, given: list[Expression]) -> Expression:
        kind = given[0].kind
        for one in given[1:]:
            kind = joined(kind, one.kind)
        helper = self.unit.helper(name if kind is float else f"{name}_int")
        text = given[0].value
        for one in given[1:]:
            text = f"{helper}({text}, {one.value})"
        return Expression(text if kind in (float, int) else f"({self.unit.type(kind)}){text}", kind)

    def _bound(self, node: ast.Call, signature: inspect.Signature, name: str) -> dict[str, Expression]:
        """Parameter → what it is given."""
        try:
            bound = signature.bind(
                *self._arguments(node), **{one.arg or "": self._expression(one.value) for one in node.keywords}
            )
        except TypeError as error:
            raise self.source.refused(node, f"{name}(): {error};", "correct the call") from None
        found: dict[str, Expression] = {}
        for one in signature.parameters.values():
            kind = kind_of(one.default)
            found[one.name] = bound.arguments.get(one.name) or Expression(self.unit.literal(one.default, kind), kind)
        return found

    def _arguments(self, node: ast.Call) -> list[Expression]:
        """What a call is given by place; a tuple behind a star is each of its values."""
        found = []
        for one in node.args:
            whole = self._expression(one.value if isinstance(one, ast.Starred) else one)
            if not isinstance(one, ast.Starred):
                found.append(whole)
            elif isinstance(whole.kind, Struct):
                found += [whole.field(identifier(name), kind) for name, kind in whole.kind.fields]
            else:
                raise self.source.refused(node, "a star in a call", "name the values one by one")
        return found

    def _construct(self, node: ast.Call, made: Any) -> Expression:
        given = self._bound(node, inspect.signature(made), made.__name__)
        hints = field_kinds(made)
        kinds = []
        for name, one in given.items():
            wanted = hints[name]
            self._check(node, f"{name} of {made.__name__}", one.kind, wanted)
            kinds.append((name, one.kind if wanted is None else wanted))
        kind = Struct(made, tuple(kinds))
        return Expression(self._literal(kind, list(given.items())), kind)

    def _check(self, node: ast.AST, what: str, given: Kind, wanted: Kind) -> None:
        if (
            wanted is None
            or given == wanted
            or (is_number(given) and wanted in (float, int) and joined(given, wanted) == wanted)
        ):
            return
        raise self.source.refused(node, f"{what}, {said(given)},", "give it the kind that is annotated", said(wanted))

    def _literal(self, kind: Kind, given: list[tuple[str, Expression]]) -> str:
        fields = ", ".join(f".{identifier(name)} = {one.value}" for name, one in given)
        return f"({self.unit.type(kind)}){{{fields}}}"

    def _address(self, one: Expression) -> str:
        """A pointer to it; what has no place in memory gets one."""
        if one.pointer:
            return one.text
        type_ = self.unit.type(one.kind)
        if one.place or one.text.startswith(f"({type_}){{"):
            return f"&{one.within(ATOM)}"
        return f"({type_}[]){{{one.value}}}"

    def _called(self, node: ast.Call, called: Callable[..., Any]) -> Expression:
        given = self._bound(node, inspect.signature(called), called.__name__)
        hints = hints_of(called)
        kinds = []
        for name, one in given.items():
            wanted = annotated(hints.get(name))
            alike = (
                isinstance(wanted, Struct)
                and isinstance(one.kind, Struct)
                and set(wanted.fields) <= set(one.kind.fields)
            )
            wanted = one.kind if wanted is None or alike else wanted  # Python asks for fields, and not for a class
            self._check(node, f"{name} of {called.__name__}()", one.kind, wanted)
            kinds.append(wanted)
        name, result = self.unit.call(called, tuple(kinds), self)
        texts = [
            one.value if is_number(kind) else self._address(one)
            for one, kind in zip(given.values(), kinds, strict=True)
        ]
        if name in {identifier(local) for local in (*self.locals, *self.parameters)}:
            raise self.source.refused(node, f"a local with the name of {name}(), which it calls,", "rename the local")
        return Expression(f"{name}({', '.join(texts)})", result)


def _ends(body: list[ast.stmt]) -> bool:
    """Whether every way through a block returns."""
    last = body[-1] if body else None
    return isinstance(last, ast.Return) or (isinstance(last, ast.If) and _ends(last.body) and _ends(last.orelse))


def _name_of(part: ast.expr) -> str:
    """What a result is called: the local that it is, or the class that makes it; nothing for what has no name."""
    if isinstance(part, ast.Call) and isinstance(part.func, ast.Name) and part.func.id[0].isupper():
        return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", part.func.id).lower()
    return part.id if isinstance(part, ast.Name) else ""


def _at(node: Any, where: ast.expr) -> Any:
    """An operator, which has no line, with that of its expression."""
    node.lineno = where.lineno
    return node
