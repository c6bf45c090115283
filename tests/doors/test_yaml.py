"""Whatever a YAML file holds, ``check`` says what is wrong with it, and soon."""

import copy
import itertools
import json
import random
import re
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labcrane import ProtocolError
from labcrane.core import read_yaml
from labcrane.files.yaml import YamlFile, parse_yaml
from labcrane.testing import discover, load, main

PROTOCOLS = Path(__file__).parents[2] / "protocols"

NINE = "abcdefghi"
BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{now}: &{now} [{', '.join(['*' + before] * 9)}]\n" for before, now in itertools.pairwise(NINE)
)
MERGES = "a: &a {x: 1}\n" + "".join(
    f"{now}: &{now} {{<<: [{', '.join(['*' + before] * 9)}]}}\n"
    for before, now in itertools.pairwise(NINE)
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "title: a\n\x07",
            ":2:1: this is not valid YAML: it contains the character U+0007, which is not",
        ),
        (
            "day: 2001-99-99",
            ":1:6: this is not valid YAML: '2001-99-99' looks like a date or a time but is not",
        ),
        ("[" * 3000, ":1:51: nested deeper than 50 levels; write it flat"),
        ("a:\n" + "- " * 2000, ":2:100: nested deeper than 50 levels; write it flat"),
        (
            BOMB,
            " contains more than 50000 values, or itself, through its aliases; use fewer of them",
        ),
        (
            "title: " + "x" * 5_000_000,
            " cannot be read: it has 5000007 bytes; the maximum is 256000",
        ),
        ("a: [" + "1, " * 20_001 + "1]", " has more than 20000 commas, colons, brackets, dashes"),
        ("a: 0b" + "1" * 90_000, ":1:4: it holds a whole number of 90000 bits; write less"),
        ('a: "\\ud800"', ":1:4: it contains the character U+D800 in "),
        ("a: !!python/object:os.system x", ":1:4: it holds 'x' with a tag; write plain values"),
        (
            "a: !!int x",
            ":1:4: this is not valid YAML: the tag !!int requires a whole number, which 'x' is not",
        ),
        (
            "a: [1,\n 2, !!bool maybe]",
            ":2:5: this is not valid YAML: the tag !!bool requires true or false",
        ),
        (
            "a: !!map 5",
            ":1:4: this is not valid YAML: a tag that requires keys with values, before",
        ),
        ("a:\n  b: [1, !x 5]", ":2:10: it holds '5' with a tag; write plain values"),
        ("a: &a [*b]", ":1:8: this is not valid YAML: found undefined alias 'b'"),
    ],
)
def test_a_hostile_file_is_refused_with_file_and_reason(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "hostile.yaml"
    path.write_text(text)
    for read in (read_yaml, YamlFile.read):
        with pytest.raises(ProtocolError, match=re.escape(f"{path}{message}")):
            read(path)


def test_bytes_that_are_no_text_and_folders_are_refused(tmp_path: Path) -> None:
    (tmp_path / "wide.yaml").write_bytes("title: ü".encode("utf-16"))
    with pytest.raises(ProtocolError, match=r"yaml:1:1: byte 0xFF is not UTF-8; .* save it as"):
        read_yaml(tmp_path / "wide.yaml")
    with pytest.raises(ProtocolError, match="is not a file; give the path of a YAML file"):
        read_yaml(tmp_path)


def test_aliases_and_merges_mean_what_they_always_did() -> None:
    text = "one: &one {x: 1, y: [2, 3]}\ntwo: {<<: *one, x: 4}\nthree: *one\n"
    assert parse_yaml(text, "aliases") == {
        "one": {"x": 1, "y": [2, 3]},
        "two": {"x": 4, "y": [2, 3]},
        "three": {"x": 1, "y": [2, 3]},
    }
    assert parse_yaml(MERGES, "merges")["i"] == {"x": 1}  # by the plain loader it takes a minute


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (
            "[true]",
            "a step is true; it must be consent, instructions",
        ),
        ("[null, {block: {task: aiming}}]", "a step is nothing; it must be consent"),
        ("[{}, {block: {task: aiming}}]", "a step is {}; it must be consent"),
        ("[{block: }]", "is nothing; it must be a mapping of keys"),
        ("[]", "is []; it needs at least 1"),
    ],
)
def test_a_step_that_is_none_is_told_with_its_line(
    tmp_path: Path, capsys, steps: str, message: str
) -> None:
    text = (PROTOCOLS / "retrieval" / "protocol.yaml").read_text()
    shutil.copytree(PROTOCOLS, tmp_path / "protocols")
    path = tmp_path / "protocols" / "retrieval" / "wrong.yaml"
    path.write_text(text.partition("sessions:")[0] + f"sessions: [{{name: a, steps: {steps}}}]\n")
    assert main(["check", str(path)]) == 2
    said = capsys.readouterr().err.replace("\n", " ")
    assert message in re.sub(r"\s+", " ", said)


VALUES = [
    None, True, False, 0, -1, 1, 1e308, 2**70, "", "x", "\x00", "a/b", "../..", "/etc/passwd",
    "ü" * 50, [], [[]], [True], [None], {}, {"a": {}}, {"use": None}, {"use": []}, "2001-01-01",
    [1, 2], ["x"], -0.5, 10**9, {"use": "x"}, "nul", ".", "consent",
]  # fmt: skip


def places_in(node: object, at: tuple = ()) -> list[tuple]:
    if isinstance(node, dict):
        inside = list(node.items())
    elif isinstance(node, list):
        inside = list(enumerate(node))
    else:
        inside = []
    return [at, *(place for key, value in inside for place in places_in(value, (*at, key)))]


def wrong(data: dict, dice: random.Random) -> dict:
    """Return a protocol with some places changed, left out or renamed."""
    data = copy.deepcopy(data)
    for _ in range(dice.choice([1, 1, 2, 4])):
        *way, last = dice.choice(places_in(data)[1:] or [("labcrane",)])
        node = data
        for step in way:
            node = node[step]
        match dice.randrange(4):
            case 0 if isinstance(node, dict):
                node[str(dice.choice(VALUES))] = node.pop(last, None)
            case 1 if len(node) > 1:
                node.pop(last)
            case _:
                node[last] = dice.choice(VALUES)
    return data


NOWHERE = ("{}" + "a" * 300, "b/" * 3000 + "{}", "{}/under a file", "c\0{}")
"""Names of files that no disk takes, or that lead through what is no folder."""


@pytest.mark.slow
@pytest.mark.parametrize("form", NOWHERE, ids=["long", "deep", "through", "NUL"])
def test_a_file_that_no_disk_can_have_is_told_of_wherever_one_is_named(
    tmp_path: Path, form: str
) -> None:
    folder = shutil.copytree(PROTOCOLS / "retrieval", tmp_path / "retrieval")
    path, registry = folder / "protocol.yaml", discover()
    whole = read_yaml(path)
    named = [
        place
        for place in places_in(whole)
        if isinstance(text := at(whole, place), str) and text and (folder / text).is_file()
    ]
    assert len(named) >= 3
    for *way, last in named:
        data = copy.deepcopy(whole)
        holder = at(data, way)
        ending = Path(holder[last]).suffix
        holder[last] = form.format(holder[last]) + ending
        path.write_text(json.dumps(data))
        with pytest.raises(ProtocolError, match=r"protocol\.yaml"):
            load(path, registry)


def at(data: object, place: Iterable[str | int]) -> Any:
    """Return what is in a place."""
    for step in place:
        data = data[step]
    return data


TOKENS = st.sampled_from(
    [
        *"[]{},:-?&*!|>'\"%@`#\n ",
        "a",
        "1",
        "<<",
        "&a ",
        "*a",
        "!!int ",
        "!!set ",
        "2001-01-01",
        "\n  ",
        "---",
        "...",
        "0x",
        "1e9",
        ".nan",
        "\\x",
        "\x85",
        "\ufeff",
        "\t",
    ]
)


@pytest.mark.slow
@settings(max_examples=800, deadline=None)
@given(st.lists(TOKENS, max_size=40).map("".join) | st.text(max_size=60))
def test_any_text_is_yaml_or_is_told_to_be_none(text: str) -> None:
    try:
        json.dumps(parse_yaml(text, "a text"), default=str).encode()
    except ProtocolError as error:
        assert str(error).startswith("a text")  # noqa: PT017 - some of it is YAML
