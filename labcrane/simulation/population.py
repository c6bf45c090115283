"""Population of simulated participants: how its operators differ, and how many leave."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import (
    Field,
    FiniteFloat,
    NonNegativeFloat,
    PositiveFloat,
    ValidationError,
    model_validator,
)

from labcrane.design.plan import SessionPlan
from labcrane.design.seeds import derive
from labcrane.errors import ProtocolError
from labcrane.files.yaml import YamlFile
from labcrane.protocol.steps import Section
from labcrane.protocol.study import Study

BESIDE = "cohort.yaml"
"""Name of the population's file beside a protocol."""


class Lognormal(Section):
    """Positive, with a long tail: most differences between people are of this kind."""

    median: PositiveFloat
    """What half of the participants are below."""

    log_sd: NonNegativeFloat
    """Standard deviation of the logarithm."""

    def draw(self, random: np.random.Generator) -> float:
        """Return one participant's value."""
        return self.median * math.exp(self.log_sd * float(random.standard_normal()))


class Uniform(Section):
    """Anything between two values, each as likely."""

    lowest: FiniteFloat
    """The smallest value."""

    highest: FiniteFloat
    """The largest value."""

    @model_validator(mode="after")
    def _in_order(self) -> "Uniform":
        if self.lowest > self.highest:
            raise ValueError(
                f"lowest is {self.lowest:g}, above highest, {self.highest:g}; exchange them"
            )
        return self

    def draw(self, random: np.random.Generator) -> float:
        """Return one participant's value."""
        return float(random.uniform(self.lowest, self.highest))


class Population(Section):
    """The participants of a simulated study.

    Every value follows from the study's name, the participant's and the setting's, so that a
    setting more does not change the others.
    """

    labcrane_cohort: Literal[1]
    """Version of the format."""

    operator: dict[str, Lognormal | Uniform] = Field(default_factory=dict)
    """How settings of the protocol's operator are distributed; those that are not named here are
    for everybody as the protocol has them."""

    groups: dict[str, dict[str, PositiveFloat]] = Field(default_factory=dict)
    """By what a between-subject group's settings are multiplied: the effect that is put in."""

    dropout: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a participant leaves during a session; the later ones are then missing."""

    def drawn(self, study: Study, participant: str, group: str = "") -> dict[str, float]:
        """Return a participant's own settings of the operator."""
        own = {
            name: spread.draw(_random(study, participant, name))
            for name, spread in self.operator.items()
        }
        written = study.operator.settings.model_dump()
        for name, factor in self.groups.get(group, {}).items():
            own[name] = factor * own.get(name, written[name])
        return own

    def study_of(self, study: Study, participant: str, group: str = "") -> Study:
        """Return the study with this participant as its operator.

        Raises
        ------
        ProtocolError
            A value that was drawn is none that the operator can have.
        """
        own = self.drawn(study, participant, group)
        choice = study.operator
        settings = choice.settings.model_dump() | own
        try:
            checked = type(choice.settings).model_validate(settings)
        except ValidationError as error:
            name = error.errors()[0]["loc"][0]
            raise ProtocolError(
                f"participant {participant} was drawn with {name} {own[str(name)]:g}, which "
                f"{choice.name!r} cannot have: {error.errors()[0]['msg']}; narrow its distribution"
            ) from None
        return replace(study, operator=replace(choice, settings=checked))

    def leaves_at(self, study: Study, plan: SessionPlan) -> int | None:
        """Return the trial of the session in which the participant leaves; None for staying."""
        random = _random(study, plan.participant, f"dropout {plan.number}")
        leaving, when = random.uniform(size=2).tolist()
        trials = sum(len(block.trials) for block in plan.blocks)
        return 1 + int(when * trials) if leaving < self.dropout and trials else None


EVERYBODY_THE_SAME = Population(labcrane_cohort=1)
"""Participants who differ in nothing but their seeds."""


def read_population(path: Path | None, study: Study) -> Population:
    """Read a population, and check it against the study it is for; without a file all are alike.

    Raises
    ------
    ProtocolError
        With one line for every mistake.
    """
    if path is None:
        return EVERYBODY_THE_SAME
    source = YamlFile.read(path)
    population = source.checked(Population)
    _check(population, study, source)
    source.raise_problems()
    return population


def _check(population: Population, study: Study, source: YamlFile) -> None:
    groups = tuple(study.protocol.design.groups)
    _check_names(population.operator, study, source, ("operator",))
    for group, factors in population.groups.items():
        if group not in groups:
            known = ", ".join(groups) or "none"
            message = f"there is no group {group!r}; there is {known}"
            source.problem(("groups", group), message, key=True)
        _check_names(factors, study, source, ("groups", group))


def _check_names(
    names: Mapping[str, object], study: Study, source: YamlFile, place: tuple[str, ...]
) -> None:
    written = study.operator.settings.model_dump()
    numbers = [name for name, value in written.items() if type(value) in (int, float)]
    for name in names:
        if name not in numbers:
            source.problem(
                (*place, name),
                f"{name!r} is no number that {study.operator.name!r} is set by; there is "
                f"{', '.join(numbers)}",
                key=True,
            )


def _random(study: Study, participant: str, what: str) -> np.random.Generator:
    return np.random.default_rng(derive(study.protocol.study, participant, "population", what))
