"""A study: what ``bowden campaign`` runs, from its file to each single run, which is made of its number alone."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bowden import __version__
from bowden.control import Law
from bowden.control.knowledge import Knowledge
from bowden.control.law_file import LawFile, loaded
from bowden.core.errors import ParameterError
from bowden.core.kernel_cache import source_hash
from bowden.core.own_file import digest
from bowden.models.cable.sheath_path import BendPath
from bowden.plants.bends import RandomBend
from bowden.rig.rig import Rig
from bowden.sim.injected import Injected, SensorFault
from bowden.sim.run import Case
from bowden.study.distributions import Distribution, Value
from bowden.study.file import KnownSection, StudyFile
from bowden.study.keys import simulated, with_values

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
    """A dotted key of the rig, ``control.gains.NAME``, ``known.NAME`` or ``fault.NAME``."""
    unit: str
    spread: Distribution


@dataclass(frozen=True)
class Study:
    """A study that has been read and checked."""

    path: Path
    file: StudyFile
    rig: Rig
    """With what [set] changes, and the study's duration."""
    given: tuple[str | LawFile, ...]
    """The laws as they are named."""
    columns: tuple[Column, ...]

    def __getstate__(self) -> dict[str, Any]:
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """With their own gains."""
        return tuple(map(loaded, self.given))

    @property
    def duration(self) -> float:
        """Of each run [s]."""
        return self.rig.duration

    @cached_property
    def _tree(self) -> dict[str, Any]:
        return simulated(self.rig)

    @cached_property
    def nominal(self) -> tuple[Law, ...]:
        """The laws as the rig itself has them, where nothing is drawn."""
        return tuple(self.rig.fitted(given) for given in self.given)

    @cached_property
    def gains_varied(self) -> frozenset[str]:
        """Gains of the first law that differ between its runs, judged by the first of them."""
        nominal, first = self.nominal[0].numbers, range(min(self.file.runs, _LOOKED_AT))
        laws = [self.run(number)[1][0] for number in first]
        return frozenset(name for name, value in nominal.items() if any(law.numbers[name] != value for law in laws))

    def _varies(self, *sections: str) -> bool:
        return any(column.name.startswith(sections) for column in self.columns)

    def drawn(self, number: int) -> Drawn:
        """The run's seed, and the value of every column."""
        random = np.random.default_rng([self.file.seed, number])
        seed = int(random.integers(2**63))
        even = random.random(len(self.columns)).tolist()
        return Drawn(seed, {c.name: c.spread.value(u) for c, u in zip(self.columns, even, strict=True)})

    def rig_of(self, drawn: Drawn) -> Rig:
        """The rig of one run, with its seed; gains of the laws and their knowledge of the rig are not in it.

        Raises:
            ParameterError: values that do not fit one another.
        """
        if not self.columns:
            return self.rig.replace(seed=drawn.seed)
        keys = [(k, v) for k, v in drawn.values.items() if not k.startswith(("control.gains.", "known.", "fault."))]
        tree = with_values(self._tree, [*keys, ("scenario.seed", drawn.seed)])
        return Rig.of_tree(tree, self.path, keep=self.rig)

    def run(self, number: int, drawn: Drawn | None = None) -> tuple[Rig, tuple[Law, ...], SensorFault | None]:
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

    def _put_together(self, drawn: Drawn) -> tuple[Rig, tuple[Law, ...], SensorFault | None]:
        rig = self.rig_of(drawn)
        if rig.pushing is not None:
            rig.pushing.refuse_integral()
        laws = tuple(self._fitted(given, rig, drawn) for given in self.given)
        return rig, laws, self._fault(drawn.values, rig.sample_time)

    def _fitted(self, given: str | LawFile, rig: Rig, drawn: Drawn) -> Law:
        law = rig.fitted(given, self._believed(rig.knowledge, drawn))
        gains = {k.removeprefix("control.gains."): v for k, v in drawn.values.items() if k.startswith("control.gains.")}
        return law.with_gains(**{key: value for key, value in gains.items() if key in law.numbers})

    def _believed(self, known: Knowledge, drawn: Drawn) -> Knowledge:
        """What the laws of a run know: what its rig knows, wrong by the factors of [known].

        A slope that is drawn nobody has measured: `relative_slope` is that of the study's own rig.
        """
        known = known._replace(relative_slope=self.rig.knowledge.relative_slope)
        factors = {key: float(drawn.values.get(f"known.{key}", 1.0)) for key in KnownSection.model_fields}
        return known._replace(**{key: getattr(known, key) * factor for key, factor in factors.items()})

    def _bend(self, rig: Rig) -> BendPath:
        """The bend of a run; one that is not drawn is the same object in all runs, which share what it costs."""
        moved = self._varies("scenario.bend", "sheath.") or isinstance(rig.bend, RandomBend)
        return rig.bend_path if moved else self.rig.bend_path

    def _fault(self, values: dict[str, Value], dt: float) -> SensorFault | None:
        if "fault.kind" not in values:
            return None
        kind = str(values["fault.kind"])
        begin = float(values.get("fault.begin_s", 0.0))
        end = begin + float(values.get("fault.length_s", self.duration))
        return SensorFault(Injected[kind.upper()], round(begin / dt), round(end / dt))

    @property
    def worn(self) -> bool:
        """True if the plants are suits on wearers, in place of benches."""
        return self.rig.suit.worn

    def cases(self, runs: Iterable[tuple[int, Drawn]]) -> Iterator[Case]:
        """The runs of these numbers, for `bowden.sim.many`."""
        for number, drawn in runs:
            rig, laws, fault = self.run(number, drawn)
            push = rig.pushing
            yield Case(
                plant=rig.simulated_plant,
                laws=laws,
                reference=rig.trajectory,
                bend=self._bend(rig),
                seed=rig.seed,
                initial_motor=rig.start_motor,
                fault=fault,
                sources=() if push is None else tuple(map(push.source, laws)),
            )

    @cached_property
    def identity(self) -> dict[str, Any]:
        """All that the results depend on, as JSON values: two studies with the same give the same rows."""
        laws = [law for law in self.given if isinstance(law, LawFile)]
        files = {Path(law.path).name: digest(law.source)[:16] for law in laws}
        files |= {one.file: digest(one.source)[:16] for law in laws for one in law.modules}
        return {
            "bowden": software(),
            "laws": [law.name for law in self.laws],
            "runs": self.file.runs,
            "seed": self.file.seed,
            "duration_s": self.duration,
            "rig": simulated(self.rig),
            "plant": self.plant_hash,
            "draws": {column.name: {column.spread.kind: list(column.spread.given)} for column in self.columns},
            "known": self.file.known is not None,
            "files": files,
        }

    @cached_property
    def hash(self) -> str:
        """A short name of the identity."""
        text = json.dumps(self.identity, sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @cached_property
    def plant_hash(self) -> str:
        """The hash of the rig as far as a simulation depends on it: the contents of its files too."""
        default = Rig()
        return self.rig.replace(drive=default.drive, limits=default.limits, live=default.live).hash
