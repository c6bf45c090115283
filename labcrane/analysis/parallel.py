"""The same work for many things at once: here, on the cores of this computer, or on a cluster."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from labcrane.errors import LabcraneError, PluginError, ProtocolError

OrderT = TypeVar("OrderT")
ResultT = TypeVar("ResultT")

RETRIES = 3
"""How often work is given to another worker after its own has died."""

CONNECT_S = 10.0
"""Longest time to wait for a scheduler to answer, in seconds."""

SHARE = 4
"""Pieces of work below which a worker loads libraries for longer than it works."""


def usual_workers(orders: int) -> int:
    """Return how many processes are worth it for so many pieces of work on this computer."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(cores or 1, orders // SHARE))


def work(
    do: Callable[[OrderT], ResultT],
    orders: Sequence[OrderT],
    workers: int | None = 1,
    scheduler: str | None = None,
) -> Iterator[ResultT]:
    """Yield what comes of each order, in the order in which they are finished.

    What a worker does must not depend on which worker it is, and must bear being done twice.

    Parameters
    ----------
    do
        A function of a module; it and the orders are sent to other processes.
    workers
        Processes on this computer; 1 is this one, None as many as are worth it.
    scheduler
        Address of a Dask scheduler, ``tcp://host:8786``, whose workers do it instead.

    Raises
    ------
    LabcraneError
        What a worker raised; or the workers died again and again.
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
                # Nobody waits for what is begun: what a worker does leaves nothing when it dies.
                pool.shutdown(kill_workers=True)
                raise
            finally:
                for future in given:
                    future.cancel()
            # What is done is here: nobody waits for workers to unload their libraries.
            pool.shutdown(kill_workers=True)
        return
    raise LabcraneError(
        f"worker processes died {1 + RETRIES} times, and {len(left)} of {len(orders)} pieces of "
        "work are not done; look for what kills them (memory?), or use fewer with --workers"
    ) from why


def _be_ended_by_the_parent() -> None:
    """Let the interrupt that a terminal sends to all of a program's processes be the parent's."""
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
                f"workers of {scheduler} died again and again: {error}; look into their logs"
            ) from error
        finally:
            client.cancel(futures)
