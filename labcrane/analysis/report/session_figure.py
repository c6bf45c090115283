"""A picture of a session's movements: the tip's path and speed, and the times."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from labcrane.recording.participant_file.reader import SessionRecord

MOST_IN_A_COLUMN = 16
"""Trials under one another in the legend."""


def draw(session: "SessionRecord", path: Path) -> None:
    """Draw the counted movements of a session into a PNG file."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 5.4), layout="constrained")
    above, speed = figure.subplots(1, 2)
    stamp = "simulated operator" if session.attrs["simulated"] == "yes" else "recorded operator"
    figure.suptitle(f"{session.context['title']} — {session.attrs['participant']} ({stamp})")
    _draw_from_above(session, above)
    _draw_speed(session, speed)
    figure.savefig(path, dpi=110)


def names(trials: "pd.DataFrame") -> list[str]:
    """Return the names of a table's trials, a row each: ``3``, or ``practice 1``.

    The record also numbers approach movements; names count the trials alone, and a repeated trial
    keeps its number.
    """
    found = []
    for number, practice in zip(trials["trial"], trials["practice"], strict=True):
        alike = trials.loc[trials["practice"] == practice, "trial"]
        place = alike[alike <= number].nunique()
        found.append(f"practice {place}" if practice else str(place))
    return found


def _draw_from_above(session: "SessionRecord", axes: "Axes") -> None:
    from matplotlib.patches import Circle

    state = session.streams["state"]
    for name, (_, trial) in zip(names(session.trials), session.trials.iterrows(), strict=True):
        moving = (state.time >= trial["started"]) & (state.time <= trial["ended"])
        x = state.data["tip.position.x"][moving]
        y = state.data["tip.position.y"][moving]
        axes.plot(-y, x, lw=1.2, label=name)
        axes.add_patch(
            Circle(
                (-trial["target_y"], trial["target_x"]), trial["width"] / 2, fill=False, color="0.3"
            )
        )
    axes.plot(0, 0, "ks", ms=8)
    axes.annotate("crane", (0, 0), textcoords="offset points", xytext=(8, -3))
    axes.set(xlabel="to the right (m)", ylabel="ahead (m)", title="tip from above", aspect="equal")
    columns = -(-len(session.trials) // MOST_IN_A_COLUMN)
    axes.legend(
        title="trial",
        fontsize="small",
        loc="center left",
        bbox_to_anchor=(1.02, 0.5),
        ncols=max(1, columns),
    )
    axes.grid(alpha=0.3)


def _draw_speed(session: "SessionRecord", axes: "Axes") -> None:
    state = session.streams["state"]
    velocity = state.data[["tip.velocity.x", "tip.velocity.y", "tip.velocity.z"]]
    speed = (velocity**2).sum(axis=1) ** 0.5
    for _, trial in session.trials.iterrows():
        moving = (state.time >= trial["started"]) & (state.time <= trial["ended"])
        axes.plot(state.time[moving] - trial["started"], speed[moving], lw=1)
    axes.set(xlabel="time in the trial (s)", ylabel="tip speed (m/s)", title="speed of the tip")
    axes.grid(alpha=0.3)
