"""Settings of the questionnaires."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, ValidationInfo, field_validator, model_validator

from labcrane import Machine, ProtocolError, Settings
from labcrane.core import (
    AnswerError,
    Item,
    Names,
    Once,
    Reference,
    StudyPath,
    WrongKey,
    look,
    outside,
    read_yaml,
    unlike,
    was_run,
)

SIX = 6
"""Scales of the task load index."""

SUS_SPAN = (1.0, 5.0, 1.0)
"""Lowest and highest answer of a statement of the system usability scale, and the step."""

NAME = r"^[a-z][a-z0-9_]*$"


def unstepped(words: Mapping[float, str], lowest: float, highest: float, step: float) -> str:
    """Return which words do not belong to a step of the scale; empty if all do."""
    scale = Item("scale", "", "scale", lowest, highest, step)
    for at in words:
        try:
            scale.check(float(at))
        except AnswerError:
            return f"has words at {at:g}, and takes {scale.takes}; write words at these alone"
    return ""


def _twice(names: Sequence[str]) -> list[str]:
    return [each for each in names if names.count(each) > 1]


class RatingSettings(Settings):
    """Settings of questionnaires whose wording comes from labcrane."""

    language: Literal["en", "de"] = "en"
    """Language of the questionnaire."""


Asked = Literal["age", "gender", "sex", "handedness", "experience", "gaming"]
"""Items that demographics can include."""


class DemographicsSettings(RatingSettings):
    """Settings of the demographics that a study reports."""

    ask: Annotated[tuple[Asked, ...], Field(min_length=1)] = (
        "age",
        "sex",
        "handedness",
        "experience",
        "gaming",
    )
    """Items, in this order; ask only what the study reports."""

    @field_validator("ask")
    @classmethod
    def _each_is_one(cls, ask: tuple[Asked, ...]) -> tuple[Asked, ...]:
        if twice := _twice(ask):
            raise ValueError(f"{twice[0]!r} is listed twice; write each once")
        return ask


class LabText(Settings):
    """The wording of a questionnaire that labcrane must not distribute: a file of the lab."""

    rights: str = Field(min_length=1)
    """The lab's permission to use this wording; it is recorded."""

    title: str = ""
    """Title above the items; the usual name by default."""

    items: tuple[str, ...] = Field(min_length=1)
    """The items, in the order of the publication."""

    left: str = ""
    """Words at the lowest end of every scale."""

    right: str = ""
    """Words at the highest end of every scale."""

    words: dict[float, str] = Field(default_factory=dict)
    """Labels of the steps of every scale, as in the publication: ``{0: none, 1: slight}``. The page
    then shows the scale as a list."""


def _only_the_file(schema: dict[str, Any]) -> None:
    """Omit the keys that are read from the file: protocols do not contain them."""
    del schema["properties"]["text"]
    schema["required"].remove("text")


class TlxText(LabText):
    """The task load index in another language."""

    performance: tuple[str, str]
    """Words at the ends of the scale of performance, from good to poor."""

    pair: str
    """Wording for each pair, with {one} and {other} in the places of the scales' titles."""

    @field_validator("items")
    @classmethod
    def _are_six(cls, items: tuple[str, ...]) -> tuple[str, ...]:
        if len(items) != SIX or not all(": " in item for item in items):
            raise ValueError(
                "the six scales are needed, mental, physical and temporal demand, performance, "
                "effort and frustration, each as its title, a colon and its definition"
            )
        return items

    @field_validator("words")
    @classmethod
    def _are_at_the_ends(cls, words: dict[float, str], info: ValidationInfo) -> dict[float, str]:
        if words and not was_run(info):
            raise ValueError(
                f"NASA task load index has words at {min(words):g}, and its scales have words at "
                "their ends alone; write left, right and performance, and leave words out"
            )
        return words

    @field_validator("pair")
    @classmethod
    def _names_both(cls, pair: str) -> str:
        if "{one}" not in pair or "{other}" not in pair:
            raise ValueError("it must have {one} and {other} in the places of the scales' titles")
        return pair


def _perhaps_the_file(schema: dict[str, Any]) -> None:
    """Omit the keys that are read from the file."""
    del schema["properties"]["text"]


class TranslatedSettings(Settings):
    """Settings of a questionnaire in English, or in the language of a file of the lab."""

    model_config = ConfigDict(json_schema_extra=_perhaps_the_file)

    language: Literal["en"] = "en"
    """Language of the questionnaire without a file."""

    file: StudyPath | None = None
    """YAML file with a translation, in the protocol's folder: rights, items, and optionally title,
    left, right and words."""

    text: LabText | None = None
    """What the file holds; read from it."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any, info: ValidationInfo) -> Any:
        if not (isinstance(given, dict) and isinstance(given.get("file"), str)):
            return given
        return given if "text" in given else {**given, "text": _lab_file(given["file"], info)}


class SusSettings(TranslatedSettings):
    """Settings of the system usability scale."""

    @model_validator(mode="after")
    def _words_are_at_steps(self, info: ValidationInfo) -> "SusSettings":
        words = self.text.words if self.text is not None else {}
        if not was_run(info) and (wrong := unstepped(words, *SUS_SPAN)):
            raise WrongKey(f"SUS {wrong}", at=("file",))
        return self


class TlxSettings(TranslatedSettings):
    """Settings of the NASA task load index."""

    weighted: bool = False
    """Whether the fifteen pairwise comparisons are included, for the weighted score."""

    text: TlxText | None = None
    """What the file holds; read from it."""


class LabTextSettings(Settings):
    """Settings of a questionnaire whose wording the lab must provide."""

    model_config = ConfigDict(json_schema_extra=_only_the_file)

    file: StudyPath
    """YAML file with the wording, in the protocol's folder: rights, items, and optionally title,
    left, right and words."""

    text: LabText
    """What the file holds; read from it."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any, info: ValidationInfo) -> Any:
        if not (isinstance(given, dict) and isinstance(given.get("file"), str)):
            raise ValueError(  # noqa: TRY004 - pydantic collects these
                "its words may not be passed on with labcrane; name the lab's own file with "
                "file: (docs/questionnaires.md says what is in it)"
            )
        return given if "text" in given else {**given, "text": _lab_file(given["file"], info)}


class WordedSettings(LabTextSettings):
    """Settings of a questionnaire whose published scales have words at their steps."""

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        if self.text.words:
            return {}
        return {
            "file": "has no words, which the publication has at the steps of the scale, so that "
            "what is asked is not the published instrument; write them there, as words: "
            "{0: none, 1: slight}"
        }


def _lab_file(name: str, info: ValidationInfo) -> Any:
    """Return the content of a YAML file in the protocol's folder."""
    folder: Path = (info.context or {}).get("folder", Path())
    path = folder / name
    if not was_run(info) and info.context and (why := outside(path, folder)):
        raise WrongKey(why, at=("file",))
    try:
        return read_yaml(path)
    except ProtocolError as error:
        raise WrongKey(
            f"the lab's file {str(path)!r} cannot be read: {error}", at=("file",)
        ) from None


class QuestionSettings(Settings):
    """One item of the lab's own questionnaire."""

    name: str = Field(pattern=NAME)
    """Name of the answer in the record: a lower-case word."""

    text: str
    """Text of the item."""

    kind: Literal["scale", "number", "choice", "text"] = "scale"
    """``scale``: steps between two ends; ``number``; ``choice``; ``text``."""

    lowest: float = 0.0
    """Smallest number that can be answered."""

    highest: float = 10.0
    """Largest number that can be answered."""

    step: float = Field(default=1.0, ge=0.0)
    """Step of a scale or number; 0 allows any value in between."""

    left: str = ""
    """Words at the lowest end of a scale."""

    right: str = ""
    """Words at the highest end of a scale."""

    words: dict[float, str] = Field(default_factory=dict)
    """Labels of a scale's steps: ``{0: never, 5: now and then, 10: always}``."""

    choices: tuple[str, ...] = ()
    """Options of a choice."""

    required: bool = True
    """Whether it must be answered, or declined, before the questionnaire is submitted."""

    @field_validator("choices")
    @classmethod
    def _each_is_another(cls, choices: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        if was_run(info):
            return choices
        if twice := _twice(choices):
            raise ValueError(f"{twice[0]!r} is listed twice; write each once")
        known: dict[str, str] = {}
        for each in choices:
            if len(each.splitlines()) > 1:
                raise ValueError(
                    f"{each!r} has a line end, which tables do not hold; write it in one line"
                )
            if (other := known.setdefault(look(each), each)) != each:
                raise ValueError(f"{other!r} and {each!r}. {unlike(each, other)}; rename one")
        return choices

    @model_validator(mode="after")
    def _can_be_answered(self, info: ValidationInfo) -> "QuestionSettings":
        if self.kind == "choice" and not self.choices:
            raise WrongKey(
                f"question {self.name!r} is a choice and has no choices; list them",
                at=("choices" if "choices" in self.model_fields_set else "kind",),
            )
        if not was_run(info) and self.kind != "choice" and self.choices:
            raise WrongKey(
                f"question {self.name!r} has choices, and its kind is {self.kind!r}; write kind: "
                "choice, or leave them out",
                at=("choices",),
            )
        if not self.lowest < self.highest:
            raise WrongKey(
                f"question {self.name!r} must rise, but goes from {self.lowest:g} to "
                f"{self.highest:g}; write a highest above the lowest",
                at=("highest" if "highest" in self.model_fields_set else "lowest",),
            )
        if self.words and self.kind != "scale":
            raise WrongKey(
                f"question {self.name!r} has words, but is not a scale; leave them out",
                at=("words",),
            )
        if wrong := unstepped(self.words, self.lowest, self.highest, self.step):
            raise WrongKey(f"question {self.name!r} {wrong}", at=("words",))
        return self

    def doubt(self) -> str:
        """Return why the settings are probably a mistake; empty if they are not."""
        if self.kind == "choice" and len(self.choices) == 1:
            return "has one choice"
        if self.kind not in {"scale", "number"}:
            words = [key for key in ("left", "right") if getattr(self, key)]
            return f"has {' and '.join(words)}, which only a scale shows" if words else ""
        item = self.item()
        if item.step and not math.isclose(last := item.at_step(item.steps), self.highest):
            return (
                f"goes from {self.lowest:g} to {self.highest:g} in steps of {self.step:g}, so "
                f"that {last:.10g} is the most that can be answered"
            )
        return ""

    def item(self) -> Item:
        """Return it as the item it is."""
        return Item(**{**self.model_dump(), "words": tuple(self.words.items())})


def _or_in_the_file(schema: dict[str, Any]) -> None:
    """Let a protocol write the file alone."""
    schema["anyOf"] = [{"required": schema.pop("required")}, {"required": ["file"]}]


Number = Annotated[str, Reference("question with numbers", own=True)]
"""An item that is answered with a number."""


class FreeSettings(Settings):
    """Settings of the lab's own questionnaire, written in the protocol or in a separate file."""

    model_config = ConfigDict(json_schema_extra=_or_in_the_file)

    file: StudyPath | None = None
    """YAML file in the protocol's folder with title, questions and any other of these keys; its
    content replaces this key."""

    title: str
    """Title above the items."""

    rights: str = "the lab's own"
    """Source of the wording."""

    questions: tuple[QuestionSettings, ...] = Field(min_length=1)
    """The items, in order."""

    sums: dict[str, Annotated[tuple[Number, ...], Field(min_length=1), Once()]] = Field(
        default_factory=dict
    )
    """Sum scores: for the name of each score, the names of the items that it adds."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any, info: ValidationInfo) -> Any:
        if not (isinstance(given, dict) and isinstance(given.get("file"), str)):
            return given
        found = _lab_file(given["file"], info)
        if not isinstance(found, dict):
            raise WrongKey(
                f"the lab's file {given['file']!r} holds no keys; it must hold title and questions",
                at=("file",),
            )
        if twice := sorted({*found} & {*given}):
            raise WrongKey(
                f"{', '.join(twice)} is in both {given['file']!r} and the protocol; remove one",
                at=(twice[0],),
            )
        return {**found, **given, "file": None}

    @field_validator("questions")
    @classmethod
    def _differ(cls, questions: tuple[QuestionSettings, ...]) -> tuple[QuestionSettings, ...]:
        names = [question.name for question in questions]
        if twice := sorted(set(_twice(names))):
            last = len(names) - 1 - names[::-1].index(twice[0])
            raise WrongKey(
                f"{', '.join(twice)} is the name of two questions; rename one", at=(last, "name")
            )
        return questions

    def provides(self, machine: Machine) -> Names:
        numbers = [each.name for each in self.questions if each.kind in {"scale", "number"}]
        return {"question with numbers": numbers}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        doubts = ((at, each.doubt()) for at, each in enumerate(self.questions, start=1))
        return {f"questions.{at}": doubt for at, doubt in doubts if doubt}
