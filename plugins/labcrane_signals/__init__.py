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
        offer("gaze_signal", GazeSettings, _gaze),
        offer("force_signal", ForceSettings, _force),
        offer("stick_signal", StickSettings, _sticks),
        offer("any_signal", AnySettings, _any),
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


def _gaze(settings: GazeSettings, machine: Machine) -> SignalMonitor:
    from labcrane_signals.gaze import GazeMonitor

    return GazeMonitor(settings)


def _force(settings: ForceSettings, machine: Machine) -> SignalMonitor:
    from labcrane_signals.plain import ForceMonitor

    return ForceMonitor(settings)


def _sticks(settings: StickSettings, machine: Machine) -> SignalMonitor:
    from labcrane_signals.sticks import StickMonitor

    return StickMonitor(settings)


def _any(settings: AnySettings, machine: Machine) -> SignalMonitor:
    from labcrane_signals.plain import PlainMonitor

    return PlainMonitor()
