"""Command that measures the delay of views, sounds and vibrations, by a sensor."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.cli.options import study_of
from labcrane.cli.output import out
from labcrane.errors import ProtocolError

if TYPE_CHECKING:
    from labcrane.streams.edges import Kind

WORDS: "Mapping[Kind, str]" = {"display": "view", "audio": "sound", "touch": "vibration"}
GUIDES: "Mapping[Kind, str]" = {
    "display": "Fix the photodiode over the square in a corner of view {name!r} and shade it. It "
    "must be an LSL stream of 500 Hz or more.",
    "audio": "Put the microphone to the loudspeaker or the headphones of {name!r}, or connect the "
    "line output. It must be an LSL stream of 1 kHz or more.",
    "touch": "Fix the accelerometer to a tactor of {name!r}, and lay both on something soft. It "
    "must be an LSL stream of 500 Hz or more.",
}
"""How to fix the sensor."""


def measure_delay(
    kind: "Kind", protocol: Path, stream: str | None, name: str | None, count: int, channel: int
) -> None:
    """Measure the delay of a view, a sound or a vibration; without a stream, print what is known.

    Parameters
    ----------
    stream, channel
        The sensor's stream, and the number of its channel, from 1.
    name
        The protocol's name for it; the only one by default.
    count
        Number of changes.
    """
    from labcrane.feedback.delays import delay_in_words, store

    word, guide = WORDS[kind], GUIDES[kind]
    study = study_of(protocol)
    there = list(study.views if kind == "display" else study.sounds)
    if name is None and len(there) == 1:
        name = there[0]
    if stream is None:
        _say_known(protocol, word, guide, there)
        return
    if name is None or name not in there:
        asked = f"choose a {word} with --name" if name is None else f"there is no {word} {name!r}"
        raise ProtocolError(f"{asked}; there is {', '.join(there) or 'none'}")
    from labcrane.feedback.measure_delay import measure

    out.print(guide.format(name=name), markup=False)
    measured = measure(
        study, kind, name, stream, count, channel, lambda text: out.print(text, markup=False)
    )
    found = measured.delay
    path = store(protocol, name, measured)
    out.print(
        f"{word} {name}: delay {delay_in_words(measured, measured.facts)}, "
        f"{1e3 * found.least_s:.1f} to {1e3 * found.most_s:.1f} ms, {found.seen} of {found.asked} "
        f"changes seen at {found.sensor_hz:.0f} Hz; {path}",
        markup=False,
    )


def _say_known(protocol: Path, word: str, guide: str, there: Sequence[str]) -> None:
    """Print earlier measurements, and how to measure."""
    from labcrane.feedback.delays import NOT_MEASURED, delay_in_words, read_delays

    known = read_delays(protocol)
    for each in there:
        before = known.get(each)
        said = delay_in_words(before, before.facts) if before else NOT_MEASURED
        out.print(f"{word} {each}: delay {said}", markup=False)
        out.print(guide.format(name=each) + " Name it with --stream.", markup=False)
    if not there:
        out.print(f"{protocol} has no {word}s", markup=False)
