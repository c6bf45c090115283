"""Estimates of load: band powers of an EEG, heart beats, skin conductance, pupil size."""

from labcrane import Estimate, Offer, hookimpl, offer
from labcrane_estimates.settings import (
    BandPowerSettings,
    HeartSettings,
    PupilSettings,
    SkinSettings,
)

labcrane_api = 1


@hookimpl
def labcrane_estimates() -> list[Offer[Estimate]]:
    return [
        offer("band_power", BandPowerSettings, "labcrane_estimates.band_power:BandPower"),
        offer("heart", HeartSettings, "labcrane_estimates.heart:Heart"),
        offer("skin", SkinSettings, "labcrane_estimates.skin:Skin"),
        offer("pupil", PupilSettings, "labcrane_estimates.pupil:Pupil"),
    ]
