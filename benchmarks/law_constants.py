"""Which constants of our law matter: each halved and doubled, over six scenarios and development cells.

``python benchmarks/law_constants.py 400``: cells; those that were begun and not finished go on. The law's files are
copied with every constant made a gain, so that all variants are one compiled law.
"""

import ast
import importlib
import math
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import bowden.control.our_law as ours
from bowden.control.knowledge import configured
from bowden.control.law import Law
from bowden.control.laws import bowden as declaration
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import RADIANS
from bowden.models.cable.sheath_path import constant_bend, random_bend
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.bench import default_bench
from bowden.plants.presets.suit import suit
from bowden.sim.many import simulate_many
from bowden.sim.run import Case
from bowden.sim.suit_runs import DRIVE_INTEGRAL
from kept import Kept
from measure import table
from unseen_cells import DURATION, case_of, draw

COPY, OLD, FACTORS = "law_with_constants_as_gains", "bowden.control.our_law", (0.5, 2.0)


class AsGains(ast.NodeTransformer):
    """Kernels that take each constant from the gains, which all of them are given as their last argument."""

    def __init__(self, constants: Mapping[str, float], kernels: Mapping[str, bool]) -> None:
        self.constants, self.kernels = constants, kernels

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        if not self.kernels[node.name]:
            node.args.args.append(ast.arg("gains", ast.Name("BowdenGains", ast.Load())))
        node.body = [self.visit(one) for one in node.body]
        return node

    def visit_Call(self, node: ast.Call) -> ast.Call:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and self.kernels.get(node.func.id) is False:
            node.args.append(ast.Name("gains", ast.Load()))
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id not in self.constants:
            return node
        return ast.Attribute(ast.Name("gains", ast.Load()), f"c_{node.id}", ast.Load())


def with_constants_as_gains() -> tuple[Law, list[str]]:
    """Our law of which each constant is a gain, and the names of these."""
    into, constants = Path(tempfile.mkdtemp()) / COPY, dict[str, float]()
    into.mkdir()
    files = [*Path(ours.__path__[0]).glob("*.py"), Path(declaration.__file__)]
    trees = {file.name: ast.parse(file.read_text(encoding="utf-8")) for file in files}
    nodes = [node for name, tree in trees.items() if name != "bowden.py" for node in tree.body]
    for node in nodes:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant | ast.Tuple):
            value, to = ast.literal_eval(node.value), ast.unparse(node.targets[0]).strip("()").split(", ")
            constants |= dict(zip(to, value if len(to) > 1 else [value], strict=True))
    made = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    kernels = {kernel.name: any(one.arg == "gains" for one in kernel.args.args) for kernel in made}
    for name, tree in trees.items():
        if name == "gains.py":
            (gains,) = (node for node in tree.body if isinstance(node, ast.ClassDef))
            gains.body += ast.parse("\n".join(f"c_{one}: float = {value}" for one, value in constants.items())).body
        elif name != "bowden.py":
            change = AsGains(constants, kernels)
            tree.body = [change.visit(node) if isinstance(node, ast.FunctionDef) else node for node in tree.body]
            at = next((i for i, node in enumerate(tree.body) if isinstance(node, ast.ImportFrom)), len(tree.body))
            tree.body[at:at] = ast.parse(f"from {COPY}.gains import BowdenGains").body
        (into / name).write_text(ast.unparse(ast.fix_missing_locations(tree)).replace(OLD, COPY), encoding="utf-8")
    sys.path.insert(0, str(into.parent))
    law: Law = importlib.import_module(f"{COPY}.bowden").LAW
    return law, list(constants)


def scenarios(variants: tuple[Law, ...]) -> Iterator[tuple[str, Case, float]]:
    """Bench still, moved; a wide play behind a wrongly known servo; suit ringing, slow, fast; and how long each [s]."""
    bench, worn = default_bench(), suit()._replace(motor=suit().motor._replace(integral=DRIVE_INTEGRAL))
    known, rest = knowledge_of(bench), constant_bend(bench.sheath.bend)
    moved = random_bend(0.7 * bench.sheath.bend, 1.5 * bench.sheath.bend, 3.0, 40.0, 1)
    servo, slope = 0.75 * known.servo_frequency, 1.4 * bench.cable.slope
    wrong = known._replace(servo_frequency=servo, delay=2.0 * known.delay, slope=slope)
    wide = bench._replace(sheath=bench.sheath._replace(gap=3.0 * bench.sheath.gap))
    told = {"lag": 0.09, "bandwidth": 4.0}
    for name, plant, knows, gains, degrees, period, bend in (
        ("bench still", bench, known, {}, 70.0, 4.0, rest),
        ("bench moved", bench, known, {}, 70.0, 4.0, moved),
        ("wide, all wrong", wide, wrong, {}, 70.0, 4.0, rest),
        ("suit ringing", worn, knowledge_of(worn), {}, 90.0, 8.0, constant_bend(worn.sheath.bend)),
        ("suit slow", worn, knowledge_of(worn), told, 90.0, 20.0, constant_bend(worn.sheath.bend)),
        ("suit fast", worn, knowledge_of(worn), told, 90.0, 4.0, constant_bend(worn.sheath.bend)),
    ):
        laws = tuple(configured(law.with_gains(**gains), knows) for law in variants)
        yield name, Case(plant, laws, PeriodicMinimumJerk(0.0, degrees * RADIANS, period), bend, 1), 40.0


def costs(variants: tuple[Law, ...], cells: int, there: set[str]) -> Iterator[list[Any]]:
    """RMSE of each variant [rad], infinite of an unstable one, of each case that is not `there` yet."""
    for name, case, duration in scenarios(variants):
        if name not in there:
            (outcomes,) = simulate_many([case], duration)
            yield [name, *(one.rmse if one.ended else math.inf for one in outcomes)]
    for cell in (draw("development", number) for number in range(cells) if str(number) not in there):
        (outcomes,) = simulate_many([case_of(cell, tuple(configured(v, cell.known) for v in variants))], DURATION)
        yield [str(cell.number), *(o.rmse if o.ended and o.peak <= cell.allowed else math.inf for o in outcomes)]


def main() -> None:
    """Print what each constant's factors change."""
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    law, names = with_constants_as_gains()
    tried = [(name, factor) for name in names for factor in FACTORS]
    values, kept = law.numbers, Kept("law_constants")
    variants = (law, *(law.with_gains(**{f"c_{name}": factor * values[f"c_{name}"]}) for name, factor in tried))
    rows = kept.filled(costs(variants, cells, {row[0] for row in kept.rows()}), 6 + cells)
    rows.sort(key=lambda row: row[0].isdigit())
    found = np.log(np.array([row[1:] for row in rows], dtype=np.float64))
    with np.errstate(invalid="ignore"):
        change = np.expm1(np.where(found == found[:, :1], 0.0, found - found[:, :1]))[:, 1:]
    columns = ["constant", "factor", *(row[0] for row in rows[:6]), "mean of cells", "cells by 1 %", "unstable"]
    lines = []
    for i, (name, factor) in enumerate(tried):
        of = change[6:, i]
        mean = np.expm1(np.mean(np.log1p(of[np.isfinite(of) & (of > -1.0)])))
        shares = f"{mean:+.2%}", f"{np.mean(np.abs(of) > 0.01):.0%}", f"{np.sum(of == np.inf) - np.sum(of == -1):+d}"
        lines.append([name, f"{factor:g}", *(f"{one:+.1%}" for one in change[:6, i]), *shares])
    print(table(columns, lines))


if __name__ == "__main__":
    main()
