"""Gaze streams of a session: which one is measured, and why others are not.

A stream of LSL type ``Gaze`` is measured where a channel ``aoi`` names what is looked at, or where
two channels in pixels say where in the participant's window. Pixels of a head-mounted tracker's
scene camera look the same, so they are taken for the window's only where that is declared: in the
protocol (``space``), ``labcrane resync --space``, or ``coordinate_system`` in the stream's header.
They are joined to the areas of the one view that the operator sees (:func:`window_pictures`).
"""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from labcrane.analysis.cohort import Participant
from labcrane.errors import RecordingError, nearest
from labcrane.recording.participant_file.reader import SessionRecord, Stream
from labcrane.recording.pictures import LOG

if TYPE_CHECKING:
    import pandas as pd

KIND, CHANNEL = "Gaze", "aoi"
AREAS = ".areas"
PIXELS = frozenset({"px", "pixel", "pixels"})

SCREEN, SCENE = "screen", "scene"
WORDS = {"screen": SCREEN, "display": SCREEN, "monitor": SCREEN, "world": SCENE, "scene": SCENE}
"""Spaces by the words with which headers state a coordinate system: ``world``, ``screen-space``."""

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


def window_stream(session: SessionRecord, name: str = "") -> Stream | None:
    """Return the gaze stream in pixels of the window; None for none or several."""
    found = [each for each in _gaze(session) if place(each) and name in ("", each.name)]
    return found[0] if len(found) == 1 else None


def place(gaze: Stream) -> tuple[str, ...]:
    """Return the columns of a place in the window, x and y in pixels; empty without them.

    Empty also if it is not stated that its pixels are the window's.
    """
    columns = _in_pixels(gaze)
    return columns if columns and gaze_space(gaze) == SCREEN else ()


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
        if CHANNEL in each.units or not _in_pixels(each) or place(each):
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
    return named or [each for each in _gaze(session) if place(each)]


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


def _in_pixels(gaze: Stream) -> tuple[str, ...]:
    pixels = [name for name, unit in gaze.units.items() if unit.lower() in PIXELS]
    across = [name for name in pixels if name.lower().endswith("x")]
    down = [name for name in pixels if name.lower().endswith("y")]
    return (across[0], down[0]) if across and down else ()
