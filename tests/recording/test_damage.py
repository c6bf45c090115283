"""Torn and damaged journals: shorter recordings, never wrong numbers, never a hang."""

import struct
from pathlib import Path

import numpy as np
import pytest
import pyxdf
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recording.journals import COLUMNS, START, frames, stamp, write

from labcrane import RecordingError
from labcrane.recording import Channel, StreamHeader
from labcrane.recording.xdf import writer as xdf
from labcrane.recording.xdf.chunk import BOUNDARY, MAGIC, Tag, pack, pack_numbers, pack_stream
from labcrane.recording.xdf.reader import XdfFile, read_xdf

COUNT = 30
FRAMES = frames(COUNT)


@pytest.fixture(params=[0.0, 0.0005, 60.0], ids=["every chunk", "some chunks", "at the end"])
def data(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """A journal whose checks come often, now and then, or once."""
    monkeypatch.setattr(xdf, "CHECK_EVERY_S", request.param)
    return write(tmp_path / "whole.xdf", COUNT).read_bytes()


def read(folder: Path, content: bytes) -> XdfFile:
    path = folder / "x.xdf"
    path.write_bytes(content)
    return read_xdf(path)


def rows(file: XdfFile) -> np.ndarray:
    """Stamps and values of all frames that were read."""
    for stream in file.streams:
        if stream.header.name == "labcrane.frames":
            return np.column_stack([stream.stamps, stream.data])
    return np.empty((0, 1 + len(COLUMNS)))


TRUE = np.column_stack([[stamp(k) for k in range(COUNT)], FRAMES])


def assert_true(file: XdfFile) -> None:
    """Every frame that was read is one that was written, bit for bit, in order."""
    got = rows(file)
    written = [row.tobytes() for row in TRUE]
    places = [written.index(row.tobytes()) for row in np.ascontiguousarray(got)]
    assert places == sorted(set(places))


def test_a_whole_journal_is_whole(data: bytes, tmp_path: Path) -> None:
    file = read(tmp_path, data)
    assert file.whole
    assert file.checked == len(data)
    np.testing.assert_array_equal(rows(file), TRUE)


@pytest.mark.slow
def test_a_journal_cut_anywhere_is_read_to_its_last_whole_chunk(
    data: bytes, tmp_path: Path
) -> None:
    """The samples only ever grow with the length."""
    before = 0
    for length in (*range(0, len(data), 5), len(data)):
        file = read(tmp_path, data[:length])
        assert not file.damaged
        count = len(rows(file))
        np.testing.assert_array_equal(rows(file), TRUE[:count])
        assert before <= count <= before + 1
        before = count
    assert before == COUNT


def test_pyxdf_reads_what_we_read_of_a_torn_journal(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "x.xdf"
    headers = data.index(b"labcrane.events</source_id>") + 200
    for length in range(headers, len(data), 53):
        file = read(tmp_path, data[:length])
        ours = rows(file)
        if file.torn in (5, 6):  # pyxdf 1.17.5 expects the tag of a chunk where its length is
            with pytest.raises(struct.error):
                pyxdf.load_xdf(path)
            continue
        streams, _ = pyxdf.load_xdf(path, dejitter_timestamps=False, synchronize_clocks=False)
        (theirs,) = (s for s in streams if s["info"]["name"] == ["labcrane.frames"])
        # pyxdf takes a torn last sample for a whole one and fills it with what was before.
        count = len(ours)
        assert len(theirs["time_stamps"]) in (count, count + 1)
        np.testing.assert_array_equal(theirs["time_stamps"][:count], ours[:, 0])
        if count:
            np.testing.assert_array_equal(theirs["time_series"][:count], ours[:, 1:])


@pytest.mark.slow
@settings(
    max_examples=300,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(flips=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 7)), min_size=1, max_size=3))
def test_flipped_bits_shorten_a_recording_but_change_no_number(
    data: bytes, tmp_path: Path, flips: list[tuple[float, int]]
) -> None:
    content = bytearray(data)
    for place, bit in flips:
        content[int(place * (len(data) - 1))] ^= 1 << bit
    if bytes(content) == data:
        return
    try:
        file = read(tmp_path, bytes(content))
    except RecordingError:
        assert content[:4] != b"XDF:"
        return
    if file.unchecked or file.checked < len(content):
        return  # the checks themselves were hit: what they covered is read, and reported as such
    assert_true(file)
    if file.whole:
        assert len(rows(file)) == COUNT  # what was hit holds no sample


@settings(
    max_examples=200,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(
    start=st.floats(0, 1),
    stop=st.floats(0, 1),
    garbage=st.binary(max_size=80),
)
def test_garbage_in_the_middle_ends_no_recording(
    data: bytes, tmp_path: Path, start: float, stop: float, garbage: bytes
) -> None:
    a, b = sorted((int(start * len(data)), int(stop * len(data))))
    try:
        file = read(tmp_path, data[:a] + garbage + data[b:])
    except RecordingError:
        return
    before = sum(1 for end in ends_of_frames(data) if end <= a)
    if file.streams and file.streams[0].header.name == "labcrane.frames":
        np.testing.assert_array_equal(rows(file)[:before], TRUE[:before])


@pytest.mark.slow
def test_a_signalling_nan_anywhere_is_damage_and_no_error(data: bytes, tmp_path: Path) -> None:
    nan = np.array([0x7FF0_0000_0000_0001], "<u8").tobytes()
    for at in range(len(data) - 600, len(data) - 8):
        try:
            file = read(tmp_path, data[:at] + nan + data[at + 8 :])
        except RecordingError:
            continue
        assert_true(file)


def ends_of_frames(data: bytes) -> list[int]:
    """Where each frame ends, found by its bytes."""
    return [data.index(row.tobytes()) + row.nbytes for row in FRAMES]


def test_a_flipped_bit_costs_one_frame(data: bytes, tmp_path: Path) -> None:
    for number in (0, 17, COUNT - 1):
        content = bytearray(data)
        content[ends_of_frames(data)[number] - 3] ^= 16
        file = read(tmp_path, bytes(content))
        np.testing.assert_array_equal(rows(file), np.delete(TRUE, number, axis=0))
        assert len(file.damaged) == 1
        assert not file.unchecked


def test_a_damaged_length_costs_one_frame(data: bytes, tmp_path: Path) -> None:
    """Without the checks, everything to the next boundary would be lost."""
    content = bytearray(data)
    end = ends_of_frames(data)[17]
    content[data.rindex(b"\x04", 0, end - len(COLUMNS) * 8 - 22) + 2] ^= 0x55
    file = read(tmp_path, bytes(content))
    assert len(rows(file)) >= COUNT - 1
    assert_true(file)


@settings(max_examples=200)
@given(content=st.binary(max_size=400))
def test_noise_is_read_as_nothing(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    file = read(tmp_path_factory.getbasetemp(), b"XDF:" + content)
    assert not any(len(stream.stamps) for stream in file.streams)


def test_a_damaged_header_is_reported_with_the_stream_that_lost_its_name(
    data: bytes, tmp_path: Path
) -> None:
    content = bytearray(data)
    content[data.index(b"labcrane.frames")] ^= 1
    file = read(tmp_path, bytes(content))
    assert [stream.header.name for stream in file.streams] == ["labcrane.events"]
    assert file.nameless == [1]
    with pytest.raises(RecordingError, match="headers of 1 streams are damaged"):
        file.stream("labcrane.frames")


def test_files_of_others_go_on_behind_the_next_boundary(tmp_path: Path) -> None:
    """They have no checks; the means of the format itself are boundary chunks."""
    header = StreamHeader("n", "EEG", (Channel("c"),))
    values = np.arange(30.0)
    dtype = np.dtype("<f8")
    chunks = [
        pack_numbers(1, values[k : k + 1] + START, values[k : k + 1, None], dtype)
        for k in range(30)
    ]
    chunks[10:10] = [pack(Tag.BOUNDARY, BOUNDARY)]
    chunks[5] = b"\x04\xff\xff" + chunks[5][3:]
    start = MAGIC + pack(Tag.FILE_HEADER, b"<info/>")
    head = start + pack_stream(Tag.STREAM_HEADER, 1, header.xml)
    file = read(tmp_path, head + b"".join(chunks))
    np.testing.assert_array_equal(file.stream("n").data[:, 0], [0, 1, 2, 3, 4, *range(10, 30)])
    assert [span.stop - span.start for span in file.damaged] == [5 * len(chunks[0]) + 7]
    assert file.checked == 0


def test_zeros_behind_the_last_chunk_are_a_torn_tail(data: bytes, tmp_path: Path) -> None:
    """What a power cut leaves when the file's length reached the disk before its content."""
    cut = ends_of_frames(data)[20]
    file = read(tmp_path, data[:cut] + bytes(5000))
    np.testing.assert_array_equal(rows(file), TRUE[:21])
    assert file.torn == 5000


def test_an_empty_file_is_a_journal_killed_before_its_first_chunk(tmp_path: Path) -> None:
    file = read(tmp_path, b"")
    assert file.streams == []
    assert not read(tmp_path, b"XD").streams


@pytest.mark.slow
def test_one_flipped_bit_anywhere_costs_at_most_one_frame(data: bytes, tmp_path: Path) -> None:
    start = data.index(b"labcrane.events</source_id>") + 200  # behind the headers
    for place in range(start, len(data), 7):
        content = bytearray(data)
        content[place] ^= 1 << (place % 8)
        file = read(tmp_path, bytes(content))
        assert_true(file)
        assert len(rows(file)) >= COUNT - 1
