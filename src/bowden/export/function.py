"""One kernel as one function of C: statements and expressions in their order, under their names."""

import ast
import builtins
import functools
import inspect
import itertools
import math
import typing
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from types import FunctionType
from typing import Any

import numpy as np

from bowden.core.errors import ParameterError
from bowden.core.kernel_content import global_value, is_kernel, reaching
from bowden.core.nested import is_named
from bowden.core.primitives import cos, exp, floor, log, power, sin, sqrt, tanh
from bowden.export.source import KernelSource, operators
from bowden.export.unit import (
    Kind,
    Row,
    Struct,
    Unit,
    hints_of,
    identifier,
    is_enum,
    is_number,
    joined,
    kind_name,
    kind_of,
    snake_case,
    unused,
)

CHOICE, OR, AND, BITS, EQUAL, LESS, SUM, PRODUCT, UNARY, ATOM = range(10)
"""How strongly an operator of C binds; those of bits stand in brackets beside one another."""

_BY_LEVEL: dict[int, dict[type[ast.AST], str]] = {
    OR: {ast.Or: "||"},
    AND: {ast.And: "&&"},
    BITS: {ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.LShift: "<<", ast.RShift: ">>"},
    EQUAL: {ast.Eq: "==", ast.NotEq: "!="},
    LESS: {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="},
    SUM: {ast.Add: "+", ast.Sub: "-"},
    PRODUCT: {ast.Mult: "*", ast.Div: "/"},
    UNARY: {ast.USub: "-", ast.UAdd: "+", ast.Invert: "~", ast.Not: "!"},
}
_OPERATORS = {kind: (sign, level) for level, signs in _BY_LEVEL.items() for kind, sign in signs.items()}
_BUILT_IN: dict[Any, tuple[str, int, Kind]] = {
    **{one: (one.__name__, 1, float) for one in (exp, sin, cos, log, sqrt, tanh, floor)},
    **{abs: ("fabs", 1, float), power: ("pow", 2, float), math.copysign: ("copysign", 2, float)},
    **{one: (one.__name__, 1, bool) for one in (math.isnan, math.isfinite, math.isinf)},
    **{one: ("", 1, one) for one in (float, bool, int)},
}
"""Function that takes numbers → its name in C, how many it takes, and the kind of its result; a kind converts."""
_INSTEAD: dict[Any, str] = {
    np.where: "use a if condition else b",
    math.pow: "import power from bowden.core.kernel",
    math.fabs: "use abs(x)",
    sum: "add the terms up",
    **dict.fromkeys(_BUILT_IN, "give it numbers, in their order"),
}
"""Function → what to write in its place."""
_LOCAL = object()


@dataclass(frozen=True)
class Expression:
    """A piece of C."""

    text: str
    kind: Kind
    level: int = ATOM
    fixed: bool = False
    """Whether it stands in memory, and stays as it is."""

    def within(self, level: int) -> str:
        """Its text as an operand."""
        return self.text if self.level >= level else f"({self.text})"

    def operand(self, level: int) -> str:
        """Its text as an operand of arithmetic, or of a comparison with another kind."""
        return f"(int){self.within(UNARY)}" if is_enum(self.kind) else self.within(level)

    def field(self, name: str, kind: Kind) -> "Expression":
        """A part of it."""
        text = f"{self.text[1:]}->" if self.text.startswith("*") else f"{self.within(ATOM)}."
        return Expression(f"{text}{identifier(name)}", kind, fixed=self.fixed)

    def address(self, type_: str) -> str:
        """A pointer to it; what has no place in memory gets one."""
        if self.text.startswith("*"):
            return self.text[1:]
        placed = self.level == ATOM and ("(" not in self.text or self.text.endswith("}"))
        return f"&{self.text}" if placed else f"({type_}[]){{{self.text}}}"


def called(unit: Unit, function: Any, kinds: tuple[Kind, ...]) -> tuple[str, Kind]:
    """The name of a kernel for arguments of these kinds, and the kind of its result; it is written if it is new."""
    key = function, kinds, reaching(function, unit.module.parts)
    if key not in unit.made:
        name = identifier(function.__name__)
        if name in unit.functions or name in unit.helpers:
            name = f"{function.__module__.rpartition('.')[2]}_{name}"
        name = unused(name, {*unit.functions, *(f"{unit.prefix}_{one}" for one in unit.module.functions)})
        unit.functions[name], unit.made[key] = "", None
        made = Function(unit, function, kinds, name)
        text = made.written()
        del unit.functions[name]  # so that it comes behind those that it calls
        unit.functions[name], unit.made[key] = text, (name, made.result)
    if (found := unit.made[key]) is None:
        where = f"{function.__code__.co_filename}, line {function.__code__.co_firstlineno}"
        do = "write it as a loop over a fixed range: for i in range(n)"
        raise ParameterError(f"{where}: {function.__name__} calls itself", do=do)
    return found


class Function:
    """A kernel of a unit, for arguments of certain kinds, under its name in C."""

    def __init__(self, unit: Unit, function: FunctionType, kinds: tuple[Kind, ...], name: str) -> None:
        self.unit, self.function, self.name = unit, function, name
        self.source = KernelSource(function)
        self.refused = self.source.refused
        self.kinds: dict[str, Kind] = dict(zip(inspect.signature(function).parameters, kinds, strict=True))
        self.parameters = tuple(self.kinds)
        self.result: Kind = None
        body, parts = self.source.body, dict(reaching(function, unit.module.parts))
        self.used, self.assigned = _names(body), _names(body, ast.Store)
        """Name → how often it stands in the function, and how often it is assigned."""
        loops = [node for one in body for node in ast.walk(one) if isinstance(node, ast.For)]
        self.counters = _names((loop.target for loop in loops), ast.Store)
        self.declared = set(self.parameters)
        self.pointers = {name for name, kind in self.kinds.items() if not is_number(kind)}
        """Arguments that are handed over as pointers, and locals that are another name of what stands elsewhere."""
        self._outside = vars(builtins) | {name: global_value(function, name, parts) for name in function.__globals__}

    def written(self) -> str:
        """The whole function."""
        body = self.source.body
        lines = self._block(body)
        if not _ends(body):
            raise self.refused(body[-1], "behind which there is a way without a result", "add a return at its end")
        given = ", ".join(map(self._parameter, self.parameters)) or "void"
        head = f"static inline {self.unit.type(self.result)} {self.name}({given})"
        ignored = [f"    (void){identifier(name)};" for name in self.parameters if name not in self.used]
        return "\n".join([*self.source.docstring(), head, "{", *ignored, *lines, "}"])

    def _parameter(self, name: str) -> str:
        const = "" if name in self.assigned else "const "
        return f"{const}{self.unit.type(self.kinds[name])} {'*' if name in self.pointers else ''}{identifier(name)}"

    # ---- statements ----

    def _block(self, body: list[ast.stmt]) -> list[str]:
        """The lines of a block, one step further in than what it stands in."""
        lines: list[str] = []
        for k, one in enumerate(body):
            above, opened = self.source.above(one), self._opened(one)
            self.declared.update(opened)
            made = self._statement(one)
            if k and (self.source.is_blank_after(body[k - 1]) or above):
                lines.append("")
            lines += [*above, *(f"{self.unit.type(self.kinds[name])} {identifier(name)};" for name in opened), *made]
        return [f"    {line}" if line else "" for line in lines]

    def _opened(self, one: ast.stmt) -> list[str]:
        """The locals to be declared before a statement: set within it, where no block of it has them to itself.

        The block of a loop has not what one pass may leave to the next.
        """
        if not isinstance(one, ast.If | ast.For):
            return []
        own = {name for block in (one.body, one.orelse) for name, n in _names(block).items() if n == self.used[name]}
        if isinstance(one, ast.For):
            own = {name for name in own if _begins(one.body, name)}
        return sorted(_names([one], ast.Store).keys() - self.declared - own - self.counters.keys())

    def _statement(self, one: ast.stmt) -> list[str]:
        match one:
            case ast.Assign(targets=[target], value=value) | ast.AnnAssign(target=target, value=ast.expr() as value):
                return self._assign(target, value)
            case ast.AugAssign(target=ast.Name(id=name) as target):
                sum_ = ast.copy_location(ast.BinOp(ast.Name(name, ast.Load()), one.op, one.value), one)
                return self._assign(target, ast.fix_missing_locations(sum_))
            case ast.If():
                return [*self._if(one), "}"]
            case ast.For():
                return self._loop(one)
            case ast.Return(value=ast.expr() as value):
                return [f"return {self._returned(one, value)};"]
            case ast.Pass() | ast.Expr(value=ast.Constant()):
                return []
        raise self.refused(one)

    def _if(self, one: ast.If, before: str = "") -> list[str]:
        lines = [f"{before}if ({self._number(one.test, truth=True).text}) {{"]
        lines += [f"    {line}" for line in self.source.above(one)] if before else []
        lines += self._block(one.body)
        match one.orelse:
            case []:
                return lines
            case [ast.If() as other] if not self._opened(other):
                return [*lines, *self._if(other, "} else ")]
        return [*lines, "} else {", *self._block(one.orelse)]

    def _loop(self, one: ast.For) -> list[str]:
        ends: list[Expression] = []
        match one:
            case ast.For(target=ast.Name(id=name), orelse=[], iter=ast.Call(func=ast.Name(id="range"), args=args)):
                ends = [self._expression(end) for end in args]
        if len(ends) not in (1, 2) or any(end.kind is not int for end in ends):
            raise self.refused(one, "", "write for i in range(n), n a whole number that is fixed, and no else")
        if name in self.parameters or self.assigned[name] > self.counters[name]:
            raise self.refused(one.target, "which counts a loop and is another local", "give it another name")
        self.kinds[name], i = int, identifier(name)
        begin = ends[0].text if ends[1:] else "0"
        lines = [f"for (int {i} = {begin}; {i} < {ends[-1].within(SUM)}; ++{i}) {{", *self._block(one.body), "}"]
        del self.kinds[name]
        return lines

    def _assign(self, target: ast.expr, value: ast.expr) -> list[str]:
        if isinstance(target, ast.Name):
            return [self._set(target, self._expression(value))]
        names = [one for one in getattr(target, "elts", []) if isinstance(one, ast.Name)]
        if not isinstance(target, ast.Tuple) or len(names) < len(target.elts):
            raise self.refused(target)
        if isinstance(value, ast.Tuple) and len(value.elts) == len(names):
            for k, one in enumerate(names):
                if one.id in _names(value.elts[k + 1 :]):
                    raise self.refused(one, "which is set and read at once", "assign on lines of their own")
            return [self._set(*pair) for pair in zip(names, map(self._expression, value.elts), strict=True)]
        whole, lines = self._expression(value), []
        fields = getattr(whole.kind, "fields", ())
        if len(fields) != len(names):
            raise self.refused(value, f"as {len(names)} values", "name each of them")
        if "(" in whole.text:
            both = "_".join(identifier(one.id) for one in names)
            lines = [f"const {self.unit.type(whole.kind)} {both} = {whole.text};"]
            whole = Expression(both, whole.kind, fixed=True)
        return lines + [self._set(name, whole.field(*one)) for name, one in zip(names, fields, strict=True)]

    def _set(self, target: ast.Name, value: Expression) -> str:
        name = target.id
        if isinstance(value.kind, Struct) and not value.kind.made:
            raise self.refused(target, "which is several values", "give each value a name: a, b = f(x)")
        kind = self.kinds.setdefault(name, value.kind)
        if kind != value.kind and not (kind is float and value.kind is int):
            given = f"which is first {kind_name(kind)} and then {kind_name(value.kind)}"
            raise self.refused(target, given, "give the second one another name")
        if name in self.parameters and not is_number(kind):
            raise self.refused(target, "an argument that is set anew", "give it another name")
        if name in self.declared:
            return f"{identifier(name)} = {value.text};"
        self.declared.add(name)
        type_, once = self.unit.type(kind), self.assigned[name] == 1
        if once and value.fixed and not is_number(kind):
            self.pointers.add(name)
            return f"const {type_} *{identifier(name)} = {value.address(type_)};"
        const, brace = "const " if once else "", f"({type_}){{"
        text = value.text[len(brace) - 1 :] if value.text.startswith(brace) else value.text
        return f"{const}{type_} {identifier(name)} = {text};"

    def _returned(self, one: ast.Return, value: ast.expr) -> str:
        several = isinstance(value, ast.Tuple)
        nodes = value.elts if isinstance(value, ast.Tuple) else [value]
        parts = [self._expression(node) for node in nodes]
        if self.result is None:
            hint = hints_of(self.function).get("return")
            hints = [*(typing.get_args(hint) if several else [hint]), *[None] * len(nodes)]
            kinds = [kind_of(hint=want) or part.kind for part, want in zip(parts, hints, strict=False)]
            names = [*map(_name_of, nodes)]
            names = [name if names.count(name) == 1 and name else f"item{k}" for k, name in enumerate(names)]
            fields = tuple(zip(names, kinds, strict=True))
            self.result = Struct(f"{self.name}_result", fields) if several else kinds[0]
        made = {"": self.result} if getattr(self.result, "made", self) else dict(self.result.fields)
        wanted = [*made.values()]
        if [joined(*pair) for pair in itertools.zip_longest((part.kind for part in parts), wanted)] != wanted:
            expected = " and ".join(map(kind_name, wanted))
            raise self.refused(one, "which is another kind of result", "return the kinds that are annotated", expected)
        return self._literal(self.result, dict(zip(made, parts, strict=True))) if several else parts[0].text

    # ---- expressions ----

    def _expression(self, node: ast.expr) -> Expression:
        if any(type(one) not in _OPERATORS for one in operators(node)):
            raise self.refused(node)
        match node:
            case ast.Constant(value=value):
                if (kind := kind_of(value)) is None:
                    raise self.refused(node, "", "use numbers; an IntEnum has names for them")
                return Expression(self.unit.value(value, kind), kind)
            case ast.Name(id=name) if name in self.kinds:
                mark, level = ("*", UNARY) if name in self.pointers else ("", ATOM)
                return Expression(f"{mark}{identifier(name)}", self.kinds[name], level, self.assigned[name] < 2)
            case ast.Name(id=name) if name in self.assigned:
                raise self.refused(node, "which is read before it is set", "set it first")
            case ast.Name():
                return self._global(node, self.source.file)
            case ast.Attribute(value=value):
                if (owner := self._looked_up(value)) is _LOCAL or is_named(owner):
                    return self._field(node, self._expression(value))
                return self._global(node, "" if owner is math or owner is np else getattr(owner, "__file__", ""))
            case ast.Subscript(value=value, slice=place):
                row, at = self._expression(value), self._expression(place)
                if at.kind is not int or not isinstance(row.kind, Row):
                    raise self.refused(node, "", "take one number of a tuple of numbers, by a whole number")
                return Expression(f"{row.field('at', None).text}[{at.text}]", row.kind.of, fixed=row.fixed)
            case ast.UnaryOp(op=op, operand=operand):
                negated = isinstance(op, ast.Not)
                inner = self._number(operand, truth=negated)
                if isinstance(op, ast.Invert) and inner.kind is float:
                    raise self.refused(node)
                kind = bool if negated else float if inner.kind is float else int
                return Expression(f"{_OPERATORS[type(op)][0]}{inner.operand(ATOM)}", kind, UNARY)
            case ast.BinOp(op=ast.Add(), left=ast.Tuple(elts=new), right=past):
                return self._shifted(new, past)
            case ast.BinOp():
                return self._arithmetic(node)
            case ast.Compare(left=first, comparators=others):
                parts = [self._number(one) for one in (first, *others)]
                found = [self._compared(*three) for three in zip(parts, node.ops, parts[1:], strict=False)]
                text = " && ".join(one.within(EQUAL) for one in found)
                return found[0] if len(found) == 1 else Expression(text, bool, AND)
            case ast.BoolOp(op=op, values=values):
                sign, level = _OPERATORS[type(op)]
                parts = [self._number(one, truth=True) for one in values]
                texts = [part.within(level if part.level == level else EQUAL) for part in parts]
                return Expression(f" {sign} ".join(texts), bool, level)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                asked, left, right = self._number(test, truth=True), self._expression(body), self._expression(orelse)
                if (kind := joined(left.kind, right.kind)) is None:
                    both = f"{kind_name(left.kind)} and {kind_name(right.kind)}"
                    raise self.refused(node, both, "let both sides be of one kind")
                return Expression(f"{asked.within(OR)} ? {left.within(OR)} : {right.within(CHOICE)}", kind, CHOICE)
            case ast.Tuple(elts=elements):
                parts = [self._expression(one) for one in elements]
                if len({part.kind for part in parts}) != 1:
                    raise self.refused(node, "", "use a NamedTuple")
                kind = Row(parts[0].kind, len(parts))
                return Expression(f"({self.unit.type(kind)}){{{{{', '.join(part.text for part in parts)}}}}}", kind)
            case ast.Call():
                return self._call(node)
        raise self.refused(node)

    def _number(self, node: ast.expr, *, truth: bool = False) -> Expression:
        """A number that is computed with; or a truth."""
        found = self._expression(node)
        if not is_number(found.kind) or (truth and found.kind is not bool):
            do, wanted = ("compare numbers: x != 0.0", "bool") if truth else ("compute with numbers", "float")
            raise self.refused(node, f"which is {kind_name(found.kind)}", do, wanted)
        return found

    def _field(self, node: ast.Attribute, whole: Expression) -> Expression:
        if node.attr == "value" and is_enum(whole.kind):
            return Expression(f"(int64_t){whole.within(UNARY)}", int, UNARY)
        kinds = dict(getattr(whole.kind, "fields", ()))
        if node.attr not in kinds:
            raise self.refused(node, "", "name a field of a NamedTuple", ", ".join(kinds))
        return whole.field(node.attr, kinds[node.attr])

    def _global(self, node: ast.expr, file: str) -> Expression:
        """A constant of a file, by the name that it has there; of no file a number of `math`, or an enum's member."""
        value = self._looked_up(node)
        if (kind := kind_of(value)) is None:
            raise self.refused(node, f"which is {type(value).__name__}", "use numbers, tuples of them and kernels")
        if is_enum(kind) or not file:
            return Expression(self.unit.value(value, kind), kind)
        return Expression(self.unit.constant(file, ast.unparse(node).rpartition(".")[2], value), kind, fixed=True)

    def _looked_up(self, node: ast.expr) -> Any:
        """What a name outside the function stands for; `_LOCAL` for what is of a value within."""
        first, *more = ast.unparse(node).split(".")
        if not first.isidentifier() or first in self.kinds or first in self.assigned:
            return _LOCAL
        try:
            return functools.reduce(getattr, more, self._outside[first])
        except (KeyError, AttributeError):
            raise self.refused(node, "which is not defined", "correct the name") from None

    def _arithmetic(self, node: ast.BinOp) -> Expression:
        left, right = self._number(node.left), self._number(node.right)
        sign, level = _OPERATORS[type(node.op)]
        whole = float not in (left.kind, right.kind)
        if level == BITS:
            if not whole:
                raise self.refused(node, "of float", "use whole numbers for sets of bits")
            wide = left.kind is not int or sign == "<<"
            first = f"(int64_t){left.within(UNARY)}" if wide else left.within(SUM)
            return Expression(f"{first} {sign} {right.operand(SUM)}", int, BITS)
        first = f"({self.unit.real}){left.operand(UNARY)}" if sign == "/" and whole else left.operand(level)
        return Expression(f"{first} {sign} {right.operand(level + 1)}", int if whole and sign != "/" else float, level)

    def _shifted(self, new: list[ast.expr], moved: ast.expr) -> Expression:
        """``(newest,) + past[:-1]``, a row that moves on by one place."""
        match moved:
            case ast.Subscript(value=value, slice=ast.Slice() as part) if ast.unparse(part) == ":-1":
                newest, past = [self._expression(one) for one in new], self._expression(value)
                if isinstance(past.kind, Row) and [one.kind for one in newest] == [past.kind.of]:
                    type_, item, length = self.unit.type(past.kind), self.unit.type(past.kind.of), past.kind.length
                    helper = self.unit.helper(f"{type_}_shifted", type=type_, item=item, length=length)
                    return Expression(f"{helper}({newest[0].text}, {past.address(type_)})", past.kind)
        raise self.refused(moved)

    def _compared(self, left: Expression, operator: ast.cmpop, right: Expression) -> Expression:
        sign, level = _OPERATORS[type(operator)]
        write = Expression.within if left.kind == right.kind else Expression.operand
        return Expression(f"{write(left, SUM)} {sign} {write(right, SUM)}", bool, level)

    # ---- calls ----

    def _call(self, node: ast.Call) -> Expression:
        what = self._looked_up(node.func)
        if what is _LOCAL:
            anew = isinstance(node.func, ast.Attribute) and node.func.attr == "_replace"
            raise self.refused(node, "", "call its class with all fields" if anew else "call kernels by their names")
        if isinstance(what, type) and hasattr(what, "_fields"):
            given = self._given(node, what)
            kind = Struct(what.__name__, tuple((name, one.kind) for name, one in given.items()), what)
            return Expression(self._literal(kind, given), kind)
        if not is_kernel(what):
            return self._built_in(node, what)
        values = self._given(node, what).values()
        name, result = called(self.unit, what, tuple(one.kind for one in values))
        if name in {identifier(local) for local in (*self.assigned, *self.parameters)}:
            raise self.refused(node, "beside a local of its name", "rename the local")
        texts = (one.text if is_number(one.kind) else one.address(self.unit.type(one.kind)) for one in values)
        return Expression(f"{name}({', '.join(texts)})", result)

    def _built_in(self, node: ast.Call, what: Any) -> Expression:
        """A call of one of Python's own functions, or of libm's, with numbers."""
        extreme = what is min or what is max
        name, count, kind = _BUILT_IN.get(what, ("", 0, None)) if callable(what) else ("", 0, None)
        given = [self._number(one) for one in node.args] if (count or extreme) and not node.keywords else []
        if extreme and given[1:]:
            kind = functools.reduce(joined, (one.kind for one in given))
            name, type_ = (what.__name__, float) if kind is float else (f"{what.__name__}_int", int)
            helper = self.unit.helper(name, type=self.unit.type(type_), sign="<" if what is min else ">")
            text = functools.reduce(lambda text, one: f"{helper}({text}, {one.text})", given[1:], given[0].text)
            return Expression(text if kind in (float, int) else f"({self.unit.type(kind)}){text}", kind)
        if not count or len(given) != count:
            raise self.refused(node, "", _instead(what), "a kernel, or a function of the subset")
        if name:
            suffix = "f" if self.unit.single and kind is float else ""
            return Expression(f"{name}{suffix}({', '.join(one.text for one in given)})", kind)
        if kind is int and given[0].kind is float:
            raise self.refused(node, "of a float", "use floor of bowden.core.kernel, which gives a float")
        if given[0].kind is kind:
            return given[0]
        return Expression(f"({self.unit.type(kind)}){given[0].within(UNARY)}", kind, UNARY)

    def _given(self, node: ast.Call, what: Any) -> dict[str, Expression]:
        """Parameter → what a call gives it, as the kind that is annotated."""
        signature = inspect.signature(what)
        values, named = map(self._expression, node.args), {one.arg or "**": one.value for one in node.keywords}
        try:
            bound = signature.bind(*values, **{name: self._expression(one) for name, one in named.items()})
        except TypeError as error:
            raise self.refused(node, str(error), "correct the call") from None
        found, hints = {}, hints_of(what)
        for name, parameter in signature.parameters.items():
            default = kind_of(parameter.default)
            one = bound.arguments.get(name) or Expression(self.unit.literal(parameter.default, default), default)
            kind = kind_of(hint=hints.get(name)) or one.kind
            if isinstance(kind, Struct) and set(kind.fields) <= set(getattr(one.kind, "fields", ())):
                kind = one.kind  # Python asks for fields, and not for a class
            if joined(one.kind, kind) != kind:
                given = f"whose {name} is {kind_name(one.kind)}"
                raise self.refused(node, given, "give it the kind that is annotated", kind_name(kind))
            found[name] = replace(one, kind=kind)
        return found

    def _literal(self, kind: Kind, given: dict[str, Expression]) -> str:
        fields = ", ".join(f".{identifier(name)} = {one.text}" for name, one in given.items())
        return f"({self.unit.type(kind)}){{{fields}}}"


def _names(nodes: Iterable[ast.AST], context: type[ast.expr_context] = ast.expr_context) -> Counter[str]:
    """Name → how often it stands there, in all contexts or in one."""
    named = (node for one in nodes for node in ast.walk(one) if isinstance(node, ast.Name))
    return Counter(node.id for node in named if isinstance(node.ctx, context))


def _begins(block: list[ast.stmt], name: str) -> bool:
    """Whether a block sets a name before it reads it."""
    first = next(one for one in block if name in _names([one]))
    return isinstance(first, ast.Assign) and name not in _names([first.value])


def _ends(body: list[ast.stmt]) -> bool:
    """True if every way through a block returns."""
    last = body[-1] if body else None
    return isinstance(last, ast.Return) or (isinstance(last, ast.If) and _ends(last.body) and _ends(last.orelse))


def _name_of(part: ast.expr) -> str:
    """What a result is called: the local that it is, or the class that makes it; nothing for what has no name."""
    if isinstance(part, ast.Call) and isinstance(part.func, ast.Name) and part.func.id[0].isupper():
        return snake_case(part.func.id).lower()
    return part.id if isinstance(part, ast.Name) else ""


def _instead(what: Any) -> str:
    """What to write in place of a call."""
    name, other = getattr(what, "__name__", ""), "write it with what docs/own_law.md names"
    if isinstance(what, FunctionType):
        other = f"mark {name} with @kernel"
    elif any(name == one for one, _, _ in _BUILT_IN.values()):
        other = f"import {name} from bowden.core.kernel"
    return _INSTEAD.get(what, other)
