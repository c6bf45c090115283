"""Questions about how the YAML is written."""

from collections.abc import Mapping

from labcrane.protocol.pages import Language
from labcrane.protocol.questions.question import Doubts, asks, key_of
from labcrane.protocol.study import Study

NAMED: Mapping[str, Mapping[Language, str]] = {
    "camera": {
        "en": "camera film video",
        "de": "kamera film video",
        "pl": "kamer film wideo",
        "fr": "caméra film vidéo",
        "es": "cámara film vídeo video",
    },
    "microphone": {
        "en": "microphone voice sound audio",
        "de": "mikrofon stimme ton audio",
        "pl": "mikrofon głos dźwięk audio",
        "fr": "micro voix son audio",
        "es": "micrófono voz sonido audio",
    },
    "screen": {"en": "screen", "de": "bildschirm", "pl": "ekran", "fr": "écran", "es": "pantalla"},
}
"""Words of which a participant understands what is recorded, by kind and language."""


@asks
def _of_recordings(study: Study) -> Doubts:
    """Question words of the consent text that do not say what is recorded."""
    for name, chosen in study.recordings.items():
        said = getattr(chosen.settings, "consent", "").casefold()
        kinds = NAMED.get(chosen.name, {}).get(study.protocol.page.language, chosen.name).split()
        if not any(word.casefold() in said for word in (name, *kinds)):
            yield (
                ("recordings", name, "consent"),
                f"the words {said!r} name neither recording {name!r} nor what it is "
                f"({', '.join(kinds)}), so that any consent text may contain them",
            )


@asks
def _of_commas(study: Study) -> Doubts:
    """Question lists of numbers in which a comma may be meant as the sign of a decimal."""
    for place, two in study.source.uneven_commas() if study.source else ():
        yield (
            place,
            (
                f"{key_of(place)} has {two} without a space beside commas with one, which are two "
                f"numbers; write {two.replace(',', '.')} if one is meant, or else "
                f"{two.replace(',', ', ')}"
            ),
        )


@asks
def _of_cut_texts(study: Study) -> Doubts:
    """Question texts that go on behind a space and a ``#``, which begins a comment."""
    for place, rest in study.source.cut_texts() if study.source else ():
        yield (
            place,
            (
                f"{key_of(place)} ends before {rest!r}, which YAML reads as a comment; put the "
                "text in quotation marks, or write the comment in a line of its own"
            ),
        )
