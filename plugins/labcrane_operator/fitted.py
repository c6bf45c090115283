"""A fitted operator as a part of a protocol."""

from collections.abc import Mapping
from pathlib import Path

from labcrane import RecordingError
from labcrane_operator.fitting import Estimate
from labcrane_operator.settings import OperatorSettings

DECIMALS = 4

WHY_NOT: Mapping[str, str] = {
    "learning_rate": "no learning was found in this session",
    "lapse_s": "there were fewer than two lapses",
    "pace_sd": "a difference between people; one person's pace is in fitts_a_s and fitts_b_s",
    "motor_noise": "the machine and the scheme filter it",
    "motor_noise_s": "the machine and the scheme filter it",
    "gain_per_s": "the hands' correction and the plan are seen only together",
    "patience_m": "the plan's delay and the machine's are seen only together",
    "look_s": "the end of a stroke and the look at it are seen only together",
    "inside": "the task's end rule hides it",
    "still_m_s": "the task's end rule hides it",
    "press_s": "of no consequence for a movement",
    "axes": "the study's devices say which there are",
    "button": "the study's devices say which there is",
    "response": "responses to a second task are not looked at",
}
"""Why a setting has no value from a recording; it keeps its default."""


def not_identified(fitted: Mapping[str, Estimate]) -> dict[str, str]:
    """Return the settings that were not fitted, each with the reason."""
    return {name: WHY_NOT[name] for name in OperatorSettings.model_fields if name not in fitted}


def numbers(estimate: Estimate) -> tuple[str, str, str]:
    """Return value, lower and upper limit in words; the limits are empty without an interval."""
    value = f"{estimate.value:.{DECIMALS}f}"
    if estimate.interval is None:
        return value, "", ""
    low, high = estimate.interval
    return value, f"{low:.{DECIMALS}f}", f"{high:.{DECIMALS}f}"


def save(text: str, path: Path) -> None:
    """Write the part.

    Raises
    ------
    RecordingError
        It cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be written: {error.strerror}; give --out another place"
        ) from error


def protocol_part(fitted: Mapping[str, Estimate], source: str) -> str:
    """Return YAML for a protocol: the operator with the fitted values, and their source."""
    lines = [f"# Fitted to {source}.", "# What is missing keeps its default.", "operator:"]
    lines.append("  use: simulated_operator")
    for name, estimate in fitted.items():
        value, low, high = numbers(estimate)
        lines.append(f"  {name}: {value}  # {low} to {high}" if low else f"  {name}: {value}")
    return "\n".join(lines) + "\n"
