"""Limits that a study sets to the error of its time stamps."""

from dataclasses import dataclass
from typing import NamedTuple

from labcrane.core.findings import Verdict


class WarnLimit(NamedTuple):
    """Beyond ``warn`` a value deserves a look, beyond ``fail`` the data do."""

    warn: float
    fail: float

    def judge(self, value: float) -> Verdict:
        """Return the verdict on a value; one that is not known is a failure."""
        if not value <= self.fail:
            return Verdict.FAIL
        return Verdict.WARN if value > self.warn else Verdict.PASS


ERROR_S = WarnLimit(0.001, 0.05)
RATE = WarnLimit(0.002, 0.05)
LAG_S = WarnLimit(0.05, 5.0)
SILENT_S = WarnLimit(5.0, 5.0)
GAP_S = WarnLimit(0.0, 1.0)
DRIFT_PPM = WarnLimit(100.0, 500.0)
RESIDUAL_S = WarnLimit(0.0002, 0.002)
RTT_S = WarnLimit(0.002, 0.02)
PROBE_AGE_S = WarnLimit(6.0, 30.0)
MISSING = WarnLimit(0.0, 0.01)
LATE = WarnLimit(0.01, 0.05)


@dataclass(frozen=True, slots=True)
class Limits:
    """What a study demands of its time stamps. Times are seconds.

    Attributes
    ----------
    error_s
        Uncertainty, at 95 %, of nearly all corrected stamps, and of those of any second.
    silent_s
        From a required regular stream's last sample to the end of the recording.
    rate
        Relative deviation of the effective from the nominal rate.
    lag_s
        Shortest time, either way, from a regular stream's stamps to their arrival.
    gap_s
        Longest interruption of a regular stream.
    drift_ppm
        Rate error of the source's clock; a crystal in order stays below a hundred.
    residual_s
        Scatter of the clock probes about the curve.
    rtt_s
        95th percentile of round trips. Half of it bounds what asymmetry of the path can hide.
    probe_age_s
        Longest time without a trusted probe.
    missing
        Fraction of samples that the source's own counter says are lost.
    late
        Fraction of the loop's ticks that woke more than a period after they were due.
    """

    error_s: WarnLimit = ERROR_S
    silent_s: WarnLimit = SILENT_S
    rate: WarnLimit = RATE
    lag_s: WarnLimit = LAG_S
    gap_s: WarnLimit = GAP_S
    drift_ppm: WarnLimit = DRIFT_PPM
    residual_s: WarnLimit = RESIDUAL_S
    rtt_s: WarnLimit = RTT_S
    probe_age_s: WarnLimit = PROBE_AGE_S
    missing: WarnLimit = MISSING
    late: WarnLimit = LATE
