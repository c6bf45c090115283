"""Steps of a session, as a protocol writes them."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    ConfigDict,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    field_validator,
)

from labcrane.core.settings import Settings
from labcrane.errors import ProtocolError, suggestion
from labcrane.files.complaints import shown
from labcrane.files.model import AtMost, Usual, was_run
from labcrane.files.names import absent, outside
from labcrane.files.system import is_folder
from labcrane.files.units import Unit
from labcrane.files.yaml import Place, YamlFile, read_text
from labcrane.protocol.design import Criterion, FactorName, Switch

READING_S = 120.0
"""Seconds that people are likely to spend on a page of text, or questions; for plans only."""


class Section(Settings):
    """A part of a protocol."""


class Block(Section):
    """A run of trials of one task.

    Further keys limit how many levels of a factor are used: ``pairs: 2``.
    """

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={"additionalProperties": {"type": "integer", "minimum": 1}},
    )

    task: str
    """Which of the protocol's tasks."""

    name: FactorName | None = None
    """Name of the block in the record; the task's by default."""

    ask: tuple[str, ...] = ()
    """Questionnaires after each counted trial: ``[subjective_accuracy, situational_awareness]``."""

    feedback: Switch = "all"
    """Which feedback is switched on during its trials: ``all``, ``none``, what the participant's
    ``group`` is given, or a list of names."""

    condition: PositiveInt | None = None
    """Number of the participant's condition, from 1, in the participant's order; the
    condition says which feedback is on."""

    fading: tuple[Annotated[float, Field(ge=0.0, le=1.0)], ...] = (1.0,)
    """Share of the trials with feedback in each part of the block: ``[1, 0.5, 0]`` is all of the
    first third, every second trial of the second, none of the last."""

    repeat: Annotated[PositiveInt, AtMost(1000)] = 1
    """Number of repetitions of the block, each in a new order."""

    track: str = ""
    """The track of the design that chooses the levels of its factor, round by round."""

    until: Criterion | None = None
    """For practice: the block ends as soon as this is met."""

    @field_validator("fading")
    @classmethod
    def _has_parts(cls, fading: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if not fading and not was_run(info):
            raise ValueError(
                "there is no part in it; write the share of each, as [1, 0.5, 0], or leave fading "
                "out"
            )
        return fading

    @property
    def limits(self) -> dict[str, Any]:
        """How many levels of which factor, as written."""
        return dict(self.model_extra or {})


class Break(Section):
    """A pause in which the machine rests."""

    seconds: Annotated[NonNegativeFloat, Unit("s")]
    """How long it lasts, in seconds; the experimenter can end it earlier, which is recorded."""


FIXATION_POINTS = ((0.5, 0.5), (0.15, 0.15), (0.85, 0.15), (0.85, 0.85), (0.15, 0.85))
"""The middle, and points towards the corners: calibration is worst there."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Fixation(Section):
    """A check of the eye tracker: the operator looks at points, one after another."""

    seconds: Annotated[PositiveFloat, Field(ge=1.0), Unit("s"), Usual(1.0, 20.0)] = 2.0
    """How long each point is shown, in seconds; the first half second is the way to it."""

    points: Annotated[tuple[tuple[Share, Share], ...], Field(min_length=1)] = FIXATION_POINTS
    """Where they are, as shares of the picture's width and height from its upper left corner."""


StepKind = Literal[
    "consent", "instructions", "questionnaire", "fixation", "practice", "reference", "block",
    "break",
]  # fmt: skip
STEPS: tuple[str, ...] = get_args(StepKind)

TIMED: Mapping[str, type[Break | Fixation]] = {"break": Break, "fixation": Fixation}
"""Steps that last for as long as they say."""


class Step(Section):
    """One step of a session, with what kind it is and what it needs."""

    kind: StepKind
    text: str = ""
    file: str = ""
    block: Block | None = None
    seconds: float = 0.0
    points: tuple[tuple[float, float], ...] = ()
    questionnaires: tuple[str, ...] = ()

    @property
    def planned(self) -> int:
        """How many steps of a plan it is: one for each repetition, and each round of practice."""
        if self.block is None:
            return 1
        return self.block.repeat * (self.block.until.rounds if self.block.until else 1)


class Session(Section):
    """One visit of a participant."""

    name: FactorName
    """Name of the session in the record."""

    after_days: tuple[NonNegativeInt, NonNegativeInt] | None = None
    """Earliest and latest day after the session before: ``[1, 3]``."""

    window_s: Annotated[PositiveFloat | None, Usual(10.0, 86_400.0)] = None
    """How long the visit may take, in seconds, as announced to participants and booked for rooms:
    ``90 min``. A check warns of a session that is likely to take longer."""

    steps: tuple[Step, ...] = Field(min_length=1)
    """Steps of the session, in order."""

    @field_validator("after_days", mode="before")
    @classmethod
    def _two_days(cls, days: Any) -> Any:
        if isinstance(days, int) and not isinstance(days, bool):
            raise ValueError(  # noqa: TRY004 - for pydantic
                f"it is {days}; write the earliest and the latest day, as [{days}, {days}]"
            )
        return days

    @field_validator("after_days")
    @classmethod
    def _window_is_one(cls, days: tuple[int, int] | None) -> tuple[int, int] | None:
        if days is not None and days[0] > days[1]:
            raise ValueError(
                f"the earliest day, {days[0]}, is after the latest, {days[1]}; write the earliest "
                "first"
            )
        return days


def read_sessions(source: YamlFile) -> Any:
    """Return the sessions with every step in its long form, noting steps that make no sense."""
    sessions = source.data.get("sessions")
    if not isinstance(sessions, list):
        return sessions
    found = []
    for number, session in enumerate(sessions):
        place: Place = ("sessions", number)
        steps = session.get("steps") if isinstance(session, dict) else None
        if not isinstance(steps, list):
            found.append(session)
            continue
        parsed = [_step(source, (*place, "steps", at), step) for at, step in enumerate(steps)]
        # What is wrong with a step has been noted; one that is right stands in for it, so that
        # every other keeps its place, and its line.
        whole = [{"kind": "break"} if step is None else step for step in parsed]
        found.append({**session, "steps": whole})
    return found


def _step(source: YamlFile, place: Place, step: Any) -> dict[str, Any] | None:
    if step == "consent":
        return {"kind": step}
    if not (isinstance(step, dict) and len(step) == 1):
        _no_step(source, place, step)
        return None
    (kind, value), *_ = step.items()
    if kind not in STEPS:
        instead = suggestion(str(kind), STEPS, "possible:")
        source.problem((*place, str(kind)), f"{kind!r} is not a step; {instead}", key=True)
        return None
    if kind == "instructions":
        return _instructions(source, place, value)
    if kind in TIMED:
        return _timed(source, (*place, kind), value)
    if kind == "consent":
        told = "consent is a step by itself; write '- consent'"
        source.problem((*place, kind), told, key=True)
        return None
    if kind == "questionnaire":
        return _questionnaire(source, place, value)
    block = source.check(Block, (*place, kind))
    if block and block.until and kind != "practice":
        source.problem(
            (*place, kind, "until"), "only practice can have a criterion; remove until", key=True
        )
        return None
    if block and block.track and (wrong := _beside_track(block)):
        key, why = wrong
        source.problem((*place, kind, key), f"{why}; drop {key}, or the track", key=True)
        return None
    return {"kind": kind, "block": block} if block else None


def _timed(source: YamlFile, place: Place, value: Any) -> dict[str, Any] | None:
    kind = str(place[-1])
    if isinstance(value, (str, int, float)):
        told = f"{kind} is {shown(value)}; write how long it lasts as {{seconds: {value}}}"
        source.problem(place, told)
        return None
    timed = source.check(TIMED[kind], place)
    return {"kind": kind, **timed.model_dump()} if timed else None


def _no_step(source: YamlFile, place: Place, step: Any) -> None:
    """Note a value that is not a step: often, its keys are not indented below it."""
    (kind, value), *beside = (isinstance(step, dict) and step.items()) or [("", "")]
    if kind in STEPS and value is None and not any(key in STEPS for key, _ in beside):
        key = beside[0][0]
        told = (
            f"{key!r} is in one column with {kind!r}, to which it belongs; indent it, and what "
            "follows, by two spaces more"
        )
        source.problem((*place, key), told, key=True)
        return
    source.problem(place, f"a step is {shown(step)}; it must be {', '.join(STEPS)}, with its value")


def _beside_track(block: Block) -> tuple[str, str] | None:
    """Return a key that a block with unpredictable trials cannot have, and why."""
    if block.until:
        return "until", "a block with a track ends by the track's own rule"
    if block.fading != (1.0,):
        return "fading", "parts of a block are not known beforehand when a track chooses its end"
    return None


def _questionnaire(source: YamlFile, place: Place, value: Any) -> dict[str, Any] | None:
    names = [value] if isinstance(value, str) else value
    if not (isinstance(names, list) and names):
        told = f"questionnaire is {shown(value)}; it must be a name, or a list of names"
        source.problem((*place, "questionnaire"), told)
        return None
    if wrong := [at for at, name in enumerate(names) if not isinstance(name, str)]:
        for at in wrong:
            told = f"questionnaire[{at + 1}] is {shown(names[at])}; it must be a name"
            source.problem((*place, "questionnaire", at), told)
        return None
    return {"kind": "questionnaire", "questionnaires": tuple(names)}


def _instructions(source: YamlFile, place: Place, value: Any) -> dict[str, Any] | None:
    if not isinstance(value, str):
        told = f"instructions is {shown(value)}; it must be the name of a text file"
        source.problem((*place, "instructions"), told)
        return None
    path = source.path.parent / value
    if not source.recorded and (why := outside(path, source.path.parent)):
        told = f"instructions is {value!r}, and {why}"
        source.problem((*place, "instructions"), told)
        return None
    if is_folder(path):
        told = f"instructions is {value!r}, which is a folder; name a text file in it"
        source.problem((*place, "instructions"), told)
        return None
    try:
        text = read_text(path).removeprefix("\ufeff")  # as editors on Windows write it
    except ProtocolError as error:
        missing = isinstance(error.__context__, FileNotFoundError)
        told = f" is {value!r}, and {absent(path)}" if missing else f": {error}"
        source.problem((*place, "instructions"), f"instructions{told}")
        return None
    if not text.strip() and not source.recorded:
        told = f"instructions is {value!r}, which is empty; write in it what is to be read"
        source.problem((*place, "instructions"), told)
        return None
    return {"kind": "instructions", "file": value, "text": text}
