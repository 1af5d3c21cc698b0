"""What is set before a run: law, gains, reference, duration, and who it is for; and the rig that this makes."""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from bowden.control import LAWS, Law
from bowden.core.arguments import format_value
from bowden.core.errors import ParameterError, near
from bowden.core.nested import innermost
from bowden.core.quantity import Quantity, declared, meanings
from bowden.rig.rig import Rig
from bowden.rig.sections import REFERENCES

LONGEST = {"subject": 80, "session": 80, "notes": 2000}
"""Texts that go into the log → characters that they may have."""
OWN = ""
"""In place of a preset's name: preset and gains of the rig itself."""
_UNIT = re.compile(r"\[([^\]]+)\][.;, ]*$")
_MOST_GAINS = 64
_DEEP = 3
_OF_ONE = ("law", "preset", "gains", "reference")
"""Settings of a rig with one motor."""
_RECORDED = "recorded"


@dataclass(frozen=True)
class RunSettings:
    """All that is set; `changed` makes another one."""

    base: Rig
    """What the settings begin with: the rig of the file, or that of the guided path."""
    law: str = ""
    """Its name; empty for the rig's own."""
    preset: str | None = OWN
    """Its name; `OWN` for what the rig says, preset and gains, and None for the law's defaults."""
    gains: Mapping[str, float] = field(default_factory=dict)
    """Those that differ from what rig and preset give."""
    reference: Mapping[str, Any] = field(default_factory=dict)
    """Section of a rig.toml; empty for the rig's own."""
    duration: float = math.nan
    """NaN for the rig's own [s]."""
    about: Mapping[str, str] = field(default_factory=lambda: dict.fromkeys(LONGEST, ""))
    """`subject`, `session` and `notes`, for the log."""

    @cached_property
    def rig(self) -> Rig:
        """The rig that runs.

        Raises:
            ParameterError: settings that it cannot have.
        """
        rig = self.base
        if rig.motors:
            return rig if math.isnan(self.duration) else rig.replace(duration=self.duration)
        if self.law and self.law != rig.law_name:
            rig = rig.with_law(self.law, self.preset)
        elif self.preset != OWN:
            rig = rig.replace(preset=self.preset, gains={})
        if self.gains:
            rig = rig.replace(gains={**rig.gains, **self.gains})
        if self.reference:
            rig = _with_reference(rig, self.reference)
        return rig if math.isnan(self.duration) else rig.replace(duration=self.duration)

    @cached_property
    def fitted(self) -> Law:
        """The law with the gains that run."""
        return self.rig.fitted()

    @property
    def laws(self) -> list[str]:
        """Names of the laws on offer: those of the package, and the rig's own."""
        return sorted({*LAWS, self.base.law_name})

    @property
    def owns_law(self) -> bool:
        """True if the law is the rig's own."""
        return self.law in ("", self.base.law_name)

    @property
    def chooses(self) -> bool:
        """True if the rig itself says a preset or gains."""
        return bool(self.base.preset or self.base.gains)

    def changed(self, given: Mapping[str, Any]) -> "RunSettings":
        """The settings with what a page gives; each change is tried, so that none is there that cannot be.

        Raises:
            ParameterError: a name that is none, or a value that cannot be.
        """
        known = ("law", "preset", "gains", "reference", "duration", *LONGEST)
        for name in given:
            if name not in known:
                raise ParameterError(
                    f"there is no setting {format_value(name)}", expected=near(name, known), do="reload the page"
                )
        made = self
        if self.base.motors and (fixed := sorted({*given} & {*_OF_ONE})):
            raise ParameterError(
                f"{', '.join(fixed)} of a rig with several motors is as its file says",
                expected="a duration and texts",
                do="change the rig.toml, or start the console with --motor",
            )
        if "law" in given and given["law"] != (made.law or made.base.law_name):
            law = _one_of(given["law"], self.laws, "law")
            made = replace(made, law=law, preset=OWN if law == made.base.law_name else None, gains={})
        if "preset" in given:  # also the one that it is: that takes back what was changed
            preset = given["preset"]
            if preset is not None:
                rigs = [OWN] if made.owns_law else []
                preset = _one_of(preset, [*rigs, *made.rig.loaded_law.presets], "preset")
            elif made.owns_law and not made.chooses:
                preset = OWN  # which is the same
            made = replace(made, preset=preset, gains={})
        if "gains" in given:
            made = replace(made, gains={**made.gains, **_gains(given["gains"], made.rig.loaded_law)})
        if "reference" in given:
            own = own_reference(made.base)
            section = _section(given["reference"], recorded=own.get("kind") == _RECORDED)
            now = made.reference or own
            kind = section.get("kind", now.get("kind"))
            if kind == own.get("kind") == _RECORDED:
                made = replace(made, reference={})
            else:
                begin = next((one for one in (now, own) if one.get("kind") == kind), {})
                made = replace(made, reference={**begin, **section})
        if "duration" in given:
            made = replace(made, duration=_number(given["duration"], "duration"))
        for name, most in LONGEST.items():
            if name in given:
                made = replace(made, about={**made.about, name: _text(given[name], name, most)})
        if made is not self:
            _ = [one.rig.fitted() for one in made.rig.parts]
        return made

    def document(self, *, locked: bool) -> dict[str, Any]:
        """As the page shows it.

        Args:
            locked: whether a session goes on that has these settings.
        """
        if self.base.motors:
            return self._of_motors() | {**self.about, "locked": locked}
        law = self.fitted
        return {
            "law": self.law or self.base.law_name,
            "laws": titled(self.laws),
            "preset": self.preset,
            "presets": self._presets(law),
            "edited": sorted(self.gains),
            "gains": {name: gain_of(law, name) for name in law.choices[:_MOST_GAINS]},
            "reference": reference_of(self.rig, self.base),
            "duration": self.rig.duration,
            **self.about,
            "locked": locked,
        }

    def _of_motors(self) -> dict[str, Any]:
        """What of several motors can be set, and what can only be shown."""
        laws = ", ".join(f"{motor.name}: {motor.rig.law_name}" for motor in self.base.motors)
        kinds = ", ".join(
            f"{motor.name}: {own_reference(motor.rig).get('kind', type(motor.rig.reference).__name__)}"
            for motor in self.base.motors
        )
        return {
            **{"law": laws, "laws": [{"name": laws, "title": laws}], "preset": OWN, "edited": [], "gains": {}},
            "presets": [{"name": OWN, "title": "of the rig, for each motor"}],
            "reference": {"kind": kinds, "kinds": [kinds], "fields": {}},
            "duration": self.rig.duration,
        }

    def _presets(self, law: Law) -> list[Mapping[str, str | None]]:
        """Sets of gains to begin with: the rig's own, the law's defaults, and those that it names."""
        base = self.base
        own: list[Mapping[str, str | None]] = []
        if self.owns_law:
            own_words = [f"preset {base.preset}"] if base.preset else []
            own_words += [f"{len(base.gains)} of its own"] if base.gains else []
            own = [{"name": OWN, "title": f"of the rig: {', '.join(own_words) or 'defaults of the law'}"}]
        defaults: Mapping[str, str | None] = {"name": None, "title": "defaults of the law"}
        plain = [] if own and not self.chooses else [defaults]
        return [*own, *plain, *titled(law.presets)]


def gain_of(law: Law, name: str) -> dict[str, Any]:
    """A gain as the page shows it; a limit that there is not is None."""
    low, high = law.limits.get(name, (-math.inf, math.inf))
    words = innermost(law.gains, tuple(name.split(".")), meanings) or ""
    found = _UNIT.search(words)
    meaning, unit = (words[: found.start()].rstrip(" .,"), found[1]) if found else (words.rstrip("."), "")
    value = law.numbers[name]
    return {
        "value": value if math.isfinite(value) else None,
        "low": low if math.isfinite(low) else None,
        "high": high if math.isfinite(high) else None,
        "unit": unit,
        "meaning": meaning,
        "live": name in law.live,
    }


def own_reference(rig: Rig) -> dict[str, Any]:
    """A rig's reference as the section of a rig.toml has it; empty where a file has no words for it."""
    try:
        return dict(rig.tree().get("reference", {}))
    except ParameterError:
        return {}


def reference_of(rig: Rig, base: Rig) -> dict[str, Any]:
    """The reference as the section of a rig.toml has it: its kind, the kinds that there are, and its fields.

    Of a recorded motion, and of one that a file has no words for, no field can be set.

    Args:
        rig: whose reference it is.
        base: the rig of the file, to whose recorded motion one may return.
    """
    kinds = [name for name in REFERENCES if name != _RECORDED]
    section = own_reference(rig)
    kind = section.get("kind", type(rig.reference).__name__)
    if own_reference(base).get("kind") == _RECORDED:
        kinds = [_RECORDED, *kinds]
    if kind not in kinds or kind == _RECORDED:
        return {"kind": kind, "kinds": kinds if kind in kinds else [kind, *kinds], "fields": {}}
    named = {one.quantity.named(one.name): one.quantity for one in declared(REFERENCES[kind].kind)}
    fields = {key: _field(one, section.get(key)) for key, one in named.items()}
    return {"kind": kind, "kinds": kinds, "fields": fields}


def _field(quantity: Quantity, value: Any) -> dict[str, Any]:
    """A field as the page shows it."""
    low = quantity.ge if quantity.ge is not None else quantity.gt
    high = quantity.le if quantity.le is not None else quantity.lt
    return {"value": value, "low": low, "high": high, "unit": quantity.file_unit, "meaning": quantity.meaning}


def titled(names: "Iterable[str]") -> list[dict[str, str]]:
    """Names with a title for each."""
    return [{"name": name, "title": name.replace("_", " ")} for name in names]


def _one_of(value: Any, known: "Mapping[str, Any] | list[str]", what: str) -> str:
    if not isinstance(value, str) or value not in known:
        names = ", ".join(known) or "none"
        raise ParameterError(f"{what} is {format_value(value)}", expected=f"one of {names}", do="choose another one")
    return value


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(f"{what} is {format_value(value)}", expected="a number", do="correct it")
    return float(value)


def _text(value: Any, what: str, most: int) -> str:
    if not isinstance(value, str) or len(value) > most:
        raise ParameterError(
            f"{what} is {format_value(value)}", expected=f"a text of at most {most} characters", do="shorten it"
        )
    return "".join(one for one in value if one.isprintable() or one == "\n")


def _gains(given: Any, law: Law) -> dict[str, float]:
    if not isinstance(given, Mapping):
        raise ParameterError(
            f"gains is {format_value(given)}", expected="an object of gains and numbers", do="correct it"
        )
    return {_one_of(name, law.choices, "a gain"): _number(value, f"gain {name}") for name, value in given.items()}


def _section(given: Any, *, recorded: bool) -> dict[str, Any]:
    """A reference from the wire: numbers, lists of numbers and a kind, and no file.

    Args:
        given: from the wire.
        recorded: whether the rig's own is a recorded motion, to which one returns by its kind alone.
    """
    if recorded and given == {"kind": _RECORDED}:
        return {"kind": _RECORDED}
    if not isinstance(given, Mapping) or given.get("kind") == _RECORDED or not _plain(given, _DEEP):
        raise ParameterError(
            f"reference is {format_value(given)}",
            expected="the section [reference] of a rig.toml, without a file",
            do="correct it",
        )
    return dict(given)


def _plain(value: Any, deep: int) -> bool:
    """True if a value is made of numbers, of lists of them, and of names under `kind` alone."""
    if isinstance(value, Mapping):
        return deep > 0 and all(
            isinstance(name, str) and (isinstance(one, str) if name == "kind" else _plain(one, deep - 1))
            for name, one in value.items()
        )
    if isinstance(value, list):
        return deep > 0 and len(value) <= 200 and all(_plain(one, deep - 1) for one in value)
    return isinstance(value, int | float | bool)


def _with_reference(rig: Rig, section: Mapping[str, Any]) -> Rig:
    """The rig with another reference; all else stays as it is in this process."""
    from pathlib import Path

    tree = {"reference": dict(section)}
    return rig.replace(reference=Rig.of_tree(tree, Path(rig.origin)).reference)
