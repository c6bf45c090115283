import threading
from pathlib import Path

import numpy as np
import pytest
import pyxdf
from recording.journals import COLUMNS, RATE_HZ, frames, stamp, write

from labcrane import RecordingError
from labcrane.recording import Channel, StreamHeader, XdfWriter
from labcrane.recording.paths import next_part, part_number, parts, session_of
from labcrane.recording.xdf import writer as xdf
from labcrane.recording.xdf.chunk import BOUNDARY, Tag, pack, samples_head
from labcrane.recording.xdf.header import FORMATS
from labcrane.recording.xdf.reader import read_xdf

NUMBERS = [form for form in FORMATS if form != "string"]


def channels(count: int) -> tuple[Channel, ...]:
    return tuple(Channel(f"c{number}", "microvolts", "EEG") for number in range(count))


def load(path: Path) -> dict:
    streams, _ = pyxdf.load_xdf(path, dejitter_timestamps=False, synchronize_clocks=False)
    return {stream["info"]["name"][0]: stream for stream in streams}


@pytest.mark.parametrize("form", NUMBERS)
def test_numbers_come_back_from_pyxdf_and_from_our_reader(tmp_path: Path, form: str) -> None:
    dtype = FORMATS[form]
    rng = np.random.default_rng(1)
    data = (rng.standard_normal((500, 3)) * 50).astype(dtype)
    stamps = np.sort(rng.uniform(10, 20, 500))
    path = tmp_path / "x.xdf"
    with XdfWriter(path) as writer:
        number = writer.add_stream(StreamHeader("n", "EEG", channels(3), form, 50.0))
        for start, stop in ((0, 1), (1, 300), (300, 300), (300, 499), (499, 500)):
            writer.write_samples(number, stamps[start:stop], data[start:stop])
    theirs, ours = load(path)["n"], read_xdf(path).stream("n")
    for values, times in (
        (theirs["time_series"], theirs["time_stamps"]),
        (ours.data, ours.stamps),
    ):
        np.testing.assert_array_equal(values, data)
        np.testing.assert_array_equal(times, stamps)
    assert ours.data.dtype == dtype


def test_texts_come_back_from_pyxdf_and_from_our_reader(tmp_path: Path) -> None:
    rows = [("", "a"), ("zażółć", '{"x": 1}'), ("x" * 100_000, "\n\0")]
    path = tmp_path / "x.xdf"
    with XdfWriter(path) as writer:
        number = writer.add_stream(StreamHeader("m", "Markers", channels(2), "string"))
        writer.write_texts(number, [1.0, 2.0], rows[:2])
        writer.write_texts(number, [3.0], rows[2:])
    theirs, ours = load(path)["m"], read_xdf(path).stream("m")
    assert ours.texts == rows
    assert [tuple(row) for row in theirs["time_series"]] == rows
    np.testing.assert_array_equal(ours.stamps, [1.0, 2.0, 3.0])


def test_footer_says_what_was_written(tmp_path: Path) -> None:
    path = write(tmp_path / "x.xdf", 481)
    footer = load(path)["labcrane.frames"]["footer"]["info"]
    assert footer["sample_count"] == ["481"]
    assert float(footer["first_timestamp"][0]) == stamp(0)
    assert float(footer["last_timestamp"][0]) == stamp(480)
    assert float(footer["measured_srate"][0]) == pytest.approx(RATE_HZ)
    check = load(path)["labcrane.check"]
    assert int(check["footer"]["info"]["sample_count"][0]) == len(check["time_stamps"])


def test_clock_offsets_reach_pyxdf_which_corrects_with_them(tmp_path: Path) -> None:
    path = tmp_path / "x.xdf"
    with XdfWriter(path) as writer:
        number = writer.add_stream(StreamHeader("n", "EEG", channels(1)))
        for second in range(20):
            writer.write_offset(number, float(second), 1000.0)
            writer.write_sample(number, float(second), np.array([1.0]))
    streams, _ = pyxdf.load_xdf(path, dejitter_timestamps=False)
    (stream,) = (s for s in streams if s["info"]["name"] == ["n"])
    np.testing.assert_allclose(stream["time_stamps"], 1000.0 + np.arange(20))
    ours = read_xdf(path).stream("n")
    np.testing.assert_array_equal(ours.offsets, np.stack([np.arange(20.0), np.full(20, 1e3)], 1))
    assert ours.footer is not None
    assert ours.footer.count("<offset>") == 20


def test_header_of_a_foreign_stream_is_kept_to_the_letter(tmp_path: Path) -> None:
    text = (
        '<?xml version="1.0"?>\n<info>\n\t<name>Gaze &amp; more</name><type>Gaze</type>'
        "<channel_count>3</channel_count><nominal_srate>200.5</nominal_srate>"
        "<channel_format>float32</channel_format><source_id>id</source_id><desc><channels>"
        "<channel><label>x</label><unit>pixels</unit><type>ScreenX</type><eye>left</eye></channel>"
        "</channels><acquisition><model>Neon</model></acquisition></desc></info>\n"
    )
    header = StreamHeader.from_xml(text)
    assert header.name == "Gaze & more"
    assert header.rate_hz == 200.5
    assert header.channels[0] == Channel("x", "pixels", "ScreenX", {"eye": "left"})
    assert header.labels == ("x", "channel 2", "channel 3")
    assert header.desc == {"acquisition": {"model": "Neon"}}
    path = tmp_path / "x.xdf"
    with XdfWriter(path) as writer:
        writer.add_stream(header)
    assert read_xdf(path).streams[0].header.xml == text
    assert "Gaze & more" in load(path)


def test_header_says_labels_units_and_types_where_the_conventions_have_them(tmp_path: Path) -> None:
    path = write(tmp_path / "x.xdf", 1)
    info = load(path)["labcrane.frames"]["info"]
    described = info["desc"][0]["channels"][0]["channel"]
    assert [channel["label"][0] for channel in described] == [c.label for c in COLUMNS]
    assert [channel["unit"][0] for channel in described] == [c.unit for c in COLUMNS]
    assert [channel["group"][0] for channel in described] == [c.group for c in COLUMNS]
    assert float(info["nominal_srate"][0]) == RATE_HZ


def test_an_existing_file_is_never_written_to(tmp_path: Path) -> None:
    path = tmp_path / "ses-01_run.xdf"
    path.write_text("somebody's data", encoding="utf-8")
    with pytest.raises(RecordingError, match="already exists"):
        XdfWriter(path)
    assert path.read_text(encoding="utf-8") == "somebody's data"


def test_parts_are_numbered_by_the_process_that_goes_on(tmp_path: Path) -> None:
    first = tmp_path / "ses-01_run.xdf"
    for _ in range(11):
        write(next_part(first), 1)
    assert [part_number(part) for part in parts(first)] == list(range(1, 12))
    assert parts(first)[10].name == "ses-01_run.part11.xdf"
    assert session_of(parts(first)[10]) == (1, "run")
    assert session_of(tmp_path / "notes.xdf") is None
    assert "<part>11</part>" in read_xdf(parts(first)[10]).header


def test_boundaries_and_checks_come_once_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x.xdf"
    now = 0.0
    monkeypatch.setattr(xdf.time, "monotonic", lambda: now)
    with XdfWriter(path, sync_s=60.0) as writer:
        number = writer.add_stream(StreamHeader("n", "EEG", channels(1)))
        for _ in range(100):
            now += 0.1
            writer.write_sample(number, now, np.array([now]))
    assert path.read_bytes().count(BOUNDARY) in (10, 11)
    assert read_xdf(path).checked == path.stat().st_size


def test_threads_share_a_writer(tmp_path: Path) -> None:
    path = tmp_path / "x.xdf"
    with XdfWriter(path) as writer:
        numbers = [writer.add_stream(StreamHeader(f"n{k}", "EEG", channels(2))) for k in range(4)]

        def work(number: int) -> None:
            for k in range(500):
                writer.write_sample(number, float(k), np.array([number, k], np.float64))

        threads = [threading.Thread(target=work, args=(number,)) for number in numbers]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    file = read_xdf(path)
    assert file.whole
    for number, stream in zip(numbers, file.streams, strict=True):
        np.testing.assert_array_equal(stream.data[:, 0], np.full(500, number))
        np.testing.assert_array_equal(stream.data[:, 1], np.arange(500))


@pytest.mark.parametrize(
    "values",
    [np.zeros(3), np.zeros((1, 2)), np.zeros(2, np.float32), np.zeros(2, np.int64)],
)
def test_a_frame_that_does_not_fit_is_refused(tmp_path: Path, values: np.ndarray) -> None:
    with XdfWriter(tmp_path / "x.xdf") as writer:
        number = writer.add_stream(StreamHeader("n", "EEG", channels(2)))
        with pytest.raises(RecordingError, match="2 channels of double64"):
            writer.write_sample(number, 0.0, values)


def test_a_row_may_be_a_view_with_strides(tmp_path: Path) -> None:
    path = tmp_path / "x.xdf"
    table = np.arange(12.0).reshape(3, 4)
    with XdfWriter(path) as writer:
        number = writer.add_stream(StreamHeader("n", "EEG", channels(3)))
        writer.write_sample(number, 0.0, table[:, 1])
    np.testing.assert_array_equal(read_xdf(path).stream("n").data, [table[:, 1]])


def test_a_closed_writer_says_so(tmp_path: Path) -> None:
    with XdfWriter(tmp_path / "x.xdf") as writer:
        number = writer.add_stream(StreamHeader("n", "EEG", channels(1)))
    writer.close()
    with pytest.raises(RecordingError, match="closed"):
        writer.write_sample(number, 0.0, np.zeros(1))


@pytest.mark.parametrize("texts", [False, True])
def test_stamps_that_were_left_out_are_deduced_from_the_rate_as_pyxdf_does(
    tmp_path: Path, *, texts: bool
) -> None:
    """LabRecorder leaves out stamps that follow from the one before."""
    header = StreamHeader("n", "EEG", channels(1), "string" if texts else "double64", 10.0)
    values = (1.0, 2.0, 3.0)
    first, *others = (
        b"\x01\x01%d" % value if texts else np.float64(value).tobytes() for value in values
    )
    body = b"\x08" + np.float64(5.0).tobytes() + first
    body += b"".join(b"\x00" + value for value in others)
    path = tmp_path / "x.xdf"
    path.write_bytes(
        b"XDF:"
        + pack(Tag.FILE_HEADER, b"<info><version>1.0</version></info>")
        + pack(Tag.STREAM_HEADER, b"\x01\0\0\0" + header.xml.encode())
        + samples_head(1, 3, len(body))
        + body
    )
    stream = read_xdf(path).stream("n")
    np.testing.assert_allclose(stream.stamps, [5.0, 5.1, 5.2])
    np.testing.assert_allclose(load(path)["n"]["time_stamps"], stream.stamps)
    found = [float(row[0]) for row in (stream.texts if texts else stream.data)]
    assert found == list(values)


def test_a_file_is_read_while_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "x.xdf"
    with XdfWriter(path) as writer:
        number = writer.add_stream(StreamHeader("n", "EEG", channels(len(COLUMNS))))
        for k, row in enumerate(frames(50)):
            writer.write_sample(number, stamp(k), row)
            assert len(read_xdf(path).stream("n").stamps) == k + 1


@pytest.mark.slow
def test_long_runs_of_equal_frames_read_as_pyxdf_reads_them(tmp_path: Path) -> None:
    # They are viewed in one piece, not read sample by sample; what that saves is in
    # benchmarks/recording.py.
    path = write(tmp_path / "x.xdf", 24_000)
    ours = read_xdf(path).stream("labcrane.frames")
    np.testing.assert_array_equal(ours.data, load(path)["labcrane.frames"]["time_series"])


def test_an_unknown_stream_is_named_with_those_there_are(tmp_path: Path) -> None:
    path = write(tmp_path / "x.xdf", 1)
    with pytest.raises(RecordingError, match=r"no stream 'EEG'; it has labcrane.frames, labcrane"):
        read_xdf(path).stream("EEG")


@pytest.mark.parametrize("content", [b"<?xml version", b"\x89HDF\r\n", b"XDF;"])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.xdf"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="not an XDF file"):
        read_xdf(path)
