"""The search for a pseudonym: whatever is packed, and what cannot be searched is never clean."""

import bz2
import gzip
import io
import lzma
import random
import struct
import tarfile
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from governance.kept_people import REASON
from governed import TODAY, Lab

from labcrane.participants import proof
from labcrane.participants import recovery as unfinished
from labcrane.participants.mentions import Mentions
from labcrane.participants.proof import mentioned, searched
from labcrane.testing import main

NAMES = Mentions(["P001", "P0011", "VP-7", "007"])
NOTE = b"ask P007 about the second session"


def zipped(content: bytes, name: str = "note.txt", method: int = zipfile.ZIP_STORED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        archive.writestr(name, content)
    return out.getvalue()


def locked(content: bytes, method: int = 0) -> bytes:
    """Return a zip whose member needs a password: its bytes are noise, its heads say so."""
    plain = zipped(content)
    noise = bytes(each ^ 0x5A for each in content)
    raw = bytearray(plain.replace(content, noise))
    for head, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = raw.index(head) + flags
        struct.pack_into("<H", raw, at, 1)
        struct.pack_into("<H", raw, at + 2, method)
    return bytes(raw)


def of_another_method(content: bytes) -> bytes:
    raw = bytearray(locked(content, 98))
    for head, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        struct.pack_into("<H", raw, raw.index(head) + flags, 0)
    return bytes(raw)


def deep(content: bytes) -> bytes:
    for _ in range(6):
        content = zipped(content, method=zipfile.ZIP_DEFLATED)
    return content


def spoilt(packed: bytes) -> bytes:
    return packed[: len(packed) - len(packed) // 3]


def half_spoilt(content: bytes) -> bytes:
    """Return a zip of two members, of which one is damaged and holds nothing that can be read."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bad.txt", content * 9)
        archive.writestr("good.txt", b"nobody")
    raw = bytearray(out.getvalue())
    at = raw.index(b"bad.txt") + len("bad.txt")
    raw[at : at + 8] = b"\xff" * 8
    return bytes(raw)


OFFICE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(500) + "EncryptedPackage".encode("utf-16-le")

CLOSED = {
    "a zip with a password": ("a.zip", locked(NOTE), "note.txt in a.zip: it needs a password"),
    "a zip by AES": ("a.zip", locked(NOTE, 99), "note.txt in a.zip: it needs a password"),
    "in a zip": ("a.zip", zipped(locked(NOTE), "b.zip"), "note.txt in b.zip in a.zip: it needs"),
    "in gzip": ("a.zip.gz", gzip.compress(locked(NOTE)), "note.txt in what is in a.zip.gz: it"),
    "another method": ("a.zip", of_another_method(NOTE), "note.txt in a.zip: it is damaged, or"),
    "a damaged member": ("a.zip", half_spoilt(NOTE), "bad.txt in a.zip: it is damaged, or"),
    "a workbook with a password": ("a.xlsx", OFFICE, "a.xlsx: it needs a password"),
    "a workbook in a zip": ("a.zip", zipped(OFFICE, "a.xlsx"), "a.xlsx in a.zip: it needs a pas"),
    "7z": ("a.7z", b"7z\xbc\xaf\x27\x1c\x00\x04", "a.7z: it is a 7z archive"),
    "RAR": ("a.rar", b"Rar!\x1a\x07\x01\x00", "a.rar: it is a RAR archive"),
    "PGP": ("a.txt", b"-----BEGIN PGP MESSAGE-----\n\nhQ", "a.txt: it is encrypted by PGP"),
    "noise": ("a.gpg", bytes(range(256)), "a.gpg: its name says that it is encrypted"),
    "a PDF": ("a.pdf", b"%PDF-1.7\n", "a.pdf: a PDF's text is packed and drawn"),
    "deep": ("a.zip", deep(NOTE), "archives in archives are opened 4 deep"),
    "half a gzip": ("a.gz", spoilt(gzip.compress(random.Random(1).randbytes(99))), "a.gz: it is"),
    "half an xz": ("a.xz", spoilt(lzma.compress(random.Random(1).randbytes(99))), "a.xz: it is"),
    "half a bzip2": ("a.bz2", spoilt(bz2.compress(random.Random(1).randbytes(99))), "a.bz2: it is"),
    "a damaged HDF5": ("a.h5", proof.HDF5 + bytes(90), "a.h5: it is damaged, or packed otherwise"),
    "a damaged Parquet": ("a.parquet", b"PAR1" + bytes(90), "a.parquet: it is damaged, or packed"),
}


@pytest.mark.parametrize("case", CLOSED.values(), ids=CLOSED)
def test_what_cannot_be_searched_is_said_and_never_taken_for_clean(
    case: tuple[str, bytes, str], tmp_path: Path
) -> None:
    name, content, why = case
    path = tmp_path / name
    path.write_bytes(content)
    done = searched(path, Mentions(["P007"]))
    assert done.found == set()
    [line] = done.closed
    assert why in line


@pytest.mark.slow
def test_erasing_ends_with_what_nobody_could_search(
    lab: Lab, capsys: pytest.CaptureFixture[str]
) -> None:
    (lab.places.root / "notes.zip").write_bytes(locked(NOTE))
    (lab.places.root / "old").mkdir()
    (lab.places.root / "old" / "notes.xlsx").write_bytes(OFFICE)
    (lab.places.root / "both.zip").write_bytes(zipped(NOTE) + locked(NOTE))
    words = ["erase", "P007", "--data", str(lab.places.root), "--reason", REASON, "--yes"]
    assert main(words) == 0
    said = " ".join(capsys.readouterr().out.split())
    told = "cannot be searched for P007; check it yourself:"
    root = " ".join(str(lab.places.root).split())
    assert f"{told} {root}/note.txt in notes.zip: it needs a password" in said
    assert f"{told} {root}/old/notes.xlsx: it needs a password" in said
    assert f"still mentions P007: {root}/both.zip" in said
    assert said.index(told) < said.index("P007 is erased.")


def test_a_lab_of_our_own_files_alone_is_searched_to_its_end(lab: Lab) -> None:
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    assert (done.mentions, done.unsearched) == ([], [])


def tarred(content: bytes) -> bytes:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        member = tarfile.TarInfo("note.txt.gz")
        packed = gzip.compress(content)
        member.size = len(packed)
        archive.addfile(member, io.BytesIO(packed))
    return out.getvalue()


def hdf5(content: bytes) -> bytes:
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        rows = np.array([b"x" * 40] * 70_000 + [content])
        file.create_dataset("a/b", data=rows, compression="gzip", chunks=(1000,))
    return out.getvalue()


PACKED: dict[str, Callable[[bytes], bytes]] = {
    "gzip": gzip.compress,
    "xz": lzma.compress,
    "bzip2": bz2.compress,
    "zip": lambda content: zipped(content, method=zipfile.ZIP_LZMA),
    "tar in gzip": lambda content: gzip.compress(tarred(content)),
    "hdf5": hdf5,
}


@pytest.mark.parametrize("pack", PACKED.values(), ids=PACKED)
def test_what_is_packed_is_searched(pack: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(pack(b"the answer of P001 in words"))
    done = searched(path, NAMES)
    assert (done.found, done.closed) == ({"P001"}, [])


def test_pieces_of_a_file_are_searched_as_the_whole_would_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against one search of the whole text, with windows of any even length, one byte a letter."""
    dice, path = random.Random(9), tmp_path / "text"
    words = ["P001", "P0011", "P00", "VP-7", "VP7PILOT", "sub-007", "007", "/", "_", " ", "1", "x"]
    names = 0
    for _ in range(400):
        text = "".join(dice.choice(words) for _ in range(dice.randrange(60)))
        monkeypatch.setattr(proof, "OVERLAP", 64)
        monkeypatch.setattr(proof, "WINDOW", dice.choice([64, 66, 100, 1000]))
        path.write_text(text)
        assert mentioned(path, NAMES) == NAMES.of(text)
        path.write_bytes(b"\x00\x00" * 3 + text.encode("utf-16-le"))
        assert mentioned(path, NAMES) >= NAMES.of("\x00\x00\x00" + text)
        names += len(NAMES.of(text))
    assert names > 200


@pytest.mark.parametrize("name", ["long.txt", "long.gz"])
def test_a_long_file_takes_no_more_memory_than_a_window(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    with gzip.open(path, "wb", 1) if name.endswith(".gz") else path.open("wb") as file:
        for _ in range(48):
            file.write(b"nobody is here. " * (1 << 16))
        file.write(b"P001")
    tracemalloc.start()
    try:
        assert mentioned(path, NAMES) == {"P001"}
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 30e6, "48 MB are searched in pieces of one"


def test_a_bomb_is_not_unpacked_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, "LARGEST", 1 << 22)
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(gzip.compress(bytes(1 << 26))))
    done = searched(path, NAMES)
    assert len(done.closed) == 1
    assert "GB are packed in it" in done.closed[0]
