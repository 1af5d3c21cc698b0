"""One way from logs to a model: describe → fit each family → judge → trust → model.

What is fitted hangs on what there is: six families to one log, one loop that load and bend may schedule to several
(`loads`), and gain and offset alone of a model that is known (`recalibrate`). What comes of it is judged and trusted by
one rule.

**One log**: each family is fitted to its first half, compared on stretches left out, judged on its second half, and
fitted again to the whole. A lag τ of the joint, which no rate-independent model can show, adds −τ·d(joint)/dt to it. A
fitted model takes part of that for hysteresis; what it cannot take is the part of the joint's speed that lies outside
all its sensitivities, v⊥, and the residual is then −τ·v⊥.
"""

import math
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bowden.core.errors import LogError
from bowden.core.units import DEGREES
from bowden.identify.cable import trust
from bowden.identify.cable.bouc_wen import fit_bouc_wen, fit_static, fit_terms, search
from bowden.identify.cable.fit import Fit, usable
from bowden.identify.cable.fitted import ModelFit, described
from bowden.identify.cable.generalised import fit_branches, rough_branches
from bowden.identify.cable.loads import fit_logs
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.plays import fit_line, fit_play, fit_stack
from bowden.identify.cable.projection import Array, Estimate, Progress, solve_linear
from bowden.identify.cable.recalibrate import fit_gain
from bowden.identify.cable.turns import Turns, find_turns, motor_noise
from bowden.identify.cable.uncertainty import all_shown, loop_of, standard_errors
from bowden.identify.cable.validation import Refit, Settling, left_out_errors, settling, simplest_of_the_best
from bowden.identify.log.read import Log
from bowden.identify.log.variables import Scheduled
from bowden.plants.identified import CableModel, IdentifiedCable
from bowden.plants.predicted import PREDICTED
from bowden.plants.trust import Trust
from bowden.records.metrics import rmse

FAMILIES: Mapping[str, Refit] = {
    "line": fit_line,
    "play": fit_play,
    "bouc_wen": fit_bouc_wen,
    "bouc_wen_static": fit_static,
    "prandtl_ishlinskii": fit_stack,
    "generalised_play": fit_branches,
}
"""Every family's name, from the simplest on → how a member is searched from another."""
_FINE, _JUDGED, _SEARCHED = 2500, 600, 150
"""Nodes of the path on which models are fitted, compared with one another, and searched for globally."""
_READ = 250
"""Strokes of a long log that are fitted, spread over all of it: they say what a cable's loop is, and how it strays."""
_SEARCHED_STROKES = 30
"""The global search needs no more of a long log; the gradient stage sees all of it."""
_OUTWARD = ("line", "play", "prandtl_ishlinskii")
"""What is offered where one reversal was seen: left-out stretches then do not show how a bent loop goes on."""
_TAKEN_OUT = 3
"""Times that a lag is taken out: a loop's model takes a part of it for hysteresis, the less the smaller it is."""
_EACH, _FOLLOWED, _COUNTED = 200_000, 50_000, 1_000_000
"""Samples up to which each is a node of the path along which models are judged, nodes of a longer log's, and samples on
which errors are counted: of twice as many and more, every so many."""
_WORSE, _SLIGHT = 1.3, 0.01 / DEGREES
"""A model fitted to the whole log is not taken where its error on it exceeds that of the fit to the first half by this
factor and by this much [rad]: weights that fade towards the past cost less."""


def identify(
    logs: Sequence[Log],
    by: Sequence[Scheduled] = (),
    known: IdentifiedCable | None = None,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> Fit:
    """The model of a cable from logs of it.

    Args:
        logs: one or more, read and checked.
        by: load, bend or both of each log, which may schedule the model of several logs; of one log, where a known
            model is scheduled by them.
        known: model of which only gain and offset are fitted.
        seed: of the global search; with the same seed the result is the same.
        progress: called with what is being done and the share of the work that is behind.

    Raises:
        LogError: logs that nothing can be fitted to, or that do not go together.
        ParameterError: variables that do not go together.
    """
    begin = clock.perf_counter()
    tell = progress or (lambda what, share: None)
    if known is not None:
        found = fit_gain(logs[0], known, by)
    elif len(logs) > 1:
        found = fit_logs(logs, by, seed, tell)
    else:
        found, late = _fit_log(logs[0], seed, tell), 0.0
        for _ in range(_TAKEN_OUT):
            if not trust.lags(found.logs[0].lag):
                break
            late += found.logs[0].lag[0]
            found = _fit_log(earlier(logs[0], late), seed, tell)
    judged = trust.trust(found, None if known is None else known.trust)
    return replace(found, trust=judged, best=replace(found.best, trust=judged), seconds=clock.perf_counter() - begin)


def _fit_log(log: Log, seed: int, tell: Progress) -> Fit:
    split = int(np.searchsorted(log.time, 0.5 * (log.time[0] + log.time[-1])))
    noise = motor_noise(log.motor[:split])
    _check_motion(log, "motor", log.motor[:split], "check its column, or record a larger motion from the start")
    _check_motion(log, "joint", log.joint[:split], "check its column, its encoder and the cable")
    half = _fit_part(log, split, find_turns(log.motor[:split], noise), seed, tell)
    few, turns = half.fine.strokes < trust.TOLD, find_turns(log.motor, noise)
    tell("fitting the whole log", 0.6)
    whole = _fit_part(log, len(log.time), turns, seed, lambda what, share: None) if few else _refit(log, turns, half)
    seen = whole if few else half
    tell("comparing on left-out stretches", 0.7)
    errors = left_out_errors(FAMILIES, seen.estimates, seen.judged, seen.fine, seen.counted, log.time, log.joint)
    shown_by_log = seen.fine.strokes > 1 and trust.following(log, split) >= trust.FOLLOWS  # a reversal, and a cable
    names = ("line",) if not shown_by_log else _OUTWARD if seen.fine.strokes < 3 else tuple(errors)
    best: str = simplest_of_the_best(
        {name: errors[name] for name in names},
        {name: len(seen.estimates[name].slopes) for name in names},
        [name for name, one in seen.estimates.items() if not all_shown(seen.fine, one)],
        [name for name, one in seen.estimates.items() if one.prior is not None],
    )

    fine, start = half.fine, half.settling.start
    begun = fine.time[np.flatnonzero(fine.weight)[0]] if start else log.time[0]
    nodes = len(log.time) if len(log.time) <= _EACH else _FOLLOWED
    path = _path(log, len(log.time), turns, nodes, None)
    every = max(1, len(log.time) // _COUNTED)
    time, measured = log.time[::every], log.joint[::every]
    fitted, later = (time >= begun) & (time < log.time[split]), time >= log.time[split]
    counts = np.interp(time[fitted], fine.time, half.counted)
    models: dict[str, ModelFit] = {}
    kept = []
    for done, family in enumerate(FAMILIES):
        tell("judging on the second half", 0.9 + 0.02 * done)
        (error, final), part = (_along(path, one, family, time) - measured for one in (half, whole)), whole
        before, after = (rmse(one[time >= begun]) for one in (error, final))
        if after > _WORSE * before + _SLIGHT:
            part = half
            kept.append(f"{family} ({after * DEGREES:.2g}° against {before * DEGREES:.2g}°)")
        estimate = part.estimates[family]
        models[family] = ModelFit(
            model=CableModel(family, estimate.parameters),
            uncertainty=standard_errors(part.fine, estimate, family),
            loop=loop_of(part.fine, estimate.fitted),
            fitted_count=len(estimate.slopes),
            train_rms=math.sqrt(float(np.average(error[fitted] ** 2, weights=counts))),
            test_rms=rmse(error[later]),
            left_out_rms=math.sqrt(float(np.mean(errors[family]))),
        )
    chosen = models[best]
    found = described(
        log,
        path,
        split,
        _along(path, half, best, log.time),
        train_rms=chosen.train_rms,
        line_rms=models["line"].test_rms,
        loop=chosen.loop,
        lag=time_lag(fine, half.estimates[best]),
        fitted_from=int(np.searchsorted(log.time, begun)),
        one_amplitude=fine.span if trust.one_amplitude(fine) else 0.0,
    )
    warnings = trust.advise(found, fine, half.rest_until, models, best)
    if kept:
        warnings.append(
            f"fitted to the whole log a model was worse on it than fitted to the first half, and stays as it was: "
            f"{', '.join(kept)}; its error beyond the first half's range is not known to be small"
        )
    tell("done", 1.0)
    others = {name: dict(one.parameters) for name, one in models.items() if name != best and usable(name, one)}
    return Fit(
        models,
        replace(chosen.model, others=others, covered=log.covered, encoders=log.encoders),
        (found,),
        chosen.test_rms,
        (*log.warnings, *warnings),
        chosen_on_whole=few,
    )


def _check_motion(log: Log, what: str, values: Array, do: str) -> None:
    noise = motor_noise(values)
    span = float(np.ptp(np.convolve(values, np.full(9, 1.0 / 9.0), "valid")))  # nine outweigh the noise
    if not span > max(8.0 * noise, 1e-9):
        raise LogError(
            f"{log.name}: in the first half the {what} moves {np.rad2deg(span):.3g}° with {np.rad2deg(noise):.2g}° of "
            "noise",
            expected="strokes well above the encoder's noise",
            do=do,
        )


@dataclass(frozen=True)
class _Part:
    """A log, or the first half of one, with every family's best member."""

    fine: Path
    """On which they were fitted, weighted as the cable's settling asks."""
    counted: Array
    """How much each node of it counts, over what it would on a cable that does not settle (n,), 0 to 1 [–]."""
    judged: Path
    """The same, thinned, on which they are compared."""
    settling: Settling
    estimates: dict[str, Estimate]
    """By the family's name."""

    @property
    def rest_until(self) -> float | None:
        """Time to which the log counts less since it begins at rest [s]; None where it does not."""
        if self.settling != Settling() or (self.counted == 1.0).all():
            return None
        return float(self.fine.time[self.counted < 1.0].max())


def _fit_part(log: Log, stop: int, turns: Turns, seed: int, tell: Progress) -> _Part:
    """Every family fitted to the first `stop` samples of a log, searched globally."""
    raw, thin = (_path(log, stop, turns, nodes) for nodes in (_FINE, _JUDGED))
    tell("generalised_play", 0.1)
    weighting = settling(raw, rough_branches(raw))
    searched = _path(log, stop, turns, _SEARCHED, None).first(_SEARCHED_STROKES)
    fine, judged, searched = (weighting.weighted(path) for path in (raw, thin, searched))
    branches = fit_branches(fine)
    tell("bouc_wen, searched globally", 0.2)
    plain = fit_terms(fine, search(searched, seed), 1, 0)
    tell("all families", 0.3)
    estimates = {
        "line": fit_line(fine),
        "play": fit_play(fine, thin=judged),
        "bouc_wen": plain,
        "bouc_wen_static": fit_static(fine, plain),
        "prandtl_ishlinskii": fit_stack(fine),
        "generalised_play": branches,
    }
    return _Part(fine, _counted(raw, fine), judged, weighting, estimates)


def _refit(log: Log, turns: Turns, half: _Part) -> _Part:
    """Every family fitted to the whole log, searched from where it was for its first half."""
    raw, thin = (_path(log, len(log.time), turns, nodes) for nodes in (_FINE, _JUDGED))
    fine, judged = half.settling.weighted(raw), half.settling.weighted(thin)
    estimates = {family: refit(fine, half.estimates[family]) for family, refit in FAMILIES.items()}
    return _Part(fine, _counted(raw, fine), judged, half.settling, estimates)


def _path(log: Log, stop: int, turns: Turns, nodes: int, most: int | None = _READ) -> Path:
    return build_path(log.time[:stop], log.motor[:stop], log.joint[:stop], turns, nodes, most)


def _counted(raw: Path, weighted: Path) -> Array:
    """Weight over weight without settling; of a reversal, which has none, that of the node before it."""
    seen = np.flatnonzero(raw.weight > 0)
    shares = weighted.weight[seen] / raw.weight[seen]
    before = np.searchsorted(seen, np.arange(len(raw.weight)), side="right") - 1
    return np.asarray(shares[np.maximum(before, 0)])


def _along(path: Path, part: _Part, name: str, time: Array) -> Array:
    """Joint angle (n,) [rad] by the member of a family that was fitted to a part."""
    return path.at(time, PREDICTED[name](part.estimates[name].parameters, path.motor))


def time_lag(path: Path, estimate: Estimate) -> tuple[float, float]:
    """The lag τ [s] that explains most of what a model leaves, and the share of the squared residual that it explains.

    At one speed alone a lag and a wider loop are the same: the share is then small.
    """
    counted = path.weight > 0
    weight, time = path.weight[counted], path.time[counted]
    speed = np.gradient(estimate.fitted[counted], time)
    sensitivities = np.stack([slope[counted] for slope in estimate.slopes.values()], axis=1)
    absorbed, _ = solve_linear(sensitivities, speed, weight)
    outside = speed - np.einsum("np,p->n", sensitivities, absorbed)
    residual = (path.joint - estimate.fitted)[counted]
    power = float(weight @ outside**2)
    if power <= 1e-9 * float(weight @ speed**2):
        return 0.0, 0.0
    along = float(weight @ (residual * outside))
    return -along / power, along**2 / (power * max(float(weight @ residual**2), 1e-300))


def earlier(log: Log, late: float) -> Log:
    """A log whose joint is read so much later than its motor, with both at one time; `late` may be below zero [s]."""
    kept = (log.time + late >= log.time[0]) & (log.time + late <= log.time[-1])
    time, motor = log.time[kept], log.motor[kept]
    joint = np.interp(time + late, log.time, log.joint)
    why = f"the joint was {1e3 * late:.3g} ms late; taken out, the loop is not wider by it"
    if late > 0.0:
        why += "; a controller that reads this sensor has that delay as well, in the rig's delay_cycles"
    doubts, encoders = (*log.doubts, Trust("with care", (why,))), log.encoders._replace(joint_late=max(0.0, late))
    return replace(log, time=time, motor=motor, joint=joint, doubts=doubts, counts=log.resolutions, encoders=encoders)
