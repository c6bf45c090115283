"""Gaze streams of a session: which one is measured, and why others are not.

A stream of LSL type ``Gaze`` is measured where a channel ``aoi`` names what is looked at, or where
two channels in pixels say where in the participant's window. Pixels of a head-mounted tracker's
scene camera look the same, so they are taken for the window's only where that is declared: in the
protocol (``space``), ``labcrane resync --space``, or ``coordinate_system`` in the stream's header.
They are joined to the areas of the one view that the operator sees (:func:`window_pictures`).
A sample is known where an eye that was asked for is (:class:`WindowGaze`).
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from labcrane.analysis.cohort import Participant
from labcrane.analysis.monitor_settings import monitor_setting
from labcrane.core.eyes import (
    BOTH,
    CONFIDENCE,
    LEFT,
    RIGHT,
    Eye,
    eyes_of,
    is_confidence,
    is_sure,
    side_of,
)
from labcrane.errors import RecordingError, nearest
from labcrane.recording.participant_file.reader import SessionRecord, Stream
from labcrane.recording.pictures import LOG
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

KIND, CHANNEL = "Gaze", "aoi"
AREAS = ".areas"
PIXELS = frozenset({"px", "pixel", "pixels"})

SCREEN, SCENE = "screen", "scene"
WORDS = {"screen": SCREEN, "display": SCREEN, "monitor": SCREEN, "world": SCENE, "scene": SCENE}
"""Spaces by the words with which headers state a coordinate system: ``world``, ``screen-space``."""

BEST, MEAN = "best", "mean"
EYES = (LEFT, RIGHT, BEST, MEAN)
"""Eyes that may be asked for: one of them, the one that is known more often, or both."""

UNMEASURED = ("participant", "session", "stream", "why")


def gaze_stream(session: SessionRecord, name: str = "") -> Stream | None:
    """Return the stream by which gaze is measured: one that names areas, else one in the window.

    None without one, or if several are usable: :func:`unmeasured` lists them.

    Parameters
    ----------
    name
        Name of the stream; empty for the only one.

    Raises
    ------
    RecordingError
        The stream of that name cannot be measured.
    """
    found = [each for each in _candidates(session) if name in ("", each.name)]
    if name and not found:
        there = nearest(name, [each.name for each in _candidates(session)], "there is")
        raise RecordingError(f"gaze cannot be measured by a stream {name!r}; {there}")
    return found[0] if len(found) == 1 else None


def window_stream(session: SessionRecord) -> Stream | None:
    """Return the gaze stream in pixels of the window; None for none or several."""
    found = [each for each in _gaze(session) if in_window(each)]
    return found[0] if len(found) == 1 else None


def in_window(gaze: Stream) -> bool:
    """Return whether a stream has a place in pixels, and states that they are the window's."""
    return bool(_in_pixels(gaze)) and gaze_space(gaze) == SCREEN


@dataclass(frozen=True)
class WindowGaze:
    """Where in the window eyes look, by a stream in its pixels.

    A sample below the confidence ``least`` is not gaze.
    """

    stream: Stream
    eyes: tuple[Eye, ...]
    least: float

    @property
    def called(self) -> str:
        """What is used: ``left``, ``left and right``; ``both`` if the tracker has one place."""
        return _named(eye.side for eye in self.eyes)

    def spots(self, start: int = 0, stop: int | None = None) -> FloatArray:
        """Return x and y in pixels, shape ``(n, 2)``: the mean of the eyes that see.

        NaN where none does.
        """
        samples = _samples(self.stream, start, stop)
        seen = np.array([eye.seen(samples, self.least) for eye in self.eyes])
        where = np.array([samples[:, [eye.x, eye.y]] for eye in self.eyes])
        total = np.where(seen[:, :, None], where, 0.0).sum(axis=0)
        count = seen.sum(axis=0)[:, None]
        spots: FloatArray = np.where(count > 0, total / np.maximum(count, 1), np.nan)
        return spots


def window_gaze(session: SessionRecord, stream: Stream, eye: str = MEAN) -> WindowGaze:
    """Return where in the window eyes look.

    Parameters
    ----------
    stream
        One that :func:`in_window` is true of.
    eye
        One of :data:`EYES`. ``best`` is the one that is known in more samples of the session;
        ``mean`` what the tracker has computed from both, otherwise the mean of those that see.

    Raises
    ------
    RecordingError
        The stream does not have that eye.
    """
    eyes, least = _in_pixels(stream), least_confidence(session)
    sides = {each.side: each for each in eyes}
    if eye == MEAN:
        chosen = (sides[BOTH],) if BOTH in sides else eyes
    elif eye == BEST:
        samples = _samples(stream)
        chosen = (max(eyes, key=lambda each: int(each.seen(samples, least).sum())),)
    elif eye in sides:
        chosen = (sides[eye],)
    else:
        raise _no_eye(stream, eye, sides)
    return WindowGaze(stream, chosen, least)


def sure_samples(
    session: SessionRecord, gaze: Stream, eye: str = MEAN
) -> tuple[npt.NDArray[np.bool_], str]:
    """Return which samples the tracker is sure of in an eye that is asked for, and by which eyes.

    All of them, and no eye, where it does not say how sure it is.

    Raises
    ------
    RecordingError
        The stream does not have that eye.
    """
    texts = gaze.header is None or len(gaze.numeric) != len(gaze.units)
    channels = () if gaze.header is None or texts else gaze.header.channels
    columns = [at for at, channel in enumerate(channels) if is_confidence(channel)]
    sides = {side_of(channels[at]) for at in columns} - {BOTH} or {BOTH}
    if eye in (LEFT, RIGHT):
        if eye not in sides:
            raise _no_eye(gaze, eye, sides)
        sides = {eye}
    if not columns:
        return np.ones(len(gaze), bool), ""
    samples, least = _samples(gaze), least_confidence(session)
    sure = np.zeros(len(gaze), bool)
    for side in sides:
        mine = [at for at in columns if side_of(channels[at]) in (side, BOTH)]
        sure |= is_sure(samples[:, mine], least)
    return sure, _named(sides)


def _no_eye(gaze: Stream, eye: str, sides: Iterable[str]) -> RecordingError:
    return RecordingError(
        f"gaze stream {gaze.name!r} does not have the {eye} eye alone; it has {_named(sides)}; "
        "choose another one: MeasureSettings(gaze_eye='mean')"
    )


def _named(sides: Iterable[str]) -> str:
    return " and ".join(side or "both" for side in sorted(sides))


def least_confidence(session: SessionRecord) -> float:
    """Return the confidence below which a sample is not gaze: that of the protocol's monitor."""
    stated = monitor_setting(session, "confidence")
    return CONFIDENCE if stated is None else float(stated)


def _samples(gaze: Stream, start: int = 0, stop: int | None = None) -> FloatArray:
    """Return samples of all channels, shape ``(n, n_channels)``."""
    values = gaze.values(list(gaze.units), start, stop)
    return np.column_stack(list(values.values())).astype(np.float64)


def window_pictures(session: SessionRecord) -> Stream | None:
    """Return the areas in the pictures of the operator's window; None for none or several.

    The experimenter's view records its areas as well, but no gaze is in its pixels.
    """
    found = _pictures(session)
    return found[0] if len(found) == 1 else None


def gaze_space(gaze: Stream) -> str:
    """Return the space of a stream's positions: ``screen``, ``scene``, or empty if not stated.

    A declaration takes precedence over the header.
    """
    if declared := gaze.attrs.get("space"):
        return str(declared)
    header = gaze.header
    if header is None:
        return ""
    once = str(header.desc.get("coordinate_system", ""))
    stated = " ".join([once, *(one.extra.get("coordinate_system", "") for one in header.channels)])
    found = {WORDS[word] for word in re.findall("[a-z]+", stated.lower()) if word in WORDS}
    return found.pop() if len(found) == 1 else ""


def unmeasured(session: SessionRecord) -> list[tuple[str, str]]:
    """Return the gaze streams that are not measured, each with the reason and a remedy."""
    found = []
    for each in _gaze(session):
        if CHANNEL in each.units or not _in_pixels(each) or in_window(each):
            continue
        if gaze_space(each) == SCENE:
            why = (
                "is in pixels of a scene camera, which moves with the head, and not of the "
                "participant's window; map it onto the window (docs/devices.md)"
            )
        else:
            why = (
                "is in pixels, but neither the protocol nor its header states of which picture; "
                "for the participant's window, declare it with labcrane resync FILE --space "
                f"'{each.name}=screen'; for a scene camera, '{each.name}=scene'"
            )
        found.append((each.name, why))
    several = _candidates(session)
    pictures = [each.name.removeprefix(LOG).removesuffix(AREAS) for each in _pictures(session)]
    by_place = [each for each in several if CHANNEL not in each.units]
    if by_place and len(pictures) > 1:
        views = " and ".join(map(repr, pictures))
        why = (
            f"is in pixels of the window, but it is unknown of which view ({views}); "
            "join it manually with labcrane.analysis.gaze.looks_on_screen (docs/devices.md)"
        )
        return [*found, *((each.name, why) for each in by_place)]
    names = " and ".join(repr(each.name) for each in several)
    why = f"could be measured as well as others: {names}; choose one: gaze_stream='NAME'"
    return [*found, *((each.name, f"{why} of MeasureSettings") for each in several[1:] and several)]


def unmeasured_of(participant: Participant) -> "pd.DataFrame":
    """Return :func:`unmeasured` of all sessions: participant, session, stream, why."""
    import pandas as pd

    rows = [
        (participant.name, number, *told)
        for number, session in participant.sessions()
        for told in unmeasured(session)
    ]
    return pd.DataFrame(rows, columns=list(UNMEASURED))


def _gaze(session: SessionRecord) -> list[Stream]:
    return [each for each in session.streams.values() if each.attrs.get("type") == KIND]


def _candidates(session: SessionRecord) -> Sequence[Stream]:
    """Return the streams that could be measured; those that name areas are preferred."""
    named = [each for each in _gaze(session) if CHANNEL in each.units]
    return named or [each for each in _gaze(session) if in_window(each)]


def _pictures(session: SessionRecord) -> list[Stream]:
    """Return the areas of each view that the operator sees; of a view that is not named, too."""
    components = session.context.get("components", {})
    aside = {
        f"{LOG}{part.removeprefix('views.')}{AREAS}"
        for part, choice in components.items()
        if part.startswith("views.")
        and choice.get("settings", {}).get("seen_by", "operator") != "operator"
    }
    streams = session.streams.values()
    return [one for one in streams if one.name.endswith(AREAS) and one.name not in aside]


def _in_pixels(gaze: Stream) -> tuple[Eye, ...]:
    return () if gaze.header is None else eyes_of(gaze.header.channels, PIXELS)
