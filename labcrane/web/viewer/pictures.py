"""Pictures and sound of a session's recordings, as the viewer's page asks for them."""

from base64 import b64encode
from collections.abc import Mapping
from typing import Any

from labcrane.errors import RecordingError
from labcrane.web.viewer.film import Film

SOUND_S = 20.0
"""So much sound is given at once."""


def picture(film: Film, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a recording shows at a second, ready for JSON: a picture, or why there is none.

    Of sound there is no picture: only whether there is any.
    """
    footage = film.footage[asked["name"]]
    try:
        row = footage.row(film.start + float(asked["t"]))
        audible = footage.is_sound
        src = "" if audible else _data("image/jpeg", footage.picture(row))
    except RecordingError as error:
        return {"src": "", "sound": False, "said": str(error)}
    since = float(footage.time[row]) - film.start
    return {"src": src, "sound": audible, "said": "", "since": since}


def sound(film: Film, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Return the sound from a second on, ready for JSON."""
    begin = film.start + float(asked["t"])
    return {"src": _data("audio/wav", film.footage[asked["name"]].sound(begin, SOUND_S))}


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{b64encode(content).decode()}"
