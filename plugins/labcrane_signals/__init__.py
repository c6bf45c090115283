"""Monitors of other programs' signals: EEG, ECG, EMG, gaze, force, sticks, and any other."""

from labcrane import Machine, Offer, SignalMonitor, hookimpl, offer
from labcrane_signals.settings import (
    AnySettings,
    EcgSettings,
    EegSettings,
    EmgSettings,
    ForceSettings,
    GazeSettings,
    StickSettings,
)

labcrane_api = 1


@hookimpl
def labcrane_monitors() -> list[Offer[SignalMonitor]]:
    return [
        offer("eeg_signal", EegSettings, _eeg),
        offer("ecg_signal", EcgSettings, _ecg),
        offer("emg_signal", EmgSettings, _emg),
        offer("gaze_signal", GazeSettings, "labcrane_signals.gaze:GazeMonitor"),
        offer("force_signal", ForceSettings, "labcrane_signals.plain:ForceMonitor"),
        offer("stick_signal", StickSettings, "labcrane_signals.sticks:StickMonitor"),
        offer("any_signal", AnySettings, "labcrane_signals.plain:PlainMonitor"),
    ]


def _eeg(settings: EegSettings, machine: Machine) -> SignalMonitor:
    from labcrane_signals.electrodes import EEG, ElectrodeMonitor

    return ElectrodeMonitor(settings, EEG)


def _ecg(settings: EcgSettings, machine: Machine) -> SignalMonitor:
    from labcrane_signals.electrodes import ECG, ElectrodeMonitor

    return ElectrodeMonitor(settings, ECG)


def _emg(settings: EmgSettings, machine: Machine) -> SignalMonitor:
    from labcrane_signals.electrodes import EMG, ElectrodeMonitor

    return ElectrodeMonitor(settings, EMG)
