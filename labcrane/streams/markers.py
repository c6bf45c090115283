"""Numbers for events: docs/markers.md describes both marker streams for their readers.

The other one carries an event as the journal holds it
(:func:`labcrane.recording.journal.event_text`).
"""

from collections.abc import Mapping

OTHER = 1
"""Code of an event that has no code of its own."""

CODES: Mapping[str, int] = {
    "session.start": 10,
    "session.end": 11,
    "pause.start": 12,
    "pause.end": 13,
    "step.start": 14,
    "step.end": 15,
    "instructions.shown": 16,
    "break.start": 17,
    "break.end": 18,
    "waiting": 19,
    "fixation.shown": 22,
    "fixation.over": 23,
    "judgement.awaited": 24,
    "judgement.over": 25,
    "block.start": 20,
    "block.end": 21,
    "trial.start": 30,
    "trial.end": 31,
    "targets.shown": 40,
    "target.entered": 41,
    "scene.placed": 43,
    "goal.reached": 44,
    "contact.object": 45,
    "contact.body": 46,
    "overload": 47,
    "drop": 48,
    "deformity.found": 49,
    "command.onset": 50,
    "movement.onset": 51,
    "movement.offset": 52,
    "mistakes.too_many": 53,
    "tap.ignored": 54,
    "deformity.reported": 55,
    "order.start": 60,
    "order.pause": 61,
    "order.repeat": 62,
    "order.skip": 63,
    "order.end": 64,
    "order.note": 65,
    "order.override": 66,
    "order.completion": 67,
    "order.hint": 68,
    "order.report": 69,
    "questionnaire.start": 80,
    "questionnaire.answer": 81,
    "questionnaire.refused": 82,
    "questionnaire.end": 83,
    "stop_rule.met": 84,
    "participant.dropout": 85,
    "page.denied": 86,
    "order.setting": 87,
    "feedback.setting": 88,
    "input.lost": 90,
    "input.back": 91,
    "feedback.ready": 94,
    "feedback.lost": 95,
    "feedback.awaited": 96,
}
"""A number, once given, never changes its meaning."""

LEARNT_LATE: Mapping[str, str] = {
    "movement.onset": "when the movement is over, or the trial",
    "movement.offset": "when the machine has been at rest for as long as a rest takes",
}
"""Events that lie behind when a session learns of them, and when it does. Their stamps are right,
but a pulse is taken for the moment at which it comes."""

FRAMES = ("session.", "step.", "block.", "break.", "trial.")
"""How events begin that only say what others belong to: they happen in one tick with these."""

_SENT = sorted(
    (event for event in CODES if event not in LEARNT_LATE),
    key=lambda event: event.startswith(FRAMES),
)

PULSES = {event: CODES[event] for event in _SENT}
"""Codes that go out as pulses where a protocol does not say which, the most urgent first: people
average by what is shown and done, and the beginning of its trial or block can wait."""
