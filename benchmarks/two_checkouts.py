"""Whether two checkouts of bowden say the same: ``python benchmarks/two_checkouts.py OLD NEW [PART …]``.

For a rewriting that is to change nothing. Each part runs in both checkouts, in processes of their own, through what
stays (commands with ``--json``, and the benchmarks' generators), and leaves one JSON document in ``out/checkouts``.
What is there already is not run again, so that the old checkout runs once. Numbers may differ by 1e-9 of their size.
"""

import argparse
import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[1]
DATA = HERE.parent / "shared" / "data"
SAME = 1e-9
"""Relative difference of numbers that counts as none."""
TIMES = ("seconds", "created", "hash", "version", "page", "path", "out", "file")
"""Keys of what is different in every run."""
CABLES = 4
"""Recordings from which rigs are made."""

FAULTS = """
import json, fault_matrix
print(json.dumps(list(fault_matrix.singles(2, 0))))
"""
UNSEEN = """
import json
from unseen import draw, play
from bowden.control import LAWS
cells = [draw("development", number) for number in range(40)]
runs = play(list(LAWS.values()), cells)
print(json.dumps([[run.number, run.law, run.stable, run.rmse_deg, run.travel_deg] for run in runs]))
"""


class Checkout:
    """A folder with the project.

    Args:
        root: of the checkout.
    """

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        digest = hashlib.sha256()
        for path in sorted([*self.root.glob("src/**/*.py"), *self.root.glob("benchmarks/*.py")]):
            digest.update(path.read_bytes())
        self.kept = HERE / "out" / "checkouts" / digest.hexdigest()[:16]
        self.kept.mkdir(parents=True, exist_ok=True)

    def bowden(self, *arguments: str) -> Any:
        """The document that a command prints, or how it failed."""
        code = "from bowden.app.main import main; main()"
        return self._json([sys.executable, "-c", code, *arguments, "--json"])

    def python(self, code: str) -> Any:
        """The document that code prints."""
        return self._json([sys.executable, "-c", code])

    def _json(self, command: list[str]) -> Any:
        paths = (self.root / "src", self.root / "benchmarks", self.root / "tests", self.root)
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths))}
        done = subprocess.run(command, cwd=self.kept, env=environment, capture_output=True, text=True, check=False)
        try:
            return json.loads(done.stdout)
        except ValueError:
            return {"exit code": done.returncode, "stderr": done.stderr[-2000:]}


def recordings(one: Checkout) -> Iterator[tuple[str, Any]]:
    """Each recording identified."""
    for path in sorted([*DATA.glob("cable/*.csv*"), *DATA.glob("cable_load/*.csv*")]):
        yield path.stem, one.bowden("identify", str(path), "--out", f"models/{path.stem}")


def rigs(one: Checkout) -> Iterator[tuple[str, Any]]:
    """A rig round some of the recordings' cables, and a suit: every law simulated, and checked."""
    from bowden.control import LAWS

    laws = [argument for law in LAWS for argument in ("--law", law)]
    for path in sorted(DATA.glob("cable/*.csv*"))[:CABLES]:
        one.bowden("identify", str(path), "--out", f"models/{path.stem}")
        rig = f"{path.stem}.toml"
        yield f"init {rig}", one.bowden("init", rig, "--model", f"models/{path.stem}/model.toml", "--force")
        yield f"check {rig}", one.bowden("check", rig)
        yield f"simulate {rig}", one.bowden("simulate", rig, *laws, "--force", "--duration", "20")
    for kind in ([], ["--suit"]):
        yield f"init {kind}", one.bowden("init", "own.toml", *kind, "--force")
        yield f"check {kind}", one.bowden("check", "own.toml")
        yield f"tune {kind}", one.bowden("tune", "own.toml", "--dry-run")
        yield f"simulate {kind}", one.bowden("simulate", "own.toml", *laws, "--force", "--duration", "20")


def emg(one: Checkout) -> Iterator[tuple[str, Any]]:
    """Each recording of EMG scored."""
    for path in sorted([*DATA.glob("emg*/*.csv*")]):
        if ".labels" not in path.name:
            labels = path.with_name(path.name.replace(".csv", ".labels.csv").removesuffix(".gz"))
            known = ["--labels", str(labels)] if labels.is_file() else []
            yield path.stem, one.bowden("emg", "score", str(path), *known)


def paper(one: Checkout) -> Iterator[tuple[str, Any]]:
    """The paper, claim by claim."""
    yield "reproduce", one.bowden("reproduce")


def faults(one: Checkout) -> Iterator[tuple[str, Any]]:
    """Every fault of the matrix: when it is seen, and when the power is off."""
    yield "faults", one.python(FAULTS)


def unseen(one: Checkout) -> Iterator[tuple[str, Any]]:
    """Every law on cells of the development set."""
    yield "unseen", one.python(UNSEEN)


def schema(one: Checkout) -> Iterator[tuple[str, Any]]:
    """Rigs good and bad: their trees, what follows from them, and how they are refused."""
    yield "schema", one.python((HERE / "benchmarks" / "rig_cases.py").read_text(encoding="utf-8"))


def motors(one: Checkout) -> Iterator[tuple[str, Any]]:
    """Rigs with several motors, on one joint and on several: checked, simulated, tuned, and run on twins."""
    yield "motors", one.python((HERE / "benchmarks" / "motor_cases.py").read_text(encoding="utf-8"))


PARTS = {part.__name__: part for part in (recordings, rigs, emg, paper, faults, unseen, schema, motors)}


def document(one: Checkout, part: str) -> Any:
    """What a part gives in a checkout, kept."""
    path = one.kept / f"{part}.json"
    if not path.is_file():
        found = {}
        for name, value in PARTS[part](one):
            print(f"{one.root.name} {part}: {name}", file=sys.stderr)
            found[name] = value
        path.write_text(json.dumps(found), encoding="utf-8")
    return json.loads(path.read_text(encoding="utf-8"))


def differences(old: Any, new: Any, place: str = "", skipped: tuple[str, ...] = TIMES) -> Iterator[str]:
    """Places where two documents differ, but at keys with one of the words that are `skipped`."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in old.keys() | new.keys():
            if any(word in key for word in skipped):
                continue
            if key not in old or key not in new:
                yield f"{place}.{key}: only in {'old' if key in old else 'new'}"
            else:
                yield from differences(old[key], new[key], f"{place}.{key}", skipped)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from differences(a, b, f"{place}[{i}]", skipped)
    elif isinstance(old, int | float) and isinstance(new, int | float):
        if not (old == new or math.isclose(old, new, rel_tol=SAME, abs_tol=SAME) or (old != old and new != new)):
            yield f"{place}: {old!r} → {new!r}"
    elif old != new:
        yield f"{place}: {str(old)[:200]!r} → {str(new)[:200]!r}"


def main() -> int:
    """Run what is missing, and print what differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    asked = parser.parse_args()
    old, new, count = Checkout(asked.old), Checkout(asked.new), 0
    for part in asked.parts or PARTS:
        skipped = () if part == "schema" else TIMES
        found = sorted(differences(document(old, part), document(new, part), part, skipped))
        count += len(found)
        print(f"{part}: {len(found)} differences")
        print("\n".join(found[:40]))
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
