"""Cameras, microphones and screens, recorded by PyAV into Matroska files."""

from labcrane import Capture, Machine, Offer, hookimpl, offer
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

    return [
        offer("camera", FilmCameraSettings, build, needs=NEEDS),
        offer("microphone", MicrophoneSettings, build, needs=NEEDS),
        offer("screen", ScreenSettings, build, needs=NEEDS),
    ]
