"""The study protocol: what its YAML may say."""

import inspect
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    create_model,
    field_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from labcrane.analysis.presented import PresentedLimits
from labcrane.analysis.scoring.settings import IndicatorSettings
from labcrane.core.by_estimate import ByEstimate, Part
from labcrane.core.records import Trial
from labcrane.core.references import ButtonName
from labcrane.core.signals import Signal
from labcrane.files.model import AtMost, was_run
from labcrane.files.names import misfit
from labcrane.files.yaml import YamlFile
from labcrane.protocol.design import Design, FactorName
from labcrane.protocol.evaluation import StopRule
from labcrane.protocol.pages import PageSettings
from labcrane.protocol.steps import Section, Session, read_sessions
from labcrane.protocol.streams import StreamNeed, TimeLimits
from labcrane.registry.hookspecs import ROLES


def _names_a_folder(name: str, info: ValidationInfo) -> str:
    if not was_run(info) and (why := misfit(name, person=False)):
        raise ValueError(f"{name!r} {why}")
    return name


FolderName = Annotated[str, AfterValidator(_names_a_folder)]
STUDY_NAME = r"^[a-z][a-z0-9_-]*$"


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

ASSIST = "assist"
"""Factor of a track that chooses the assistant's share, and the column of what it chose."""


class Assist(Use):
    """An input device that moves the machine together with the operator: shared control.

    The command of each joint is ``(1 - share)`` times the operator's plus ``share`` times the
    assistant's. Then the machine's limits act.
    """

    share: Part | Annotated[dict[FactorName, Part], Field(min_length=1)] | ByEstimate
    """The assistant's share of the command in every trial, 0 to 1; or shares by name, which
    groups, conditions and blocks switch on as they do feedback: ``{half: 0.5, full: 1}``. A trial
    with none of them on has the share 0. A track with ``factor: assist`` chooses among them. Or a
    share that follows an estimate."""

    takeover: ButtonName = ""
    """A button of the input: while it is pressed, the operator has the whole command."""

    @property
    def levels(self) -> dict[str, float]:
        """The shares that have names."""
        return self.share if isinstance(self.share, dict) else {}

    @staticmethod
    def signals(joints: Sequence[str]) -> tuple[Signal, ...]:
        """Return what is recorded: the share in effect, and what either asks the joints for."""
        return (
            Signal(f"{ASSIST}.share", "1"),
            Signal(f"{ASSIST}.operator", "rad/s", tuple(joints)),
            Signal(f"{ASSIST}.assistant", "rad/s", tuple(joints)),
        )

    def share_in(self, trial: Trial) -> float:
        """Return the assistant's share in a trial; of one that follows an estimate the first."""
        if isinstance(self.share, ByEstimate):
            return self.share.to[0]
        if not isinstance(self.share, dict):
            return self.share
        on = (trial.planned.condition.get(ASSIST), *trial.active)
        return next((part for name, part in self.share.items() if name in on), 0.0)


OF_ASSIST = ("share", "takeover")
"""Keys of ``assist`` that are not settings of the device."""


class Participants(Section):
    """The participants."""

    pattern: str = r"P\d{3,4}"
    """Regular expression that must match a participant's whole pseudonym."""

    planned: Annotated[PositiveInt, AtMost(100_000)] = 1
    """Number of planned participants."""

    @field_validator("pattern")
    @classmethod
    def _compiles(cls, pattern: str) -> str:
        try:
            re.compile(pattern)
        except re.error as error:
            raise ValueError(
                f"{pattern!r} is not a regular expression: {error}; write one, such as P\\d{{3}} "
                "for P001 to P999"
            ) from None
        return pattern

    @property
    def ends_early(self) -> bool:
        """Whether the pattern asks for a sign before its beginning or behind its end.

        Of patterns with alternatives nothing is said: another one may match.
        """
        plain = re.sub(r"\\[AbBZ]", "", self.pattern)
        plain = re.sub(r"\\.|\[\^?\]?[^]]*\]", "x", plain)
        return "|" not in plain and bool(re.search(r"\$\w(?![*?{])|\w\^", plain))


class _AsDescribed:
    """Says in the JSON Schema what describes a machine; its keys are checked when it is read."""

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        # It is made of docstrings, which only a schema needs.
        from labcrane.machines.descriptions.description import MachineDescription  # noqa: PLC0415

        return {"anyOf": [{"type": "string"}, MachineDescription.model_json_schema()]}


class OnFault(Section):
    """Reactions to faults during a session."""

    input_lost: Literal["pause", "end"] = "pause"
    """The operator's controls are unplugged or fall silent: pause until they are back, or end the
    session. The machine is held at rest either way."""

    stream_lost: Literal["pause", "mark"] = "pause"
    """A required stream falls silent, or its recorder fails: pause until it is back, or
    continue and mark it in the record."""

    feedback_lost: Literal["restart", "continue", "pause"] = "restart"
    """A view or sound fails: restart it, continue without it, or pause until it is back. One that
    cannot be started in the first place stops the session, unless it is set to continue without."""

    session_died: Literal["continue", "redo_trial", "redo_block"] = "redo_trial"
    """The session's process died: where ``labcrane resume`` continues. If it only stalled, for
    longer than `presented.max_gap_s`, the trial is repeated, except with ``continue``."""


class Protocol(Section):
    """One study."""

    labcrane: Literal[1]
    """Version of the protocol format."""

    study: Annotated[
        FolderName, Field(pattern=STUDY_NAME, json_schema_extra={"pattern": STUDY_NAME})
    ]
    """Short name of the study, in lower case; part of every seed."""

    title: str
    """Name of the study."""

    participants: Participants = Participants()
    """Number and pseudonyms of the participants."""

    rate_hz: PositiveFloat = Field(default=240.0, le=2000.0)
    """Ticks of the loop per second."""

    machine: Annotated[str | dict[str, Any], _AsDescribed()]
    """Name of a machine that comes with labcrane, or of a YAML file in the protocol's folder; or a
    URDF file with its joints: ``{urdf: arm.urdf, joints: [...], tip: hook}``."""

    input: Use
    """The device that the operator moves."""

    operator: Use = DEFAULT_OPERATOR
    """The simulated operator, which moves the input in simulations."""

    assist: Assist | None = None
    """An assistant beside the operator; none by default."""

    scheme: Use
    """Maps the operator's axes to commands."""

    dynamics: Use
    """The simulated motion of the machine."""

    tasks: dict[FactorName, Use] = Field(min_length=1)
    """Tasks of the operator, by name."""

    secondary: dict[FactorName, Use] = Field(default_factory=dict)
    """Second tasks beside them, by name. Groups, conditions and blocks switch them on as they do
    feedback."""

    questionnaires: dict[str, Use] = Field(default_factory=dict)
    """Questionnaires with settings, by the study's names for them. One without settings is asked
    by its own name and need not be listed."""

    indicator: IndicatorSettings = IndicatorSettings()
    """How the performance indicator is computed."""

    stop_rules: tuple[StopRule, ...] = ()
    """Limits of scores and estimates beyond which the session pauses and the experimenter
    decides."""

    page: PageSettings = PageSettings()
    """Where the experimenter's and the participant's page are served."""

    feedback: dict[str, Use] = Field(default_factory=dict)
    """Feedback that can be switched on during trials, by name: cues for every view, and sounds."""

    views: dict[str, Use] = Field(default_factory=dict)
    """Windows and other displays that are always shown, by name."""

    streams: dict[Annotated[str, AfterValidator(_names_a_folder)], StreamNeed] = Field(
        default_factory=dict
    )
    """External streams to be recorded, by the study's names for them."""

    recordings: dict[Annotated[str, AfterValidator(_names_a_folder)], Use] = Field(
        default_factory=dict
    )
    """Cameras, microphones and screens to be recorded, by the study's names for them."""

    monitors: dict[str, Use] | None = None
    """Monitors of the signals of those streams, by name. Without this key all that
    are installed do, as they are without settings; ``{}`` is none."""

    sync: TimeLimits = TimeLimits()
    """Required accuracy of the timestamps."""

    presented: PresentedLimits = PresentedLimits()
    """How much of a movement the operator must have been shown."""

    design: Design = Design()
    """Factors between and within participants, and their order."""

    sessions: tuple[Session, ...] = Field(min_length=1)
    """The sessions (visits), in order."""

    on_fault: OnFault = OnFault()
    """Reactions to faults."""

    environment: Literal["record", "refuse"] = "record"
    """The installed packages differ from those at the approval (another NumPy): report that and
    record it with the session, or refuse to run."""

    expected: tuple[str, ...] = ()
    """Keys of warnings of ``labcrane check`` about settings that are intended."""

    @property
    def switched(self) -> tuple[str, ...]:
        """Names of all that trials switch on: feedback, secondary tasks, shares of assist."""
        return (*self.feedback, *self.secondary, *(self.assist.levels if self.assist else ()))


def protocol_model() -> type[Protocol]:
    """Return the model of a protocol, with a key for every role that is on the table."""
    more: dict[str, Any] = {}
    for role, entry in ROLES.items():
        for key in entry.keys:
            kind, empty = (dict[str, Use], dict) if entry.several else (Use | None, lambda: None)
            about = inspect.cleandoc(role.__doc__ or entry.about).splitlines()[0]
            more[key] = (kind, Field(default_factory=empty, description=about))
    more = {key: field for key, field in more.items() if key not in Protocol.model_fields}
    return create_model("Protocol", __base__=Protocol, **more) if more else Protocol


OTHERS = {
    "labcrane_cohort": "a cohort of simulated operators, and not a protocol",
    "labcrane_scene": "a scene, and not a protocol",
    "labcrane_part": "a part of a scene, and not a protocol",
    "labcrane_dmd": "a dynamic model, and not a protocol",
}
"""First keys of other files in a protocol's folder."""


def read(path: Path, *, recorded: bool = False) -> tuple[Protocol | None, YamlFile]:
    """Read a protocol file; mistakes are noted in the file that is returned.

    ``recorded`` is whether it has been run, and is not judged again.

    Raises
    ------
    ProtocolError
        The file does not exist or is not valid YAML.
    """
    source = YamlFile.read(path, recorded=recorded)
    if not isinstance(source.data, dict):
        source.problem((), "it must be a mapping of keys, beginning with 'labcrane: 1'")
        return None, source
    if other := next((key for key in source.data if key in OTHERS), None):
        source.problem((other,), f"the file is {OTHERS[other]}; give the protocol", key=True)
        return None, source
    if swallowed := _swallowed(source.data):
        key, inside = swallowed
        source.problem(
            (key,),
            f"{key} has {inside!r} in it, which is a key of its own; close the quotation mark "
            f"where the text of {key} ends",
        )
        return None, source
    plain = dict(source.data)
    if "sessions" in plain:
        plain["sessions"] = read_sessions(source)
    return source.check(protocol_model(), value=plain), source


def _swallowed(data: dict[str, Any]) -> tuple[str, str] | None:
    """Return a key whose text holds another that is missed: its quotation was closed too late."""
    missed = [name for name, about in Protocol.model_fields.items() if about.is_required()]
    for key, value in data.items():
        for name in missed:
            held = isinstance(value, str) and re.search(rf"(?:^|\s){name}:(?:\s|$)", value)
            if held and name not in data:
                return key, f"{name}:"
    return None
