"""Presenter of frames: one feedback component, and the cues it draws."""

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from labcrane.core.records import Frame, SessionState, Value
from labcrane.core.roles import Component, Cue, Feedback
from labcrane.core.settings import Settings
from labcrane.core.signals import Layout
from labcrane.feedback.config import ComponentConfig, FeedbackConfig
from labcrane.feedback.delays import delay_in_words
from labcrane.registry.call_monitor import promised
from labcrane.registry.offers import Offer
from labcrane.registry.registry import Registry
from labcrane.types import FloatArray

RoleT = TypeVar("RoleT", bound=Component)


class Presenter:
    """Presents frames with one feedback component and the cues it draws.

    Used by the feedback process, and without it by previews, measurements of delays and tests.
    """

    def __init__(self, order: FeedbackConfig, registry: Registry) -> None:
        self._order = order
        self._registry = registry
        self._situation = SessionState()
        self._resting = True
        self.feedback = self._presenting()
        self.cues = {name: self._built(Cue, name, part) for name, part in order.cues.items()}

    @property
    def layout(self) -> Layout:
        """Signals of :meth:`present`: the component's, then those of every cue."""
        cues = (
            replace(signal, name=f"cue.{name}.{signal.name}")
            for name, cue in self.cues.items()
            for signal in cue.signals
        )
        return Layout(self._order.name, (*self.feedback.signals, *cues))

    @property
    def facts(self) -> dict[str, Value]:
        """Facts of the open component and its delay, for the record."""
        facts = dict(self.feedback.metadata())
        return {**facts, "delay": delay_in_words(self._order.measured, facts)}

    def open(self) -> None:
        """Open everything; raises what the components raise."""
        for component in (*self.cues.values(), self.feedback):
            component.open(self._order.run)
        self.feedback.update(self._situation)

    def close(self) -> None:
        """Close everything."""
        for component in (self.feedback, *self.cues.values()):
            component.close()

    def update(self, situation: SessionState) -> None:
        """Take up a new situation; components with new settings apply them or are rebuilt."""
        before, self._situation = self._situation, situation
        for name in {*situation.settings, *before.settings}:
            if situation.settings.get(name) != before.settings.get(name):
                self._rebuild(name)
        self.feedback.update(situation)

    def present(self, frame: Frame) -> FloatArray | None:
        """Present a frame; return what was presented, or None while switched off."""
        active = self._situation.active
        if not self._order.always and self._order.name not in active:
            if not self._resting:
                self.feedback.idle()
                self._resting = True
            return None
        self._resting = False
        values = []
        shapes: list[Any] = []
        for name, cue in self.cues.items():
            if name in active and frame.trial:
                shapes += cue.draw(frame)
                values.append(promised(f"cue {name!r}", cue.signals, cue.values, frame))
            else:
                values.append(np.full(Layout(name, cue.signals).size, np.nan))
        frame.shapes = tuple(shapes)
        said = f"feedback {self._order.name!r}"
        shown = promised(said, self.feedback.signals, self.feedback.present, frame)
        return np.concatenate([shown, *values])

    def _rebuild(self, name: str) -> None:
        if name in self.cues:
            self.cues[name].close()
            self.cues[name] = self._built(Cue, name, self._order.cues[name])
            self.cues[name].open(self._order.run)
        elif name == self._order.name:
            offer = self._registry.find(Feedback, self._order.part.use)
            if self.feedback.adjust(self._settings(offer, name, self._order.part)):
                return
            self.feedback.close()
            self.feedback = self._presenting()
            self.feedback.open(self._order.run)

    def _presenting(self) -> Feedback:
        """Return the component, with its window's title and the windows before it."""
        order = self._order
        feedback = self._built(Feedback, order.name, order.part)
        settings = self._registry.find(Feedback, order.part.use).settings
        feedback.title = order.title
        feedback.before = [
            settings.model_validate(part.settings)
            for part in order.before
            if part.use == order.part.use
        ]
        return feedback

    def _built(self, role: type[RoleT], name: str, part: ComponentConfig) -> RoleT:
        offer = self._registry.find(role, part.use)
        return offer.build(self._settings(offer, name, part), self._order.run.machine)

    def _settings(self, offer: Offer[RoleT], name: str, part: ComponentConfig) -> Settings:
        changed = self._situation.settings.get(name, {})
        return offer.settings.model_validate({**part.settings, **changed})
