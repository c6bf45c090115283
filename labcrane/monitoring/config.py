"""Configuration of monitors: which of them look at the streams of a session."""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from labcrane.core.roles import SignalMonitor
from labcrane.core.signals import SignalStream
from labcrane.errors import StreamError
from labcrane.machines.library import load_machine
from labcrane.machines.machine import Machine
from labcrane.registry.registry import Registry, discover

MACHINE = "ch8"
"""Default machine without a study: monitors are built with a machine, like all components."""


@dataclass(frozen=True, slots=True)
class MonitorConfig:
    """Configuration of the monitors of signals, ready for JSON.

    Attributes
    ----------
    protocol
        The study's protocol, whose folder contains its own plugins and machine; empty for none.
    machine
        Name of the machine that is operated.
    use
        Names and settings of the monitors; None for all that are installed, without settings.
    """

    protocol: str = ""
    machine: str | Mapping[str, Any] = MACHINE
    use: Sequence[Mapping[str, Any]] | None = None

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> "MonitorConfig":
        """Return the config of a JSON object."""
        known = cls.__dataclass_fields__
        if unknown := sorted(set(fields) - set(known)):
            raise StreamError(
                f"monitors have no setting {', '.join(unknown)}; they have {', '.join(known)}"
            )
        return cls(**fields)


class MonitorBuilder:
    """Builds new monitors for each stream, of every kind that knows it. Thread-safe."""

    def __init__(self, config: MonitorConfig) -> None:
        path = Path(config.protocol) if config.protocol else None
        self._registry: Registry = discover(study=path)
        folder = path.parent if path else Path()
        self._machine: Machine = load_machine(config.machine, folder)
        self._folder = folder
        self._use = config.use
        self._lock = threading.Lock()

    def build(self, stream: SignalStream) -> dict[str, SignalMonitor]:
        """Return the monitors that know ``stream``, begun with it, by their names.

        Raises
        ------
        PluginError
            A monitor that is named is not installed.
        """
        with self._lock:  # plugins are imported by one thread at a time
            return self._build(stream)

    def _build(self, stream: SignalStream) -> dict[str, SignalMonitor]:
        built = {}
        for name, settings in self._named():
            offer = self._registry.find(SignalMonitor, name)
            checked = offer.settings.model_validate(settings, context={"folder": self._folder})
            monitor = offer.build(checked, self._machine)
            if monitor.knows(stream):
                monitor.begin(stream)
                built[name] = monitor
        return built

    def _named(self) -> list[tuple[str, Mapping[str, Any]]]:
        if self._use is None:
            return [(name, {}) for name in self._registry.offers[SignalMonitor]]
        return [(str(use["use"]), use.get("settings", {})) for use in self._use]
