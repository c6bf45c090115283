"""One edit of a protocol's text changes that value, and not a character elsewhere."""

import io
import json
import random
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from labcrane import ProtocolError
from labcrane.cli.shipped import shipped_studies
from labcrane.start.text import edited, positions, ties

SHIPPED = [each / "protocol.yaml" for each in shipped_studies().values()]


def read(text: str) -> Any:
    """Read with the safe loader, which shares nothing with what edits."""
    return json.loads(json.dumps(YAML(typ="safe").load(text), default=str))


def restyled(path: Path, rng: random.Random) -> str:
    """Write a shipped protocol in a random style, with comments in random lines."""
    yaml = YAML()
    dash = rng.choice([0, 2])
    yaml.indent(mapping=2, sequence=2 + dash, offset=dash)
    yaml.width = rng.choice([60, 200])
    yaml.preserve_quotes = True
    data = yaml.load(path.read_text(encoding="utf-8"))

    def style(node: Any) -> None:
        if isinstance(node, CommentedMap | CommentedSeq):
            if rng.random() < 0.3:
                node.fa.set_block_style()
            for child in node.values() if isinstance(node, CommentedMap) else node:
                style(child)

    style(data)
    out = io.StringIO()
    yaml.dump(data, out)
    lines = []
    for line in out.getvalue().splitlines():
        if line[:1].isalpha() and rng.random() < 0.3:
            lines += ["", f"# about {rng.random():.3f} - and: more"]
        lines.append(line)
    made = "\n".join(lines) + "\n"
    assert read(made) == read(path.read_text(encoding="utf-8"))
    return made


def scalars(data: Any, place: tuple = ()) -> list[tuple]:
    if isinstance(data, dict):
        return [found for key, each in data.items() for found in scalars(each, (*place, key))]
    if isinstance(data, list):
        return [found for at, each in enumerate(data) for found in scalars(each, (*place, at))]
    return [place]


def changed(data: Any, place: tuple, value: Any) -> Any:
    if not place:
        return value
    made = dict(data) if isinstance(data, dict) else list(data)
    made[place[0]] = changed(data[place[0]], place[1:], value)
    return made


VALUES = [
    7,
    0.125,
    True,
    None,
    "plain",
    "50 cm",
    "a: b # c",
    "ähnlich, so",
    "yes",
    "12",
    "don't",
    "",
]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200))
def test_a_field_of_a_random_protocol_changes_alone(seed: int) -> None:
    rng = random.Random(seed)
    text = restyled(rng.choice(SHIPPED), rng)
    data = read(text)
    place = rng.choice(scalars(data))
    value = rng.choice(VALUES)
    if place[-2:-1] == ("scenes",) and "scenes: *scenes" in text:  # one list, by an anchor
        with pytest.raises(ProtocolError, match="cannot be changed alone"):
            edited(text, "set", place, value)
        return
    made = edited(text, "set", place, value)
    assert read(made) == changed(data, place, value)
    same = SequenceMatcher(None, text, made, autojunk=False).get_matching_blocks()
    kept = same[0].size + (same[-2].size if len(same) > 2 else 0)
    begin = next((n for n, (a, b) in enumerate(zip(text, made, strict=False)) if a != b), len(text))
    end = next(
        (n for n, (a, b) in enumerate(zip(text[::-1], made[::-1], strict=False)) if a != b), 0
    )
    assert kept or begin
    field = text[begin : len(text) - end] if end else ""
    assert "\n" not in field.strip("\n") or isinstance(value, str), field
    lines = [line for line in text.splitlines() if line.strip()]
    left = made.splitlines()
    gone = [line for line in lines if line not in left]
    assert len(gone) <= max(1, field.count("\n") + 1), gone
    comments = [line for line in lines if line.lstrip().startswith("#")]
    assert [line for line in left if line.lstrip().startswith("#")] == comments


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_steps_are_added_moved_and_removed_alone(seed: int) -> None:
    rng = random.Random(seed)
    text = restyled(rng.choice(SHIPPED), rng)
    data = read(text)
    steps = data["sessions"][0]["steps"]
    place: tuple = ("sessions", 0, "steps")
    step = {"break": {"seconds": 30}}
    at = rng.randrange(len(steps) + 1)
    longer = edited(text, "insert", (*place, at), step)
    assert read(longer)["sessions"][0]["steps"] == [*steps[:at], step, *steps[at:]]
    assert [line for line in text.splitlines() if line not in longer.splitlines()] == [] or (
        "[" in longer
    )
    to = rng.randrange(len(steps) + 1)
    moved = edited(longer, "move", (*place, at), to)
    assert read(moved)["sessions"][0]["steps"] == [*steps[:to], step, *steps[to:]]
    assert edited(moved, "remove", (*place, to)) == text


def test_what_was_added_and_removed_again_leaves_the_text_as_it_was() -> None:
    for path in SHIPPED:
        text = path.read_text(encoding="utf-8")
        for place in (("page",), ("design", "seed"), ("participants", "minutes")):
            made = edited(text, "set", (*place, "new"), 1) if place == ("page",) else edited(
                text, "set", place, 1
            )  # fmt: skip
            assert made != text
            added = place if place[0] not in read(text) or place != ("page",) else (*place, "new")
            if place[0] in read(text):
                assert edited(made, "remove", added) == text


COMMENTED = """\
# head
a: 1      # why one
list:
  # first
  - x: 1
    y: 2  # two
  # second
  - {x: 3}

text: |
  one
    two
# tail
last: [1, 2]   # end
"""


@pytest.mark.parametrize(
    ("how", "place", "value", "old", "new"),
    [
        ("set", ("a",), 2.5, "a: 1  ", "a: 2.5  "),
        ("set", ("list", 0, "z"), "q", "# two\n", "# two\n    z: q\n"),
        ("set", ("list", 1, "z"), [1], "{x: 3}", "{x: 3, z: [1]}"),
        ("set", ("text",), "three\nfour\n", "one\n    two\n", "three\n  four\n"),
        ("set", ("text",), "three", "|\n  one\n    two\n", "three\n"),
        ("set", ("new", "inner"), 1, "# end\n", "# end\nnew: {inner: 1}\n"),
        ("remove", ("list", 0, "x"), None, "x: 1\n    y", "y"),
        ("remove", ("list", 0, "y"), None, "    y: 2  # two\n", ""),
        ("remove", ("list", 1), None, "  # second\n  - {x: 3}\n", ""),
        ("remove", ("list", 1, "x"), None, "{x: 3}", "{}"),
        ("remove", ("last", 0), None, "[1, 2]", "[2]"),
        ("remove", ("last", 1), None, "[1, 2]", "[1]"),
        ("insert", ("last", 0), 0, "[1, 2]", "[0, 1, 2]"),
        ("insert", ("last", 2), 3, "[1, 2]", "[1, 2, 3]"),
        ("insert", ("list", 2), {"x": 4}, "{x: 3}\n", "{x: 3}\n  - x: 4\n"),
        ("insert", ("fresh", 0), "b", "# end\n", "# end\nfresh: [b]\n"),
        ("move", ("last", 0), 1, "[1, 2]", "[2, 1]"),
        (
            "move", ("list", 1), 0,
            "  # first\n  - x: 1\n    y: 2  # two\n  # second\n  - {x: 3}\n",
            "  # second\n  - {x: 3}\n  # first\n  - x: 1\n    y: 2  # two\n",
        ),
    ],
)  # fmt: skip
def test_an_edit_keeps_comments_and_style(
    how: str, place: tuple, value: Any, old: str, new: str
) -> None:
    assert COMMENTED.count(old) == 1
    assert edited(COMMENTED, how, place, value) == COMMENTED.replace(old, new)


def test_a_key_without_a_value_and_an_empty_file_take_one() -> None:
    assert edited("a:\nb: 1\n", "set", ("a",), 3) == "a: 3\nb: 1\n"
    assert edited("a:\nb: 1\n", "set", ("a", "c"), 3) == "a: {c: 3}\nb: 1\n"
    assert edited("# only this\n", "set", ("a",), 3) == "# only this\na: 3\n"
    assert edited("", "set", ("a",), 3) == "a: 3\n"


def test_a_value_that_an_anchor_ties_to_another_is_refused() -> None:
    text = "a: &one {x: 1}\nb: *one\nc: {<<: *one, y: 2}\n"
    for place in (("a", "x"), ("b", "x")):
        with pytest.raises(ProtocolError, match="cannot be changed alone"):
            edited(text, "set", place, 2)
    assert edited(text, "set", ("c", "y"), 3) == text.replace("y: 2", "y: 3")
    assert edited(text, "set", ("c", "x"), 3) == text.replace("y: 2", "y: 2, x: 3")


@pytest.mark.parametrize(
    ("how", "place"), [("remove", ("q",)), ("move", ("a", 0)), ("set", ("a", "b"))]
)
def test_a_place_that_is_not_there_is_named(how: str, place: tuple) -> None:
    with pytest.raises(ProtocolError, match="change it in the text"):
        edited("a: 1\n", how, place, 5)


def test_places_have_line_and_column() -> None:
    found = {tuple(place): (line, column) for place, line, column in positions(COMMENTED)}
    assert found[("a",)] == (2, 1)
    assert found[("list", 0)] == (5, 5)
    assert found[("list", 1, "x")] == (8, 6)
    assert found[("last", 1)] == (14, 11)


def test_the_places_that_an_anchor_ties_are_named_and_no_others() -> None:
    text = "a: &x {b: 1}\nc: *x\nd: &alone 2\ne: {<<: *x, f: 3}\n"
    assert sorted(ties(text)) == [["a"], ["c"], ["e", "<<"]]
