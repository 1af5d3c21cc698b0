"""Which constants of our law matter: each halved and doubled, over six scenarios and development cells.

``python benchmarks/law_constants.py 400``: cells; those that were begun and not finished go on. The law's files are
copied with every constant made a gain, so that all variants are one compiled law.
"""

import argparse
import ast
import importlib
import math
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from bowden.sim.many import Case, simulate_many
from bowden.sim.suit_runs import DRIVE_INTEGRAL
from kept import Kept
from measure import table
from unseen_cells import DURATION, case_of, draw

Array = NDArray[np.float64]
COPY, OLD = "law_with_constants_as_gains", "bowden.control.our_law"
FACTORS = (0.5, 2.0)
MATTERS = 0.01
"""Change of an RMSE by which a constant matters [–]."""
SENTINELS = {"UNSEEN"}


def constants_of(folder: Path) -> dict[str, ast.expr]:
    """Name → value of each module's constants; a value may name other constants."""
    found: dict[str, ast.expr] = {}
    for file in sorted(folder.glob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign):
                (to,), value = node.targets, node.value
                pairs = zip(to.elts, value.elts, strict=True) if isinstance(to, ast.Tuple) else [(to, value)]
                found |= {name.id: one for name, one in pairs if _is_number(one)}
    return {name: value for name, value in found.items() if name not in SENTINELS}


def _is_number(value: ast.expr) -> bool:
    """A number, or some made of numbers and constants."""
    allowed = (ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop, ast.Constant, ast.Name, ast.Load)
    return not isinstance(value, ast.Name) and all(isinstance(node, allowed) for node in ast.walk(value))


class AsGains(ast.NodeTransformer):
    """Kernels that take each constant from the gains, which all of them are given."""

    def __init__(self, constants: Mapping[str, ast.expr], kernels: Mapping[str, bool]) -> None:
        self.constants, self.kernels = constants, kernels

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """One kernel: with its gains as its last argument, where it has none."""
        if not self.kernels[node.name]:
            node.args.args.append(ast.arg("gains", ast.Name("BowdenGains", ast.Load())))
        node.body = [self.visit(one) for one in node.body]
        return node

    def visit_Call(self, node: ast.Call) -> ast.Call:
        """A kernel's call, which hands the gains on."""
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and self.kernels.get(node.func.id) is False:
            node.args.append(ast.Name("gains", ast.Load()))
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """A constant; one that is made of others, from these."""
        value = self.constants.get(node.id)
        if value is None or isinstance(node.ctx, ast.Store):
            return node
        if isinstance(value, ast.Constant):
            return ast.Attribute(ast.Name("gains", ast.Load()), f"c_{node.id}", ast.Load())
        copied: ast.expr = ast.parse(ast.unparse(value), mode="eval").body
        changed: ast.expr = self.visit(copied)
        return changed


def with_constants_as_gains() -> tuple[Law, list[str]]:
    """Our law of which each constant is a gain, and the names of these."""
    folder, into = Path(ours.__path__[0]), Path(tempfile.mkdtemp()) / COPY
    into.mkdir()
    constants = constants_of(folder)
    plain = {name: ast.literal_eval(value) for name, value in constants.items() if isinstance(value, ast.Constant)}
    trees = {file.name: ast.parse(file.read_text(encoding="utf-8")) for file in folder.glob("*.py")}
    trees["declared.py"] = ast.parse(Path(declaration.__file__).read_text(encoding="utf-8"))
    kernels = {
        node.name: any(one.arg == "gains" for one in node.args.args)
        for name, tree in trees.items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and name != "declared.py"
    }
    given = ast.parse(f"from {COPY}.gains import BowdenGains").body
    for name, tree in trees.items():
        if name == "gains.py":
            (gains,) = (node for node in tree.body if isinstance(node, ast.ClassDef))
            gains.body += ast.parse("\n".join(f"c_{one}: float = {value}" for one, value in plain.items())).body
        elif name != "declared.py":
            changes = AsGains(constants, kernels)
            tree.body = [changes.visit(node) if isinstance(node, ast.FunctionDef) else node for node in tree.body]
            at = next((i for i, node in enumerate(tree.body) if isinstance(node, ast.ImportFrom)), len(tree.body))
            tree.body[at:at] = given
        (into / name).write_text(ast.unparse(ast.fix_missing_locations(tree)).replace(OLD, COPY), encoding="utf-8")
    sys.path.insert(0, str(into.parent))
    law: Law = importlib.import_module(f"{COPY}.declared").LAW
    return law, list(plain)


def scenarios(variants: tuple[Law, ...]) -> Iterator[tuple[str, Case, float]]:
    """Bench still, moved; a wide play behind a wrongly known servo; suit ringing, slow, fast; and how long each [s]."""
    bench, worn = default_bench(), suit()._replace(motor=suit().motor._replace(integral=DRIVE_INTEGRAL))
    stroke, rest = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 4.0), constant_bend(bench.sheath.bend)
    low, high = 0.7 * bench.sheath.bend, 1.5 * bench.sheath.bend
    known = knowledge_of(bench)
    wrong = known._replace(
        servo_frequency=0.75 * known.servo_frequency, delay=2.0 * known.delay, slope=1.4 * bench.cable.slope
    )
    wide = bench._replace(sheath=bench.sheath._replace(gap=3.0 * bench.sheath.gap))
    yield "bench still", Case(bench, tuple(configured(law, known) for law in variants), stroke, rest, 1), 40.0
    moved = random_bend(low, high, 3.0, 40.0, 1)
    yield "bench moved", Case(bench, tuple(configured(law, known) for law in variants), stroke, moved, 1), 40.0
    yield "wide, all wrong", Case(wide, tuple(configured(law, wrong) for law in variants), stroke, rest, 1), 40.0
    knows, wears = knowledge_of(worn), [law.with_gains(lag=0.09, bandwidth=4.0) for law in variants]
    ringing = tuple(configured(law.with_gains(lag=0.0, bandwidth=6.0), knows) for law in variants)
    told, arm = tuple(configured(law, knows) for law in wears), constant_bend(worn.sheath.bend)
    for name, laws, period in (("suit ringing", ringing, 8.0), ("suit slow", told, 20.0), ("suit fast", told, 4.0)):
        yield name, Case(worn, laws, PeriodicMinimumJerk(0.0, 90.0 * RADIANS, period), arm, 1), 40.0


def costs(variants: tuple[Law, ...], cells: int, there: set[str]) -> Iterator[list[Any]]:
    """RMSE of each variant [rad], infinite of an unstable one, of each case that is not `there` yet."""
    for name, case, duration in scenarios(variants):
        if name not in there:
            (outcomes,) = simulate_many([case], duration)
            yield [name, *(one.rmse if one.ended else math.inf for one in outcomes)]
    for number in range(cells):
        if str(number) not in there:
            cell = draw("development", number)
            (outcomes,) = simulate_many([case_of(cell, tuple(configured(v, cell.known) for v in variants))], DURATION)
            yield [str(number), *(one.rmse if one.ended and one.peak <= cell.allowed else math.inf for one in outcomes)]


def changes(rows: list[list[Any]]) -> Array:
    """RMSE over that of the law as it is, less 1, a row for each case; infinite where only one is stable [–]."""
    found = np.array([row[1:] for row in rows], dtype=np.float64)
    whole = found[:, :1]
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isinf(found) & np.isinf(whole), 1.0, found / whole)
    return ratio[:, 1:] - 1.0


def row_of(name: str, factor: float, scenarios: Array, cells: Array) -> list[str]:
    """A factor's row: changes of the scenarios and of the cells that both stand, shares of cells, and unstable ones."""
    both = cells[np.isfinite(cells) & (cells > -1.0)]
    mean = np.expm1(np.mean(np.log1p(both)))
    unstable = int(np.sum(np.isinf(cells))) - int(np.sum(cells <= -1.0))
    changed = f"{np.mean(np.abs(cells) > MATTERS):.0%}"
    return [name, f"{factor:g}", *(f"{one:+.1%}" for one in scenarios), changed, f"{mean:+.2%}", f"{unstable:+d}"]


def main() -> None:
    """Print each constant's factors with what they change."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cells", type=int, nargs="?", default=400)
    cells = parser.parse_args().cells
    law, names = with_constants_as_gains()
    tried = [(name, factor) for name in names for factor in FACTORS]
    values = law.numbers
    variants = (law, *(law.with_gains(**{f"c_{name}": factor * values[f"c_{name}"]}) for name, factor in tried))
    kept = Kept("law_constants")
    rows = kept.filled(costs(variants, cells, {row[0] for row in kept.rows()}), 6 + cells)
    of_cells = changes([row for row in rows if row[0].isdigit()])
    others = [row for row in rows if not row[0].isdigit()]
    found = changes(others)
    columns = ["constant", "factor", *(row[0] for row in others), "cells changed", "mean of cells", "unstable"]
    print(table(columns, [row_of(*one, found[:, i], of_cells[:, i]) for i, one in enumerate(tried)]))


if __name__ == "__main__":
    main()
