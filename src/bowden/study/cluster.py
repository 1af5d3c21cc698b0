"""The chunks of a campaign on dask.distributed: pure tasks, so that a worker that is lost costs nothing but time."""

import contextlib
import importlib
import logging
from collections.abc import Iterator
from typing import Any

from bowden.core.errors import BowdenError, ParameterError
from bowden.study.study import Study, software
from bowden.study.workers import Done, Work, compute, packed

_PATIENCE = 10.0
"""For a scheduler or a first worker to answer [s]."""

_LEAVE_INTERRUPTIONS = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
"""Run in each new process on this machine: the terminal sends Ctrl-C to all, and the parent ends them."""


def on_cluster(study: Study, work: Work, where: str) -> Done:
    """Over the workers of a cluster.

    Args:
        study: to compute.
        work: its chunks.
        where: the address of a scheduler, or ``local:N`` for N processes on this machine.

    Raises:
        ParameterError: no dask.distributed here, no scheduler or worker there, or workers with other software.
    """
    with _client(where) as client:
        _check_workers(client, where)
        pack, waiting = packed(study), iter(work)

        def next_task() -> Any:
            one = next(waiting, None)
            if one is None:
                return None
            chunk, numbers = one
            key = f"bowden-{study.hash}-{chunk}"
            return client.submit(compute, pack, numbers.start, numbers.stop, key=key, retries=2)

        window = 4 * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        first = [task for _ in range(window) if (task := next_task()) is not None]
        tasks = importlib.import_module("distributed").as_completed(first, loop=client.loop)
        for task in tasks:
            chunk = int(task.key.rpartition("-")[2])
            try:
                found = task.result()
            except BowdenError:
                raise
            except Exception as error:
                raise ParameterError(
                    f"the cluster cannot compute chunk {chunk}: {type(error).__name__}: {' '.join(str(error).split())}",
                    do="read the logs of its workers",
                ) from error
            following = next_task()
            if following is not None:
                tasks.add(following)
            task.release()
            yield chunk, found


@contextlib.contextmanager
def _client(where: str) -> Iterator[Any]:
    try:
        dask: Any = importlib.import_module("dask")
        distributed: Any = importlib.import_module("distributed")  # its types are half there
    except ImportError as error:
        raise ParameterError(
            "--cluster needs dask.distributed, which is not installed", do='pip install "bowden[cluster]"'
        ) from error
    quiet = {
        "distributed.logging.distributed": "critical",
        "distributed.admin.system-monitor.interval": "10s",
        "distributed.scheduler.allowed-failures": 10,
        "distributed.worker.preload": [_LEAVE_INTERRUPTIONS],
    }
    with dask.config.set(quiet), contextlib.ExitStack() as stack:
        stack.callback(logging.disable, logging.root.manager.disable)
        logging.disable(logging.CRITICAL)  # what it says of lost workers is not for who waits for results
        address: Any = where
        if where.partition(":")[0] == "local":
            count = where.partition(":")[2]
            if not (count.isdigit() and 1 <= int(count) <= 1024):
                raise ParameterError(f"--cluster is {where!r}", expected="local:N with N from 1 to 1024")
            address = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=int(count),
                    threads_per_worker=1,
                    host="127.0.0.1",
                    dashboard_address=None,
                    worker_dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            )
        try:
            if address is where:  # a client of no address would wait, and complain in the end
                importlib.import_module("distributed.comm").resolve_address(where)
            client = stack.enter_context(distributed.Client(address, timeout=_PATIENCE, set_as_default=False))
        except (OSError, ValueError, TimeoutError) as error:
            raise ParameterError(
                f"no scheduler answers at {where}: {' '.join(str(error).split())[:120] or type(error).__name__}",
                expected="the address of one that runs, such as tcp://127.0.0.1:8786, or local:N",
            ) from error
        yield client


def _check_workers(client: Any, where: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        raise ParameterError(f"the scheduler at {where} has no workers", do="start some, and try again") from error
    try:
        found = client.run(software)
    except Exception as error:
        raise ParameterError(
            f"a worker of {where} cannot run bowden: {type(error).__name__}: {' '.join(str(error).split())[:120]}",
            do=f"install bowden {software()} there",
        ) from error
    for worker, theirs in found.items():
        if theirs != software():
            raise ParameterError(
                f"the worker {worker} has bowden {theirs}, and the command {software()}",
                expected="the same software on both",
                do="install it there",
            )
