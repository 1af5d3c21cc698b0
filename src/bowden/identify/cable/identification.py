"""One way from logs to a model: describe → fit each family → judge → trust → model.

What is fitted hangs on what there is: six families to one log, one loop that load and bend may schedule to several, and
gain and offset alone of a model that is known. What comes of it is judged and trusted by one rule.
"""

import time as clock
from collections.abc import Sequence
from dataclasses import replace

from bowden.identify.cable.family import Progress
from bowden.identify.cable.fit import Fit
from bowden.identify.cable.trust import trust
from bowden.identify.log.read import Log
from bowden.identify.log.variables import Scheduled
from bowden.plants.identified import IdentifiedCable


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
        from bowden.identify.cable.recalibrate import fit_gain

        found = fit_gain(logs[0], known, by)
    elif len(logs) == 1:
        from bowden.identify.cable.one_log import fit_log

        found = fit_log(logs[0], seed, tell)
    else:
        from bowden.identify.cable.loads import fit_logs

        found = fit_logs(logs, by, seed, tell)
    judged = trust(found, None if known is None else known.trust)
    return replace(found, trust=judged, best=replace(found.best, trust=judged), seconds=clock.perf_counter() - begin)
