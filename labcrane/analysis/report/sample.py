"""Sample of a study: how many, how old, which gender, by group."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

AGE, GENDERS, HANDS, EXPERIENCE = "age", ("gender", "sex"), "handedness", "experience"


def sample(answers: "pd.DataFrame", groups: dict[str, str]) -> "pd.DataFrame":
    """Return one row for all and one per group, from the answers to demographics.

    An item that was never presented has no column; declined answers are not counted.

    Parameters
    ----------
    answers
        Of :func:`labcrane.analysis.questionnaires.answers_of`.
    groups
        The group of each participant by name; "" where there are none.
    """
    import pandas as pd

    names = sorted({name for name in groups.values() if name})
    parts = [("all", list(groups))]
    if len(names) > 1:
        parts += [(name, [who for who, own in groups.items() if own == name]) for name in names]
    # Asked twice, the last answer holds.
    last = answers.drop_duplicates(["participant", "item"], keep="last")
    rows = []
    for name, people in parts:
        own = last[last["participant"].isin(people)]
        row: dict[str, object] = {"group": name, "n": len(people)}
        for item in (AGE, EXPERIENCE):
            if (last["item"] == item).any():
                row |= _spread(item, own.loc[own["item"] == item, "value"].to_numpy(float))
        for item in (*GENDERS, HANDS):
            if (last["item"] == item).any():
                words = [word for word in own.loc[own["item"] == item, "text"] if word]
                row |= {item: _counts(words), f"{item}_answers": len(words)}
        rows.append(row)
    return pd.DataFrame(rows)


def _spread(item: str, values: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> dict[str, object]:
    known = values[np.isfinite(values)]
    if not known.size:
        return {f"{item}_answers": 0}
    return {
        f"{item}_answers": known.size,
        f"{item}_mean": float(known.mean()),
        f"{item}_sd": float(known.std(ddof=1)) if known.size > 1 else float("nan"),
        f"{item}_min": float(known.min()),
        f"{item}_max": float(known.max()),
    }


def _counts(words: Sequence[str]) -> str:
    return ", ".join(f"{count} {word}" for word, count in sorted(Counter(words).items()))


def counted(number: int, noun: str) -> str:
    """Return ``1 participant``, or ``3 participants``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def in_words(table: "pd.DataFrame") -> str:
    """Return the sample in a sentence, with the number of known answers."""
    row = table.iloc[0].to_dict()
    about = []
    item = next((item for item in GENDERS if row.get(item)), "")
    if item:
        silent = row["n"] - row[f"{item}_answers"]
        about.append(str(row[item]) + (f" and {silent} without an answer" if silent else ""))
    if row.get("age_answers"):
        sd = f", SD = {row['age_sd']:.2f}" if np.isfinite(row["age_sd"]) else ""
        low, high = row["age_min"], row["age_max"]
        known = f", of {row['age_answers']} who said it" if row["age_answers"] < row["n"] else ""
        about.append(f"{low:g} to {high:g} years old, M = {row['age_mean']:.2f}{sd}{known}")
    groups = [f"{own['n']} in {own['group']}" for own in table.iloc[1:].to_dict("records")]
    text = counted(row["n"], "participant") + (f" ({'; '.join(about)})" if about else "")
    return text + (f": {', '.join(groups)}." if groups else ".")
