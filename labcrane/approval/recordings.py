"""Comparison of the recordings of people with the consent text."""

from pathlib import Path

from labcrane.errors import ProtocolError
from labcrane.protocol.study import Study


def check_consent_names(study: Study, consent: Path) -> None:
    """Make sure that the consent text names each recording in the words of the protocol.

    Capitals and line breaks do not matter.

    Raises
    ------
    ProtocolError
        It does not, or it is not a text.
    """
    if not study.recordings:
        return
    try:
        text = _plain(consent.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ProtocolError(
            f"the consent text {consent} cannot be read as text ({error}), so that it cannot be "
            "compared with the recordings of the protocol; give a text file (.md or .txt)"
        ) from error
    words = {name: getattr(each.settings, "consent", "") for name, each in study.recordings.items()}
    lacking = [
        f"{study.where(('recordings', name))}: the consent text {consent} does not contain "
        f"{said!r}, by which it is to name recording {name!r}; add a sentence with these words, "
        "or correct the key consent of the recording"
        for name, said in words.items()
        if not said or _plain(said) not in text
    ]
    if lacking:
        raise ProtocolError("\n".join(lacking))


def _plain(text: str) -> str:
    return " ".join(text.split()).casefold()
