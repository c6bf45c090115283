"""Corrected times of recorded streams, as often as one likes."""

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from labcrane.errors import RecordingError
from labcrane.recording.foreign_streams import RecordedStream
from labcrane.recording.xdf.header import Description, StreamHeader
from labcrane.streams.sync.correction import Corrected, Treatment, correct
from labcrane.streams.sync.raw import raw_of
from labcrane.types import FloatArray


def treatment_of(header: StreamHeader) -> Treatment:
    """Return the treatment that a stream's own header asks for.

    ``desc/synchronization`` says whether it may drop samples, and what must be subtracted from its
    stamps (``offset_mean``, in seconds).
    """
    timing = header.desc.get("synchronization", {})
    return Treatment(
        rate_hz=header.rate_hz,
        can_drop_samples=_text(timing, "can_drop_samples").lower() == "true",
        latency_s=_seconds(header, _text(timing, "offset_mean")),
    )


def resync(recorded: RecordedStream) -> Corrected:
    """Correct a recorded stream by its header."""
    return correct(raw_of(recorded), treatment_of(recorded.header))


def columns_of(corrected: Corrected) -> dict[str, FloatArray]:
    """Return what the participant file keeps per sample, by name."""
    return {
        "time": corrected.time,
        "time_error": corrected.error,
        "time_uneven": corrected.uneven,
        "time_basis": corrected.basis.astype(np.float64),
    }


def quality_of(corrected: Corrected, treatment: Treatment) -> dict[str, float | str]:
    """Return everything that the participant file keeps of how corrected times came."""
    segments = "; ".join(
        f"{part.start} to {part.stop} by {part.basis}, {part.probes} probes, "
        f"{part.drift_ppm:+.3f} ppm"
        for part in corrected.segments
    )
    each = asdict(corrected.quality)
    each |= {f"error_p95_{name}_s": size for name, size in each.pop("made_of_s").items()}
    quality: dict[str, float | str] = {
        name: value if isinstance(value, str) else float(value) for name, value in each.items()
    }
    return quality | {
        "segments": segments,
        "dejitter": treatment.way.value,
        "transport_s": treatment.transport_s,
        "latency_s": treatment.latency_s,
    }


def _text(timing: Description, name: str) -> str:
    if not isinstance(timing, Mapping):
        return ""
    value = timing.get(name, "")
    return value.strip() if isinstance(value, str) else ""


def _seconds(header: StreamHeader, text: str) -> float:
    try:
        return float(text or 0.0)
    except ValueError:
        raise RecordingError(
            f"stream {header.name!r} states offset_mean {text!r}, which is not a number of "
            "seconds; give its latency in the protocol"
        ) from None
