"""Export of recordings as MAT files, version 5, which MATLAB and Octave load."""

from collections.abc import Sequence

from labcrane import Machine, Offer, hookimpl, offer
from labcrane.analysis import Exporter
from labcrane_matlab.settings import MatlabSettings

labcrane_api = 1


@hookimpl
def labcrane_exporters() -> Sequence[Offer[Exporter]]:
    def matlab(settings: MatlabSettings, machine: Machine) -> Exporter:
        from labcrane_matlab.matlab import Matlab

        return Matlab(settings)

    return (offer("matlab", MatlabSettings, matlab),)
