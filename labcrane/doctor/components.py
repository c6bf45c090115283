"""The hardware of components, examined by their plugins.

Each examination runs in a process of its own: a driver that crashes or hangs is a finding.
"""

import pickle
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from pydantic import ValidationError

from labcrane.core.findings import Finding
from labcrane.core.settings import Settings
from labcrane.doctor import check_process
from labcrane.protocol.components import ComponentSpec
from labcrane.protocol.study import Study
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.registry import Registry, discover

MOVING = 10.0
"""Factor of the time limit with a person who moves things."""


@dataclass(frozen=True, slots=True)
class ExaminedPart:
    """A part to examine.

    Attributes
    ----------
    area
        Its name for researchers: ``view operator``.
    role
        The word of protocols for the component's role.
    name
        The component's name.
    settings
        Those of the protocol.
    study
        The protocol, whose folder may contain plugins.
    """

    area: str
    role: str
    name: str
    settings: Settings
    study: Path | None = None


@dataclass(frozen=True, slots=True)
class PackedLook:
    """An examination for another process.

    Attributes
    ----------
    what
        What is examined, in words.
    look
        Pickled: it can be read when the study's own plugins are there.
    study
        The protocol, whose folder may contain plugins.
    """

    what: str
    look: bytes
    study: Path | None

    fix: ClassVar = "check its driver, or report it to the plugin's author"

    def prepared(self) -> Callable[[check_process.Tell | None], Iterable[Finding]]:
        """Load the plugins; return what examines."""
        registry = discover(study=self.study)
        look: ExaminedPart = pickle.loads(self.look)  # noqa: S301 - from the process that started this one
        (role,) = (role for role, entry in ROLES.items() if entry.word == look.role)
        examines = registry.offers[role][look.name].examine
        assert examines is not None  # noqa: S101 - why it is looked at
        return partial(
            examines, look.settings
        )  # no call of ours between an examination and its timer


def of_study(study: Study, registry: Registry) -> list[ExaminedPart]:
    """Return the examinations that a study needs; ``registry`` is the one it was loaded with."""
    words = {
        id(offer): ROLES[role].word
        for role, offers in registry.offers.items()
        for offer in offers.values()
    }
    return [
        ExaminedPart(area, words[id(choice.offer)], choice.name, choice.settings, study.path)
        for area, choice in _chosen(study).items()
        if choice.offer.examine is not None
    ]


def unexamined(study: Study) -> list[str]:
    """Return which devices of a study no plugin can look at, and what shows whether they work."""
    drawn = {f"feedback {name}" for name in study.cues}
    return [
        f"{area}: plugin {choice.plugin!r} has no examine for it; a session with --pilot shows "
        "whether it works"
        for area, choice in _chosen(study).items()
        if choice.offer.examine is None and area not in drawn
    ]


def _chosen(study: Study) -> dict[str, ComponentSpec]:
    return {
        f"input {study.input.name}": study.input,
        **{f"feedback {name}": choice for name, choice in (study.cues | study.sounds).items()},
        **{f"view {name}": choice for name, choice in study.views.items()},
        **{f"recording {name}": choice for name, choice in study.recordings.items()},
    }


def of_everything(registry: Registry) -> tuple[list[ExaminedPart], list[str]]:
    """Return the examinations of everything installed, and what needs a protocol for one."""
    looks, left_out = [], []
    for role, offers in registry.offers.items():
        for name, offer in sorted(offers.items()):
            if offer.examine is None:
                continue
            word = ROLES[role].word
            try:
                looks.append(ExaminedPart(f"{word} {name}", word, name, offer.settings()))
            except ValidationError:
                left_out.append(f"{word} {name}: give --protocol with a study that uses it")
    return looks, left_out


def examine(look: ExaminedPart, *, move: bool) -> Sequence[Finding]:
    """Return the plugin's findings; ``move`` if a person is there to move things."""
    wait_s = check_process.WAIT_S * (MOVING if move else 1.0)
    packed = PackedLook(f"{look.role} {look.name!r}", pickle.dumps(look), look.study)
    return check_process.examine(packed, wait_s=wait_s, asks=move)
