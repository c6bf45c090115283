"""What a check approves runs, and is in the approval: faults drawn at random, told at the door."""

import random
import re
import shutil
from pathlib import Path

import pytest
from pydantic import ValidationError
from rehearsal import SHORT, said_of

from labcrane import ProtocolError
from labcrane.approval.materials import materials
from labcrane.design.quest_plus import grid
from labcrane.files.units import KINDS, in_unit
from labcrane.protocol.questions import PLAUSIBLE, questions
from labcrane.protocol.streams import TimeLimits
from labcrane.protocol.tracks import QuestPlus
from labcrane.simulation.rehearsal import rehearse
from labcrane.testing import Registry, load, plan_session

FED = SHORT.replace("sessions:", "feedback: {ball: {use: sphere}}\nsessions:")


@pytest.fixture
def told(tmp_path: Path, registry: Registry):
    """Return what is said of a protocol, its file left out."""
    return lambda text: said_of(tmp_path / "study.yaml", text, registry)


def line_of(text: str, part: str) -> int:
    return text[: text.index(part)].count("\n") + 1


def test_feedback_that_fades_in_no_parts_is_refused(told, tmp_path: Path, registry) -> None:
    text = FED.replace("pairs: 1}", "pairs: 1, fading: []}")
    assert told(text) == [
        f"{line_of(text, 'fading')}:49: sessions[1].steps[1].block.fading: there is no part in it; "
        "write the share of each, as [1, 0.5, 0], or leave fading out"
    ]
    path = tmp_path / "study.yaml"
    load(path, registry, recorded=True)  # a record of it is read


@pytest.mark.parametrize("seed", range(12))
def test_a_track_that_ends_before_it_begins_is_refused_and_any_other_is_planned(
    told, seed: int, tmp_path: Path, registry: Registry
) -> None:
    """The bound is that of the prior itself, worked out by the law."""
    drawn = random.Random(seed)
    names = ["2m_far_left", "2m_far_right"]
    levels = {name: round(drawn.uniform(-5, 5), 3) for name in names}
    prior = grid(QuestPlus(spreads=(0.5, 1.0)), tuple(levels.values())).posterior(
        *([[0.0, 0.0]] * 2)
    )
    for factor, ends in ((1.001, True), (0.999, False), (drawn.uniform(1, 50), True)):
        sd = prior.sd * factor
        written = ", ".join(f"{name}: {level}" for name, level in levels.items())
        text = SHORT.replace("pairs: 1", "track: t").replace(
            "sessions:",
            f"design:\n  tracks:\n    t:\n      factor: pairs\n      levels: {{{written}}}\n"
            f"      quest_plus:\n        spreads: [0.5, 1]\n        until_sd: {sd!r}\nsessions:",
        )
        said = told(text)
        if not ends:
            assert said == []
            study = load(tmp_path / "study.yaml", registry)
            assert plan_session(study, "P001", 1).blocks
            continue
        (one,) = said
        assert one.startswith(f"{line_of(text, 'until_sd')}:19: ")
        assert "is reached before the first answer" in one
        assert f"is {prior.sd:.3g}; write a smaller value" in one


def test_whatever_a_rehearsal_raises_is_a_finding_with_its_block(
    tmp_path: Path, registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of faults of labcrane's own too: the plan, and what runs it."""
    from labcrane.design import plan
    from labcrane.simulation import rehearsal

    path = tmp_path / "study.yaml"
    path.write_text(SHORT, encoding="utf-8")
    study = load(path, registry)

    def broken(*_: object, **__: object) -> None:
        raise AssertionError

    at = f"{path}:{line_of(SHORT, '- block')}:"
    for holder, name in ((plan.Planner, "_block"), (rehearsal, "_run")):
        with monkeypatch.context() as patched:
            patched.setattr(holder, name, broken)
            with pytest.raises(ProtocolError, match="it ends in AssertionError") as raised:
                rehearse(study)
        said = str(raised.value)
        assert "is a fault of labcrane, not of your protocol; report it with the protocol" in said
        assert "test_approves_what_runs.py:" in said
        if name == "_block":
            assert said.startswith(at)


def naming(what: str, name: str) -> str:
    """Return a protocol that names a file."""
    quoted = f"'{name}'"
    if what == "instructions":
        return SHORT.replace("      - block", f"      - instructions: {quoted}\n      - block")
    if what == "machine":
        old = next(line for line in SHORT.splitlines() if line.startswith("machine:"))
        return SHORT.replace(old, f"machine: {quoted}")
    if what == "urdf":
        old = next(line for line in SHORT.splitlines() if line.startswith("machine:"))
        return SHORT.replace(old, f"machine: {{urdf: {quoted}, joints: [a, b, c], tip: t}}")
    sections = {
        "model": f"dynamics: {{use: dmd_arm, model: {quoted}}}",
        "valve": f"scheme: {{use: valve, model: {quoted}}}",
        "questions": f"questionnaires: {{q: {{use: tlx, file: {quoted}}}}}",
    }
    text = SHORT
    key = sections[what].split(":")[0]
    text = re.sub(rf"^{key}:.*\n( .*\n)*", "", text, flags=re.M)
    return text.replace("sessions:", f"{sections[what]}\nsessions:")


@pytest.mark.parametrize("what", ["instructions", "model", "valve", "machine", "urdf"])
@pytest.mark.parametrize("seed", range(3))
def test_a_file_outside_of_the_studys_folder_is_refused_however_it_is_written(
    told, tmp_path: Path, what: str, seed: int
) -> None:
    """By two dots, whole, or by a link within the folder; the same file within it is let in."""
    drawn = random.Random(f"{what}{seed}")
    ending = ".yaml" if what in {"model", "valve", "machine"} else ".txt"
    stem = "".join(drawn.choices("abcdefgh", k=8))
    elsewhere = tmp_path.parent / f"{tmp_path.name}-{stem}"
    elsewhere.mkdir()
    outside = elsewhere / f"{stem}{ending}"
    outside.write_text("x: 1\n", encoding="utf-8")
    (tmp_path / f"link{ending}").symlink_to(outside)
    (tmp_path / "sub").symlink_to(elsewhere)
    ways = [
        f"../{elsewhere.name}/{outside.name}", str(outside), f"link{ending}", f"sub/{outside.name}"
    ]  # fmt: skip
    for way in ways:
        text = naming(what, way)
        told_of = [line for line in told(text) if "is not in the folder of the protocol" in line]
        assert len(told_of) == 1, (way, told_of)
        assert told_of[0].startswith(f"{line_of(text, way)}:")
        assert told_of[0].endswith(
            "put it there, so that it moves with the study and is part of its approval"
        )
    shutil.copy(outside, tmp_path / outside.name)
    inside = naming(
        what, drawn.choice([outside.name, f"./{outside.name}", str(tmp_path / outside.name)])
    )
    assert not any("not in the folder" in line for line in told(inside))


def test_what_a_scene_or_a_machine_uses_from_outside_is_refused(told, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("things: {a: {use: ../part.yaml}}\n", encoding="utf-8")
    (tmp_path.parent / "part.yaml").write_text("{}\n", encoding="utf-8")
    text = naming("model", "m.yaml").replace("m.yaml'", "m.yaml', scenes: [scene.yaml]")
    (tmp_path / "m.yaml").write_text("{}\n", encoding="utf-8")
    found = [line for line in told(text) if "which uses 'part.yaml'" in line]
    assert found
    assert found[0].startswith(f"{line_of(text, 'scene.yaml')}:")


@pytest.mark.parametrize("seed", range(6))
def test_whatever_a_study_uses_is_in_its_approval_by_content(
    tmp_path: Path, registry: Registry, seed: int
) -> None:
    """Names with spaces and percent signs, long ones, in folders, whole: one byte is a drift."""
    drawn = random.Random(seed)
    folder = "/".join("d" * drawn.randint(1, 120) for _ in range(3))
    name = drawn.choice(["a b.txt", "ä%20.txt", "x.txt", f"{'n' * 200}.txt", "words"])
    path = tmp_path / folder / name
    path.parent.mkdir(parents=True)
    path.write_text("Read this.\n", encoding="utf-8")
    way = drawn.choice(
        [f"{folder}/{name}", f"./{folder}/../{folder.split('/')[-1]}/{name}", str(path)]
    )
    (tmp_path / "study.yaml").write_text(naming("instructions", way), encoding="utf-8")
    study = load(tmp_path / "study.yaml", registry)
    before = materials(study, registry)["files"]
    path.write_text("Read that.\n", encoding="utf-8")
    assert materials(study, registry)["files"] != before
    assert any(name in each for each in before)


def test_a_file_that_is_named_through_a_link_to_the_folder_is_in_the_approval(
    tmp_path: Path, registry: Registry
) -> None:
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "words.txt").write_text("Read this.\n", encoding="utf-8")
    (tmp_path / "link").symlink_to(folder, target_is_directory=True)
    way = str(tmp_path / "link" / "words.txt")
    (folder / "study.yaml").write_text(naming("instructions", way), encoding="utf-8")
    study = load(folder / "study.yaml", registry)
    before = materials(study, registry)["files"]
    assert "words.txt" in before
    (folder / "words.txt").write_text("Read that.\n", encoding="utf-8")
    assert materials(study, registry)["files"] != before


@pytest.mark.parametrize(
    ("section", "key", "said"),
    [
        ("scheme: {use: valve, model: other.yaml}", "model", "is not a model: "),
        ("scheme: {use: valve, model: words.md}", "model", "is not a model: "),
        ("dynamics: {use: dmd_arm, model: other.yaml}", "model", "not a model: it has no segments"),
        ("operator: {use: recorded, file: nothing.h5}", "file", "nothing.h5"),
        ("operator: {use: recorded, file: words.md}", "file", "words.md"),
        ("input: {use: recorded, file: nothing.h5}", "file", "nothing.h5"),
    ],
)
def test_a_file_of_another_kind_is_refused_by_a_check(
    told, tmp_path: Path, section: str, key: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.yaml").write_text("labcrane_scene: 1\nthings: {}\n", encoding="utf-8")
    (tmp_path / "words.md").write_text("Read this.\n", encoding="utf-8")
    name = section.partition(":")[0]
    text = re.sub(rf"^{name}:.*\n( .*\n)*", "", SHORT, flags=re.M)
    text = text.replace("sessions:", f"{section}\nsessions:")
    found = [line for line in told(text) if said in line]
    assert len(found) == 1, told(text)
    at = section.index(f"{key}: ") + len(f"{key}: ") + 1
    assert found[0].startswith(f"{line_of(text, section)}:{at}: ")
    assert "Field required" not in found[0]


@pytest.mark.parametrize("seed", range(8))
def test_that_a_device_is_there_is_no_axis(told, seed: int) -> None:
    drawn = random.Random(seed)
    axis = drawn.choice(["left.x", "left.y", "right.x", "right.y"])
    status = drawn.choice(["left.connected", "right.connected", "-left.connected"])
    text = SHORT.replace(f" {axis}" if f" {axis}" in SHORT else f"-{axis}", f" {status}")
    (one,) = told(text)
    assert "there is no such axis" in one
    assert f"{status!r}" in one
    assert "connected" not in one.partition("the input has")[2]


@pytest.mark.parametrize("seed", range(20))
def test_decimal_commas_are_asked_about_whatever_the_digits(
    tmp_path: Path, registry: Registry, seed: int
) -> None:
    """A comma without a space beside one with a space; lists written in one way are not asked."""
    drawn = random.Random(seed)
    whole = drawn.sample(range(1, 7), 4)
    first, second, third, fourth = whole
    pair = f"{first},{second}"
    parts = [pair, *map(str, (third, fourth))]
    drawn.shuffle(parts)
    path = tmp_path / "study.yaml"
    for separator, asked in ((", ", True), (",", False)):
        text = SHORT.replace("distances: [2]", f"distances: [{separator.join(parts)}], width: 0.3")
        path.write_text(text, encoding="utf-8")
        found = [each for each in questions(load(path, registry)) if "without a space" in each.text]
        assert len(found) == asked
        if asked:
            assert found[0].key == "tasks.aiming.distances"
            assert f"has {pair} without a space" in found[0].text
            assert f"write {pair.replace(',', '.')} if one is meant" in found[0].text
    even = SHORT.replace("distances: [2]", f"distances: {sorted(whole)}, width: 0.3")
    path.write_text(even, encoding="utf-8")
    assert not any("without a space" in each.text for each in questions(load(path, registry)))


@pytest.mark.parametrize("seed", range(10))
def test_several_quantities_named_tuples_and_pictures_a_second_are_understood(seed: int) -> None:
    drawn = random.Random(seed)
    minutes, seconds = drawn.randint(1, 50), drawn.randint(1, 59)
    assert in_unit(f"{minutes} min {seconds} s", "s") == 60 * minutes + seconds
    assert in_unit(f"{minutes} fps", "Hz") == minutes
    assert in_unit(f"{minutes} cm", "mm") == 10 * minutes
    assert in_unit(f"{minutes} deg", "arcmin") == 60 * minutes
    limits = TimeLimits.model_validate({"error_s": [f"{minutes} ms", f"{seconds} s"]})
    assert limits.error_s == (minutes / 1000, seconds)
    with pytest.raises(ValidationError, match="true"):
        TimeLimits.model_validate({"gap_s": [True, seconds]})


@pytest.mark.parametrize("text", ["1 min 30", "1 min 30 cm", "1 min 30 parsnips"])
def test_what_is_no_quantity_is_told_in_our_words(text: str) -> None:
    with pytest.raises(ValueError, match="a time is required; write a plain number, in s"):
        in_unit(text, "s")


@pytest.mark.parametrize(
    ("section", "key"),
    [
        ("page:\n  port: 0\n  certificate: a.pem", "certificate"),
        ("views:\n  op:\n    use: view\n    quality: low\n    text_arcmin: 20", "text_arcmin"),
        (
            "feedback:\n  ball:\n    use: sphere\n    smallest: 0.9\n    largest: 0.1",
            "smallest",
        ),
        ("questionnaires:\n  q:\n    use: free\n    file: q.yaml", "file"),
    ],
)
def test_what_is_wrong_of_several_keys_has_the_line_of_one_of_them(told, section, key) -> None:
    text = SHORT.replace("sessions:", f"{section}\nsessions:")
    found = [line for line in told(text) if "quality" not in line]
    assert len(found) == 1, found
    assert found[0].startswith(f"{line_of(text, f' {key}:')}:")


def test_every_unit_that_keys_ask_for_has_an_example_and_sizes_that_can_be_meant() -> None:
    assert KINDS.keys() == PLAUSIBLE.keys() - {""}
    assert all(in_unit(example, unit) is not None for unit, (_, example) in KINDS.items())
    with pytest.raises(
        ValueError, match="'2 cm' is a length, where a number of pixels is required"
    ):
        in_unit("2 cm", "px")
