"""The study protocol: what its YAML may say."""

import re
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    ConfigDict,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    field_validator,
)

from labcrane.design.words import Criterion, Design
from labcrane.evaluation import IndicatorSettings, StopRule
from labcrane.offers import Settings
from labcrane.page_settings import PageSettings
from labcrane.stream_needs import StreamNeed, TimeLimits
from labcrane.yaml_file import Place, YamlFile


class Section(Settings):
    """A part of a protocol."""


class Use(Section):
    """A component to use; the keys beside ``use`` are its settings."""

    model_config = ConfigDict(extra="allow")

    use: str
    """Name of what a plugin offers; ``labcrane plugins`` lists all."""

    @property
    def settings(self) -> dict[str, Any]:
        """The settings as written, not yet checked against the component."""
        return dict(self.model_extra or {})


DEFAULT_OPERATOR = Use(use="simulated_operator")


class Participants(Section):
    """Who takes part."""

    pattern: str = r"P\d{3,4}"
    """Regular expression that a participant's pseudonym matches as a whole."""

    planned: PositiveInt = 1
    """How many participants are planned."""

    @field_validator("pattern")
    @classmethod
    def _compiles(cls, pattern: str) -> str:
        try:
            re.compile(pattern)
        except re.error as error:
            raise ValueError(f"{pattern!r} is no regular expression: {error}") from None
        return pattern


class OnFault(Section):
    """What happens when something fails during a session."""

    input_lost: Literal["pause", "end"] = "pause"
    """The operator's controls are unplugged or fall silent: pause until they are back, or end the
    session. The machine is held at rest either way."""

    stream_lost: Literal["pause", "mark"] = "pause"
    """A required stream falls silent, or its recorder fails: pause until it is back, or go on and
    mark it in the record."""

    feedback_lost: Literal["restart", "continue", "pause"] = "restart"
    """A view or sound fails: start it again, go on without it, or pause until it is back. One that
    cannot be started in the first place stops the session, unless it is to go on without."""

    session_died: Literal["continue", "redo_trial", "redo_block"] = "redo_trial"
    """The session's process died: where ``labcrane resume`` goes on."""


class Block(Section):
    """A run of trials of one task.

    Keys beside these limit how many levels of a factor are used: ``pairs: 2``.
    """

    model_config = ConfigDict(extra="allow")

    task: str
    """Which of the protocol's tasks."""

    name: str | None = None
    """Name of the block in the record; the task's by default."""

    ask: tuple[str, ...] = ()
    """Questionnaires after each counted trial: ``[subjective_accuracy, situational_awareness]``."""
    feedback: Literal["all", "none", "group"] | tuple[str, ...] = "all"
    """Which feedback is switched on during its trials: ``all``, ``none``, what the participant's
    ``group`` is given, or a list of names."""

    fading: tuple[Annotated[float, Field(ge=0.0, le=1.0)], ...] = (1.0,)
    """Share of the trials with feedback, part by part: ``[1, 0.5, 0]`` is all of the first third,
    every second trial of the second, none of the last."""

    repeat: PositiveInt = 1
    """How many times the block is run, each time in a new order."""

    until: Criterion | None = None
    """For practice: it ends as soon as this is met."""

    @property
    def limits(self) -> dict[str, Any]:
        """How many levels of which factor, as written."""
        return dict(self.model_extra or {})


class Break(Section):
    """A pause in which the machine rests."""

    seconds: NonNegativeFloat
    """How long it lasts, in seconds; the examiner can end it earlier, which is recorded."""


class Step(Section):
    """One step of a session, with what kind it is and what it needs."""

    kind: Literal[
        "consent", "instructions", "questionnaire", "practice", "reference", "block", "break"
    ]
    text: str = ""
    file: str = ""
    block: Block | None = None
    seconds: float = 0.0
    questionnaires: tuple[str, ...] = ()


class Session(Section):
    """One visit of a participant."""

    name: str
    """Name of the session in the record."""

    after_days: tuple[NonNegativeInt, NonNegativeInt] | None = None
    """Earliest and latest day after the session before: ``[1, 3]``."""

    steps: tuple[Step, ...] = Field(min_length=1)
    """What happens, in order."""

    @field_validator("after_days")
    @classmethod
    def _window_is_one(cls, days: tuple[int, int] | None) -> tuple[int, int] | None:
        if days is not None and days[0] > days[1]:
            raise ValueError(f"the earliest day, {days[0]}, is after the latest, {days[1]}")
        return days


class Protocol(Section):
    """One study."""

    labcrane: Literal[1]
    """Version of the protocol format."""

    study: str = Field(pattern=r"^[a-z][a-z0-9_-]*$")
    """Short name of the study, in lower case; part of every seed."""

    title: str
    """What the study is called."""

    participants: Participants = Participants()

    rate_hz: PositiveFloat = Field(default=240.0, le=2000.0)
    """Ticks of the loop per second."""

    machine: str
    """Name of a machine that comes with labcrane, or of a file beside the protocol."""

    input: Use
    """What the operator moves."""

    operator: Use = DEFAULT_OPERATOR
    """Who moves it when the study is simulated."""

    scheme: Use
    """How the operator's axes become commands."""

    dynamics: Use
    """What moves."""

    tasks: dict[str, Use] = Field(min_length=1)
    """What the operator is asked to do, by name."""

    questionnaires: dict[str, Use] = Field(default_factory=dict)
    """Questionnaires with settings, by the study's names for them. One without settings is asked
    by its own name and need not be listed."""

    indicator: IndicatorSettings = IndicatorSettings()
    """How the performance indicator is worked out."""

    stop_rules: tuple[StopRule, ...] = ()
    """Scores above which the session pauses and the examiner decides."""

    page: PageSettings = PageSettings()
    """Where the supervisor's and the participant's page are served."""
    feedback: dict[str, Use] = Field(default_factory=dict)
    """What can be switched on during trials, by name: cues for every view, and sounds."""

    views: dict[str, Use] = Field(default_factory=dict)
    """Windows and other displays that are always there, by name."""

    streams: dict[str, StreamNeed] = Field(default_factory=dict)
    """Streams of others to be recorded, by the study's names for them."""

    sync: TimeLimits = TimeLimits()
    """How right the time stamps must be."""

    design: Design = Design()

    sessions: tuple[Session, ...] = Field(min_length=1)
    """The visits, in order."""

    on_fault: OnFault = OnFault()


def read(path: Path) -> tuple[Protocol | None, YamlFile]:
    """Read a protocol file; mistakes are noted in the file that is returned.

    Raises
    ------
    ProtocolError
        The file does not exist or is no YAML.
    """
    source = YamlFile.read(path)
    if not isinstance(source.data, dict):
        source.problem((), "a protocol is a mapping of keys, beginning with 'labcrane: 1'")
        return None, source
    plain = {**source.data, "sessions": _sessions(source)}
    return source.check(Protocol, value=plain), source


def _sessions(source: YamlFile) -> Any:
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
        whole = [step for step in parsed if step is not None]
        # What is wrong with a step has been noted; the model need not complain about none.
        stand_in = [] if whole else [{"kind": "break"}]
        found.append({**session, "steps": whole or stand_in})
    return found


STEPS = ("consent", "instructions", "questionnaire", "practice", "reference", "block", "break")


def _step(source: YamlFile, place: Place, step: Any) -> dict[str, Any] | None:
    if step == "consent":
        return {"kind": step}
    if not (isinstance(step, dict) and len(step) == 1):
        source.problem(place, f"a step is one of {', '.join(STEPS)} with a value, not {step!r}")
        return None
    (kind, value), *_ = step.items()
    if kind not in STEPS:
        close = get_close_matches(kind, STEPS, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"possible: {', '.join(STEPS)}"
        source.problem(place, f"{kind!r} is not a step; {hint}")
        return None
    if kind == "instructions":
        return _instructions(source, place, value)
    if kind == "break":
        pause = source.check(Break, (*place, kind))
        return {"kind": kind, "seconds": pause.seconds} if pause else None
    if kind == "consent":
        source.problem(place, "consent is a step by itself: '- consent'")
        return None
    if kind == "questionnaire":
        return _questionnaire(source, place, value)
    block = source.check(Block, (*place, kind))
    if block and block.until and kind != "practice":
        source.problem((*place, kind, "until"), "only practice has a criterion; drop until")
        return None
    return {"kind": kind, "block": block} if block else None


def _questionnaire(source: YamlFile, place: Place, value: Any) -> dict[str, Any] | None:
    names = [value] if isinstance(value, str) else value
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        source.problem(place, f"questionnaire is a name or a list of names, not {value!r}")
        return None
    return {"kind": "questionnaire", "questionnaires": tuple(names)}


def _instructions(source: YamlFile, place: Place, value: Any) -> dict[str, Any] | None:
    if not isinstance(value, str):
        source.problem(place, f"instructions name a text file, not {value!r}")
        return None
    path = source.path.parent / value
    try:
        return {"kind": "instructions", "file": value, "text": path.read_text(encoding="utf-8")}
    except OSError:
        source.problem(place, f"instructions file {str(path)!r} does not exist or cannot be read")
        return None
