"""Quality of loop and clocks, one row per session and per stream."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.cohort import Participant
from labcrane.analysis.presented import in_words, not_presented
from labcrane.core.findings import Verdict, worst
from labcrane.errors import RecordingError, shortened
from labcrane.recording.participant_file.reader import SessionRecord

if TYPE_CHECKING:
    import pandas as pd

SHOWN = 5


def verdict_of_stamps(report: Mapping[str, Any]) -> str:
    """Return a recorded sync report's verdict on timestamps alone; empty without a report."""
    if not {"presented", "interrupted"} & set(report):
        return str(report.get("verdict", ""))
    judged = [*report["streams"], *filter(None, [report["loop"]]), *report["missing"]]
    judged += report.get("loop_back", ())
    return worst(Verdict(one["verdict"]) for one in judged).value


def loop_quality(participant: Participant) -> "pd.DataFrame":
    """Return the lateness of the loop's ticks, one row per session.

    Lateness is the time from a tick's due time to its wake-up. A late tick is one whose lateness is
    more than a period. A session on a clock that jumps (``--fast``) is never late, and has no
    external streams: ``not_there`` names those that it would have had.
    """
    import pandas as pd

    return pd.DataFrame(participant.rows(lambda session: [_loop(session)]))


def _loop(session: SessionRecord) -> dict[str, Any]:
    loop = session.streams["loop"].columns(("woke", "due", "wrote", "paused"))
    lateness, rate_hz = loop["woke"] - loop["due"], float(session.attrs["rate_hz"])
    return {
        "clock": session.attrs.get("clock", ""),
        "sync_verdict": verdict_of_stamps(session.sync_report),
        "not_there": ", ".join(session.sync_report.get("absent", ())),
        "ticks": len(lateness),
        "rate_hz": rate_hz,
        "lateness_median_ms": 1e3 * float(np.median(lateness)),
        "lateness_p99_ms": 1e3 * float(np.quantile(lateness, 0.99)),
        "lateness_worst_ms": 1e3 * float(lateness.max()),
        "late_ticks": int((lateness > 1.0 / rate_hz).sum()),
        "paused_s": float(loop["paused"].sum() / rate_hz),
        "write_worst_ms": 1e3 * float(loop["wrote"].max()),
    }


def sync_quality(participant: Participant) -> "pd.DataFrame":
    """Return what the participant file states on external clocks, one row per stream.

    Everything that the correction noted has a column of its own; ``corrected`` states
    whether there is a time on our clock at all.
    """
    import pandas as pd

    return pd.DataFrame(participant.rows(_clocks))


def _clocks(session: SessionRecord) -> Iterator[dict[str, Any]]:
    for name, stream in session.streams.items():
        about = {key: value for key, value in stream.attrs.items() if key != "name"}
        if "corrected" in about:  # others are our own: one clock
            corrected = "yes" if about.pop("corrected") else "no"
            samples = len(stream.time)
            yield {"stream": name, "corrected": corrected, "samples": samples, **about}


def estimates_quality(participant: Participant) -> "pd.DataFrame":
    """Return how late the values of estimates were used, one row per session and estimate.

    Latency is the time from what a value stands for to the wake-up of the first tick that used it.
    ``fallback_share`` is the part of the ticks that used the fallback.
    """
    import pandas as pd

    return pd.DataFrame(participant.rows(_estimates))


def _estimates(session: SessionRecord) -> Iterator[dict[str, Any]]:
    frames = session.streams["input"]
    states = [name for name in frames.units if re.fullmatch(r"estimate\.\w+\.state", name)]
    for column in states:
        own = column.removesuffix(".state")
        found = frames.columns((f"{own}.time", column))
        time, used = found[f"{own}.time"], found[column] == 0.0
        first = used & (np.diff(time, prepend=np.nan) != 0.0)
        woke = session.streams["loop"].columns(("woke",))["woke"]
        latency_ms = 1e3 * (woke - time)[first]
        middle, most = np.quantile(latency_ms, [0.5, 0.99]) if first.any() else (np.nan, np.nan)
        yield {
            "estimate": own.removeprefix("estimate."),
            "values_used": int(first.sum()),
            "latency_median_ms": float(middle),
            "latency_p99_ms": float(most),
            "fallback_share": float(1.0 - used.mean()),
        }


def loop_backs(participant: Participant) -> "pd.DataFrame":
    """Return what photodiodes and microphones showed of the streams that recorded them.

    Milliseconds: delay of the sensor after the picture or sound, by how much it grew from the first
    third of the session to the last, the uncertainty of the stream's times at 95 %, and the lag of
    a camera or microphone that is declared.
    """
    import pandas as pd

    return pd.DataFrame(
        participant.rows(lambda session: map(_loop_back, session.sync_report.get("loop_back", ())))
    )


def _loop_back(one: Mapping[str, Any]) -> dict[str, Any]:
    delay = one["delay"] or {}
    seconds = {
        "delay": delay.get("mean_s"),
        "delay_sd": delay.get("sd_s"),
        "growth": one["moved_s"],
        "stated": one["stated_s"],
        "declared_lag": one.get("declared_s"),
    }
    return {
        **{name: one[name] for name in ("stream", "channel", "of", "verdict")},
        "seen": delay.get("seen", 0),
        "changes": delay.get("asked", 0),
        **{f"{name}_ms": None if s is None else 1e3 * s for name, s in seconds.items()},
    }


def unprobed(participants: Iterable[Participant]) -> list[str]:
    """Return the streams whose clock offset was not measured, at all or in part, in words.

    The error of their times is unknown.
    """
    found = []
    for participant in participants:
        for number, session in participant.sessions():
            for name, stream in session.streams.items():
                if "corrected" not in stream.attrs or not len(stream.time):
                    continue  # our own: one clock
                where = f"{name} of {participant.name}, session {number}"
                missing = float(stream.attrs.get("unprobed", 0.0))
                if not stream.attrs["corrected"]:
                    found.append(f"{where} (not corrected)")
                elif missing:
                    found.append(f"{where} ({missing:.0f} of {len(stream.time)} samples)")
    return found


def check_probed(participants: Iterable[Participant], *, accept: bool) -> list[str]:
    """Return the streams whose clock offset was never measured.

    Raises
    ------
    RecordingError
        There are some, and they are not accepted.
    """
    found = unprobed(participants)
    if found and not accept:
        raise RecordingError(
            f"timestamp accuracy of {shortened(found, SHOWN, '; ')} is unknown: their "
            "clock offsets were not measured; remove these streams from the study, or use "
            "--accept-unprobed (the output notes it)"
        )
    return found


def exclusions(movements: "pd.DataFrame") -> "pd.DataFrame":
    """Return the movements excluded from means, with the reason."""
    names = ["participant", "session", "trial", "attempt", "outcome", "practice"]
    counted = is_result(movements)
    out = movements.reindex(columns=names).loc[~counted].copy()
    still, unseen = without_onset(movements)[~counted], not_presented(movements)[~counted]
    shown = [
        in_words(row) if why else ""
        for row, why in zip(movements[~counted].to_dict("records"), unseen, strict=True)
    ]
    out["why"] = [
        "practice"
        if row.practice
        else f"outcome {row.outcome}" + ", no onset" * unmoved + f", {said}" * bool(said)
        for row, unmoved, said in zip(out.itertuples(index=False), still, shown, strict=True)
    ]
    return out.drop(columns="practice")


def is_result(movements: "pd.DataFrame") -> "pd.Series[bool]":
    """Return which movements are results: successful, with an onset, shown, and no practice.

    Attempts that are not the trial's last are not successful, see :data:`core.records.UNDONE`.
    """
    import pandas as pd

    if movements.empty:  # sessions that ended before their first result have no columns either
        return pd.Series([], index=movements.index, dtype=bool)
    counts = (movements["practice"].astype(float) == 0.0) & ~not_presented(movements)
    return is_success(movements) & counts


def is_success(movements: "pd.DataFrame") -> "pd.Series[bool]":
    """Return which movements are successes in which something moved, practice among them."""
    return (movements["outcome"] == "success") & ~without_onset(movements)


OF_AIMING = ("movement_onset", "movement_time", "error_along")
"""Results that identify an aimed movement; trials of other tasks lack the last of them."""


def without_onset(movements: "pd.DataFrame") -> "pd.Series[bool]":
    """Return which aimed movements have no onset: ended or skipped before anything moved.

    Their errors say where the machine was, and nothing on accuracy.
    """
    import pandas as pd

    if not set(OF_AIMING) <= set(movements):
        return pd.Series(data=False, index=movements.index, dtype=bool)
    return movements["movement_onset"].isna() & movements["error_along"].notna()
