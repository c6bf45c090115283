"""Population of simulated participants: how its operators differ, and how many leave."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist
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

from labcrane.core.items import Item
from labcrane.core.records import Value
from labcrane.design.plan import SessionPlan
from labcrane.design.seeds import derive
from labcrane.errors import ProtocolError, nearest
from labcrane.files.complaints import WrongKey, told
from labcrane.files.yaml import YamlFile
from labcrane.protocol.steps import Section
from labcrane.protocol.study import Study


class Lognormal(Section):
    """Positive, with a long tail: most differences between people are of this kind."""

    median: PositiveFloat
    """The median: half of the participants are below it."""

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
            raise WrongKey(
                f"lowest is {self.lowest:g}, above highest, {self.highest:g}; exchange them",
                at=("lowest",),
            )
        return self

    def draw(self, random: np.random.Generator) -> float:
        """Return one participant's value."""
        return float(random.uniform(self.lowest, self.highest))


class Normal(Section):
    """A bell, cut off where no participant was."""

    mean: FiniteFloat
    """The mean before it is cut off."""

    sd: PositiveFloat
    """The standard deviation before it is cut off."""

    lowest: FiniteFloat
    """The smallest value."""

    highest: FiniteFloat
    """The largest value."""

    def draw(self, random: np.random.Generator) -> float:
        """Return one participant's value."""
        bell = NormalDist(self.mean, self.sd)
        chance = random.uniform(bell.cdf(self.lowest), bell.cdf(self.highest))
        # There and back is rounded: by the last digit, a value may be outside.
        return min(max(bell.inv_cdf(float(chance)), self.lowest), self.highest)


class Shares(Section):
    """One of several choices."""

    shares: dict[str, PositiveFloat] = Field(min_length=1)
    """How many, or how large a part, give each."""


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

    answers: dict[str, dict[str, Normal | Uniform | Shares]] = Field(default_factory=dict)
    """How answers are distributed, by questionnaire and item: numbers, or of a choice how many
    give each. Items that are not named here are answered by chance."""

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
            A sampled value is impossible for the operator.
        """
        own = self.drawn(study, participant, group)
        choice = study.operator
        settings = choice.settings.model_dump() | own
        try:
            checked = type(choice.settings).model_validate(settings)
        except ValidationError as error:
            first = next(told(error.errors(), ("operator",), type(choice.settings)))
            name = str(first.place[0])
            what = first.message.partition("; ")[2] or first.message
            raise ProtocolError(
                f"participant {participant} was drawn with {name} {own[name]:g}, which "
                f"{choice.name!r} cannot have: {what}; narrow its distribution"
            ) from None
        answers = self.answered(study, participant)
        return replace(study, operator=replace(choice, settings=checked), answers=answers)

    def answered(self, study: Study, participant: str) -> dict[str, dict[str, Value]]:
        """Return a participant's answers, by questionnaire and item."""
        found: dict[str, dict[str, Value]] = {}
        for name, spreads in self.answers.items():
            items = {item.name: item for item in study.questionnaires[name].items()}
            for item, spread in spreads.items():
                random = _random(study, participant, f"answer {name} {item}")
                found.setdefault(name, {})[item] = _drawn(items[item], spread, random)
        return found

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
    population = source.check(Population)
    named = population or source.but_for_numbers(Population, source.data)
    if named is not None:
        _check(named, study, source)
    source.raise_problems()
    if population is None:
        raise AssertionError("what is wrong with a file is a problem, and problems were raised")
    return population


def _check(population: Population, study: Study, source: YamlFile) -> None:
    groups = tuple(study.protocol.design.groups)
    _check_names(population.operator, study, source, ("operator",))
    _check_ends(population, study, source)
    for group, factors in population.groups.items():
        if group not in groups:
            known = ", ".join(groups) or "none"
            message = f"there is no group {group!r}; there is {known}"
            source.problem(("groups", group), message, key=True)
        _check_names(factors, study, source, ("groups", group))
    for name, spreads in population.answers.items():
        if (asked := study.questionnaires.get(name)) is None:
            message = f"there is no questionnaire {name!r}; "
            message += nearest(name, study.questionnaires, "there is")
            source.problem(("answers", name), message, key=True)
            continue
        items = {item.name: item for item in asked.items()}
        for item, spread in spreads.items():
            if why := _why_not(name, item, spread, items):
                source.problem(("answers", name, item), why, key=True)


def _check_ends(population: Population, study: Study, source: YamlFile) -> None:
    """Complain of values, alone and with a group's factor, that the operator cannot have."""
    written = _numbers(study)
    for name, drawn in population.operator.items():
        if name not in written:
            continue
        for end, value in _ends(drawn).items():
            if why := _impossible(study, name, value):
                source.problem(("operator", name, end), f"{name} is {value:g}; {why}")
    for group, factors in population.groups.items():
        for name, factor in factors.items():
            if name not in written:
                continue
            drawn_from = population.operator.get(name)
            values = [written[name]] if drawn_from is None else [*_ends(drawn_from).values()]
            if why := _why_no_factor(study, name, factor, values):
                source.problem(("groups", group, name), why)


def _ends(spread: Lognormal | Uniform) -> dict[str, float]:
    """Return values that are certain to be sampled, or approached closely, by their keys.

    A lognormal distribution is represented by its median, since its tails are infinite. A value of
    a tail that is impossible is reported with the participant for whom it was sampled.
    """
    if isinstance(spread, Lognormal):
        return {"median": spread.median}
    return {"lowest": spread.lowest, "highest": spread.highest}


def _impossible(study: Study, name: str, value: float) -> str:
    """Return why the study's operator cannot have this setting; an empty text where it can.

    Rules between several settings are not checked here: the other settings are sampled as well.
    """
    settings = study.operator.settings
    try:
        type(settings).model_validate(settings.model_dump() | {name: value})
    except ValidationError as error:
        alone = [each for each in error.errors() if each["type"] != "value_error"]
        for complaint in told(alone, (), type(settings)):
            if complaint.place and complaint.place[0] == name:
                return complaint.message.partition("; ")[2] or complaint.message
    return ""


def _why_no_factor(study: Study, name: str, factor: float, values: Sequence[float]) -> str:
    """Return why no member of a group can have a setting, multiplied; empty where they can."""
    for value in values:
        why = "" if _impossible(study, name, value) else _impossible(study, name, factor * value)
        if why:
            return f"{name} is {factor:g} times {value:g}, {factor * value:g}; {why}"
    return ""


def _why_not(
    name: str, asked: str, spread: Normal | Uniform | Shares, items: Mapping[str, Item]
) -> str:
    """Return why an item cannot be answered so; nothing where it can."""
    item = items.get(asked)
    if item is None:
        return f"{name!r} does not ask {asked!r}; {nearest(asked, items, 'it asks')}"
    if isinstance(spread, Shares):
        if item.kind != "choice":
            return f"{asked!r} is not a choice but {item.takes}; give mean, sd, lowest and highest"
        unknown = [choice for choice in spread.shares if choice not in item.choices]
        if unknown:
            there = ", ".join(item.choices)
            return f"{asked!r} has no choice {', '.join(unknown)}; it has {there}"
        return ""
    if item.kind not in {"scale", "number"}:
        return f"{asked!r} is not a number but {item.takes}"
    if not item.lowest <= spread.lowest <= spread.highest <= item.highest:
        return (
            f"{asked!r} is from {item.lowest:g} to {item.highest:g}, not from {spread.lowest:g} to "
            f"{spread.highest:g}"
        )
    if isinstance(spread, Normal) and not spread.lowest < spread.mean < spread.highest:
        return (
            f"the mean, {spread.mean:g}, is not between lowest, {spread.lowest:g}, and highest, "
            f"{spread.highest:g}"
        )
    for limit in (spread.lowest, spread.highest):
        steps = (limit - item.lowest) / item.step if item.step else 0.0
        if not math.isclose(steps, round(steps), abs_tol=1e-9):
            return f"{asked!r} takes {item.takes}, and {limit:g} is none of them"
    return ""


def _drawn(
    item: Item,
    spread: Normal | Uniform | Shares,
    random: np.random.Generator,
) -> Value:
    """Return one participant's answer, on the steps that the item has."""
    if isinstance(spread, Shares):
        shares = np.array(list(spread.shares.values()))
        return list(spread.shares)[int(random.choice(len(shares), p=shares / shares.sum()))]
    return item.nearest(spread.draw(random))


def _check_names(
    names: Mapping[str, object], study: Study, source: YamlFile, place: tuple[str, ...]
) -> None:
    numbers = _numbers(study)
    for name in names:
        if name not in numbers:
            source.problem(
                (*place, name),
                f"{name!r} is not a numeric setting of {study.operator.name!r}; choose one of "
                f"{', '.join(numbers)}",
                key=True,
            )


def _numbers(study: Study) -> dict[str, float]:
    """Return the numeric settings of the study's operator."""
    written = study.operator.settings.model_dump()
    return {name: value for name, value in written.items() if type(value) in (int, float)}


def _random(study: Study, participant: str, what: str) -> np.random.Generator:
    return np.random.default_rng(derive(study.protocol.study, participant, "population", what))
