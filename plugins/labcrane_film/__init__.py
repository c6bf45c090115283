"""Cameras, microphones and screens, recorded by PyAV into Matroska files."""

from labcrane import Capture, Offer, hookimpl, offer
from labcrane_film.settings import FilmCameraSettings, MicrophoneSettings, ScreenSettings

labcrane_api = 1

NEEDS = {"av": "pip install 'labcrane[video]'"}


@hookimpl
def labcrane_captures() -> list[Offer[Capture]]:
    source, examine = "labcrane_film.film:FilmedSource", "labcrane_film.film:examine"
    return [
        offer("camera", FilmCameraSettings, source, examine, needs=NEEDS),
        offer("microphone", MicrophoneSettings, source, examine, needs=NEEDS),
        offer("screen", ScreenSettings, source, examine, needs=NEEDS),
    ]
