"""Export of recordings as MAT files, version 5, which MATLAB and Octave load."""

from labcrane import Offer, hookimpl, offer
from labcrane.analysis import Exporter
from labcrane_matlab.settings import MatlabSettings

labcrane_api = 1


@hookimpl
def labcrane_exporters() -> list[Offer[Exporter]]:
    return [offer("matlab", MatlabSettings, "labcrane_matlab.matlab:Matlab")]
