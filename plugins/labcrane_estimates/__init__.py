"""Estimates of load: band powers of an EEG, heart rate and its variability, pupil size."""

from labcrane import Estimate, Offer, hookimpl, offer
from labcrane_estimates.settings import BandPowerSettings, HeartSettings, PupilSettings

labcrane_api = 1


@hookimpl
def labcrane_estimates() -> list[Offer[Estimate]]:
    return [
        offer("band_power", BandPowerSettings, "labcrane_estimates.band_power:BandPower"),
        offer("heart", HeartSettings, "labcrane_estimates.heart:Heart"),
        offer("pupil", PupilSettings, "labcrane_estimates.pupil:Pupil"),
    ]
