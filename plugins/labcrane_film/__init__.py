"""Cameras, microphones and screens, recorded by PyAV into Matroska files."""

from collections.abc import Sequence

from labcrane import Capture, Machine, Offer, hookimpl, offer
from labcrane.core import Finding
from labcrane.registry import Prompt
from labcrane_film.settings import (
    FilmCameraSettings,
    MicrophoneSettings,
    ScreenSettings,
    SourceSettings,
)

labcrane_api = 1

NEEDS = {"av": "pip install 'labcrane[video]'"}


@hookimpl
def labcrane_captures() -> list[Offer[Capture]]:
    def build(settings: SourceSettings, machine: Machine) -> Capture:
        from labcrane_film.film import FilmedSource

        del machine  # the same for every machine
        return FilmedSource(settings)

    def examine(settings: SourceSettings, ask: Prompt | None) -> Sequence[Finding]:
        from labcrane_film.film import examine

        del ask  # nothing needs to be moved
        return examine(settings)

    return [
        offer("camera", FilmCameraSettings, build, examine, needs=NEEDS),
        offer("microphone", MicrophoneSettings, build, examine, needs=NEEDS),
        offer("screen", ScreenSettings, build, examine, needs=NEEDS),
    ]
