"""Monitor of calls to components: which is running, how long it takes, whether it keeps its word.

Every call of a component that fails becomes a :class:`PluginError` that names component, plugin,
tick and line. Errors of labcrane's own kind pass as they are: they are the plugin's own words.
"""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from labcrane.core.signals import Layout, Signal
from labcrane.errors import LabcraneError, PluginError
from labcrane.processes.traceback import told
from labcrane.recording.crash_marker import SHIFT, CrashMarkerFile, Place

if TYPE_CHECKING:
    import numpy as np

    from labcrane.types import FloatArray

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(slots=True)
class Overrun:
    """Calls of one method that took longer than a tick may.

    Attributes
    ----------
    calls
        How many.
    waited
        How many of them computed for less than a tick: they waited for a device, or did not have
        the processor, which another program had.
    worst_s
        How long the longest took, in seconds.
    computed_s
        How long the thread had the processor from the tick's beginning to the end of that call, in
        seconds: at most so much of it did the call compute.
    """

    calls: int = 0
    waited: int = 0
    worst_s: float = 0.0
    computed_s: float = 0.0

    def add(self, took_s: float, computed_s: float, patience_s: float) -> None:
        """Count a call."""
        self.calls += 1
        self.waited += computed_s < patience_s
        if took_s > self.worst_s:
            self.worst_s, self.computed_s = took_s, computed_s


class CallMonitor:
    """State of all components of one study.

    Attributes
    ----------
    patience_s
        A call that takes longer is an overrun; a tick's period, once a session runs.
    overruns
        By place; reporting them removes them.
    """

    def __init__(self) -> None:
        self.patience_s = float("inf")
        self.overruns: dict[Place, Overrun] = {}
        self._places: list[Place] = []
        self._number = memoryview(bytearray(8)).cast("q")
        self._base = 0
        self._inside = 0
        self._computed_s = 0.0

    @property
    def tick(self) -> int:
        """Number of the tick under way, -1 before the first."""
        return (self._base >> SHIFT) - 1

    def begin_tick(self, number: int) -> None:
        """Take note of the tick that begins."""
        self._base = (number + 1) << SHIFT
        if self.patience_s < math.inf:
            # Once a tick and not at each call: it asks the kernel, for up to microseconds.
            self._computed_s = time.thread_time()

    @cached_property
    def _arrays(self) -> tuple[type[np.ndarray[Any, Any]], np.dtype[np.float64]]:
        """The type and the dtype of what a tick is made of: loaded when the first is checked."""
        import numpy as np  # noqa: PLC0415

        return np.ndarray, np.dtype(np.float64)

    @contextmanager
    def published(self, path: Path) -> Iterator[None]:
        """Say in a file where the session is; the file goes when that ends in order."""
        file = CrashMarkerFile(path, self._places)
        private, self._number = self._number, file.number
        try:
            yield
        finally:
            self._number = private
            file.close()

    def place(
        self, component: str, plugin: str, method: str, function: Callable[..., object]
    ) -> int:
        """Return the number of a method, for :meth:`call`."""
        self._places.append(Place(component, plugin, method, _source(function)))
        return len(self._places)

    def call(self, number: int, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call a component's method.

        Raises
        ------
        PluginError
            It raised an exception that is not an error of labcrane, or tried to end the process.
        """
        before, self._inside = self._inside, number
        self._number[0] = self._base + number
        began = time.perf_counter()
        try:
            result = function(*args, **kwargs)
        except LabcraneError:
            raise
        except (Exception, SystemExit) as error:
            raise self._failure(number, function, error) from error
        finally:
            self._inside = before
            self._number[0] = self._base + before
        took = time.perf_counter() - began
        if took > self.patience_s:
            overrun = self.overruns.setdefault(self._places[number - 1], Overrun())
            overrun.add(took, time.thread_time() - self._computed_s, self.patience_s)
        return result

    def watched(
        self,
        number: int,
        function: Callable[..., T],
        check: Callable[[T], None] | None = None,
        *,
        closely: bool = True,
    ) -> Callable[..., T]:
        """Return ``function`` watched as by :meth:`call`, and what it returns by ``check``.

        Not ``closely``, it is not noted when and where it is called: for simulations, in which
        no person waits for a tick, and a dead one is repeated.
        """
        if closely:

            def call(*args: Any) -> T:
                result = self.call(number, function, *args)
                if check is not None:
                    check(result)
                return result

            return call

        def call_lightly(*args: Any) -> T:
            try:
                result = function(*args)
            except LabcraneError:
                raise
            except (Exception, SystemExit) as error:
                raise self._failure(number, function, error) from error
            if check is not None:
                check(result)
            return result

        return call_lightly

    def check(self, number: int, values: FloatArray, layout: Layout, *, finite: bool) -> None:
        """Check what a method returned against what the component's signals promise.

        Raises
        ------
        PluginError
            It is not an array of that shape, or contains a value that is not a number.
        """
        array, float64 = self._arrays
        if (
            type(values) is array
            and values.dtype is float64
            and values.shape == layout.shape
            # The product is a number when all are, and costs a third of looking at each.
            and (not finite or math.isfinite(values.dot(values)))
        ):
            return
        if wrong := self._wrong(values, layout, finite=finite):
            raise PluginError(self.complaint(number, f"returned {wrong}"))

    def _wrong(self, values: FloatArray, layout: Layout, *, finite: bool) -> str:
        """Return the mistake in the values that a method returned; empty when there is none."""
        array, float64 = self._arrays
        if type(values) is not array or values.dtype != float64:
            return f"{getattr(values, 'dtype', type(values).__name__)}, not an array of float64"
        if values.shape != (layout.size,):
            return f"shape {values.shape}, but its signals need ({layout.size},)"
        pairs = zip(layout.columns, values.tolist(), strict=True)
        return ", ".join(f"{name} {x}" for name, x in pairs if finite and not math.isfinite(x))

    def _failure(
        self, number: int, function: Callable[..., object], error: BaseException
    ) -> PluginError:
        return PluginError(self.complaint(number, f"raised {told(error, _module(function))}"))

    def complaint(self, number: int, what: str) -> str:
        """Return the error of a method, with its component, plugin and place."""
        when = f" in tick {self.tick}" if self.tick >= 0 else ""
        return f"{self._places[number - 1]}, {what}{when}"


def promised(
    called: str, signals: Sequence[Signal], method: Callable[[T], FloatArray], frame: T
) -> FloatArray:
    """Return the result of a method of feedback or a cue for a frame.

    Raises
    ------
    PluginError
        It is not what the component's signals promise; NaN may be.
    """
    values = method(frame)
    size = Layout(called, tuple(signals)).size
    shape = getattr(values, "shape", type(values).__name__)
    if shape != (size,):
        raise PluginError(
            f"{called} returned shape {shape} from {method.__name__}() ({_source(method)}), but "
            f"its signals need ({size},)"
        )
    return values


def _module(function: Callable[..., object]) -> Path | None:
    code = getattr(inspect.unwrap(function), "__code__", None)
    return Path(code.co_filename) if code else None


def _source(function: Callable[..., object]) -> str:
    code = getattr(inspect.unwrap(function), "__code__", None)
    return f"{code.co_filename}:{code.co_firstlineno}" if code else str(function)
