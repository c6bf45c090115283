"""Parallel work: in this process, or on the cores of this computer."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from labcrane.errors import LabcraneError

OrderT = TypeVar("OrderT")
ResultT = TypeVar("ResultT")

RETRIES = 3
"""Number of retries of work whose worker died."""

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
) -> Iterator[ResultT]:
    """Yield the result of each job, in the order in which they finish.

    A job must not depend on the worker that does it, and it must be repeatable.

    Parameters
    ----------
    do
        A function of a module; it and the jobs are sent to other processes.
    workers
        Processes on this computer; 1 is this one, None the useful number.

    Raises
    ------
    LabcraneError
        An error of a worker; or the workers died repeatedly.
    """
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
