"""Estimates: of load, from body and pupil, and of what the operator looks at and does."""

from labcrane import Estimate, Offer, hookimpl, offer
from labcrane_estimates.settings import (
    BandPowerSettings,
    DrtResponseSettings,
    GazeRegionSettings,
    HeartSettings,
    PupilSettings,
    SkinSettings,
    StickActivitySettings,
)

labcrane_api = 1


@hookimpl
def labcrane_estimates() -> list[Offer[Estimate]]:
    return [
        offer("band_power", BandPowerSettings, "labcrane_estimates.band_power:BandPower"),
        offer("heart", HeartSettings, "labcrane_estimates.heart:Heart"),
        offer("skin", SkinSettings, "labcrane_estimates.skin:Skin"),
        offer("pupil", PupilSettings, "labcrane_estimates.pupil:Pupil"),
        offer("gaze_region", GazeRegionSettings, "labcrane_estimates.gaze_region:GazeRegion"),
        offer(
            "stick_activity",
            StickActivitySettings,
            "labcrane_estimates.stick_activity:StickActivity",
        ),
        offer("drt_response", DrtResponseSettings, "labcrane_estimates.drt_response:DrtResponse"),
    ]
