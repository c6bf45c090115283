"""Parallel work: in this process, on the cores of this computer, or on a cluster."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from labcrane.errors import LabcraneError, PluginError, ProtocolError

OrderT = TypeVar("OrderT")
ResultT = TypeVar("ResultT")

RETRIES = 3
"""Number of retries of work whose worker died."""

CONNECT_S = 10.0
"""Longest time to wait for a scheduler to answer, in seconds."""

SHARE = 4
"""Minimum number of jobs per worker: with fewer, loading libraries takes longer than the work."""


def usual_workers(orders: int) -> int:
    """Return the useful number of processes for a number of jobs on this computer."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(cores or 1, orders // SHARE))


def work(
    do: Callable[[OrderT], ResultT],
    orders: Sequence[OrderT],
    workers: int | None = 1,
    scheduler: str | None = None,
) -> Iterator[ResultT]:
    """Yield the result of each job, in the order in which they finish.

    A job must not depend on the worker that does it, and it must be repeatable.

    Parameters
    ----------
    do
        A function of a module; it and the jobs are sent to other processes.
    workers
        Processes on this computer; 1 is this one, None the useful number.
    scheduler
        Address of a Dask scheduler, ``tcp://host:8786``, whose workers do it instead.

    Raises
    ------
    LabcraneError
        An error of a worker; or the workers died repeatedly.
    """
    if scheduler is not None:
        return _on_cluster(do, orders, scheduler)
    workers = usual_workers(len(orders)) if workers is None else workers
    if workers > 1:
        return _on_cores(do, orders, workers)
    return map(do, orders)


def _on_cores(
    do: Callable[[OrderT], ResultT], orders: Sequence[OrderT], workers: int
) -> Iterator[ResultT]:
    from concurrent.futures import as_completed
    from concurrent.futures.process import BrokenProcessPool

    from loky import ProcessPoolExecutor

    left = list(orders)
    why: Exception | None = None
    for _ in range(1 + RETRIES):
        with ProcessPoolExecutor(max_workers=workers, initializer=_be_ended_by_the_parent) as pool:
            given = {pool.submit(do, order): order for order in left}
            try:
                for future in as_completed(given):
                    result = future.result()
                    left.remove(given[future])
                    yield result
            except BrokenProcessPool as error:
                why = error
                continue  # a worker was lost, and the whole pool with it
            except (KeyboardInterrupt, GeneratorExit):
                # Do not wait for jobs under way: a dying worker leaves nothing behind.
                pool.shutdown(kill_workers=True)
                raise
            finally:
                for future in given:
                    future.cancel()
            # All results are here: do not wait for workers to unload their libraries.
            pool.shutdown(kill_workers=True)
        return
    raise LabcraneError(
        f"worker processes died {1 + RETRIES} times, and {len(left)} of {len(orders)} jobs are "
        "not done; find out what kills them (memory?), or use fewer with --workers"
    ) from why


def _be_ended_by_the_parent() -> None:
    """Leave the interrupt that a terminal sends to all processes to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _on_cluster(
    do: Callable[[OrderT], ResultT], orders: Sequence[OrderT], scheduler: str
) -> Iterator[ResultT]:
    try:
        from distributed import Client, as_completed
        from distributed.scheduler import KilledWorker
    except ModuleNotFoundError as error:
        raise PluginError(
            "--scheduler needs Dask, which is not installed; install labcrane[cluster]"
        ) from error
    try:
        client = Client(scheduler, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise ProtocolError(
            f"no Dask scheduler answers at {scheduler!r}: {error}; start one with dask scheduler, "
            "and give the address that it prints"
        ) from error
    with client:
        # A worker that dies takes no result with it: the scheduler gives its work to another.
        futures = client.map(do, orders, pure=False, retries=0)
        try:
            for _, result in as_completed(futures, with_results=True):
                yield result
        except KilledWorker as error:
            raise LabcraneError(
                f"workers of {scheduler} died again and again: {error}; check their logs"
            ) from error
        finally:
            client.cancel(futures)
