"""What is edited is never lost, and never written over what another program or a board has made."""

import os
import stat
from pathlib import Path

import pytest

from labcrane import ProtocolError
from labcrane.start import document
from labcrane.start.document import ApprovedError, Document, NewerFileError

TEXT = "# mine\nlabcrane: 1\ntitle: One   # the first\n"
OTHER = TEXT.replace("One", "Of another program")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "protocol.yaml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def files(path: Path) -> set[str]:
    return {each.name for each in path.parent.iterdir()}


def test_what_was_typed_is_there_after_a_kill_and_the_file_is_as_it_was(path: Path) -> None:
    typed = TEXT.replace("One", "Two")
    Document.open(path).change(0, typed)
    again = Document.open(path)  # by a process that knows nothing of the first
    assert (again.text, again.restored, again.unsaved) == (typed, True, True)
    assert path.read_text(encoding="utf-8") == TEXT
    again.undo(again.revision)
    assert again.text == TEXT
    again.redo(again.revision)
    again.save(again.revision)
    assert path.read_text(encoding="utf-8") == typed
    assert files(path) == {"protocol.yaml"}, "no draft is left"


def test_a_text_that_is_as_the_file_again_leaves_no_draft(path: Path) -> None:
    document = Document.open(path)
    document.change(0, TEXT + "a: 1\n")
    assert len(files(path)) == 2
    document.undo(1)
    assert (document.unsaved, files(path)) == (False, {"protocol.yaml"})


def test_a_newer_file_is_replaced_only_if_that_is_agreed_to(path: Path) -> None:
    document = Document.open(path)
    document.change(0, TEXT + "a: 1\n")
    path.write_text(OTHER, encoding="utf-8")
    assert document.changed_on_disk
    with pytest.raises(NewerFileError, match="changed by another program"):
        document.save(1)
    assert path.read_text(encoding="utf-8") == OTHER
    killed = Document.open(path)
    assert (killed.text, killed.changed_on_disk) == (TEXT + "a: 1\n", True), "nor after a kill"
    with pytest.raises(NewerFileError):
        killed.save(0)
    document.save(1, over_newer=True)
    assert path.read_text(encoding="utf-8") == TEXT + "a: 1\n"


def test_taking_the_newer_file_keeps_the_text_in_undo(path: Path) -> None:
    document = Document.open(path)
    document.change(0, TEXT + "a: 1\n")
    path.write_text(OTHER, encoding="utf-8")
    document.reload(1)
    assert (document.text, document.unsaved, document.changed_on_disk) == (OTHER, False, False)
    document.undo(document.revision)
    assert (document.text, document.unsaved) == (TEXT + "a: 1\n", True)


def test_a_file_that_was_removed_counts_as_changed(path: Path) -> None:
    document = Document.open(path)
    document.change(0, TEXT + "a: 1\n")
    path.unlink()
    with pytest.raises(NewerFileError):
        document.save(1)
    document.save(1, over_newer=True)
    assert path.read_text(encoding="utf-8") == TEXT + "a: 1\n"


def test_an_approved_study_is_saved_only_if_that_is_agreed_to(path: Path) -> None:
    path.with_name("protocol.lock.json").write_text("{}", encoding="utf-8")
    document = Document.open(path)
    document.change(0, TEXT + "a: 1\n")
    with pytest.raises(ApprovedError, match="labcrane amend"):
        document.save(1)
    assert path.read_text(encoding="utf-8") == TEXT
    document.save(1, over_approved=True)
    assert path.read_text(encoding="utf-8") == TEXT + "a: 1\n"


def test_the_texts_of_a_folder_with_an_approved_protocol_are_part_of_its_study(path: Path) -> None:
    """The instructions were written over unasked while another protocol was open."""
    path.with_name("keyboard.lock.json").write_text("{}", encoding="utf-8")
    file = path.with_name("instructions.md")
    file.write_text("Approved.\n", encoding="utf-8")
    assert Document.open(file, path).approved
    assert not Document.open(path).approved, "a protocol has its own lock"


def test_two_windows_do_not_overwrite_each_other(path: Path) -> None:
    document = Document.open(path)
    document.change(0, TEXT + "a: 1\n")
    for late in (document.change, document.undo, document.redo, document.save, document.reload):
        with pytest.raises(ProtocolError, match="another window"):
            late(*((0, "lost") if late == document.change else (0,)))
    assert document.text == TEXT + "a: 1\n"


def test_line_ends_of_windows_and_a_mark_at_the_begin_stay(path: Path) -> None:
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    document = Document.open(path)
    document.change(0, document.text.replace("One", "Two"))
    document.save(1)
    assert (
        path.read_bytes()
        == b"\xef\xbb\xbf" + TEXT.replace("One", "Two").replace("\n", "\r\n").encode()
    )
    path.write_bytes(b"a: 1\r\nb: 2\n")
    with pytest.raises(ProtocolError, match="line ends"):
        Document.open(path)


def test_a_text_that_cannot_be_read_is_kept_and_says_why(path: Path) -> None:
    document = Document.open(path)
    document.change(0, "title: [\n")
    shown = document.shown()
    assert (shown["text"], shown["data"]) == ("title: [\n", None)
    assert shown["unreadable"]
    assert Document.open(path).text == "title: [\n"


def test_what_another_program_writes_right_after_a_save_is_a_newer_file(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was taken for what had been saved, and written over by the next save unasked."""
    opened, write = Document.open(path), document.write_text

    def overtaken(at: Path, text: str, mode: int) -> None:
        write(at, text, mode)
        if at == path:
            path.write_text(OTHER, encoding="utf-8")

    monkeypatch.setattr(document, "write_text", overtaken)
    opened.change(0, TEXT + "a: 1\n")
    opened.save(1)
    assert opened.changed_on_disk
    opened.change(opened.revision, TEXT + "a: 2\n")
    with pytest.raises(NewerFileError):
        opened.save(opened.revision)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such permissions")
def test_a_saved_file_keeps_its_permissions_and_one_that_is_read_only_its_text(path: Path) -> None:
    path.chmod(0o660)
    opened = Document.open(path)
    opened.change(0, TEXT + "a: 1\n")
    opened.save(1)
    assert stat.S_IMODE(path.stat().st_mode) == 0o660
    path.chmod(0o440)
    opened.change(opened.revision, TEXT + "a: 2\n")
    with pytest.raises(ProtocolError, match="is read-only"):
        opened.save(opened.revision)
    assert path.read_text(encoding="utf-8") == TEXT + "a: 1\n"
    assert opened.unsaved
