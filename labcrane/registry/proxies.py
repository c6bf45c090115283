"""Proxies of components: the same methods, and every call is watched."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from labcrane.core.records import TrialStatus
from labcrane.core.roles import Component, InputDevice
from labcrane.core.signals import Layout
from labcrane.errors import PluginError
from labcrane.registry.call_monitor import CallMonitor
from labcrane.registry.hookspecs import ROLES, Returned, RoleEntry

if TYPE_CHECKING:
    from labcrane.core.clock import Tick
    from labcrane.core.records import Frame
    from labcrane.types import FloatArray


def watched(component: Component, name: str, plugin: str, call_monitor: CallMonitor) -> Component:
    """Return ``component`` under a call monitor; a component in its own process stays unwrapped."""
    for role, entry in ROLES.items():
        if entry.returns is not None and isinstance(component, role):
            return _proxy_of(role)(component, f"{entry.word} {name!r}", plugin, call_monitor, entry)
    return component


@contextmanager
def loosely_watched(components: Iterable[Component]) -> Iterator[None]:
    """Watch components less closely: whether each keeps its word, not when and where.

    For simulations. No person waits for their ticks, and a dead one is repeated.
    """
    hasty = [component for component in components if isinstance(component, _Proxy)]
    for component in hasty:
        component.watch(closely=False)
    try:
        yield
    finally:
        for component in hasty:
            component.watch()


class _Proxy(Component):
    """A component whose calls are watched: methods by :meth:`watch`, attributes asked."""

    def __init__(
        self,
        component: Component,
        called: str,
        plugin: str,
        call_monitor: CallMonitor,
        entry: RoleEntry,
    ) -> None:
        self._inner = component
        self._call_monitor = call_monitor
        self._layout = Layout(called, component.signals)
        self._returns = entry.returns or {}
        self._number = {
            method: call_monitor.place(called, plugin, method, getattr(component, method))
            for method in dir(type(self))
            if not method.startswith("_") and method != "watch"
            if callable(getattr(type(self), method))
        }
        self.watch()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_inner"], name)

    def watch(self, *, closely: bool = True) -> None:
        """Wrap every method again."""
        for method, number in self._number.items():
            function = getattr(self._inner, method)
            call = self._call_monitor.watched(
                number, function, self._check(method), closely=closely
            )
            vars(self)[method] = call
        if isinstance(self, InputDevice):  # the first that a tick enters
            vars(self)["read"] = _beginning(self._call_monitor, vars(self)["read"])

    def _check(self, method: str) -> Callable[[Any], None] | None:
        """Return the check of a method's results."""
        match self._returns.get(method):
            case Returned.NUMBERS:
                return self._numbers(self._number[method])
            case Returned.JUDGEMENT:
                return self._judgement(self._number[method])
            case _:
                return None

    def _numbers(self, number: int) -> Callable[[FloatArray], None]:
        """Return a check that values match the declared signals and are numbers.

        Most components fill the same array on every tick: the array is checked once, and then only
        its numbers are.
        """
        isfinite = math.isfinite
        known: FloatArray | None = None

        def check(values: FloatArray) -> None:
            nonlocal known
            if not (values is known and isfinite(values.dot(values))):
                self._call_monitor.check(number, values, self._layout, finite=True)
                known = values

        return check

    def _judgement(self, number: int) -> Callable[[TrialStatus], None]:
        """Return a check of judgements; while nothing happens, most tasks say the same again."""
        last: TrialStatus | None = None

        def check(judgement: TrialStatus) -> None:
            nonlocal last
            if judgement is last:
                return
            if not isinstance(judgement, TrialStatus):
                raise PluginError(self._call_monitor.complaint(number, f"returned {judgement!r}"))
            self._call_monitor.check(number, judgement.values, self._layout, finite=False)
            last = judgement

        return check


def _beginning(
    call_monitor: CallMonitor, read: Callable[[Tick, Frame], FloatArray]
) -> Callable[[Tick, Frame], FloatArray]:
    begin_tick = call_monitor.begin_tick

    def begin(tick: Tick, seen: Frame) -> FloatArray:
        begin_tick(tick.number)
        return read(tick, seen)

    return begin


@cache
def _proxy_of(role: type[Component]) -> type[_Proxy]:
    """Return the class of proxies of a role: an object of it is one of the role."""
    asked = {
        name: property(attrgetter(f"_inner.{name}"))
        for name in dir(role)
        if not name.startswith("_") and not callable(getattr(role, name))
    }
    made: Any = type(f"Watched{role.__name__}", (_Proxy, role), asked)
    made.__abstractmethods__ = frozenset()  # every method is set on each object
    proxy: type[_Proxy] = made
    return proxy
