"""CSV tables of others: read, or refused in words, in bounded memory."""

import gzip
from pathlib import Path

import pytest

from labcrane import LabcraneError, ProtocolError, RecordingError
from labcrane.core import read_csv_text
from labcrane.limits import LIMITS
from labcrane_bids.dataset import people_table
from labcrane_dmd.fit.recordings import read_recordings

MOST = LIMITS["CSV table"].most


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"participant,age\nP001,\xe4lt\n", "byte 0xE4 in line 2 is not UTF-8; save it as UTF-8"),
        (b"participant,age\nP001,\0\n", "line 2 contains a NUL character; remove it"),
        (b"participant,age\nP001," + b"9" * 140_000, "field larger than field limit"),
        (b"participant,age\nP001,30,left\n", "line 2: this row has more or fewer cells"),
        (b"participant,age\nP001,30\nP001,31\n", "line 3: 'P001' is listed twice; keep one row"),
        (b"participant,age\nP001\n", "line 2: this row has more or fewer cells"),
        (gzip.compress(b"participant,age\n", mtime=0)[:-9], "it is gzipped, and damaged"),
    ],
)
def test_a_table_of_people_that_is_none_is_refused_in_words(
    tmp_path: Path, content: bytes, why: str
) -> None:
    path = tmp_path / "people.csv"
    path.write_bytes(content)
    with pytest.raises(ProtocolError, match=why) as refused:
        people_table(path)
    assert str(path) in str(refused.value)


def test_a_table_is_what_it_says_gzipped_or_not(tmp_path: Path) -> None:
    path = tmp_path / "people.csv"
    for content in (b"participant,age\nP001,30\n", b"\xef\xbb\xbfparticipant,age\r\nP001,30\r\n"):
        for packed in (content, gzip.compress(content)):
            path.write_bytes(packed)
            assert people_table(path) == {"P001": {"participant": "P001", "age": "30"}}


def test_a_packed_table_is_unpacked_no_further_than_a_table_may_be(tmp_path: Path) -> None:
    """20 GB of it would be 20 MB packed, and the same answer after 50 MB."""
    path = tmp_path / "boom.csv.gz"
    path.write_bytes(gzip.compress(bytes(MOST + 1), compresslevel=1))
    with pytest.raises(RecordingError, match=f"more than {MOST} bytes once it is unpacked"):
        read_recordings(path)
    path.write_bytes(gzip.compress(b"0" * MOST, compresslevel=1))
    assert len(read_csv_text(path)) == MOST
    with path.open("wb") as file:
        file.truncate(MOST + 1)
    with pytest.raises(LabcraneError, match=f"it has {MOST + 1} bytes; the maximum is {MOST}"):
        read_recordings(path)
