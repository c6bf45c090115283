"""Command that measures the delay of views and sounds, by a photodiode or a microphone."""

from collections.abc import Sequence
from pathlib import Path

from labcrane.cli.output import out
from labcrane.errors import ProtocolError

DISPLAY = (
    "Fix the photodiode over the square in a corner of view {name!r} and shade it. It must be an "
    "LSL stream of 500 Hz or more."
)
AUDIO = (
    "Put the microphone to the loudspeaker or the headphones of {name!r}, or connect the line "
    "output. It must be an LSL stream of 1 kHz or more."
)


def measure_display(
    protocol: Path, stream: str | None, name: str | None, count: int, channel: int = 1
) -> None:
    """Measure the delay of a view; without a stream, print the known delays of all views.

    Parameters
    ----------
    stream, channel
        The photodiode's stream, and the number of its channel, from 1.
    name
        The protocol's name for the view; the only one by default.
    count
        Number of changes of the patch.
    """
    _measure(protocol, "view", DISPLAY, stream, name, count, channel)


def measure_audio(
    protocol: Path, stream: str | None, name: str | None, count: int, channel: int = 1
) -> None:
    """Measure the delay of a sound, as :func:`measure_display` that of a view."""
    _measure(protocol, "sound", AUDIO, stream, name, count, channel)


def _measure(
    protocol: Path,
    word: str,
    guide: str,
    stream: str | None,
    name: str | None,
    count: int,
    channel: int,
) -> None:
    from labcrane.feedback.delays import delay_in_words, store
    from labcrane.protocol.study import load
    from labcrane.registry.registry import discover

    study = load(protocol, discover(study=protocol))
    there = list(study.views if word == "view" else study.sounds)
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
        study, name, stream, count, channel, lambda text: out.print(text, markup=False)
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
