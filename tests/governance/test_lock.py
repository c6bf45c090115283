"""An approved study stays the approved study."""

import json
import shutil
import subprocess
import sys
from datetime import date, timedelta
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from governed import GROUPED, TODAY, Lab, edit

from labcrane import ProtocolError
from labcrane.admission import gate
from labcrane.approval.decision import Grant, amend, approve, verify
from labcrane.approval.difference import differences
from labcrane.approval.lock import lock_path, read_lock
from labcrane.approval.materials import materials, referred
from labcrane.approval.source_tree import hashes
from labcrane.registry import discover
from labcrane.yaml_file import YamlFile

MACHINE = (Path(__file__).parents[2] / "labcrane" / "machines" / "ch8.yaml").read_text()


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    """Return a study that names files of all kinds, approved, with P001's consent."""
    lab = Lab(tmp_path)
    (tmp_path / "mine.yaml").write_text(MACHINE)
    (tmp_path / "hello.md").write_text("Hello.\nPlease hold both sticks.\n")
    lab.protocol.write_text(
        lab.text.replace("machine: ch8", "machine: mine.yaml").replace(
            "steps:", "steps:\n      - consent\n      - instructions: hello.md"
        )
    )
    lab.approve()
    lab.consent("P001")
    return lab


def refusal(lab: Lab) -> list[str]:
    """Return the differences for which P001 is refused; nothing when P001 may be run."""
    try:
        gate(lab.visit("P001"))
    except ProtocolError as error:
        first, *lines, last = str(error).splitlines()
        assert first.endswith("is not the study that was approved under 'KB-12/2026':")
        assert "labcrane amend" in last
        return [line.strip() for line in lines]
    return []


def test_the_approved_study_may_be_run(lab: Lab) -> None:
    assert refusal(lab) == []


def test_white_space_comments_and_line_ends_are_no_drift(lab: Lab) -> None:
    text = lab.protocol.read_text()
    lab.protocol.write_text(
        "# a comment\n\n" + text.replace("rate_hz: 240", "rate_hz:    240.0 # x")
    )
    hello = lab.folder / "hello.md"
    hello.write_bytes(hello.read_bytes().replace(b"\n", b"\r\n"))
    machine = lab.folder / "mine.yaml"
    machine.write_text("# mine\n" + machine.read_text())
    assert refusal(lab) == []


def test_one_number_in_the_protocol_is_refused_with_its_name(lab: Lab) -> None:
    edit(lab.protocol, "movements: 1", "movements: 2")
    assert refusal(lab) == ["protocol: tasks.aiming.movements was 1, is 2"]


def test_one_number_in_a_file_that_the_protocol_names_is_refused(lab: Lab) -> None:
    edit(lab.folder / "mine.yaml", "title: ", "title: My ")
    (line, again) = refusal(lab)
    assert line.startswith("file mine.yaml: title was 'CH8")
    assert again.startswith("the machine: title was 'CH8")


def test_another_consent_text_is_refused(lab: Lab) -> None:
    edit(lab.folder / "consent_v2.txt", "at any time", "before the end")
    assert refusal(lab) == [
        "consent text consent_v2.txt: line 2 was 'I can stop at any time.', "
        "is 'I can stop before the end.'"
    ]
    (lab.folder / "consent_v2.txt").unlink()
    assert refusal(lab) == ["consent text consent_v2.txt is missing, or no longer referred to"]


def test_another_line_of_the_instructions_is_refused(lab: Lab) -> None:
    edit(lab.folder / "hello.md", "both sticks", "one stick")
    assert refusal(lab) == [
        "file hello.md: line 2 was 'Please hold both sticks.', is 'Please hold one stick.'"
    ]


def test_lines_that_come_or_go_are_told(lab: Lab) -> None:
    hello = lab.folder / "hello.md"
    hello.write_text("Hello.\nPlease hold both sticks.\nThank you.\n")
    assert refusal(lab) == ["file hello.md: line 3 is new: 'Thank you.'"]
    hello.write_text("Hello.\n")
    assert refusal(lab) == ["file hello.md: line 2 is gone; it was 'Please hold both sticks.'"]


def test_colleagues_can_read_the_lock(lab: Lab) -> None:
    assert lock_path(lab.protocol).stat().st_mode & 0o777 == 0o644


def compared(lab: Lab, data: dict[str, object], change) -> list[str]:
    """Return what is told when something changes that a protocol with ``data`` names."""
    study = lab.study
    protocol = YamlFile.read(study.path).data
    named = {**protocol, **data}
    study.path.write_text(json.dumps(named))
    before = materials(study, discover())
    change()
    return differences(before, materials(study, discover()))


def test_one_item_of_a_questionnaire_is_told_also_when_another_file_names_it(lab: Lab) -> None:
    (lab.folder / "forms").mkdir()
    form = lab.folder / "forms" / "effort.yaml"
    form.write_text("items:\n  - How hard was it?\n  - How tired are you?\n")
    (lab.folder / "forms.yaml").write_text("after: forms/effort.yaml\n")
    told = compared(lab, {"questionnaires": "forms.yaml"}, lambda: edit(form, "hard", "very hard"))
    assert told == [
        "file forms/effort.yaml: items[1] was 'How hard was it?', is 'How very hard was it?'"
    ]


def test_a_folder_counts_with_all_that_is_in_it(lab: Lab) -> None:
    scene = lab.folder / "scene"
    scene.mkdir()
    (scene / "mesh.bin").write_bytes(b"\0\1\2")

    def change() -> None:
        (scene / "mesh.bin").write_bytes(b"\0\1\3")
        (scene / "new.txt").write_text("more")

    told = compared(lab, {"scene": "scene/"}, change)
    assert told == ["file scene/mesh.bin has another content", "file scene/new.txt is new"]


def test_nothing_outside_the_studys_folder_is_read(tmp_path: Path) -> None:
    (tmp_path / "outside.txt").write_text("x")
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "inside.txt").write_text("x")
    named = ["../outside.txt", str(tmp_path / "outside.txt"), "inside.txt", "words"]
    found = referred(named, tmp_path / "study")
    assert [path.name for path in found] == ["inside.txt"]


@pytest.fixture
def third_party(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Install a plugin of somebody else's, as pip would; return its package."""
    site = tmp_path / "site"
    package = site / "labcrane_quay"
    plugins = Path(__file__).parents[2] / "plugins"
    shutil.copytree(
        plugins / "labcrane_aiming", package, ignore=shutil.ignore_patterns("__pycache__")
    )
    for module in package.glob("*.py"):
        text = module.read_text().replace("labcrane_aiming", "labcrane_quay")
        module.write_text(text.replace('"aiming"', '"quay"'))
    about = site / "labcrane_quay-0.1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: labcrane-quay\nVersion: 0.1.0\n")
    (about / "entry_points.txt").write_text("[labcrane]\nquay = labcrane_quay\n")
    monkeypatch.syspath_prepend(site)
    return package


def test_one_byte_of_a_plugins_source_is_refused_and_its_caches_do_not_count(
    lab: Lab, third_party: Path
) -> None:
    lab.protocol.write_text(lab.protocol.read_text().replace("use: aiming", "use: quay"))
    lock_path(lab.protocol).unlink()
    lab.approve()
    assert "quay" in read_lock(lab.protocol).content["materials"]["plugins"]
    (third_party / "__pycache__").mkdir(exist_ok=True)
    (third_party / "__pycache__" / "pairs.cpython-311.pyc").write_bytes(b"cache")
    (third_party / "left.pyc").write_bytes(b"cache")
    assert refusal(lab) == []
    pairs = third_party / "pairs.py"
    pairs.write_bytes(pairs.read_bytes() + b" ")
    (third_party / "extra.py").write_text("")
    assert refusal(lab) == [
        "plugin quay: labcrane_quay/extra.py is new",
        "plugin quay: the source of labcrane_quay/pairs.py has changed",
    ]
    about = third_party.parent / "labcrane_quay-0.1.0.dist-info" / "METADATA"
    edit(about, "Version: 0.1.0", "Version: 0.2.0")
    assert refusal(lab)[0] == "plugin quay: version was 0.1.0, is 0.2.0"


def test_every_plugin_that_the_protocol_names_is_locked_and_no_other(lab: Lab) -> None:
    used = read_lock(lab.protocol).content["materials"]["plugins"]
    assert set(used) == {"aiming", "bullet", "operator", "schemes"}  # a person by the operator
    point = next(point for point in entry_points(group="labcrane") if point.name == "aiming")
    assert used["aiming"]["files"] == hashes(point.module)
    assert all(name.startswith("labcrane_aiming/") for name in used["aiming"]["files"])


def test_labcranes_own_source_is_locked(lab: Lab) -> None:
    lock = read_lock(lab.protocol).content["materials"]
    assert "labcrane/loop.py" in lock["labcrane"]["files"]
    assert "labcrane/machines/ch8.yaml" in lock["labcrane"]["files"]
    changed = json.loads(json.dumps(lock))
    changed["labcrane"]["files"]["labcrane/loop.py"] = "0" * 64
    assert differences(lock, changed) == ["labcrane: the source of labcrane/loop.py has changed"]


def test_the_lock_holds_on_another_computer_under_another_path(lab: Lab, tmp_path: Path) -> None:
    """Another process, another folder, another installation of the very same source."""
    elsewhere = tmp_path / "another disk" / "Studien"
    elsewhere.mkdir(parents=True)
    for path in lab.folder.iterdir():
        if path.is_file():
            shutil.copy(path, elsewhere)
    root = Path(__file__).parents[2]
    copies = tmp_path / "installed"
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(root / "labcrane", copies / "labcrane", ignore=ignore)
    for plugin in (root / "plugins").glob("labcrane_*"):
        shutil.copytree(plugin, copies / plugin.name, ignore=ignore)
    program = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import labcrane; assert labcrane.__file__.startswith(sys.argv[1])\n"
        "from pathlib import Path; from datetime import date\n"
        "from labcrane.registry import discover; from labcrane.study import load\n"
        "from labcrane.approval.decision import verify\n"
        "registry = discover()\n"
        "print(verify(load(Path(sys.argv[2]), registry), registry, date.today()).seal)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(copies), "study.yaml"],
        cwd=elsewhere, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == read_lock(lab.protocol).seal
    assert str(tmp_path) not in lock_path(lab.protocol).read_text()


def test_an_expired_approval_is_refused(lab: Lab) -> None:
    last = date.fromisoformat(read_lock(lab.protocol).approval["valid_until"])
    gate(lab.visit("P001"), last)
    with pytest.raises(
        ProtocolError,
        match=rf"the approval 'KB-12/2026' was valid until {last}, today is .*labcrane amend",
    ):
        gate(lab.visit("P001"), last + timedelta(1))


def test_a_lock_that_was_edited_by_hand_is_refused(lab: Lab) -> None:
    edit(lock_path(lab.protocol), "KB-12/2026", "KB-13/2026")
    with pytest.raises(
        ProtocolError, match="was edited by hand or is damaged: its content does not match its seal"
    ):
        gate(lab.visit("P001"))
    lock_path(lab.protocol).write_text("{")
    with pytest.raises(ProtocolError, match="was edited by hand or is damaged: it cannot be read"):
        gate(lab.visit("P001"))


def test_a_study_that_was_never_approved_is_refused_for_people_only(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    with pytest.raises(
        ProtocolError, match=r"has not been approved: .* labcrane approve, or .* --pilot"
    ):
        gate(lab.visit("P001"))
    assert gate(lab.visit("P001", pilot=True)).slot is None
    assert gate(lab.visit("P001", simulated=True)).slot is None


def test_pilots_run_whatever_has_drifted_and_stamp_it(lab: Lab) -> None:
    from rehearsal import ScriptedConsole

    import labcrane
    from labcrane.session import run

    edit(lab.protocol, "movements: 1", "movements: 2")
    path = run(lab.visit("P001", pilot=True, simulated=True, fast=True), ScriptedConsole())
    assert path.name == "P001-PILOT-SIMULATED.h5"
    recording = labcrane.open_recording(path)
    assert recording.participant == "P001-PILOT-SIMULATED"
    assert recording.session(1).attrs["pilot"] == "yes"
    assert recording.session(1).attrs["approval"] == "none"


def test_a_study_is_approved_once(lab: Lab) -> None:
    with pytest.raises(ProtocolError, match=r"approved already, under 'KB-12/2026'; .*amend"):
        lab.approve()


@pytest.mark.parametrize(
    ("consent", "until", "said"),
    [
        ("nowhere.pdf", 9, r"there is no consent text .*nowhere\.pdf; give its file with"),
        ("../consent.txt", 9, r"is not in the folder of the protocol"),
        ("consent_v2.txt", -1, r"the approval ended on .*, today is"),
    ],
)  # fmt: skip
def test_an_impossible_grant_is_refused(
    tmp_path: Path, consent: str, until: int, said: str
) -> None:
    (tmp_path / "study").mkdir()
    lab = Lab(tmp_path / "study")
    (tmp_path / "consent.txt").write_text("x")
    grant = Grant("B", "R", TODAY + timedelta(until), lab.folder / consent)
    with pytest.raises(ProtocolError, match=said):
        approve(lab.study, discover(), grant, TODAY)
    assert not lock_path(lab.protocol).exists()


def test_an_amendment_says_what_was_changed_and_keeps_the_history(lab: Lab) -> None:
    first = read_lock(lab.protocol)
    edit(lab.protocol, "movements: 1", "movements: 2")
    grant = Grant("Ethics board", "KB-12/2026-A1", TODAY + timedelta(700), first.consent)
    amended = amend(lab.study, discover(), grant, "more movements", TODAY)
    (entry,) = read_lock(lab.protocol).amendments
    assert entry["why"] == "more movements"
    assert entry["reference"] == "KB-12/2026-A1"
    assert entry["replaces"] == first.seal
    assert entry["changes"][0] == "protocol: tasks.aiming.movements was 1, is 2"
    assert refusal(lab) == []
    kept = lab.folder / "study.lock.1.json"
    assert json.loads(kept.read_text())["seal"] == first.seal
    edit(lab.folder / "hello.md", "Hello", "Good morning")
    again = amend(lab.study, discover(), grant, "friendlier", TODAY)
    assert [entry["why"] for entry in again.amendments] == ["more movements", "friendlier"]
    assert again.amendments[1]["replaces"] == amended.seal
    with pytest.raises(ProtocolError, match="is as it was approved; there is nothing to amend"):
        amend(lab.study, discover(), grant, "again", TODAY)


def test_an_amended_consent_text_needs_a_new_consent(lab: Lab) -> None:
    edit(lab.folder / "consent_v2.txt", "at any time", "whenever I like")
    lock = read_lock(lab.protocol)
    grant = Grant("Ethics board", "A1", TODAY + timedelta(99), lock.consent)
    amend(lab.study, discover(), grant, "clearer", TODAY)
    with pytest.raises(ProtocolError, match=r"has not consented to .*, only to version"):
        gate(lab.visit("P001"))
    lab.consent("P001")
    gate(lab.visit("P001"))


def test_the_hash_of_a_study_does_not_depend_on_when_it_was_approved(lab: Lab) -> None:
    first = read_lock(lab.protocol)
    lock_path(lab.protocol).unlink()
    grant = Grant("Another board", "X", TODAY + timedelta(5), lab.folder / "consent_v2.txt")
    second = approve(lab.study, discover(), grant, TODAY)
    assert second.materials_sha256 == first.materials_sha256
    assert second.seal != first.seal
    assert verify(lab.study, discover(), TODAY).seal == second.seal


def test_another_group_in_the_protocol_is_drift(tmp_path: Path) -> None:
    lab = Lab(tmp_path, GROUPED)
    lab.approve()
    lab.consent("P001")
    edit(lab.protocol, "sound: [tone]", "sound: [tone, sphere]")
    assert refusal(lab) == ["protocol: design.groups.sound[2] is new: 'sphere'"]
