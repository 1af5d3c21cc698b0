"""One kernel as one function of C: statements and expressions in their order, under their names."""

import ast
import builtins
import functools
import inspect
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from types import FunctionType, ModuleType
from typing import Any, Protocol

import numpy as np

from bowden.core.kernel_content import Parts, is_kernel, meant
from bowden.core.nested import is_named
from bowden.core.primitives import cos, exp, floor, log, power, sin, sqrt, tanh
from bowden.export.kinds import (
    Kind,
    Row,
    Several,
    Struct,
    Style,
    annotated,
    comments,
    field_kinds,
    hints_of,
    identifier,
    is_enum,
    is_number,
    is_tuple_class,
    joined,
    kind_of,
    said,
    snake_case,
)
from bowden.export.source import KernelSource

CHOICE, OR, AND, BITS, EQUAL, LESS, SUM, PRODUCT, UNARY, ATOM = range(10)
"""How strongly an operator of C binds; those of bits stand in brackets beside one another."""

_BY_LEVEL: dict[int, dict[type[ast.AST], str]] = {
    SUM: {ast.Add: "+", ast.Sub: "-"},
    PRODUCT: {ast.Mult: "*", ast.Div: "/"},
    BITS: {ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.LShift: "<<", ast.RShift: ">>"},
    EQUAL: {ast.Eq: "==", ast.NotEq: "!="},
    LESS: {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="},
}
_OPERATORS = {kind: (sign, level) for level, signs in _BY_LEVEL.items() for kind, sign in signs.items()}
_LIBM: dict[Any, str] = {one: one.__name__ for one in (exp, sin, cos, log, sqrt, tanh, floor, math.copysign)}
_LIBM |= {power: "pow", abs: "fabs"}
_CALLS: dict[Any, str] = {
    np.where: "use a if condition else b",
    math.pow: "import power from bowden.core.kernel",
    math.fabs: "use abs(x)",
    sum: "add the terms up",
}
"""Function → what to write in its place."""
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

    def operand(self, level: int) -> str:
        """Its text as an operand of arithmetic, or of a comparison with another kind."""
        return f"(int){self.within(UNARY)}" if is_enum(self.kind) else self.within(level)

    def field(self, name: str, kind: Kind) -> "Expression":
        """A part of it."""
        text = f"{self.text}->{name}" if self.pointer else f"{self.within(ATOM)}.{name}"
        return Expression(text, kind, place=True, fixed=self.fixed or not self.place)


@dataclass(frozen=True)
class Local:
    """How a local is declared."""

    block: int
    """Number of the innermost block that all that names it stands in."""
    first: int
    """Number of the statement of that block that names it first."""
    assigned: int
    """How often."""


class _Unit(Protocol):
    """What a function asks of the C unit that it becomes a part of (`bowden.export.unit.Unit`)."""

    style: Style

    def type(self, kind: Kind) -> str: ...
    def member(self, member: IntEnum) -> Expression: ...
    def number(self, value: Any) -> Expression: ...
    def literal(self, value: Any, kind: Kind) -> str: ...
    def constant(self, file: str, name: str, value: Any, said: str = "") -> Expression: ...
    def helper(self, name: str, **words: str) -> str: ...
    def shifted(self, kind: Row) -> str: ...
    def call(self, function: Any, kinds: tuple[Kind, ...]) -> tuple[str, Kind]: ...


class Function:
    """A kernel for arguments of certain kinds.

    Args:
        unit: that it becomes a part of.
        function: the kernel.
        kinds: of its arguments.
        name: in C.
        parts: what stands for the placeholders that it reaches.
    """

    def __init__(self, unit: _Unit, function: FunctionType, kinds: tuple[Kind, ...], name: str, parts: Parts) -> None:
        self.unit, self.function, self.name, self.parts = unit, function, name, parts
        self.source = KernelSource(function)
        self.refused, self.outside = self.source.refused, self.source.outside
        self.kinds: dict[str, Kind] = dict(zip(inspect.signature(function).parameters, kinds, strict=True))
        self.parameters = tuple(self.kinds)
        self.result: Kind = None
        self.locals: dict[str, Local] = {}
        self.declared = set(self.parameters)
        self.pointers = {name for name, kind in self.kinds.items() if not is_number(kind)}
        """Arguments that are handed over as pointers, and locals that are another name of what stands elsewhere."""
        self._commented = 0
        self._blocks: dict[int, int] = {}
        self._block_number = 0
        self._find_locals(self.source.body)

    def written(self) -> str:
        """The whole function."""
        body = self.source.body
        lines = self._block(body)
        if not _ends(body):
            what = f"{self.function.__name__}, which has a way without a result,"
            raise self.refused(body[-1], what, "add a return at its end")
        given = ", ".join(self._parameter(name) for name in self.parameters) or "void"
        head = f"static inline {self.unit.type(self.result)} {self.name}({given})"
        named = {node.id for node in _names(body)}
        unused = [f"    (void){identifier(name)};" for name in self.parameters if name not in named]
        return "\n".join([*self._docstring(), head, "{", *unused, *lines, "}"])

    def _docstring(self) -> list[str]:
        where, lines = self.function.__module__, self.source.said.split("\n")
        short = f"{where}: {lines[0]}".rstrip(": ")
        return comments([short, *lines[1:]] if len(short) < 112 else [f"{where}:", *lines])

    def _parameter(self, name: str) -> str:
        type_, called = self.unit.type(self.kinds[name]), identifier(name)
        if name in self.pointers:
            return f"const {type_} *{called}"
        return f"{type_} {called}" if name in self.locals else f"const {type_} {called}"

    def _find_locals(self, body: list[ast.stmt]) -> None:
        """Find out for each local where it is declared, and how often it is assigned."""
        counters = {
            one.target.id for one in _nodes(body) if isinstance(one, ast.For) and isinstance(one.target, ast.Name)
        }
        stored = {one.id for one in _names(body) if isinstance(one.ctx, ast.Store)} - counters
        ways: dict[str, list[list[tuple[int, int]]]] = {name: [] for name in stored}
        assigned = dict.fromkeys(stored, 0)

        def walk(block: list[ast.stmt], way: list[tuple[int, int]], counting: set[str]) -> None:
            number = self._blocks.setdefault(id(block), len(self._blocks))
            for k, one in enumerate(block):
                here, counts = [*way, (number, k)], counting
                own: list[ast.AST] = [one]
                inner: list[list[ast.stmt]] = []
                if isinstance(one, ast.If):
                    own, inner = [one.test], [one.body, one.orelse]
                elif isinstance(one, ast.For):
                    own, inner = [one.target, one.iter], [one.body, one.orelse]
                    counts = counting | {node.id for node in _names([one.target])}
                for node in _names(own):
                    if node.id in counters - counts:
                        raise self.refused(node, f"{node.id}, which also counts a loop,", "give it another name")
                    if node.id in stored:
                        ways[node.id].append(here)
                        if isinstance(node.ctx, ast.Store):
                            assigned[node.id] += 2 if isinstance(one, ast.AugAssign) else 1
                for part in inner:
                    walk(part, here, counts)

        walk(body, [], set())
        for name, places in ways.items():
            shared = [level for level in zip(*places, strict=False) if len({block for block, _ in level}) == 1]
            block, first = shared[-1][0]
            self.locals[name] = Local(block, first, assigned[name])

    # ---- statements ----

    def _block(self, body: list[ast.stmt]) -> list[str]:
        """The lines of a block, one step further in than what it stands in."""
        outer, self._block_number = self._block_number, self._blocks[id(body)]
        lines: list[str] = []
        for k, one in enumerate(body):
            comments = self._comments(one.lineno)
            made = self._statement(one)
            opened = sorted(name for name in self._opened_by(k, self._block_number) if name in self.kinds)
            self.declared.update(opened)
            if k and (self.source.is_blank_after(body[k - 1]) or comments):
                lines.append("")
            lines += [*comments, *(f"{self.unit.type(self.kinds[name])} {identifier(name)};" for name in opened), *made]
        self._block_number = outer
        return [f"    {line}" if line else "" for line in lines]

    def _opened_by(self, k: int, block: int) -> list[str]:
        """The locals that have to be declared before a statement of a block."""
        locals_ = self.locals.items()
        return [name for name, at in locals_ if (at.block, at.first) == (block, k) and name not in self.declared]

    def _comments(self, line: int) -> list[str]:
        found = [text for at, text in sorted(self.source.comments.items()) if self._commented < at < line]
        self._commented = max(self._commented, line)
        return comments([one for one in found if not one.startswith(("noqa", "type:"))])

    def _statement(self, one: ast.stmt) -> list[str]:
        match one:
            case ast.Assign(targets=[target], value=value) | ast.AnnAssign(target=target, value=ast.expr() as value):
                return self._assign(target, value)
            case ast.AugAssign(target=ast.Name() as target):
                value = ast.copy_location(ast.BinOp(ast.Name(target.id, ast.Load()), one.op, one.value), one)
                return self._assign(target, ast.fix_missing_locations(value))
            case ast.AugAssign():
                raise self.outside(one.target)
            case ast.If():
                return [*self._if(one), "}"]
            case ast.For():
                return self._loop(one)
            case ast.Return(value=ast.expr() as value):
                return [f"return {self._returned(one, value)};"]
            case ast.Pass() | ast.Expr(value=ast.Constant()):
                return []
        raise self.outside(one)

    def _if(self, one: ast.If, before: str = "") -> list[str]:
        lines = [f"{before}if ({self._truth(one.test)}) {{"]
        lines += [f"    {line}" for line in self._comments(one.body[0].lineno)] if before else []
        lines += self._block(one.body)
        match one.orelse:
            case []:
                return lines
            case [ast.If() as other] if not self._opened_by(0, self._blocks[id(one.orelse)]):
                return [*lines, *self._if(other, "} else ")]
        return [*lines, "} else {", *self._block(one.orelse)]

    def _assign(self, target: ast.expr, value: ast.expr) -> list[str]:
        if isinstance(target, ast.Name):
            return [self._set(target, self._expression(value))]
        names = [one for one in getattr(target, "elts", []) if isinstance(one, ast.Name)]
        if not isinstance(target, ast.Tuple) or len(names) < len(target.elts):
            raise self.outside(target)
        if isinstance(value, ast.Tuple):
            return self._assign_each(target, names, value.elts)
        whole = self._expression(value)
        fields = whole.kind.fields if isinstance(whole.kind, Several | Struct) else ()
        if len(fields) != len(names):
            raise self.refused(value, f"{ast.unparse(value)[:40]} as {len(names)} values", "name each of them")
        lines = []
        if not whole.place:
            both = "_".join(identifier(one.id) for one in names)
            lines = [f"const {self.unit.type(whole.kind)} {both} = {whole.value};"]
            whole = Expression(both, whole.kind, place=True, fixed=True)
        parts = [whole.field(identifier(field), kind) for field, kind in fields]
        return lines + [self._set(name, part) for name, part in zip(names, parts, strict=True)]

    def _assign_each(self, target: ast.Tuple, names: list[ast.Name], values: list[ast.expr]) -> list[str]:
        """Several values at once: what no other one of them reads comes first."""
        if len(values) != len(names):
            raise self.refused(target, "an assignment of another number of values", "name each of them")
        left, lines = list(zip(names, values, strict=True)), []
        while left:
            free = [
                pair
                for pair in left
                if not any(
                    pair[0].id in {node.id for node in _names([one])} for name, one in left if name is not pair[0]
                )
            ]
            if not free:
                what = f"an assignment that exchanges {' and '.join(name.id for name, _ in left)}"
                raise self.refused(target, what, "assign on lines of their own")
            left.remove(free[0])
            lines.append(self._set(free[0][0], self._expression(free[0][1])))
        return lines

    def _set(self, target: ast.Name, value: Expression) -> str:
        name, called = target.id, identifier(target.id)
        if isinstance(value.kind, Several):
            raise self.refused(target, f"{name}, which is several values,", "give each value a name: a, b = f(x)")
        kind = self.kinds.setdefault(name, value.kind)
        if kind != value.kind and not (kind is float and value.kind is int):
            given = f"{name}, which is first {said(kind)} and then {said(value.kind)},"
            raise self.refused(target, given, "give the second one another name")
        local, type_ = self.locals[name], self.unit.type(kind)
        if name in self.parameters and not is_number(kind):
            raise self.refused(target, f"{name}, an argument that is set anew,", "give it another name")
        if name in self.declared or local.block != self._block_number:
            return f"{called} = {value.value};"
        self.declared.add(name)
        if local.assigned == 1 and value.fixed and not is_number(kind):
            self.pointers.add(name)
            return f"const {type_} *{called} = {self._address(value)};"
        text = value.value.removeprefix(f"({type_})") if value.value.startswith(f"({type_}){{") else value.value
        return f"{'const ' if local.assigned == 1 else ''}{type_} {called} = {text};"

    def _loop(self, one: ast.For) -> list[str]:
        over = f"a loop over {ast.unparse(one.iter)[:40]}"
        match one:
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=[_] | [_, _] as args)):
                ends = [self._expression(end) for end in args]
            case _:
                raise self.refused(one, over, "write for i in range(n), n a whole number that is fixed")
        if one.orelse:
            raise self.refused(one, "an else of a loop", "put it behind the loop")
        if any(end.kind is not int for end in ends):
            raise self.refused(one, over, "count up to a whole number that is fixed")
        self.kinds[name] = int
        i, begin = identifier(name), ends[0].text if ends[1:] else "0"
        head = f"for (int {i} = {begin}; {i} < {ends[-1].within(SUM)}; ++{i}) {{"
        return [head, *self._block(one.body), "}"]

    def _returned(self, one: ast.Return, value: ast.expr) -> str:
        hint = hints_of(self.function).get("return")
        if not isinstance(value, ast.Tuple):
            found, wanted = self._expression(value), annotated(hint)
            kind = wanted if wanted and is_number(wanted) and is_number(found.kind) else found.kind
            if joined(found.kind, kind) != kind or self.result not in (None, kind):
                given, do = f"a result that is {said(found.kind)}", "return the kind that is annotated"
                raise self.refused(one, given, do, said(self.result or kind))
            self.result = kind
            return found.value
        parts = [self._expression(part) for part in value.elts]
        hints = [annotated(part) for part in getattr(hint, "__args__", ())] or [None] * len(parts)
        kinds = [want if want and is_number(want) else part.kind for want, part in zip(hints, parts, strict=True)]
        if self.result is None:
            fields = [_name_of(part) or f"item{k}" for k, part in enumerate(value.elts)]
            if len(set(fields)) < len(fields):
                fields = [f"item{k}" for k in range(len(fields))]
            self.result = Several(self.name, tuple(zip(fields, kinds, strict=True)))
        elif not isinstance(self.result, Several) or [kind for _, kind in self.result.fields] != kinds:
            what = "a result of another kind than the one before"
            raise self.refused(one, what, "return the same kinds everywhere")
        fields = [field for field, _ in self.result.fields]
        return self._literal(self.result, dict(zip(fields, parts, strict=True)))

    # ---- expressions ----

    def _truth(self, node: ast.expr) -> str:
        """A condition."""
        found = self._expression(node)
        if not is_number(found.kind):
            raise self.refused(node, f"{ast.unparse(node)[:40]} as a condition", "compare numbers")
        if found.kind is bool:
            return found.value
        return f"{found.within(LESS)} != {self.unit.style.number(0.0) if found.kind is float else '0'}"

    def _expression(self, node: ast.expr) -> Expression:
        method = getattr(self, f"_on_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.outside(node)
        found: Expression = method(node)
        return found

    def _on_constant(self, node: ast.Constant) -> Expression:
        if not isinstance(node.value, bool | int | float):
            raise self.refused(node, f"{node.value!r}", "use numbers; an IntEnum has names for them")
        return self.unit.number(node.value)

    def _on_name(self, node: ast.Name) -> Expression:
        name = node.id
        if name in self.kinds:
            fixed = name not in self.locals or self.locals[name].assigned == 1
            return Expression(identifier(name), self.kinds[name], ATOM, True, name in self.pointers, fixed)
        if name in self.locals:
            raise self.refused(node, f"{name}, which is read before it is set,", "set it first")
        return self._global(node)

    def _on_attribute(self, node: ast.Attribute) -> Expression:
        if not self._is_local(node) and not is_named(self._looked_up(node.value)):
            return self._global(node)
        whole = self._expression(node.value)
        if node.attr == "value" and is_enum(whole.kind):
            return Expression(f"(int64_t){whole.within(UNARY)}", int, UNARY)
        kinds = dict(whole.kind.fields) if isinstance(whole.kind, Struct) else {}
        if node.attr not in kinds:
            raise self.refused(node, ast.unparse(node), "name a field of a NamedTuple", ", ".join(kinds))
        return whole.field(identifier(node.attr), kinds[node.attr])

    def _global(self, node: ast.Name | ast.Attribute) -> Expression:
        value = self._looked_up(node)
        if isinstance(value, IntEnum):
            return self.unit.member(value)
        if kind_of(value) is None:
            what = f"{ast.unparse(node)}, {type(value).__name__},"
            raise self.refused(node, what, "use numbers, tuples of them and kernels")
        if isinstance(node, ast.Name):
            return self.unit.constant(self.source.file, node.id, value)
        owner = self._looked_up(node.value)
        if isinstance(owner, ModuleType) and owner not in (math, np):
            return self.unit.constant(owner.__file__ or "", node.attr, value)
        return self.unit.number(float(value) if isinstance(owner, ModuleType) else value)

    def _looked_up(self, node: ast.expr) -> Any:
        """What a name outside the function stands for."""
        if isinstance(node, ast.Attribute):
            owner = self._looked_up(node.value)
            if not hasattr(owner, node.attr):
                raise self.refused(node, ast.unparse(node), "correct the name")
            return getattr(owner, node.attr)
        if not isinstance(node, ast.Name):
            raise self.outside(node)
        if node.id in self.function.__globals__:
            return meant(self.function, node.id, dict(self.parts))
        free = inspect.getclosurevars(self.function).nonlocals
        if node.id not in free and not hasattr(builtins, node.id):
            raise self.refused(node, f"{node.id}, which is not defined,", "correct the name")
        return free[node.id] if node.id in free else getattr(builtins, node.id)

    def _is_local(self, node: ast.expr) -> bool:
        """True if an attribute is of a value, and not of a module or class."""
        while isinstance(node, ast.Attribute):
            node = node.value
        return not isinstance(node, ast.Name) or node.id in self.kinds or node.id in self.locals

    def _on_subscript(self, node: ast.Subscript) -> Expression:
        whole, at = self._expression(node.value), self._expression(node.slice)
        if at.kind is not int or not isinstance(whole.kind, Row):
            raise self.refused(node, ast.unparse(node), "take one number of a tuple of numbers, by a whole number")
        return Expression(f"{whole.field('at', None).text}[{at.text}]", whole.kind.of, place=True, fixed=whole.fixed)

    def _on_unaryop(self, node: ast.UnaryOp) -> Expression:
        inner = self._expression(node.operand)
        match node.op:
            case _ if not is_number(inner.kind):
                raise self.outside(node)
            case ast.Not():
                text = f"!{inner.within(ATOM)}" if inner.kind is bool else f"!({self._truth(node.operand)})"
                return Expression(text, bool, UNARY)
            case ast.USub():
                text = inner.within(UNARY)
                return Expression(
                    f"-({text})" if text.startswith("-") else f"-{text}", float if inner.kind is float else int, UNARY
                )
            case ast.UAdd():
                return inner
            case ast.Invert() if inner.kind is int:
                return Expression(f"~{inner.within(UNARY)}", int, UNARY)
        raise self.outside(node)

    def _on_binop(self, node: ast.BinOp) -> Expression:
        if type(node.op) not in _OPERATORS:
            raise self.outside(node.op, node)
        if isinstance(node.op, ast.Add) and isinstance(node.left, ast.Tuple) and len(node.left.elts) == 1:
            return self._shifted(node, node.left.elts[0])
        left, right = self._expression(node.left), self._expression(node.right)
        for one in (left, right):
            if not is_number(one.kind):
                raise self.refused(node, f"{ast.unparse(node)[:40]} of {said(one.kind)}", "compute with numbers")
        sign, level = _OPERATORS[type(node.op)]
        whole = float not in (left.kind, right.kind)
        if level == BITS:
            if not whole:
                raise self.refused(node, f"{ast.unparse(node)[:40]} of float", "use whole numbers for sets of bits")
            wide = left.kind is not int or sign == "<<"
            first = f"(int64_t){left.within(UNARY)}" if wide else left.within(SUM)
            return Expression(f"{first} {sign} {right.operand(SUM)}", int, BITS)
        first = left.operand(level)
        if sign == "/" and whole:
            first = f"({self.unit.style.real}){left.operand(UNARY)}"
        kind = int if whole and sign != "/" else float
        return Expression(f"{first} {sign} {right.operand(level + 1)}", kind, level)

    def _shifted(self, node: ast.BinOp, new: ast.expr) -> Expression:
        """``(newest,) + past[:-1]``, a row that moves on by one place."""
        if not (isinstance(node.right, ast.Subscript) and ast.unparse(node.right.slice) == ":-1"):
            raise self.outside(node.right)
        newest, past = self._expression(new), self._expression(node.right.value)
        if not isinstance(past.kind, Row) or newest.kind != past.kind.of:
            raise self.outside(node)
        return Expression(f"{self.unit.shifted(past.kind)}({newest.value}, {self._address(past)})", past.kind)

    def _on_compare(self, node: ast.Compare) -> Expression:
        parts = [self._expression(one) for one in (node.left, *node.comparators)]
        found = []
        for (left, right), operator in zip(itertools.pairwise(parts), node.ops, strict=True):
            if type(operator) not in _OPERATORS:
                raise self.outside(operator, node)
            if not (is_number(left.kind) and is_number(right.kind)):
                raise self.refused(node, ast.unparse(node)[:40], "compare numbers")
            sign, level = _OPERATORS[type(operator)]
            write = Expression.within if left.kind == right.kind else Expression.operand
            found.append(Expression(f"{write(left, SUM)} {sign} {write(right, SUM)}", bool, level))
        if len(found) == 1:
            return found[0]
        return Expression(" && ".join(one.within(EQUAL) for one in found), bool, AND)

    def _on_boolop(self, node: ast.BoolOp) -> Expression:
        level, sign = (AND, "&&") if isinstance(node.op, ast.And) else (OR, "||")
        parts = [self._expression(one) for one in node.values]
        for one, part in zip(node.values, parts, strict=True):
            if part.kind is not bool:
                what = f"{ast.unparse(one)[:40]}, {said(part.kind)}, beside and/or"
                raise self.refused(one, what, "compare it: x != 0.0", "bool")
        texts = [part.within(level if part.level == level else EQUAL) for part in parts]
        return Expression(f" {sign} ".join(texts), bool, level)

    def _on_ifexp(self, node: ast.IfExp) -> Expression:
        asked, left, right = (self._expression(one) for one in (node.test, node.body, node.orelse))
        kind = joined(left.kind, right.kind)
        if kind is None:
            what = f"a choice between {said(left.kind)} and {said(right.kind)}"
            raise self.refused(node, what, "let both sides be of one kind")
        condition = asked.within(OR) if asked.kind is bool else self._truth(node.test)
        return Expression(f"{condition} ? {left.within(OR)} : {right.within(CHOICE)}", kind, CHOICE)

    def _on_tuple(self, node: ast.Tuple) -> Expression:
        parts = [self._expression(one) for one in node.elts]
        if len({part.kind for part in parts}) != 1:
            raise self.refused(node, ast.unparse(node)[:40], "use a NamedTuple")
        kind = Row(parts[0].kind, len(parts))
        return Expression(f"({self.unit.type(kind)}){{{{{', '.join(part.value for part in parts)}}}}}", kind)

    # ---- calls ----

    def _on_call(self, node: ast.Call) -> Expression:
        if self._is_local(node.func):
            word = ast.unparse(node.func)
            do = "call its class with all fields" if word.endswith("._replace") else "call kernels by their names"
            raise self.refused(node, f"{word}()", do)
        called = self._looked_up(node.func)
        if any(one.arg is None for one in node.keywords):
            raise self.refused(node, "two stars in a call", "name the values one by one")
        if is_tuple_class(called):
            return self._construct(node, called)
        if is_kernel(called):
            return self._called(node, called)
        known = any(called is one for one in (*_LIBM, *_TRUTHS, min, max, float, bool, int))
        given = self._arguments(node) if known and not node.keywords else []
        what, do = f"{ast.unparse(node.func)}()", self._instead(called)
        for one in given:
            if not is_number(one.kind):
                raise self.refused(node, f"{what} of {said(one.kind)}", "call it with numbers", "float")
        if given and (found := self._built_in(node, called, given)):
            return found
        raise self.refused(node, what, do, "a kernel, or a function of the subset")

    def _built_in(self, node: ast.Call, called: Any, given: list[Expression]) -> Expression | None:
        """A call of Python's own functions and of libm's, with numbers; None where their count is wrong."""
        texts = ", ".join(one.value for one in given)
        if called in (min, max):
            return self._extreme(called.__name__, given) if given[1:] else None
        if called in _LIBM:
            return Expression(f"{self.unit.style.libm(_LIBM[called])}({texts})", float)
        if given[1:]:
            return None
        if called in _TRUTHS:
            return Expression(f"{_TRUTHS[called]}({texts})", bool)
        if called is bool:
            return Expression(self._truth(node.args[0]), bool, EQUAL)
        if called is int and given[0].kind is float:
            raise self.refused(node, "int() of a float", "use floor of bowden.core.kernel, which gives a float")
        if given[0].kind is called:
            return given[0]
        return Expression(f"({self.unit.type(called)}){given[0].within(UNARY)}", called, UNARY)

    def _extreme(self, name: str, given: list[Expression]) -> Expression:
        kind = functools.reduce(joined, (one.kind for one in given))
        helper = self.unit.helper(name if kind is float else f"{name}_int")
        text = functools.reduce(lambda text, one: f"{helper}({text}, {one.value})", given[1:], given[0].value)
        return Expression(text if kind in (float, int) else f"({self.unit.type(kind)}){text}", kind)

    def _instead(self, called: Any) -> str:
        """What to write in place of a call."""
        name = getattr(called, "__name__", "")
        if isinstance(called, FunctionType):
            return _CALLS.get(called, f"mark {name} with @kernel")
        if name in {"sqrt", "exp", "sin", "cos", "log", "tanh", "floor"}:
            return f"import {name} from bowden.core.kernel"
        return _CALLS.get(called, "write it with what docs/own_law.md names")

    def _bound(self, node: ast.Call, called: Any) -> dict[str, Expression]:
        """Parameter → what it is given."""
        signature = inspect.signature(called)
        by_name = {one.arg or "": self._expression(one.value) for one in node.keywords}
        try:
            bound = signature.bind(*self._arguments(node), **by_name)
        except TypeError as error:
            raise self.refused(node, f"{called.__name__}(): {error};", "correct the call") from None
        for one in signature.parameters.values():
            if one.name not in bound.arguments:
                kind = kind_of(one.default)
                bound.arguments[one.name] = Expression(self.unit.literal(one.default, kind), kind)
        return {name: bound.arguments[name] for name in signature.parameters}

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
                raise self.refused(node, "a star in a call", "name the values one by one")
        return found

    def _construct(self, node: ast.Call, made: Any) -> Expression:
        given, hints = self._bound(node, made), field_kinds(made)
        kinds = [
            (name, self._wanted(node, f"{name} of {made.__name__}", one, hints[name])) for name, one in given.items()
        ]
        kind = Struct(made, tuple(kinds))
        return Expression(self._literal(kind, given), kind)

    def _wanted(self, node: ast.AST, what: str, given: Expression, wanted: Kind) -> Kind:
        """The kind of what is handed over: that which is annotated, where one is."""
        kind = given.kind
        if wanted is None:
            return kind
        if kind != wanted and not (is_number(kind) and wanted in (float, int) and joined(kind, wanted) == wanted):
            raise self.refused(node, f"{what}, {said(kind)},", "give it the kind that is annotated", said(wanted))
        return wanted

    def _literal(self, kind: Kind, given: dict[str, Expression]) -> str:
        fields = ", ".join(f".{identifier(name)} = {one.value}" for name, one in given.items())
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
        given, hints, kinds = self._bound(node, called), hints_of(called), []
        for name, one in given.items():
            wanted = annotated(hints.get(name))
            if (
                isinstance(wanted, Struct)
                and isinstance(one.kind, Struct)
                and set(wanted.fields) <= set(one.kind.fields)
            ):
                wanted = None  # Python asks for fields, and not for a class
            kinds.append(self._wanted(node, f"{name} of {called.__name__}()", one, wanted))
        name, result = self.unit.call(called, tuple(kinds))
        if name in {identifier(local) for local in (*self.locals, *self.parameters)}:
            raise self.refused(node, f"a local with the name of {name}(), which it calls,", "rename the local")
        pairs = zip(given.values(), kinds, strict=True)
        texts = ", ".join(one.value if is_number(kind) else self._address(one) for one, kind in pairs)
        return Expression(f"{name}({texts})", result)


def _nodes(body: Sequence[ast.AST]) -> list[ast.AST]:
    return [node for one in body for node in ast.walk(one)]


def _names(body: Sequence[ast.AST]) -> list[ast.Name]:
    return [node for node in _nodes(body) if isinstance(node, ast.Name)]


def _ends(body: list[ast.stmt]) -> bool:
    """True if every way through a block returns."""
    last = body[-1] if body else None
    return isinstance(last, ast.Return) or (isinstance(last, ast.If) and _ends(last.body) and _ends(last.orelse))


def _name_of(part: ast.expr) -> str:
    """What a result is called: the local that it is, or the class that makes it; nothing for what has no name."""
    if isinstance(part, ast.Call) and isinstance(part.func, ast.Name) and part.func.id[0].isupper():
        return snake_case(part.func.id).lower()
    return part.id if isinstance(part, ast.Name) else ""
