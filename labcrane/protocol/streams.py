"""External streams that a protocol asks for, and the required accuracy of their time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import (
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    model_validator,
)

from labcrane.core.settings import Settings, Usual, WrongKey
from labcrane.recording.own_streams import OWN_STREAMS
from labcrane.streams.sync.report.limits import Limits, WarnLimit

if TYPE_CHECKING:  # a protocol is checked without loading what corrects clocks
    from labcrane.recording.xdf.header import StreamHeader
    from labcrane.streams.request import StreamRequest
    from labcrane.streams.sync.correction import Treatment


class StreamNeed(Settings):
    """A stream of another program that a study records, by type, name or source id."""

    type: str | None = None
    """LSL type: ``EEG``, ``Gaze``, ``Markers``. By its type alone any stream on the network fits, a
    neighbour's as well: a check asks whether that is meant, and a run which one is."""

    name: str | None = None
    """LSL name."""

    source_id: str | None = None
    """LSL source id."""

    several: bool = False
    """Whether all streams that fit are recorded, without confirmation. Otherwise one is, and a
    session does not begin while two fit: another program's stream derived from yours is of its type
    as well."""

    required: bool = True
    """Whether a session starts only when the stream sends data. It never waits for a stream that it
    sends itself, as ``labcrane.input``."""

    rate_hz: Annotated[PositiveFloat | None, Usual(0.1, 50_000.0)] = None
    """Expected nominal rate, in samples per second."""

    channels: Annotated[PositiveInt | None, Usual(1, 2000)] = None
    """Expected number of channels."""

    counter: str | None = None
    """Label of the channel that counts samples; its gaps are lost samples."""

    latency_s: Annotated[float | None, Usual(1e-5, 2.0)] = None
    """Fixed latency of the device, in seconds, as measured or stated by its maker; subtracted from
    its times. What the stream's own header states holds by default."""

    space: Literal["screen", "scene"] | None = None
    """Reference of the pixels of a gaze stream: the participant's window (``screen``), or the scene
    camera of a head-mounted tracker (``scene``), which gives no areas of interest. By default, the
    stream's own header states it; where it does not, no gaze is measured."""

    min_delay_s: Annotated[NonNegativeFloat | None, Usual(1e-5, 2.0)] = None
    """For a device whose samples get their timestamps when they are sent: the shortest time from
    sampling to sending, in seconds. It cannot be observed. Without it, the scatter of timestamps is
    assumed to be centred on the true times."""

    evening: Literal["auto", "forbid", "force"] = "auto"
    """Whether timestamps of a regular stream are dejittered: only where they demonstrably scatter
    about a steady sample clock, never, or always. The times before dejittering are kept as well."""

    stamped: Literal["at_sampling", "when_sent"] | None = None
    """When samples of a regular stream get their timestamps, if its maker states that. With
    ``at_sampling`` they are the samples' own times: a step to later is a pause of the sampler, and
    what scatters are the samples. With ``when_sent`` each is late by a wait that changes. Without
    it, the uncertainty includes what either leaves open. A wrong declaration makes it too small,
    where the timestamps do not contradict it."""

    sees: dict[str, str] = Field(default_factory=dict)
    """Channels of a photodiode, a microphone or an accelerometer, by label, each with the view,
    sound or vibration at which it is: ``{Diode: operator}``. The sync report compares the times of
    each change."""

    @model_validator(mode="after")
    def _names_a_stream(self) -> "StreamNeed":
        if self.type is None and self.name is None and self.source_id is None:
            raise ValueError("a stream needs a type, a name or a source_id to be found by")
        if self.evening == "forbid" and self.min_delay_s is not None:
            raise WrongKey(
                "min_delay_s needs dejittering, to find the least delayed samples; remove it, or "
                "do not write evening: forbid",
                at=("min_delay_s",),
            )
        late = self.min_delay_s is not None or self.evening == "force"
        if self.stamped == "at_sampling" and late:
            raise WrongKey(
                "stamped: at_sampling keeps timestamps as they are; remove it, or min_delay_s and "
                "evening: force",
                at=("stamped",),
            )
        return self

    @property
    def any_of_type(self) -> bool:
        """Whether one stream is meant, and any of its type fits."""
        return self.name is None and self.source_id is None and not self.several

    def request(
        self, label: str, *, required: bool, expected: Sequence[str] = ()
    ) -> "StreamRequest":
        """Return the request to the recorder; ``label`` is the study's name for the stream.

        ``expected`` has the questions that a protocol has answered.
        """
        from labcrane.streams.request import StreamRequest  # noqa: PLC0415

        return StreamRequest(
            label=label,
            type=self.type,
            name=self.name,
            source_id=self.source_id,
            required=self.required and required and self.name not in OWN_STREAMS,
            rate_hz=self.rate_hz,
            channels=self.channels,
            counter=self.counter,
            stamped=self.stamped,
            several=self.several,
            any_meant=f"streams.{label}" in expected,
        )

    def is_for(self, header: "StreamHeader") -> bool:
        """Whether a recorded stream is the one, or one of those, that is needed."""
        from labcrane.streams.request import same_type  # noqa: PLC0415

        if self.name is not None and self.name != header.name:
            return False
        if self.source_id is not None and self.source_id != header.source_id:
            return False
        return self.type is None or same_type(self.type, header.type)

    def treatment(self, header: "StreamHeader") -> "Treatment":
        """Return how the timestamps of a recorded stream are to be interpreted."""
        from labcrane.streams.sync.correction import Treatment  # noqa: PLC0415
        from labcrane.streams.sync.dejitter import Dejitter  # noqa: PLC0415
        from labcrane.streams.sync.resync import treatment_of  # noqa: PLC0415
        from labcrane.streams.sync.sampling import Stamped  # noqa: PLC0415

        stated = treatment_of(header)
        ways = {"auto": stated.dejitter, "forbid": Dejitter.NONE, "force": Dejitter.LEAST_SQUARES}
        late = self.min_delay_s is not None
        return Treatment(
            rate_hz=stated.rate_hz,
            can_drop_samples=stated.can_drop_samples,
            stamped=Stamped(self.stamped or ""),
            dejitter=Dejitter.ENVELOPE if late else ways[self.evening],
            transport_s=self.min_delay_s or 0.0,
            latency_s=stated.latency_s if self.latency_s is None else self.latency_s,
        )


SHARES = frozenset({"missing", "late"})
"""Limits that are fractions of a whole."""


class TimeLimits(Settings):
    """Accuracy of timestamps: beyond the first number a warning, beyond the second a failure."""

    error_s: WarnLimit = Limits().error_s
    """Uncertainty of corrected timestamps at 95 %, in seconds."""

    silent_s: WarnLimit = Limits().silent_s
    """Time from a required regular stream's last sample to the end of the recording, in seconds."""

    rate: WarnLimit = Limits().rate
    """Relative deviation of a stream's effective rate from its nominal rate."""

    gap_s: WarnLimit = Limits().gap_s
    """Longest interruption of a regular stream, in seconds."""

    drift_ppm: WarnLimit = Limits().drift_ppm
    """Rate error of a source's clock, in parts per million."""

    residual_s: WarnLimit = Limits().residual_s
    """Scatter of clock probes about their curve, in seconds."""

    rtt_s: WarnLimit = Limits().rtt_s
    """95th percentile of the probes' round trips, in seconds."""

    probe_age_s: WarnLimit = Limits().probe_age_s
    """Longest time without a trusted probe, in seconds."""

    missing: WarnLimit = Limits().missing
    """Fraction of samples lost according to the source's own counter."""

    late: WarnLimit = Limits().late
    """Fraction of the loop's ticks that began more than a period late."""

    def limits(self) -> Limits:
        """Return the limits for the sync report."""
        return Limits(**dict(self))
