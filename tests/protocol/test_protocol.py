"""What a researcher is told about a protocol that cannot be run: every mistake, with its line."""

# ruff: noqa: E501 - a message is one line, as the researcher sees it

import re
from pathlib import Path

import pytest

from labcrane import ProtocolError
from labcrane.testing import Registry, load

ROOT = Path(__file__).parents[2]

WRITTEN = """\
labcrane: 1
study: aiming
title: A study
participants: {pattern: 'P\\d{3}', planned: 4}
rate_hz: 240
machine: ch8
input: {use: dual_joystick}
scheme:
  use: joint_velocity
  map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}
dynamics: {use: kinematic_crane}
tasks:
  aiming: {use: aiming, distances: [2, 3]}
design:
  order: {pairs: shuffled}
sessions:
  - name: first
    steps:
      - instructions: hello.md
      - practice: {task: aiming, pairs: 2}
      - block: {task: aiming, repeat: 2}
      - break: {seconds: 10}
"""


@pytest.fixture
def complaint(tmp_path: Path, registry: Registry):
    """Return what is said of the protocol with some words replaced, file name left out."""

    def complain(*changes: tuple[str, str]) -> list[str]:
        text = WRITTEN
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "study.yaml"
        path.write_text(text, encoding="utf-8")
        (tmp_path / "hello.md").write_text("Hello", encoding="utf-8")
        try:
            load(path, registry)
        except ProtocolError as error:
            return str(error).replace(f"{path}:", "").splitlines()
        return []

    return complain


def test_the_protocol_of_these_tests_is_fine(complaint) -> None:
    assert complaint() == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rate_hz: 240", "rat_hz: 240", "5:1: 'rat_hz' is not a key of the file; did you mean 'rate_hz'?"),
        ("rate_hz: 240", "rate_hz: -5", "5:10: rate_hz is -5; it must be greater than 0 Hz"),
        ("rate_hz: 240", "rate_hz: fast", "5:10: rate_hz is 'fast'; it must be a number in Hz, or one with its unit, as 1 kHz"),
        ("machine: ch8", "machine: ch9", "6:10: no machine is called 'ch9'; did you mean 'ch8'? labcrane has ch8, ch8_cranelike, or name a .yaml file in the protocol's folder"),
        ("use: dual_joystick", "use: dual_joistick", "7:14: input 'dual_joistick' is not installed; did you mean 'dual_joystick'? (labcrane plugins lists all)"),
        ("use: kinematic_crane", "use: kinematic_crane, actuatr: ideal", "11:34: 'actuatr' is not a key of dynamics; did you mean 'actuator'?"),
        ("distances: [2, 3]", "distances: [2, -3]", "13:40: tasks.aiming.distances[2] is -3; it must be greater than 0 m"),
        ("distances: [2, 3]", "distances: 2 m", "13:36: tasks.aiming.distances is '2 m'; it must be a list: [.., ..]"),
        ("pairs: shuffled", "pairs: randomly", "15:18: design.order.pairs.rule: 'randomly' is not a rule; use one of as_written, blocked, latin_square, shuffled, williams"),
        ("pairs: shuffled", "paris: shuffled", "15:11: no task varies 'paris'; did you mean 'pairs'? they vary pairs"),
        ("hello.md", "hallo.md", "19:23: instructions is 'hallo.md', and there is no such file; did you mean 'hello.md'?"),
        ("- break:", "- brake:", "22:9: 'brake' is not a step; did you mean 'break'?"),
        ("task: aiming, pairs: 2", "task: aimin, pairs: 2", "20:26: there is no task 'aimin'; did you mean 'aiming'? there is aiming"),
        ("task: aiming, pairs: 2", "task: aiming, pairs: 9", "20:41: pairs is 9; it must be a whole number, 1 to 4"),
        ("task: aiming, pairs: 2", "task: aiming, circles: 2", "20:34: 'circles' is not a key of a block or a factor of the task; it varies pairs"),
        ("task: aiming, pairs: 2", "task: aiming, pairss: 2", "20:34: 'pairss' is not a key of a block or a factor of the task; did you mean 'pairs'? it varies pairs"),
        ("task: aiming, pairs: 2", "task: aiming, feedbak: none", "20:34: 'feedbak' is not a key of a block or a factor of the task; did you mean 'feedback'? it varies pairs"),
        ("task: aiming, pairs: 2", "task: aiming, repet: 2", "20:34: 'repet' is not a key of a block or a factor of the task; did you mean 'repeat'? it varies pairs"),
        ("task: aiming, pairs: 2", "task: aiming, nmae: x", "20:34: 'nmae' is not a key of a block or a factor of the task; did you mean 'name'? it varies pairs"),
        ("- break: {seconds: 10}", "- break: 5 min", "22:16: break is '5 min'; write how long it lasts as {seconds: 5 min}"),
        ("- break: {seconds: 10}", "- fixation: 2", "22:19: fixation is 2; write how long it lasts as {seconds: 2}"),
        ("- name: first", "- after_days: 1\n    name: first", "17:17: sessions[1].after_days: it is 1; write the earliest and the latest day, as [1, 1]"),
        ("task: aiming, repeat: 2", "task: aiming, feedback: visual", "21:41: sessions[1].steps[3].block.feedback: it is 'visual'; write all, none, group for what the participant's own group is given, or a list of names: [visual]"),
        ("machine: ch8", "machine: arm.urdf", "6:10: machine is 'arm.urdf', a robot's file; write machine: {urdf: arm.urdf, joints: ..., tip: ...}, with the study's names for its joints"),
        ("labcrane: 1", "labcrane_cohort: 1", "1:1: the file is a cohort of simulated operators, and not a protocol; give the protocol"),
        ("labcrane: 1", "labcrane_scene: 1", "1:1: the file is a scene, and not a protocol; give the protocol"),
        ("study: aiming", "study: Aiming Study", None),
        ("labcrane: 1", "labcrane: 2", "1:11: labcrane is 2; it must be 1"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_its_line(complaint, old: str, new: str, said: str | None) -> None:
    told = complaint((old, new))
    if said is not None:
        assert told == [said]
    assert len(told) == 1
    assert told[0].split(":")[0] == str(1 + WRITTEN[: WRITTEN.index(old)].count("\n"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("labcrane: 1", "# as of old\n%YAML 1.1\n---\nlabcrane: 1",
         "2:1: the file asks for YAML 1.1, in which no is false and 1:30 is 90; remove this line"),
        ("{pairs: shuffled}", "{pairs: shuffled}\n  groups: {1: [], '1': []}",
         "16:19: it has the key '1' twice, with and without quotation marks; keep one"),
        ("{pairs: shuffled}", "{pairs: shuffled}\n  groups: {a: [], ~: []}",
         "16:19: it has nothing for a key; write a name, in quotation marks if it is one"),
        ("{pairs: shuffled}", "{pairs: shuffled}\n  groups: {[a]: []}",
         "16:12: it has a mapping or a list for a key; write a name, in quotation marks if it is one"),
        ("{pairs: shuffled}", '{pairs: shuffled}\n  groups: {"a\\nb": []}',
         "16:12: it has a line end in the key 'a\\nb'; write it in one line"),
        ("{pairs: shuffled}", '{pairs: shuffled}\n  groups: {"a\\u202eb": []}',
         "16:12: it has the character U+202E in the key 'a\\u202eb'; leave it out"),
        ("{pairs: shuffled}", "{pairs: shuffled}\ntitle: !!binary aGVsbG8=", None),
        ("- block: {task: aiming, repeat: 2}", "- block:\n        task: aiming\n        repeat: 2",
         "22:9: 'task' is in one column with 'block', to which it belongs; indent it, and what follows, by two spaces more"),
        ("- block: {task: aiming, repeat: 2}", "- block: {task:aiming, repeat: 2}",
         "21:17: there is no space after the colon of 'task'; add one"),
        ("title: ", "title: 'A ",
         "3:8: the quotation mark that opens here is closed in line 4 only; close it where the text ends"),
        ("hello.md", '"hello.md', "19:23: the quotation mark that opens here is not closed; close it"),
    ],
)  # fmt: skip
def test_what_yaml_lets_people_write_by_mistake_is_told_where_it_was_written(
    complaint, old: str, new: str, said: str | None
) -> None:
    told = complaint((old, new))
    assert len(told) == 1
    assert said is None or told == [said]


@pytest.mark.parametrize(
    ("begins", "what"),
    [
        (b"PK\x03\x04\x14\x00\xff", "a Word or LibreOffice document, or another packed file"),
        (b"\xd0\xcf\x11\xe0\xa1", "a Word document"),
        (b"%PDF-1.7\n\xe2\xe3", "a PDF"),
        (rb"{\rtf1\ansi Hello}", "an RTF document"),
    ],
)
def test_instructions_that_are_no_text_are_told_what_they_are(
    complaint, tmp_path: Path, begins: bytes, what: str
) -> None:
    (tmp_path / "hello.docx").write_bytes(begins)
    assert complaint(("hello.md", "hello.docx")) == [
        f"19:23: instructions: {tmp_path / 'hello.docx'} is {what}; save it as plain text in UTF-8"
    ]


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("{pairs: shuffled}", "{pairs: shuffled}\n  groups: {WORD: [], other: []}", "16:12: design.groups.WORD"),
        ("{pairs: shuffled}", "{pairs: shuffled}\n  conditions: {plain: all, WORD: none}", "16:28: design.conditions.WORD"),
        ("- name: first", "- name: WORD", "17:11: sessions[1].name"),
        ("{task: aiming, repeat: 2}", "{task: aiming, name: WORD}", "21:37: sessions[1].steps[3].block.name"),
        ("aiming: {use: aiming, distances: [2, 3]}", "aiming: {use: aiming, distances: [2, 3]}\n  WORD: {use: aiming}", "14:3: tasks.WORD"),
    ],
)  # fmt: skip
def test_a_name_that_tables_read_as_missing_is_refused(
    complaint, old: str, new: str, place: str
) -> None:
    from pandas._libs.parsers import STR_NA_VALUES  # what pandas reads as missing by default

    for word in sorted(STR_NA_VALUES - {""}):
        told = complaint((old, new.replace("WORD", f"'{word}'")))
        assert told[0] == (
            f"{place.replace('WORD', word)}: {word!r} means a missing value to pandas, R or BIDS, which would leave out "
            "all that is called so; take another name"
        )
    assert (
        complaint(("{pairs: shuffled}", "{pairs: shuffled}\n  groups: {none: [], nonsense: []}"))
        == []
    )


def test_a_quotation_that_takes_in_the_next_keys_is_told_where_it_opens(complaint) -> None:
    opened = ("title: A study", "title: 'A study"), ("pattern: 'P\\d{3}', ", "")
    assert complaint(*opened, ("input: {use: dual_joystick}", "input: {}'")) == [
        "3:8: title has 'machine:' in it, which is a key of its own; close the quotation mark where "
        "the text of title ends"
    ]


def test_a_protocol_without_sessions_is_told_that_it_needs_them(complaint) -> None:
    assert complaint((WRITTEN[WRITTEN.index("sessions:") :], "")) == [
        "1:1: the file needs 'sessions'"
    ]


def test_a_questionnaire_misspelt_is_told_with_that_of_the_protocol_itself(complaint) -> None:
    own = "questionnaires: {workload: {use: nasa_tlx}}\nsessions:"
    assert complaint(
        ("sessions:", own), ("- break:", "- questionnaire: [workload, worklaod]\n      - break:")
    ) == [
        "23:35: there is no questionnaire 'worklaod'; did you mean 'workload'? the protocol has "
        "workload"
    ]


def test_all_mistakes_are_told_at_once_in_the_order_of_the_file(complaint) -> None:
    told = complaint(
        ("rate_hz: 240", "rate_hz: 0"),
        ("use: joint_velocity", "use: joint_velosity"),
        ("distances: [2, 3]", "width: -1"),
        ("- break:", "- brake:"),
    )
    assert [line.split(":")[0] for line in told] == ["5", "9", "13", "22"]


@pytest.mark.parametrize(
    ("order", "levels", "said"),
    [
        ("{rule: shuffled, times: 1000, in_a_row: 2}", "[2, 3]", "4 levels, 1000 times each, are"),
        ("{rule: shuffled, times: 20, in_a_row: 2}", "[2, 3, 4, 5, 6, 2.5]", "12 levels, 20 times"),
        ("{rule: blocked, times: 1000, in_a_row: 1}", "[2, 3]", None),
        ("{rule: shuffled, times: 1000}", "[2, 3]", None),
        ("{rule: shuffled, times: 8, in_a_row: 2}", "[2, 3]", None),
    ],
)
def test_an_order_that_takes_hours_to_draw_is_told_where_it_is_asked_for(
    complaint, order: str, levels: str, said: str | None
) -> None:
    told = complaint(
        ("pairs: shuffled", f"pairs: {order}"), ("distances: [2, 3]", f"distances: {levels}")
    )
    if said is None:
        assert told == []
    else:
        (line,) = told
        assert re.match(r"\d+:\d+: pairs of task 'aiming' has ", line)
        assert said in line
        assert "use rule: blocked" in line


def test_a_target_out_of_reach_is_told_before_anything_runs(complaint) -> None:
    (told,) = complaint(("distances: [2, 3]", "distances: [2, 12]"))
    assert told == (
        "13:40: the far circle of pair '12m_far_left' at (9.74, 4.24, 0.80) m is out of reach of the "
        "CH8 knuckle boom of the crane study; move the centre or shorten the distance"
    )


def test_a_mistake_in_the_machines_file_names_that_file(complaint, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("title: mine\n", encoding="utf-8")
    told = complaint(("machine: ch8", "machine: mine.yaml"))
    assert told[0].startswith("6:10: ")
    assert "mine.yaml:1:1: the file needs 'source'" in "\n".join(told)


def test_an_axis_that_the_device_does_not_have_is_told(complaint) -> None:
    told = complaint(("slew: left.x", "slew: left.z"))
    assert told == [
        "10:15: scheme.map.slew is 'left.z', and there is no such axis; did you mean 'left.y'? "
        "the input has left.slider, left.trigger, left.twist, left.x, left.y, "
        "right.slider, right.trigger, right.twist, right.x, right.y"
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "1: it must be a mapping of keys, beginning with 'labcrane: 1'"),
        ("a: [1, 2", "1:4: '[' opens here and is not closed"),
        ("a: 1\na: 2\n", "2:1: the key 'a' is listed twice in the mapping that begins in line 1; keep one"),
    ],
)  # fmt: skip
def test_what_is_no_protocol_is_told(
    tmp_path: Path, registry: Registry, text: str, said: str
) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ProtocolError) as caught:
        load(path, registry)
    assert said in str(caught.value)


def test_a_protocol_that_does_not_exist_is_told(tmp_path: Path, registry: Registry) -> None:
    with pytest.raises(ProtocolError, match=r"nowhere\.yaml does not exist"):
        load(tmp_path / "nowhere.yaml", registry)


@pytest.mark.parametrize(
    "path", sorted(ROOT.glob("protocols/*/protocol.yaml")), ids=lambda p: p.parent.name
)
def test_the_protocols_that_come_with_labcrane_are_fine(path: Path, registry: Registry) -> None:
    assert load(path, registry).protocol.sessions
