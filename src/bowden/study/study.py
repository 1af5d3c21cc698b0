"""A study: what ``bowden campaign`` runs, from its file to each single run, which is made of its number alone."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from bowden import __version__
from bowden.control import Law, user_law
from bowden.control.knowledge import Knowledge
from bowden.core.errors import ParameterError
from bowden.core.kernel_cache import source_hash
from bowden.rig import compose
from bowden.rig.config import check_points, explained
from bowden.rig.keys import LIVE, with_values, written
from bowden.rig.schema import Rig
from bowden.sim.faulty import Fault
from bowden.sim.injected import Injected
from bowden.sim.many import Case
from bowden.study.distributions import Distribution, Value, describe
from bowden.study.schema import Study as StudyFile
from bowden.study.schema import ToldSection

SENSOR_FAULTS = [kind.name.lower() for kind in Injected if Injected.JOINT_NAN <= kind <= Injected.MOTOR_SIGN]
"""Faults that change what the law is shown and nothing else."""


_LOOKED_AT = 24
"""Runs that are made to see what differs between them."""


def software() -> str:
    """Version of the package, and of its source: what may give other rows is another one."""
    return f"{__version__} ({source_hash()})"


class Drawn(NamedTuple):
    """What a run's number makes of it."""

    seed: int
    """Of the encoders' noise and of a random bend."""
    values: dict[str, Value]
    """Column → value, of all that is drawn."""


class Column(NamedTuple):
    """One thing that is drawn."""

    name: str
    """A dotted key of the rig, ``control.gains.NAME``, ``told.NAME`` or ``fault.NAME``."""
    unit: str
    spread: Distribution


@dataclass(frozen=True)
class Study:
    """A study that has been read and checked."""

    path: Path
    file: StudyFile
    rig_path: Path
    """Of its rig.toml; its own where it has none."""
    rig: Rig
    """With what [set] changes."""
    laws: tuple[Law, ...]
    """With their own gains."""
    columns: tuple[Column, ...]
    duration: float
    """[s]"""

    @cached_property
    def _tree(self) -> dict[str, Any]:
        return written(self.rig)

    @cached_property
    def shared(self) -> compose.Setup:
        """The setup of the rig as it stands, whose reference and bend serve all runs that do not vary them."""
        return compose.setup_of(self.rig, self.rig_path, self.duration, 0)

    @cached_property
    def nominal(self) -> tuple[Law, ...]:
        """The laws as the rig itself has them, where nothing is drawn."""
        names = zip(self.laws, self.file.laws, strict=True)
        known, own = compose.known_of(self.rig, self.shared.bench, self.shared.suit), self.rig.control.law
        return tuple(compose.fitted(law, self.rig, known, rigs_own=name == own) for law, name in names)

    @cached_property
    def told_apart(self) -> frozenset[str]:
        """Gains of the first law that its runs are told differently, judged by the first of them."""
        nominal, first = self.nominal[0].gains, range(min(self.file.runs, _LOOKED_AT))
        laws = [self.setup(number)[1][0] for number in first]
        return frozenset(
            name for name, value in nominal._asdict().items() if any(getattr(law.gains, name) != value for law in laws)
        )

    @cached_property
    def _begin(self) -> float:
        """Where its reference starts [rad]."""
        return float(self.shared.reference.sample(np.zeros(1))[0, 0])

    def _varies(self, *sections: str) -> bool:
        return any(column.name.startswith(sections) for column in self.columns)

    def drawn(self, number: int) -> Drawn:
        """The run's seed, and the value of every column."""
        random = np.random.default_rng([self.file.seed, number])
        seed = int(random.integers(2**63))
        even = random.random(len(self.columns)).tolist()
        return Drawn(seed, {c.name: c.spread.value(u) for c, u in zip(self.columns, even, strict=True)})

    def rig_of(self, drawn: Drawn) -> Rig:
        """The rig of one run, with its seed; gains of the laws and what they are told are not in it.

        Raises:
            ParameterError: values that do not fit one another.
        """
        keys = [(k, v) for k, v in drawn.values.items() if not k.startswith(("control.gains.", "told.", "fault."))]
        tree = with_values(self._tree, [*keys, ("scenario.seed", drawn.seed), ("scenario.duration_s", self.duration)])
        try:
            rig = Rig.model_validate(tree)
        except ValidationError as error:
            raise explained(error, self.path) from error
        if rig.cable.slope == 0.0:
            raise ParameterError(f"{self.path}: cable.slope is 0", expected="a number above or below 0")
        check_points(rig, self.path)
        return rig

    def setup(self, number: int, drawn: Drawn | None = None) -> tuple[compose.Setup, tuple[Law, ...], Fault | None]:
        """All that a run needs; `drawn` if that is known.

        Raises:
            ParameterError: values that do not fit one another.
        """
        try:
            return self._put_together(drawn or self.drawn(number))
        except ParameterError as error:
            text = error.what.removeprefix(f"{self.path}: ")
            raise ParameterError(
                f"{self.path}, run {number}: {text}", expected=error.expected, do="narrow what is varied"
            ) from error

    def _put_together(self, drawn: Drawn) -> tuple[compose.Setup, tuple[Law, ...], Fault | None]:
        rig = self.rig_of(drawn) if self.columns else self.rig
        varied = self._varies("reference.")
        moved = self._varies("scenario.bend", "sheath.") or rig.scenario.bend.kind == "random"
        setup = compose.setup_of(
            rig,
            self.rig_path,
            self.duration,
            drawn.seed,
            None if varied else self.shared.reference,
            None if moved else self.shared.bend,
            None if varied else self._begin,
        )
        if setup.pushing is not None:
            setup.pushing.refuse_integral()
        known = self._believed(compose.known_of(rig, setup.bench, setup.suit), drawn)
        laws = tuple(
            self._fitted(law, name, rig, known, drawn) for law, name in zip(self.laws, self.file.laws, strict=True)
        )
        return setup, laws, self._fault(drawn.values, setup.bench.sample_time)

    def _believed(self, known: Knowledge, drawn: Drawn) -> Knowledge:
        """What the laws of a run are told: what its rig knows, wrong by the factors of [told]."""
        factors = {key: float(drawn.values.get(f"told.{key}", 1.0)) for key in ToldSection.model_fields}
        return known._replace(**{key: getattr(known, key) * factor for key, factor in factors.items()})

    def _fitted(self, law: Law, name: str, rig: Rig, known: Knowledge, drawn: Drawn) -> Law:
        law = compose.fitted(law, rig, known, rigs_own=name == rig.control.law)
        gains = {k.removeprefix("control.gains."): v for k, v in drawn.values.items() if k.startswith("control.gains.")}
        return law.with_gains(**{key: value for key, value in gains.items() if key in law.gains._fields})

    def _fault(self, values: dict[str, Value], dt: float) -> Fault | None:
        if "fault.kind" not in values:
            return None
        kind = str(values["fault.kind"])
        begin = float(values.get("fault.begin_s", 0.0))
        end = begin + float(values.get("fault.length_s", self.duration))
        return Fault(float(Injected[kind.upper()]), float(round(begin / dt)), float(round(end / dt)))

    @property
    def worn(self) -> bool:
        """Whether the plants are suits on wearers, in place of benches."""
        return self.rig.suit.worn

    def cases(self, runs: Iterable[tuple[int, Drawn]]) -> Iterator[Case]:
        """The runs of these numbers, for `bowden.sim.many` and `bowden.sim.suit_figures`."""
        for number, drawn in runs:
            setup, laws, fault = self.setup(number, drawn)
            push, plant = setup.pushing, setup.suit or setup.bench
            if setup.suit is not None and push is not None:
                plant = setup.suit._replace(load_cell=push.cell)
            yield Case(
                plant=plant,
                laws=laws,
                reference=setup.reference,
                bend=setup.bend,
                seed=setup.seed,
                initial_motor=setup.initial_motor,
                fault=fault,
                sources=() if push is None else tuple(map(push.source, laws)),
            )

    @cached_property
    def identity(self) -> dict[str, Any]:
        """All that the results depend on, as JSON values: two studies with the same give the same rows."""
        files = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in self.files()}
        return {
            "bowden": software(),
            "laws": [law.name for law in self.laws],
            "runs": self.file.runs,
            "seed": self.file.seed,
            "duration_s": self.duration,
            "rig": self.rig.model_dump(mode="json", exclude=set(LIVE)),
            "draws": {column.name: describe(column.spread) for column in self.columns},
            "told": self.file.told is not None,
            "files": files,
        }

    @cached_property
    def hash(self) -> str:
        """A short name of the identity."""
        text = json.dumps(self.identity, sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def files(self) -> list[Path]:
        """Files besides the study and its rig that its rows depend on: models, recordings, laws."""
        folder = self.rig_path.parent
        named = [self.rig.cable.model, getattr(self.rig.reference, "file", None)]
        others = [folder / name for name in named if name]
        laws = [law.step_kernel.__code__.co_filename for law in self.laws]
        own = [Path(file) for name, file in zip(self.file.laws, laws, strict=True) if user_law.is_file(name)]
        return [*others, *dict.fromkeys(own)]
