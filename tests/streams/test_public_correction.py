"""The correction as others use it: on plain arrays, and on anybody's XDF file."""

import re
import struct
from pathlib import Path

import h5py
import numpy as np
import pytest
from streams.synthetic import SourceClock, probe, source
from streams.unkind import Clock, probes, regular

from labcrane import RecordingError
from labcrane.clocks import correct
from labcrane.streams.sync.correction import Treatment
from labcrane.streams.sync.correction import correct as correct_raw
from labcrane.streams.sync.pool import pooled
from labcrane.streams.sync.raw import RawStream, unwrapped
from labcrane.testing import main


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(3)


def test_plain_arrays_are_corrected_within_what_is_said(random: np.random.Generator) -> None:
    times = regular(random, 250.0)
    clock = Clock(random)
    shown = probes(clock, times[0], times[-1], random)[:, :3]
    corrected = correct(clock(times), probes=shown[::-1], arrivals=times + 2e-4, rate_hz=250.0)
    error = np.abs(corrected.time - times)
    assert (error <= corrected.error).all()
    assert np.quantile(error, 0.95) < 1e-4
    assert np.median(corrected.error) < 3e-4
    assert set(corrected.basis) == {0}


def test_a_lag_that_may_be_a_clock_behind_is_in_the_uncertainty(
    random: np.random.Generator,
) -> None:
    times, clock = regular(random, 250.0), Clock(random)
    shown = probes(clock, times[0], times[-1], random)[:, :3]
    lag = float(random.uniform(6e-3, 0.04))
    corrected = correct(clock(times), probes=shown, arrivals=times + lag, rate_hz=250.0)
    assert lag - 1e-4 < np.median(corrected.error) < lag + 1e-3


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"stamps": np.zeros((3, 2))}, r"stamps must have the shape \(n,\), but have \(3, 2\)"),
        ({"arrivals": np.zeros(4)}, r"arrivals must have the shape \(3,\), one per stamp"),
        ({"counter": [0.0, np.nan, 2.0]}, "counter contain values that are not numbers"),
        ({"probes": np.zeros((5, 4))}, "remote time, offset, round trip; they have the shape"),
        (
            {"probes": [[0.0, 0.0, 1e-3], [1.0, 0.0, -1e-3]]},
            "are -0.001 s at least; they must not be negative",
        ),
        ({"rate_hz": np.nan}, "rate_hz is nan; it must be a finite number and not negative"),
        ({"rate_hz": -3.0}, "rate_hz is -3.0; it must be a finite number and not negative"),
        ({"latency_s": np.nan}, "latency_s is nan; it must be a finite number"),
        ({"end": np.inf}, "end is inf; it must be a finite number"),
        ({"evening": "maybe"}, "evening is 'maybe'; it may be 'auto', 'forbid', 'force'"),
        ({"stamped": "sent"}, "stamped is 'sent'; it may be '', 'at_sampling', 'when_sent'"),
        ({"stamped": "at_sampling", "evening": "force"}, "evening is 'force', but timestamps"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(wrong: dict, said: str) -> None:
    given = {"stamps": np.arange(3.0), **wrong}
    with pytest.raises(RecordingError, match=said):
        correct(given.pop("stamps"), **given)


@pytest.mark.parametrize("highest", [255, 65535, 99])
def test_a_counter_is_unwrapped_and_keeps_its_gaps(highest: int) -> None:
    truth = np.delete(np.arange(200_000.0), [500, 501, 90_000])
    np.testing.assert_array_equal(unwrapped(truth % (highest + 1)), truth)


def test_what_does_not_count_is_no_counter(random: np.random.Generator) -> None:
    assert unwrapped(np.zeros(100)) is None
    assert unwrapped(random.normal(size=100)) is None
    assert unwrapped(np.empty(0)) is None


@pytest.mark.parametrize("seed", range(4))
def test_two_devices_of_one_computer_agree(seed: int) -> None:
    """Each is probed on its own, over a way that delays one of them more."""
    random = np.random.default_rng(seed)
    times = regular(random, 100.0, 100, 200)
    clock = Clock(random)
    raws = [
        RawStream(clock(times), probes(clock, times[0], times[-1], random, way=way, reply=reply))
        for way, reply in ((5e-5, 0.0), (1.5e-4, 0.002))
    ]
    apart = [
        correct_raw(pair[0], Treatment(100.0)).time - correct_raw(pair[1], Treatment(100.0)).time
        for pair in (raws, pooled(raws, ["lab", "lab"]))
    ]
    assert np.abs(apart[1]).max() < 5e-5
    assert np.abs(apart[1]).max() < np.abs(apart[0]).max()


@pytest.mark.parametrize("seed", range(4))
def test_markers_and_samples_agree_as_stated_while_their_clock_is_turned(seed: int) -> None:
    """Every probe waits meanwhile, and one has no stamps that show whether it stepped."""
    random = np.random.default_rng(seed)
    clock = Clock(random)
    clock.slew(random.choice([-1, 1]) * random.uniform(1e-3, 4e-3), 1050.0, 1070.0)

    def busy(t: float, random: np.random.Generator) -> np.ndarray:
        return random.exponential(0.004 if 1040.0 < t < 1080.0 else 1e-5, (2, 8))

    samples = regular(random, 250.0, 120, 160)
    markers = np.sort(random.uniform(1001.0, samples[-1] - 1.0, 400))
    given = [
        RawStream(clock(times), probes(clock, 1000.5, samples[-1], random, congestion=busy))
        for times in (samples, markers)
    ]
    placed, told = (
        correct_raw(raw, Treatment(rate))
        for raw, rate in zip(pooled(given, ["lab", "lab"]), (250.0, 0.0), strict=True)
    )
    off = told.time - markers - np.interp(markers, samples, placed.time - samples)
    stated = told.error + np.interp(markers, samples, placed.error)
    assert np.mean(np.abs(off) <= stated) >= 0.95


def test_clocks_that_differ_are_not_pooled_whatever_their_host_is_called(
    random: np.random.Generator,
) -> None:
    times = 100.0 + np.arange(3000) / 100.0
    raws = [source(SourceClock(offset=offset), times, random) for offset in (1000.0, 1000.3)]
    for raw, alone in zip(pooled(raws, ["lab", "lab"]), raws, strict=True):
        assert raw.probes is alone.probes
    alike = [source(SourceClock(), times, random) for _ in range(2)]
    for raw, alone in zip(pooled(alike, ["", ""]), alike, strict=True):
        assert raw.probes is alone.probes


def chunk(tag: int, content: bytes) -> bytes:
    """Return a chunk of XDF 1.0, with its length in as few bytes as it needs, as LabRecorder."""
    return varlen(len(content) + 2) + struct.pack("<H", tag) + content


def varlen(number: int) -> bytes:
    short = number < 256
    return struct.pack("<BB", 1, number) if short else struct.pack("<BI", 4, number)


def as_labrecorder_writes(path: Path, random: np.random.Generator) -> dict[str, np.ndarray]:
    """Write an amplifier and markers byte for byte as LabRecorder 1.16 does; return true times.

    Nothing of it is by our writer: boundaries, stamps left out where they follow from the rate,
    offsets every 5 s paired with the time of asking, footers with the offsets again.
    """
    times = {
        "EEG": 100.0 + np.arange(30_000) / 250.0,
        "Markers": np.sort(random.uniform(101, 219, 60)),
    }
    clock = SourceClock(ppm=100.0)
    shown = probe(clock, 100.3, 221.0, random, every=2.0)
    with path.open("wb") as file:
        file.write(b"XDF:" + chunk(1, b"<?xml version='1.0'?><info><version>1.0</version></info>"))
        for number, (name, form, rate) in enumerate(
            [("EEG", "float32", 250.0), ("Markers", "string", 0.0)], 1
        ):
            text = (
                f"<?xml version='1.0'?><info><name>{name}</name><type>{name}</type>"
                f"<channel_count>1</channel_count><nominal_srate>{rate}</nominal_srate>"
                f"<channel_format>{form}</channel_format><source_id>{name}-7</source_id>"
                "<version>1.1</version><created_at>1.5</created_at><uid>a-b</uid>"
                "<session_id>default</session_id><hostname>amp-pc</hostname>"
                "<v4address /><v4data_port>16573</v4data_port>"
                "<v4service_port>16573</v4service_port>"
                "<v6address /><v6data_port>0</v6data_port><v6service_port>0</v6service_port>"
                "<desc /></info>"
            )
            file.write(chunk(2, struct.pack("<I", number) + text.encode()))
        footers: dict[int, str] = {1: "", 2: ""}
        for begin in np.arange(100.0, 222.0, 0.5):  # LabRecorder pulls every half second
            for number, name in enumerate(times, 1):
                here = times[name][(times[name] >= begin) & (times[name] < begin + 0.5)]
                body, last = b"", None
                for at in clock(here):
                    deduced = number == 1 and last is not None and abs(at - last - 0.004) < 1e-9
                    body += b"\0" if deduced else struct.pack("<Bd", 8, at)
                    body += struct.pack("<f", 1.0) if number == 1 else varlen(2) + b"go"
                    last = at
                if len(here):
                    head = struct.pack("<IBI", number, 4, len(here))
                    file.write(chunk(3, head + body))
                if begin % 5.0 == 2.0:
                    offset = shown[np.searchsorted(shown[:, 3], begin) - 1, 1]
                    file.write(chunk(4, struct.pack("<Idd", number, begin - offset, offset)))
                    footers[number] += (
                        f"<offset><time>{begin - offset}</time><value>{offset}</value></offset>"
                    )
            if begin % 10.0 == 0.0:
                file.write(chunk(5, bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4")))
        for number, name in enumerate(times, 1):
            first, last = clock(times[name][[0, -1]])
            text = (
                f"<?xml version='1.0'?><info><first_timestamp>{first}</first_timestamp>"
                f"<last_timestamp>{last}</last_timestamp>"
                f"<sample_count>{len(times[name])}</sample_count>"
                f"<clock_offsets>{footers[number]}</clock_offsets></info>"
            )
            file.write(chunk(6, struct.pack("<I", number) + text.encode()))
    return times


def test_an_xdf_file_of_labrecorder_is_corrected_and_certified(
    tmp_path: Path, random: np.random.Generator, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "others.xdf"
    times = as_labrecorder_writes(path, random)
    before = path.read_bytes()
    assert main(["resync", str(path)]) == 0
    said = capsys.readouterr().out
    assert "EEG: pyxdf's times are" in said
    words = " ".join(said.split())
    assert "nothing shows from which clock its timestamps are" in words
    assert "its clock probes' round trips were not recorded; 1 ms is assumed" in words
    assert "PASS" not in words
    assert path.read_bytes() == before
    with h5py.File(tmp_path / "others_resync.h5") as file:
        for name, true in times.items():
            error = np.abs(file[f"{name}/time"][:] - true)
            assert (error <= file[f"{name}/time_error"][:]).all()
            assert np.quantile(error, 0.95) < 1.5e-4


@pytest.mark.parametrize("share", [0.0, 0.02, 0.98, 1.0])
def test_a_way_that_takes_long_in_one_direction_alone_is_in_the_uncertainty(
    share: float, random: np.random.Generator
) -> None:
    """Nobody can see it: half of the shortest round trip is the most that it hides."""
    times, clock, way = regular(random, 250.0), Clock(random), float(random.uniform(1e-3, 5e-3))
    shown = probes(clock, times[0], times[-1], random, way=way, share=share)[:, :3]
    corrected = correct(clock(times), probes=shown, arrivals=times + 2e-4, rate_hz=250.0)
    error = np.abs(corrected.time - times)
    assert np.median(error) > 0.9 * way
    assert (error <= corrected.error).mean() >= 0.95


@pytest.mark.parametrize("seed", range(20))
def test_the_last_chunk_may_be_a_part_of_one(seed: int) -> None:
    random = np.random.default_rng(seed)
    size = int(random.integers(2, 65))
    count = 40 * size + int(random.integers(1, size))
    times = 100.0 + np.arange(count) / 250.0
    clock = SourceClock(ppm=50.0)
    came = times[np.minimum((np.arange(count) // size + 1) * size, count) - 1] + 0.001
    shown = probe(clock, 100.1, times[-1], random, every=1.0)[:, :3]
    found = correct(clock(times), probes=shown, arrivals=came, rate_hz=250.0)
    assert (np.abs(found.time - times) <= found.error).mean() >= 0.95


def test_what_of_an_xdf_file_could_not_be_read_is_told(
    tmp_path: Path, random: np.random.Generator, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "others.xdf"
    as_labrecorder_writes(path, random)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * random.uniform(0.4, 0.8))])
    assert main(["resync", str(path)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(
        r"others.xdf: its last \d+ bytes are not a complete XDF chunk and were left", said
    )


def test_the_name_of_an_xdf_file_may_be_in_capitals_but_a_packed_one_is_refused(
    tmp_path: Path, random: np.random.Generator, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both were taken for HDF5."""
    path = tmp_path / "others.XDF"
    as_labrecorder_writes(path, random)
    assert main(["resync", str(path)]) == 0
    assert (tmp_path / "others_resync.h5").is_file()
    packed = tmp_path / "others.xdfz"
    packed.write_bytes(b"")
    assert main(["resync", str(packed)]) == 1
    assert "is packed: unpack it into an .xdf file first" in " ".join(
        capsys.readouterr().err.split()
    )


def test_an_xdf_file_that_is_not_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["resync", str(tmp_path / "no.xdf")]) == 1
    assert "there is no XDF file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("tick_s", "count"),
    [
        *((tick_s, 150) for tick_s in (1 / 30, 1 / 60, 1 / 75, 0.0156001, 0.0100004)),
        *((tick_s, n) for tick_s in (1.0, 0.1, 1 / 60, 1 / 64, 1e-2, 1e-3) for n in (3, 7, 19)),
    ],
)
def test_events_of_a_clock_that_ticks_are_within_what_is_stated(tick_s: float, count: int) -> None:
    """As frames of a screen, or Windows' timer: ticks of no whole number of microseconds."""
    for seed in range(3):
        draw = np.random.default_rng([seed, 67])
        true = np.sort(draw.uniform(1.0, 300.0, count))
        ahead = draw.uniform(0.0, 5000.0)
        stamps = np.floor((true + ahead) / tick_s) * tick_s
        asked = np.arange(0.5, 302.0, 2.0)
        offset = -ahead + draw.uniform(-3e-5, 3e-5, len(asked))
        trips = 2e-4 + draw.exponential(5e-5, len(asked))
        found = correct(stamps, probes=np.column_stack([asked + ahead, offset, trips]), rate_hz=0.0)
        assert np.mean(np.abs(found.time - true) <= found.error) >= 0.95


@pytest.mark.parametrize("rate", [20.0, 25.0, 30.0, 50.0, 75.0, 100.0, 250.0])
@pytest.mark.parametrize("tick_s", [1 / 64, 0.0156001])
def test_samples_stamped_by_windows_timer_in_milliseconds_are_within_what_is_stated(
    tick_s: float, rate: float
) -> None:
    for seed in range(4):
        draw = np.random.default_rng([seed, 9])
        true = 1.0 + np.arange(180 * int(rate)) / rate * (1.0 + draw.uniform(-4e-5, 4e-5))
        ahead = draw.uniform(0.0, 5000.0)
        told = true + 1e-3 + draw.exponential(3e-4, len(true)) + ahead
        stamps = np.floor(np.floor(told / tick_s) * tick_s / 1e-3 + 1e-6) * 1e-3
        asked = np.arange(0.5, 183.0, 2.0)
        offset = -ahead + draw.uniform(-3e-5, 3e-5, len(asked))
        trips = 2e-4 + draw.exponential(5e-5, len(asked))
        probes = np.column_stack([asked + ahead, offset, trips])
        came = np.maximum.accumulate(true + 3e-3 + draw.exponential(1e-3, len(true)))
        arrivals = came if seed % 2 else None
        found = correct(stamps, probes=probes, rate_hz=rate, arrivals=arrivals)
        assert np.mean(np.abs(found.time - true) <= found.error) >= 0.95


@pytest.mark.parametrize("every_s", [2.0, 1.0, 0.8, 0.75, 1 / 3])
@pytest.mark.parametrize("count", [3, 5, 10, 19, 20, 100])
def test_markers_on_a_schedule_are_of_no_coarse_clock(every_s: float, count: int) -> None:
    draw = np.random.default_rng([count, round(1e3 * every_s)])
    pauses = np.r_[draw.choice([1.0, 1.0, 2.0, 3.0], count - 1), 2.0]
    true = 1.0 + np.cumsum(every_s * pauses) + draw.normal(0.0, 1e-4, count)
    asked = np.arange(0.2, true[-1] + 3.0, 2.0)
    probes = np.column_stack(
        [asked + 100.0, np.full(len(asked), -100.0), np.full(len(asked), 3e-4)]
    )
    found = correct(true + 100.0, probes=probes, rate_hz=0.0)
    assert found.error.max() < 1e-3


def test_a_packet_of_one_stamp_behind_a_restart_is_corrected() -> None:
    """A period of 0 was divided by."""
    taken = np.r_[1.0 + np.arange(3000) / 100, 41.0 + np.arange(20) / 100]
    packets = np.arange(3020) // 20 * 20 + 19
    sent = taken[packets] + 0.004
    asked = np.r_[np.arange(0.2, 31.0, 2.0), 41.1, 41.6, 42.5, 44.0]
    ahead = np.where(asked < 36.0, 100.0, 500.0)
    probes = np.column_stack([asked + ahead, -ahead, np.full(len(asked), 3e-4)])
    found = correct(sent + np.where(sent < 36.0, 100.0, 500.0), probes=probes, rate_hz=100.0)
    assert np.mean(np.abs(found.time - taken) <= found.error) >= 0.95
