"""Operations as C: expressions that keep the order of the operations, and what none of C's functions does as NumPy."""

import math
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field

import numpy as np

from bowden.core.primitives import TANH
from bowden.export.graph import LIBM, Graph, Operation, evaluate
from bowden.export.sides import Course, JointChoice, course

_STRENGTH = (("sel",), ("or",), ("and",), ("eq", "ne"), ("lt", "le"), ("add", "sub"), ("mul", "div"), ("neg", "not"))
_LEVEL = {kind: level for level, kinds in enumerate(_STRENGTH) for kind in kinds}
_ATOM = len(_STRENGTH)
_SIGN = {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "add": "+", "sub": "-", "mul": "*", "div": "/"}
_JOIN = {"or": "||", "and": "&&"}
_TRUTH = ("eq", "ne", "lt", "le")
_WHOLE = {text: text[0] for text in ("0.0", "1.0", "0.0f", "1.0f")}
"""A truth that is known, as a number of C and as an int."""
_LONGEST = 72
"""A result that is used once stands where it is used, as long as the expression is no longer than this."""

_HELPERS = {
    "fmin": "{real} {name}({real} a, {real} b) {{ return a == a ? (b < a ? b : a) : b; }}",
    "fmax": "{real} {name}({real} a, {real} b) {{ return a == a ? (b > a ? b : a) : b; }}",
    "sign": "{real} {name}({real} a) {{ return a > 0 ? 1 : a < 0 ? -1 : a == 0 ? 0 : a; }}",
}
"""NumPy's own: which zero C's fmin and fmax give is the processor's choice, and C has no sign."""

_TANH = """\
/* to within 2 units in the last place, with every library the same: tanh(k*ln2/2 + b) by the addition theorem */
static {real} {name}({real} x)
{{
    union {{ {real} number; unsigned long long bits; }} s;
    const {real} size = fabs(x), near = size > {most} ? {most} : size;
    const {real} k = (near * {per_piece} + {shift}) - {shift};
    const {real} b = (near - k * {high}) - k * {low}, square = b * b;
    s.number = {shift} + 1023.0 - k; /* its last bits, in the exponent's place, are 2^-k */
    s.bits <<= 52;
    const {real} u = 1.0 - s.number, v = 1.0 + s.number, c = u / v, fourth = square * square;
    const {real} p = u * b * (1.0 + square * {p1} + fourth * {p2}), q = v * (1.0 + square * {q1} + fourth * {q2});
    const {real} r = v * (square * {r1} + fourth * {r2});
    return copysign(c + (1.0 - c * c) * (b + b * ((r - p) / (q + p))), x);
}}"""
"""`bowden.core.primitives.tanh` in double."""


@dataclass(frozen=True)
class Style:
    """How numbers and functions are written."""

    prefix: str
    """Of every name that C sees outside a function."""
    single: bool = False
    """float in place of double."""

    @property
    def real(self) -> str:
        """The type of a number."""
        return f"{self.prefix}_real"

    def number(self, value: float) -> str:
        """A constant; its decimals are the shortest that give back the same bits.

        >>> Style("x").number(0.1), Style("x", single=True).number(-1e-300), Style("x").number(math.inf)
        ('0.1', '-0.0f', 'INFINITY')
        """
        if math.isnan(value):
            return "NAN"
        with np.errstate(over="ignore", under="ignore"):
            rounded = np.float32(value) if self.single else np.float64(value)
        if np.isinf(rounded):
            return "INFINITY" if value > 0.0 else "-INFINITY"
        text = str(rounded)
        return (text if "." in text or "e" in text else f"{text}.0") + ("f" if self.single else "")

    def function(self, kind: str) -> str:
        """The name of a function of one or two numbers."""
        return f"{self.prefix}_{kind}" if self._own(kind) else f"{kind}f" if self.single else kind

    def helpers(self, kinds: Set[str]) -> list[str]:
        """The functions of our own that operations of these kinds call, in C."""
        constants = {name: self.number(value) for name, value in TANH.items()}
        return [
            (_TANH if kind == "tanh" else f"static {_HELPERS[kind]}").format(
                real=self.real, name=self.function(kind), **constants
            )
            for kind in (*_HELPERS, "tanh")
            if kind in kinds and self._own(kind)
        ]

    def _own(self, kind: str) -> bool:
        return kind in _HELPERS or (kind == "tanh" and not self.single)


@dataclass
class FunctionBody:
    """The inside of one function of C."""

    lines: list[str]
    texts: list[str]
    """Of each result."""
    constants: dict[str, str] = field(default_factory=dict)
    """What has to stand above the function: constants that a function of libm makes of other constants."""
    kinds: set[str] = field(default_factory=set)
    """Kinds of the operations in it."""


@dataclass(frozen=True)
class Written:
    """An expression, and how strongly its outermost operator binds."""

    text: str
    level: int
    truth: bool = False
    """Whether C takes it for an int, 0 or 1, or a sum or product of such."""


def body(
    graph: Graph,
    style: Style,
    leaf: Callable[[str], str],
    known: Mapping[str, float],
    named: Mapping[int, str],
    where: Callable[[Operation], str],
) -> FunctionBody:
    """Write the operations down in their order.

    Args:
        graph: the operations.
        style: of numbers and functions.
        leaf: the text of a leaf that is no literal.
        known: values of the leaves that are constants.
        named: operation → name of the variable that must hold its result.
        where: the text above the first line of a function of Python; empty for none.
    """
    values = evaluate(graph, known)
    folded = _folded(graph, values)
    uses = _uses(graph, folded)
    writer = _Writer(graph, style, leaf, named, where, values, folded, uses)
    writer.write(course(graph, uses, {i for i, value in enumerate(values) if value is not None}), "    ")
    made = writer.made
    made.texts = [writer.written[i].text for i in graph.results]
    return made


@dataclass
class _Writer:
    """Writes operations down; the fields are those of `body`."""

    graph: Graph
    style: Style
    leaf: Callable[[str], str]
    named: Mapping[int, str]
    where: Callable[[Operation], str]
    values: Sequence[float | None]
    folded: Set[int]
    uses: Sequence[int]
    written: dict[int, Written] = field(default_factory=dict)
    """Operation → its result."""
    made: FunctionBody = field(default_factory=lambda: FunctionBody([], []))
    last: str = ""
    """The text that stands above the lines at the end."""

    def write(self, course: Course, indent: str) -> None:
        """Operations in their order."""
        for item in course:
            if isinstance(item, JointChoice):
                self._choose(item, indent)
            else:
                self._operate(item, indent)

    def _choose(self, choice: JointChoice, indent: str) -> None:
        """Choices that ask the same, as one ``if``."""
        names = [self.named.get(i, f"t{i}") for i in choice.made]
        taken: list[list[Written]] = []
        set_here: list[int] = []
        self._say(choice.made[0], indent)
        lines, declared = self.made.lines, len(self.made.lines)
        lines.append(f"{indent}if ({_asked(self.written[choice.condition])}) {{")
        for k, side in enumerate(choice.sides, start=1):
            self.write(side, f"{indent}    ")
            taken.append([self.written[self.graph.operations[i].arguments[k]] for i in choice.made])
            set_here.append(len(lines))
            lines += ["" for _ in names]
            lines.append(f"{indent}}} else {{" if k == 1 else f"{indent}}}")
        declarations = []
        for at, (i, name) in enumerate(zip(choice.made, names, strict=True)):
            both = [results[at] for results in taken]
            truth = i not in self.named and _are_truths(*both)
            for start, one in zip(set_here, both, strict=True):
                text = _WHOLE.get(one.text, one.text) if truth else one.text
                lines[start + at] = f"{indent}    {name} = {text};"
            declarations.append(f"{indent}{'int' if truth else self.style.real} {name};")
            self.written[i] = Written(name, _ATOM, truth)
        lines[declared:declared] = declarations

    def _operate(self, i: int, indent: str) -> None:
        one, value, made = self.graph.operations[i], self.values[i], self.made
        expression = _expression(one, self.written, self.style, self.leaf)
        if i in self.folded and value is not None:
            name = f"{self.style.prefix}_{one.kind}_{self.style.number(float(value))}"
            name = "".join(c if c.isalnum() else "_" for c in name)
            made.constants[name] = (
                f"static const {self.style.real} {name} = {self.style.number(float(value))}; /* {expression.text} */"
            )
            expression = Written(name, _ATOM)
        elif i in self.named or (
            one.kind != "leaf" and (self.uses[i] > 1 or (self.uses[i] and len(expression.text) > _LONGEST))
        ):
            self._say(i, indent)
            name, truth = self.named.get(i, f"t{i}"), expression.truth and i not in self.named
            made.lines.append(f"{indent}const {'int' if truth else self.style.real} {name} = {expression.text};")
            expression = Written(name, _ATOM, truth)
        if i not in self.folded and (self.uses[i] or i in self.named):
            made.kinds.add(one.kind)
        self.written[i] = expression

    def _say(self, i: int, indent: str) -> None:
        """Where the next line comes from."""
        place = self.where(self.graph.operations[i])
        if place and place != self.last:
            self.made.lines.append(f"{indent}/* {place} */")
            self.last = place


def _folded(graph: Graph, values: Sequence[float | None]) -> set[int]:
    """Functions of libm of constants: worked out here, since the library on the chip may round otherwise."""
    return {i for i, one in enumerate(graph.operations) if one.kind in LIBM and values[i] is not None}


def _uses(graph: Graph, folded: set[int]) -> list[int]:
    """How often each result is used; what only a folded constant needs is not."""
    uses, seen, todo = [0] * len(graph.operations), set(graph.results), list(graph.results)
    while todo:
        i = todo.pop()
        for j in () if i in folded else graph.operations[i].arguments:
            uses[j] += 1
            if j not in seen:
                seen.add(j)
                todo.append(j)
    return uses


def _asked(condition: Written) -> str:
    """A condition, as C asks it."""
    plain = condition.truth and condition.level not in (_LEVEL["sel"], _LEVEL["add"], _LEVEL["mul"])
    return condition.text if plain else f"{_in(condition, _LEVEL['lt'])} != 0"


def _are_truths(*sides: Written) -> bool:
    """Whether a choice between these is a truth."""
    return all(side.truth or side.text in _WHOLE for side in sides) and any(side.truth for side in sides)


def _expression(one: Operation, written: Mapping[int, Written], style: Style, leaf: Callable[[str], str]) -> Written:
    arguments = [written[i] for i in one.arguments]
    if one.kind == "leaf":
        literal = one.leaf.removeprefix("literal ")
        text = style.number(float.fromhex(literal)) if literal != one.leaf else leaf(one.leaf)
        return Written(text, _LEVEL["neg"] if text.startswith("-") else _ATOM)
    level = _LEVEL.get(one.kind, _ATOM)
    if one.kind == "sel":
        condition, *sides = arguments
        a, b = (_in(side, _LEVEL["or"]) for side in sides)
        truth = _are_truths(*sides)
        if truth:
            a, b = _WHOLE.get(a, a), _WHOLE.get(b, b)
        return Written(f"{_asked(condition)} ? {a} : {b}", level, truth)
    if one.kind in ("neg", "not"):
        return Written(f"{'!' if one.kind == 'not' else '-'}{_in(arguments[0], _ATOM)}", level, one.kind == "not")
    if one.kind in _JOIN:  # one within the other stands in brackets, as compilers ask for
        parts = (_in(part, level if part.level == level else _LEVEL["eq"]) for part in arguments)
        return Written(f" {_JOIN[one.kind]} ".join(parts), level, truth=True)
    if one.kind in _SIGN:
        truth = one.kind in _TRUTH or all(argument.truth for argument in arguments)
        if one.kind == "div" and truth:  # C would divide whole numbers
            arguments, truth = (
                [Written(f"({style.real}){_in(arguments[0], _ATOM)}", _LEVEL["neg"]), arguments[1]],
                False,
            )
        # to the left an operator of the same strength needs no brackets, since C takes both from left to right
        left, right = (_LEVEL["add"],) * 2 if one.kind in _TRUTH else (level, level + 1)
        return Written(f"{_in(arguments[0], left)} {_SIGN[one.kind]} {_in(arguments[1], right)}", level, truth)
    return Written(f"{style.function(one.kind)}({', '.join(argument.text for argument in arguments)})", _ATOM)


def _in(inner: Written, least: int) -> str:
    return inner.text if inner.level >= least else f"({inner.text})"
