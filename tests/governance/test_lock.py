"""An approved study stays the approved study."""

import json
import shutil
import sys
from datetime import timedelta
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from governance.approved_lab import approved_lab, refusal
from governed import GROUPED, TODAY, Lab, edit
from needs import needs
from programs import ran

from labcrane.approval.decision import Grant, approve, verify
from labcrane.approval.difference import differences
from labcrane.approval.lock import lock_path, read_lock
from labcrane.approval.materials import materials, referred
from labcrane.approval.source_tree import hashes
from labcrane.files.yaml import YamlFile


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return approved_lab(tmp_path)


def test_the_approved_study_may_be_run(lab: Lab) -> None:
    assert refusal(lab) == []


def test_white_space_comments_and_line_ends_are_no_drift(lab: Lab) -> None:
    text = lab.protocol.read_text(encoding="utf-8")
    lab.protocol.write_text(
        "# a comment\n\n" + text.replace("rate_hz: 240", "rate_hz:    240.0 # x"), encoding="utf-8"
    )
    hello = lab.folder / "hello.md"
    hello.write_bytes(hello.read_bytes().replace(b"\n", b"\r\n"))
    machine = lab.folder / "mine.yaml"
    machine.write_text("# mine\n" + machine.read_text(encoding="utf-8"), encoding="utf-8")
    assert refusal(lab) == []


def test_the_labs_certificate_and_key_are_in_no_lock(lab: Lab) -> None:
    with lab.protocol.open("a", encoding="utf-8") as file:
        file.write("page: {certificate: lab.pem, key: lab.key}\n")
    for name in ("lab.pem", "lab.key"):
        (lab.folder / name).write_text(f"what is in {name}\n", encoding="utf-8")
    files = materials(lab.study, lab.registry)["files"]
    assert "what is in lab" not in str(files)


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
    hello.write_text("Hello.\nPlease hold both sticks.\nThank you.\n", encoding="utf-8")
    assert refusal(lab) == ["file hello.md: line 3 is new: 'Thank you.'"]
    hello.write_text("Hello.\n", encoding="utf-8")
    assert refusal(lab) == ["file hello.md: line 2 is gone; it was 'Please hold both sticks.'"]


@needs("permissions")
def test_colleagues_can_read_the_lock(lab: Lab) -> None:
    assert lock_path(lab.protocol).stat().st_mode & 0o777 == 0o644


def compared(lab: Lab, data: dict[str, object], change) -> list[str]:
    """Return what is told when something changes that a protocol with ``data`` names."""
    study = lab.study
    protocol = YamlFile.read(study.path).data
    named = {**protocol, **data}
    study.path.write_text(json.dumps(named), encoding="utf-8")
    before = materials(study, lab.registry)
    change()
    return differences(before, materials(study, lab.registry))


def test_one_item_of_a_questionnaire_is_told_also_when_another_file_names_it(lab: Lab) -> None:
    (lab.folder / "forms").mkdir()
    form = lab.folder / "forms" / "effort.yaml"
    form.write_text("items:\n  - How hard was it?\n  - How tired are you?\n", encoding="utf-8")
    (lab.folder / "forms.yaml").write_text("after: forms/effort.yaml\n", encoding="utf-8")
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
        (scene / "new.txt").write_text("more", encoding="utf-8")

    told = compared(lab, {"scene": "scene/"}, change)
    assert told == ["file scene/mesh.bin has different content", "file scene/new.txt is new"]


def test_nothing_outside_the_studys_folder_is_read(tmp_path: Path) -> None:
    (tmp_path / "outside.txt").write_text("x", encoding="utf-8")
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "inside.txt").write_text("x", encoding="utf-8")
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
        text = module.read_text(encoding="utf-8").replace("labcrane_aiming", "labcrane_quay")
        module.write_text(text.replace('"aiming"', '"quay"'), encoding="utf-8")
    about = site / "labcrane_quay-0.1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: labcrane-quay\nVersion: 0.1.0\n", encoding="utf-8"
    )
    (about / "entry_points.txt").write_text("[labcrane]\nquay = labcrane_quay\n", encoding="utf-8")
    monkeypatch.syspath_prepend(site)
    return package


@pytest.mark.slow
def test_one_byte_of_a_plugins_source_is_refused_and_its_caches_do_not_count(
    lab: Lab, third_party: Path
) -> None:
    lab.protocol.write_text(
        lab.protocol.read_text(encoding="utf-8").replace("use: aiming", "use: quay"),
        encoding="utf-8",
    )
    lock_path(lab.protocol).unlink()
    lab.approve()
    assert "quay" in read_lock(lab.protocol).content["materials"]["plugins"]
    (third_party / "__pycache__").mkdir(exist_ok=True)
    (third_party / "__pycache__" / "pairs.cpython-311.pyc").write_bytes(b"cache")
    (third_party / "left.pyc").write_bytes(b"cache")
    assert refusal(lab) == []
    pairs = third_party / "pairs.py"
    pairs.write_bytes(pairs.read_bytes() + b" ")
    (third_party / "extra.py").write_text("", encoding="utf-8")
    assert refusal(lab) == [
        "plugin quay: labcrane_quay/extra.py is new",
        "plugin quay: the source of labcrane_quay/pairs.py has changed",
    ]
    about = third_party.parent / "labcrane_quay-0.1.0.dist-info" / "METADATA"
    edit(about, "Version: 0.1.0", "Version: 0.2.0")
    assert refusal(lab)[0] == "plugin quay: version was 0.1.0, is 0.2.0"


def test_every_plugin_that_the_protocol_names_is_locked_and_no_other(lab: Lab) -> None:
    used = read_lock(lab.protocol).content["materials"]["plugins"]
    assert set(used) == {"aiming", "bullet", "plugins/person.py", "schemes"}
    point = next(point for point in entry_points(group="labcrane") if point.name == "aiming")
    assert used["aiming"]["files"] == hashes(point.module)
    assert all(name.startswith("labcrane_aiming/") for name in used["aiming"]["files"])


def test_labcranes_own_source_is_locked(lab: Lab) -> None:
    lock = read_lock(lab.protocol).content["materials"]
    assert "labcrane/session/loop.py" in lock["labcrane"]["files"]
    assert "labcrane/machines/data/ch8.yaml" in lock["labcrane"]["files"]
    changed = json.loads(json.dumps(lock))
    changed["labcrane"]["files"]["labcrane/session/loop.py"] = "0" * 64
    assert differences(lock, changed) == [
        "labcrane: the source of labcrane/session/loop.py has changed"
    ]


@pytest.mark.slow
def test_the_lock_holds_on_another_computer_under_another_path(lab: Lab, tmp_path: Path) -> None:
    """Another process, another folder, another installation of the very same source."""
    elsewhere = tmp_path / "another disk" / "Studien"
    ignored = shutil.ignore_patterns("data", "__pycache__")
    shutil.copytree(lab.folder, elsewhere, ignore=ignored)
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
        "from labcrane.registry.registry import discover\n"
        "from labcrane.protocol.study import load\n"
        "from labcrane.approval.decision import verify\n"
        "registry = discover(study=Path(sys.argv[2]))\n"
        "print(verify(load(Path(sys.argv[2]), registry), registry, date.today()).seal)\n"
    )
    done = ran([sys.executable, "-c", program, str(copies), "study.yaml"], cwd=elsewhere)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == read_lock(lab.protocol).seal
    assert str(tmp_path) not in lock_path(lab.protocol).read_text(encoding="utf-8")


def test_the_hash_of_a_study_does_not_depend_on_when_it_was_approved(lab: Lab) -> None:
    first = read_lock(lab.protocol)
    lock_path(lab.protocol).unlink()
    grant = Grant("Another board", "X", TODAY + timedelta(5), lab.folder / "consent_v2.txt")
    second = approve(lab.study, lab.registry, grant, TODAY)
    assert second.materials_sha256 == first.materials_sha256
    assert second.seal != first.seal
    assert verify(lab.study, lab.registry, TODAY).seal == second.seal


def test_another_group_in_the_protocol_is_drift(tmp_path: Path) -> None:
    lab = Lab(tmp_path, GROUPED)
    lab.approve()
    lab.consent("P001")
    edit(lab.protocol, "sound: [tone]", "sound: [tone, sphere]")
    assert refusal(lab) == ["protocol: design.groups.sound[2] is new: 'sphere'"]
