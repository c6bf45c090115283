"""Events: one row for each, with its number, its meaning and its sentence.

What is derived from it: the codes on markers and triggers, the labels and their HED tags, the
sentences on the page and in the terminal, and the events that a protocol may name. A plugin's task
may have events of its own; they are labelled and told by their names.
"""

from collections.abc import Mapping
from dataclasses import dataclass

HED_VERSION = "8.3.0"
"""Version of the HED schema that the tags are from."""

OTHER = 1
"""Code of an event that has no code of its own."""


@dataclass(frozen=True, slots=True)
class EventKind:
    """What is known of all events of one name.

    Attributes
    ----------
    name
        Dotted noun and verb.
    code
        Its number on the stream of codes and on triggers, 2 to 255; a number, once given, never
        changes its meaning. None where the event is only recorded or told, and not a marker.
    meaning
        For the analysis of the recording.
    tags
        Tags of Hierarchical Event Descriptors, without the label.
    sentence
        For the experimenter, with the event's data in braces; empty where code makes it.
    kind, level
        By what the page filters it, and ``"bad"`` if the experimenter must act or ``"warn"`` if the
        experimenter should know.
    task
        Whether a task has it, not the session: a protocol may name it only with such a task.
    learnt
        When the session learns of it, where that is later than it happened. Its stamp is right, but
        a pulse is taken for the moment at which it comes.
    """

    name: str
    code: int | None
    meaning: str
    tags: tuple[str, ...]
    sentence: str = ""
    kind: str = "other"
    level: str = ""
    task: bool = False
    learnt: str = ""

    @property
    def label(self) -> str:
        """Its plain name: ``trial_start``."""
        return name_of(self.name)

    @property
    def hed(self) -> str:
        """Its tags in brackets with a label of its own.

        Tags at the same onset are joined, and HED refuses what is said twice.
        """
        return hed_of(self.name, *self.tags)


def name_of(event: str) -> str:
    """Return an event's plain name: ``trial.start`` is ``trial_start``."""
    return event.replace(".", "_")


def hed_of(event: str, *tags: str) -> str:
    """Return tags in brackets with the event's label."""
    return f"({', '.join((*tags, f'Label/{name_of(event)}'))})"


_E = EventKind
_STRUCTURE, _CONTROL = ("Experiment-structure",), ("Experiment-control",)
_SHOWN = ("Sensory-event", "Visual-presentation")
_READ = ("Sensory-event", "Instructional")
_MOVED = ("Agent-action", "(Move, Machine)")
_ANSWERED = ("Agent-action", "Participant-response")
_MEASURED = ("Measurement-event",)
_FAULTY = ("Data-feature",)

_ROWS = (
    _E("session.start", 10, "the session, or a part of it after an interruption, begins",
       _STRUCTURE, "the session began"),
    _E("session.end", 11, "the session has come to its end",
       _STRUCTURE, "the session ended: {reason}"),
    _E("pause.start", 12, "the machine is held at rest", _CONTROL),
    _E("pause.end", 13, "the session goes on", _CONTROL),
    _E("step.start", 14, "a step of the session begins",
       _STRUCTURE, "step {step} began: {kind}"),
    _E("step.end", 15, "a step of the session ends", _STRUCTURE, "step {step} ended"),
    _E("instructions.shown", 16, "instructions are shown", _READ, "instructions are shown"),
    _E("break.start", 17, "a break begins", _STRUCTURE, "a break of {seconds} s began"),
    _E("break.end", 18, "a break ends", _STRUCTURE, "the break ended"),
    _E("waiting", 19, "a step waits to be started", _CONTROL, "ready to start: {what}"),
    _E("block.start", 20, "a block of trials begins",
       _STRUCTURE, "block {block} began: {block_name}", "trials"),
    _E("block.end", 21, "a block of trials ends",
       _STRUCTURE, "block {block} ended: {block_name}", "trials"),
    _E("fixation.shown", 22, "a point to look at is shown",
       (*_SHOWN, "Cue"), "fixation point {point} is shown"),
    _E("fixation.over", 23, "a point to look at is gone",
       _SHOWN, "fixation point {point} is hidden"),
    _E("judgement.awaited", 24, "the experimenter may judge the test that has ended",
       _CONTROL, "waiting for the experimenter to judge the test", "trials"),
    _E("judgement.over", 25, "the test is judged, and the session goes on",
       _CONTROL, "judging of the test ended", "trials"),
    _E("session.resumed", 26, "the session continues after an interruption",
       _STRUCTURE, "the session continued"),
    _E("practice.end", 27, "practice ends, by its criterion or its limit",
       _STRUCTURE, "practice ended", "trials"),
    _E("track.end", 28, "a block of adaptive levels ends, with its threshold",
       _STRUCTURE, "the track {track} ended", "trials"),
    _E("trial.start", 30, "a trial begins", _STRUCTURE),
    _E("trial.end", 31, "a trial ends", _STRUCTURE),
    _E("targets.shown", 40, "the targets are shown", (*_SHOWN, "(Target, Circle)"), task=True),
    _E("target.entered", 41, "the tip is in the target",
       (*_MEASURED, "(Target, Circle)"), task=True),
    _E("scene.placed", 43, "the things of a scene are placed",
       _SHOWN, "the scene was set up", task=True),
    _E("goal.reached", 44, "a goal of the scenario is reached", _MEASURED, task=True),
    _E("contact.object", 45, "the machine touches a thing", _MEASURED, task=True),
    _E("contact.body", 46, "the machine touches a person", _MEASURED, task=True),
    _E("overload", 47, "a thing or a person is pressed too hard",
       (*_MEASURED, "Press"), task=True),
    _E("drop", 48, "what was held has fallen", (*_MEASURED, "Drop"), task=True),
    _E("deformity.found", 49, "a deformity that is there is reported", _MEASURED, task=True),
    _E("command.onset", 50, "the operator's hand moves", (*_ANSWERED, "(Move, Hand)"), task=True),
    _E("movement.onset", 51, "the machine moves", _MOVED, task=True,
       learnt="when the movement is over, or the trial"),
    _E("movement.offset", 52, "the machine has come to rest", _MOVED, task=True,
       learnt="when the machine has been at rest for as long as a rest takes"),
    _E("mistakes.too_many", 53, "one kind of mistake was made too often", _MEASURED, task=True),
    _E("tap.ignored", 54, "the trigger is pressed before anything has moved",
       _ANSWERED, task=True),
    _E("deformity.reported", 55, "the operator reports a deformity", _ANSWERED, task=True),
    _E("order.start", 60, "the experimenter starts what waits", _CONTROL),
    _E("order.pause", 61, "the experimenter pauses", _CONTROL),
    _E("order.repeat", 62, "the experimenter repeats the trial", _CONTROL),
    _E("order.skip", 63, "the experimenter skips what runs", _CONTROL),
    _E("order.end", 64, "the experimenter ends the session", _CONTROL),
    _E("order.note", 65, "the experimenter takes a note", _CONTROL, "note: {text}", "notes"),
    _E("order.override", 66, "the experimenter overrides the end of a test", _CONTROL),
    _E("order.completion", 67, "the experimenter says whether the test was completed", _CONTROL),
    _E("order.hint", 68, "the experimenter gives a hint",
       _CONTROL, "hint to the operator: {text}", "notes"),
    _E("order.report", 69, "the operator says what was seen", _CONTROL),
    _E("questionnaire.start", 80, "a questionnaire is asked",
       _READ, "questionnaire shown: {title}", "answers"),
    _E("questionnaire.answer", 81, "an item of a questionnaire is answered",
       _ANSWERED, "{item} was answered: {value}", "answers"),
    _E("questionnaire.refused", 82, "an answer is not accepted",
       _CONTROL, "an answer was not accepted: {why}", "answers", "warn"),
    _E("questionnaire.end", 83, "a questionnaire is submitted",
       ("Agent-action",), "questionnaire {questionnaire} ended", "answers"),
    _E("stop_rule.met", 84, "a score or an estimate is beyond the limit of a stop rule", _CONTROL),
    _E("participant.dropout", 85, "the participant drops out",
       _CONTROL, "the participant dropped out: {why}", "other", "warn"),
    _E("page.denied", 86, "a page asks for what it may not have",
       _CONTROL, "refused: {why}", "faults", "warn"),
    _E("order.setting", 87, "the experimenter changes a setting of feedback", _CONTROL),
    _E("feedback.setting", 88, "a setting of feedback has changed",
       _CONTROL, "{feedback}.{key} was set to {value}", "actions"),
    _E("input.lost", 90, "the operator's controls are lost",
       _CONTROL, "the controls are lost: {why}", "faults", "bad"),
    _E("input.back", 91, "the operator's controls are back",
       _CONTROL, "the controls are back", "faults"),
    _E("disk.lost", 92, "the disk accepts no data",
       _CONTROL, "the disk accepts no data: {why}", "faults", "bad"),
    _E("disk.back", 93, "the disk accepts data again",
       _CONTROL, "the disk accepts data again", "faults"),
    _E("feedback.ready", 94, "a view or sound is ready", _CONTROL, "{what} is ready"),
    _E("feedback.lost", 95, "a view or sound has failed",
       _CONTROL, "{what} failed: {why}", "faults", "bad"),
    _E("feedback.awaited", 96, "the session waits for a view or sound",
       _CONTROL, "waiting for {what}"),
    _E("stream.lost", 97, "a stream of another program is lost",
       _CONTROL, "stream {what} is lost", "faults", "bad"),
    _E("stream.back", 98, "a stream of another program is back",
       _CONTROL, "stream {what} is back", "faults"),
    _E("stream.confirmed", 99, "the experimenter says which stream is meant",
       _CONTROL, "stream {what} is {which}"),
    _E("consent.asked", 100, "the participant's consent is asked for",
       _CONTROL, "consent confirmation was requested", "answers"),
    _E("signal.bad", 101, "a signal of another program's stream is bad",
       _FAULTY, "signal of {stream} {channel}: {message}", "faults", "warn"),
    _E("signal.good", 102, "a signal of another program's stream is good again",
       _FAULTY, "signal of {stream} {channel} has recovered", "faults"),
    _E("launcher.gone", 103, "the program that watches the session is gone",
       _CONTROL, "the launcher died: the session ends", "faults", "bad"),
    _E("order.answer", 104, "an answer is given out of place", _CONTROL),
    _E("order.submit", 105, "a questionnaire is submitted out of place", _CONTROL),
    _E("order.consent", 106, "consent is given out of place", _CONTROL),
    _E("order.denied", 107, "a page asks for an action that it may not order", _CONTROL),
    _E("order.take", 108, "the experimenter chooses a stream", _CONTROL),
    _E("loop.stalled", 109, "the session stalled: it had no tick for a while, and missed some",
       _CONTROL, "the session stalled for {seconds} s; the machine was held", "faults", "bad"),
    _E("order.again", 110, "the experimenter starts a view or sound again",
       _CONTROL, "{text} is started again", "actions"),
    _E("order.without", 111, "the experimenter goes on without a view or sound",
       _CONTROL, "the session goes on without {text}", "actions"),
    _E("drt.stimulus", 112, "a stimulus of a detection response task is on",
       ("Sensory-event", "Cue"), task=True),
    _E("drt.response", 113, "the operator responds to a stimulus",
       (*_ANSWERED, "(Press, Push-button)"), task=True),
    _E("drt.outcome", 114, "the time for a response to a stimulus is over", _MEASURED, task=True),
    _E("estimate.failed", 115, "the process of an estimate has failed",
       _CONTROL, "estimate {estimate}: {why}", "faults", "warn"),
    _E("stop_rule.unjudged", 116, "a stop rule cannot be judged after a trial", _CONTROL,
       "stop rule not judged: {estimate}: {why}", "faults", "warn"),
    # Not markers: recorded beside the frames, or told to people alone.
    _E("session.standing", None, "how many trials were completed before",
       _STRUCTURE, "{done} trials were completed earlier"),
    _E("session.died", None, "the session's process has died",
       _CONTROL, "the session's process died in {where}", "faults", "bad"),
    _E("session.failed", None, "the session has failed",
       _CONTROL, "the session failed: {why}", "faults", "bad"),
    _E("consent.needed", None, "the participant's consent is awaited",
       _CONTROL, "waiting for consent to {file}", "answers"),
    _E("consent.given", None, "the participant has consented",
       _CONTROL, "consent was given", "answers"),
    _E("plugin.slow", None, "a component took too long",
       _CONTROL, "slow call: {why}", "faults", "warn"),
    _E("estimate.lost", None, "an estimate has no value and falls back",
       _CONTROL, "estimate {estimate}: {why}; its fallback is used", "faults", "warn"),
    _E("estimate.back", None, "an estimate has values again",
       _CONTROL, "estimate {estimate} has values", "faults"),
    _E("trigger.sent", None, "a code was handed to a trigger", _CONTROL),
    _E("trigger.unsent", None, "a code was perhaps not sent", _CONTROL),
    _E("trigger.echo", None, "a trigger has sent a code back", _CONTROL),
    _E("trigger.lost", None, "a trigger accepts no codes",
       _CONTROL, "trigger {why}", "faults", "bad"),
    _E("trigger.back", None, "a trigger accepts codes again",
       _CONTROL, "trigger {trigger} is back", "faults"),
    _E("trigger.flood", None, "a trigger sends codes that nobody sent",
       _CONTROL, "trigger {why}", "faults", "bad"),
)  # fmt: skip

KINDS: Mapping[str, EventKind] = {each.name: each for each in _ROWS}
"""Every event that labcrane and its bundled tasks have, by name."""

CODES: Mapping[str, int] = {each.name: each.code for each in _ROWS if each.code is not None}
"""The numbers of those that are markers."""

OF_SESSION = frozenset(name for name in CODES if not KINDS[name].task)
"""Events that every protocol may name."""

_FRAMES = ("session.", "step.", "block.", "break.", "trial.", "practice.", "track.")
"""How events begin that only say what others belong to: they happen in one tick with these."""

PULSES: Mapping[str, int] = {
    name: CODES[name]
    for name in sorted(
        (name for name in CODES if not KINDS[name].learnt),
        key=lambda name: name.startswith(_FRAMES),
    )
}
"""Codes that go out as pulses where a protocol does not say which, the most urgent first: people
average by what is shown and done, and the beginning of its trial or block can wait."""
