"""Questions about external streams, triggers and limits of time."""

from labcrane.core.events import KINDS
from labcrane.core.references import Reference, mentioned
from labcrane.protocol.questions.question import Doubts, asks
from labcrane.protocol.streams import SHARES
from labcrane.protocol.study import Study

LONGEST_LATENCY_S = 2.0

TYPES = ("Audio", "ECG", "EDA", "EEG", "EMG", "Gaze", "GSR", "Markers", "MoCap", "NIRS", "PPG")
"""Types of streams as devices usually write them."""


@asks
def _of_streams(study: Study) -> Doubts:
    usual = {each.lower(): each for each in TYPES}
    first: dict[tuple[str | None, ...], str] = {}
    for label, need in study.protocol.streams.items():
        of = (need.type, need.name, need.source_id)
        if "" in of:
            yield ("streams", label), f"streams: {label} is identified by an empty text"
        written = usual.get((need.type or "").lower(), need.type)
        if written != need.type:
            yield (
                ("streams", label, "type"),
                f"streams: {label} is of type {need.type!r}; LSL compares types letter by letter, "
                f"and devices write {written!r}",
            )
        if (other := first.setdefault(of, label)) != label:
            yield ("streams", label), f"streams: {other} and {label} are the same"
        if need.latency_s is not None and abs(need.latency_s) > LONGEST_LATENCY_S:
            yield (
                ("streams", label, "latency_s"),
                f"streams: {label} has a latency of {need.latency_s:g} s",
            )
        if need.any_of_type:
            yield (
                ("streams", label),
                f"streams: {label} is asked for by its type alone, so that any {need.type} on the "
                "network fits, a neighbour's as well, and each run asks which one is meant; give "
                "the source_id or the name that labcrane streams shows",
            )


@asks
def _of_gaze(study: Study) -> Doubts:
    """Question gaze of which nothing can be measured: in no known space, or of two trackers."""
    needs = study.protocol.streams
    for label, need in needs.items():
        if "gaze" in f"{need.type} {need.name}".lower() and need.space is None:
            yield (
                ("streams", label, "space"),
                f"streams: {label} does not say what its pixels are of, and without a "
                "coordinate_system in its header no gaze is measured by it; write space: screen "
                "for the participant's window, or space: scene for a head-mounted tracker's camera",
            )
    shown = [label for label, need in needs.items() if need.space == "screen"]
    if len(shown) > 1:
        yield (
            ("streams", shown[1], "space"),
            f"streams: {' and '.join(shown)} are all places in the participant's window, so that "
            "a report measures gaze by none of them",
        )


@asks
def _of_pulses(study: Study) -> Doubts:
    """Question events that are sent as pulses, and are learnt long after they happened."""
    for part, choice in study.choices.items():
        for each in mentioned(choice.settings) if part.startswith("triggers.") else ():
            kind = KINDS.get(str(each.value)) if each.mark == Reference("event") else None
            if kind is not None and kind.learnt:
                yield (
                    (*part.split(".", 1), *each.place),
                    f"{part} sends {each.value} as a pulse, and a session learns of it only "
                    f"{kind.learnt}, which may be seconds later; use the labels "
                    "and the participant file, whose timestamps are right, and remove it here",
                )


@asks
def _of_limits(study: Study) -> Doubts:
    """Question limits of time that fail before they warn, and shares of more than everything."""
    for key, (warn, fail) in study.protocol.sync:
        if warn > fail:
            said = f"sync.{key} warns beyond {warn:g}, and fails beyond {fail:g} already"
            yield ("sync", key), said
        elif key in SHARES and fail > 1.0:
            yield ("sync", key), f"sync.{key} fails beyond {fail:g}, and is a share of 1"
