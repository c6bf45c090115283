"""Names that look alike and are not the same."""

import unicodedata
from pathlib import Path
from random import Random

import pytest
from rehearsal import SHORT, loaded

from labcrane import ProtocolError
from labcrane.core import look
from labcrane.errors import meant

PRECOMPOSED = "éüñçåöÅŻó"
UNSEEN = ["\u200b", "\u200d", "\ufeff", "\u00ad", "\u2060"]
LATIN = {"a": "\u0430", "e": "\u0435", "o": "\u03bf", "A": "\u0391", "B": "\u0412", "x": "\u0445"}


def name(dice: Random) -> str:
    return "".join(dice.choice("axeoABmk") for _ in range(4)) + dice.choice(PRECOMPOSED)


def alike(text: str, dice: Random) -> str:
    """Return another text that looks the same, changed in one or two ways."""
    other = text
    while other == text:
        for _ in range(dice.randint(1, 2)):
            at = dice.randrange(1, len(other))
            way = dice.randrange(4)
            if way == 0:
                other = unicodedata.normalize("NFD", other)
            elif way == 1:
                other = other[:at] + dice.choice(UNSEEN) + other[at:]
            elif way == 2:
                other = dice.choice([f"{other} ", f" {other}", f"\u00a0{other}"])
            else:
                other = "".join(LATIN.get(each, each) for each in other)
    return other


def checked(folder: Path, design: str, more: str = "") -> None:
    text = SHORT.replace(
        "sessions:", f"feedback: {{ball: {{use: sphere}}}}\n{more}{design}\nsessions:"
    )
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    loaded(path)


@pytest.mark.parametrize("seed", range(20))
def test_groups_and_choices_that_look_alike_are_refused_by_code_point(
    seed: int, tmp_path: Path
) -> None:
    dice = Random(seed)
    one = name(dice)
    two = alike(one, dice)
    assert look(one) == look(two)
    pair = dice.sample([one, two], 2)
    groups = ", ".join(f'"{each}": []' for each in pair)
    with pytest.raises(ProtocolError, match=r"They look alike, but .* has") as bad:
        checked(tmp_path, f"design: {{groups: {{{groups}}}}}")
    assert "U+" in str(bad.value)
    choices = ", ".join(f'"{each}"' for each in pair)
    question = f"{{name: a, text: A, kind: choice, choices: [{choices}]}}"
    more = f"questionnaires: {{q: {{use: free, title: Q, questions: [{question}]}}}}\n"
    with pytest.raises(ProtocolError, match=r"They look alike, but .* has"):
        checked(tmp_path, "", more)


@pytest.mark.parametrize("seed", range(10))
def test_a_name_that_looks_like_a_known_one_is_told_with_its_code_points(seed: int) -> None:
    dice = Random(seed)
    known = name(dice)
    wrong = alike(known, dice)
    said = meant(wrong, ["other", known])
    assert said.startswith(f"did you mean {known!r}? They look alike, but {wrong!a} has ")


def test_names_that_look_different_stay_different(tmp_path: Path) -> None:
    names = ["a", "A", "ab", "a b", "a-b", "é", "e", "é2", "²", "2", "λ", "Z"]
    assert len({look(each) for each in names}) == len(names)
    groups = ", ".join(f'"{each}": []' for each in names)
    checked(tmp_path, f"design: {{groups: {{{groups}}}}}")


def test_a_choice_has_one_line(tmp_path: Path) -> None:
    question = '{name: a, text: A, kind: choice, choices: ["a\\nb", c]}'
    more = f"questionnaires: {{q: {{use: free, title: Q, questions: [{question}]}}}}\n"
    with pytest.raises(ProtocolError, match="has a line end, which tables do not hold"):
        checked(tmp_path, "", more)
