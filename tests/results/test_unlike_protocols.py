"""A report says where its sessions were run by protocols that differ, and by whose."""

from pathlib import Path
from random import Random
from shutil import copytree
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from labcrane.analysis.report.protocols import in_words, unlike_protocols
from labcrane.testing import main
from results.undrawn import without_figures

WRITTEN = """\
labcrane: 1
title: {title}
rate_hz: {rate}
scheme: {{use: joint_velocity, map: {{slew: {slew}, elbow: left.y}}}}
tasks: {{near: {{use: aiming, distances: {distances}}}}}
"""
USUAL = {"title": "A study", "rate": "240", "slew": "-left.x", "distances": "[2, 4]"}
PLACES = {"rate": "rate_hz", "slew": "scheme.map.slew", "distances": "tasks.near.distances[2]"}
OTHERS = {"rate": "250", "slew": "left.x", "distances": "[2, 6]"}


def ran(text: str, **others: Any) -> SimpleNamespace:
    """Return a session by a protocol; others are the machine, files and versions."""
    context = {"protocol": text, "machine": "ch8", "versions": {"labcrane": "0.1.0"}, **others}
    return SimpleNamespace(context=context)


def people(*of: list[SimpleNamespace]) -> Any:
    """Return a cohort of P001, P002 and so on, with the sessions of each."""
    included = [
        SimpleNamespace(
            name=f"P{number:03}",
            usable=tuple(range(1, len(each) + 1)),
            sessions=lambda each=each: enumerate(each, start=1),
        )
        for number, each in enumerate(of, start=1)
    ]
    return SimpleNamespace(included=tuple(included))


@pytest.mark.parametrize("seed", range(8))
def test_each_value_that_differs_is_told_with_its_place_and_who_had_it(seed: int) -> None:
    dice = Random(seed)
    changed = dice.sample(list(OTHERS), dice.randint(1, 3))
    new = WRITTEN.format(**USUAL | {key: OTHERS[key] for key in changed})
    old = WRITTEN.format(**USUAL | {"title": "An earlier title"})
    has_new = [dice.random() < 0.5 for _ in range(7)]
    has_new[:2] = True, False
    dice.shuffle(has_new)
    found = unlike_protocols(people(*([ran(new if each else old)] for each in has_new)))
    assert set(found["place"]) == {PLACES[key] for key in changed}
    for _, rows in found.groupby("place"):
        told = {row["value"]: row["sessions"].split(", ") for _, row in rows.iterrows()}
        assert {name for who in told.values() for name in who} == {f"P00{n}" for n in range(1, 8)}
        assert sorted(map(len, told.values())) == sorted(rows["n"])
    if "slew" in changed:
        row = found[found["value"] == "left.x"].iloc[0]
        assert row["sessions"].split(", ") == [
            f"P{number:03}" for number, each in enumerate(has_new, start=1) if each
        ]


def test_comments_order_and_keys_that_change_nothing_are_no_difference() -> None:
    text = WRITTEN.format(**USUAL)
    turned = "\n".join(reversed(text.splitlines())) + "\n# a note\nexpected: [scheme.map.slew]\n"
    assert not len(unlike_protocols(people([ran(text)], [ran(turned)])))
    said = in_words(unlike_protocols(people([ran(text)])))
    assert said == "All sessions were run by the same protocol."


def test_a_protocol_that_was_amended_between_sessions_is_told_by_session() -> None:
    old = WRITTEN.format(**USUAL)
    new = old.replace("slew: -left.x", "slew: left.x").replace("rate_hz: 240\n", "")
    found = unlike_protocols(people([ran(old), ran(new)], [ran(new), ran(new)]))
    assert found.to_dict("records") == [
        {"place": "rate_hz", "value": "240", "n": 1, "sessions": "P001 session 1"},
        {"place": "rate_hz", "value": "(nothing)", "n": 3,
         "sessions": "P001 session 2, P002 session 1, P002 session 2"},
        {"place": "scheme.map.slew", "value": "-left.x", "n": 1, "sessions": "P001 session 1"},
        {"place": "scheme.map.slew", "value": "left.x", "n": 3,
         "sessions": "P001 session 2, P002 session 1, P002 session 2"},
    ]  # fmt: skip
    assert in_words(found) == (
        "Not all sessions were run by the same protocol: rate_hz was 240 in 1 session and (nothing)"
        " in 3 sessions, and 1 more place; the table of protocols says who had which. The averages "
        "are over all of them."
    )


@pytest.mark.parametrize(
    ("others", "place"),
    [
        ({"machine": "title: another"}, "content of the machine"),
        ({"files": {"scene.yaml": {"sha256": "ab" * 32}}}, "content of scene.yaml"),
        ({"own_plugins": {"mine.py": "import math"}}, "content of plugin mine.py"),
        ({"versions": {"labcrane": "0.2.0"}}, "version of labcrane"),
    ],
)
def test_machine_files_and_program_that_differ_are_told(others: dict[str, Any], place: str) -> None:
    text = WRITTEN.format(**USUAL)
    found = unlike_protocols(people([ran(text)], [ran(text, **others)]))
    assert found["place"].tolist() == [place, place]
    assert found["sessions"].tolist() == ["P001", "P002"]


STUDY = """\
labcrane: 1
study: sticks
title: Two ways of a stick
participants: {planned: 5}
machine: ch8
rate_hz: 240
input: {use: dual_joystick}
operator: {use: simulated_operator}
scheme:
  use: joint_velocity
  map: {slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}
dynamics: {use: kinematic_crane}
tasks: {aiming: {use: aiming, distances: [2, 4], movements: 2}}
expected: [scheme.map.slew]
sessions:
  - name: only
    steps: [{block: {task: aiming}}]
"""


@pytest.mark.slow
def test_a_report_of_sticks_that_were_turned_round_says_so_where_a_paper_is_written_from(
    tmp_path: Path,
) -> None:
    data = tmp_path / "data"
    for name, text, kept in (
        ("old", STUDY, ("P001", "P002", "P003")),
        ("new", STUDY.replace("slew: -left.x", "slew: left.x"), ("P004", "P005")),
    ):
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
        out = tmp_path / name
        assert main(["simulate", str(tmp_path / f"{name}.yaml"), "--out", str(out)]) == 0
        for who in kept:
            copytree(out / f"{who}-SIMULATED", data / f"{who}-SIMULATED")
    report = tmp_path / "report"
    with without_figures():
        assert main(["report", str(data), "--include", "simulated", "--out", str(report)]) == 0
    said = (
        "Not all sessions were run by the same protocol: scheme.map.slew was -left.x in 3 sessions "
        "and left.x in 2 sessions; the table of protocols says who had which."
    )
    assert said in (report / "results.md").read_text("utf-8")
    assert said in (report / "report.html").read_text("utf-8")
    table = pd.read_csv(report / "tables" / "protocols.csv")
    assert table["sessions"].tolist() == [
        "P001-SIMULATED, P002-SIMULATED, P003-SIMULATED", "P004-SIMULATED, P005-SIMULATED",
    ]  # fmt: skip
