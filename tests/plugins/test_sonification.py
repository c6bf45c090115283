"""The tone: its laws against closed forms, and the sound itself against a spectrum."""

import math
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from needs import needs
from programs import ran
from pydantic import ValidationError

from labcrane import Feedback, Frame, Signal
from labcrane.testing import TARGETS, FeedbackContract, ch8, make_run, make_target, opened
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.sonification import Sonification
from labcrane_sonification.synth import Synth, offline_server
from labcrane_sonification.tone import Tone, gains, tone, weighted
from labcrane_sphere.settings import SphereSettings

RATE = 48000
BLOCKS = (64, 128, 256, 512, 1024)
RUN = make_run(ch8(), task=TARGETS)


class TestSonification(FeedbackContract):
    """Offered as "sonification"."""

    @pytest.fixture
    def feedback(self) -> Feedback:
        return Sonification(SonificationSettings(), offline_server)


@contextmanager
def a_synth(**settings: object) -> Iterator[Synth]:
    made = SonificationSettings(**settings)
    with closing(Synth(offline_server(made), made)) as synth:
        yield synth


def blocks(synth: Synth, seconds: float) -> np.ndarray:
    count = round(seconds * RATE / synth.server.getBufferSize())
    return np.concatenate([synth.block() for _ in range(count)])


def pitch_of(sound: np.ndarray) -> float:
    """Return the frequency in Hz of the strongest partial, between the bins of a spectrum."""
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound)), 1 << 20))
    peak = int(spectrum.argmax())
    a, b, c = np.log(spectrum[peak - 1 : peak + 2])
    return (peak + 0.5 * (a - c) / (a - 2 * b + c)) * RATE / (1 << 20)


def test_pitch_rises_by_equal_intervals_as_the_tip_comes_closer() -> None:
    settings = SonificationSettings(far=4.0, pitch_hz=(220.0, 880.0))
    pitches = [tone(settings, distance, 0.0, 0.0).pitch for distance in (9, 4, 3, 2, 1, 0)]
    np.testing.assert_allclose(pitches, 220 * 2 ** np.array([0, 0, 0.5, 1, 1.5, 2]))


def test_overtones_and_level_go_from_far_to_near() -> None:
    settings = SonificationSettings(far=5.0, overtones=(0, 5), level=(0.1, 0.4), weighting="none")
    tones = [tone(settings, float(distance), 0.0, 0.0) for distance in range(6)]
    assert [t.overtones for t in tones] == [5, 4, 3, 2, 1, 0]
    np.testing.assert_allclose([t.level for t in tones], [0.4, 0.34, 0.28, 0.22, 0.16, 0.1])


@pytest.mark.parametrize(("pan", "sign"), [("towards", -1.0), ("away", 1.0), ("none", 0.0)])
def test_a_target_to_the_left_sounds_from_its_side(pan: str, sign: float) -> None:
    settings = SonificationSettings(pan=pan, aside=2.0)
    assert tone(settings, 3.0, 1.0, 0.0).pan == 0.5 * sign
    assert tone(settings, 3.0, 5.0, 0.0).pan == sign


def test_panning_keeps_the_power() -> None:
    for pan in np.linspace(-1, 1, 9):
        left, right = gains(pan)
        assert left**2 + right**2 == pytest.approx(1.0)
    assert gains(-1.0)[1] == pytest.approx(0.0)
    assert gains(1.0)[0] == pytest.approx(0.0)


def inside(number: int, *, away: float = 0.1) -> Frame:
    frame = make_target(RUN, number)
    frame.task[:3] = frame.state[8:11] + np.array((away, 0.0, 0.0))
    return frame


def test_the_time_inside_counts_from_the_last_entry() -> None:
    sonification = Sonification(SonificationSettings(silent_after_s=0.3), offline_server)
    with opened(sonification, RUN):
        levels = [sonification.present(inside(number))[2] for number in (0, 60, 72, 84)]
        assert [level > 0 for level in levels] == [True, True, False, False]
        assert sonification.present(inside(90, away=1.0))[2] > 0
        assert sonification.present(inside(100))[2] > 0


def test_laws_change_while_the_server_runs_and_its_own_settings_do_not() -> None:
    sonification = Sonification(SonificationSettings(far=4.0), offline_server)
    assert not sonification.adjust(SonificationSettings(far=2.0))  # it is not open
    with opened(sonification, RUN):
        made, frame = sonification.synth, make_target(RUN)
        wide = sonification.present(frame)
        assert sonification.adjust(SonificationSettings(far=9.0, pan="away", ramp_s=0.0))
        assert sonification.synth is made
        narrow = sonification.present(frame)
        distance = np.linalg.norm(frame.task[:3] - frame.state[8:11])
        expected = [220 * 4 ** (1 - min(distance / far, 1)) for far in (4.0, 9.0)]
        np.testing.assert_allclose([wide[0], narrow[0]], expected)
        assert narrow[3] == -wide[3] != 0.0
        for other in ({"block": 512}, {"driver": "jack"}, {"overtones": (0, 9)}):
            assert not sonification.adjust(SonificationSettings(far=9.0, **other))


def test_its_loudness_follows_an_estimate_as_a_factor_of_the_level() -> None:
    law = {"estimate": "load.ratio", "between": [1, 3], "to": [1, 0.5], "at_most_per_s": 0.5}
    run = make_run(ch8(), axes=[Signal("estimate.load.ratio", "")], task=TARGETS)
    full = Sonification(SonificationSettings(), offline_server)
    follows = Sonification(SonificationSettings(loudness=law), offline_server)
    with opened(full, run), opened(follows, run):
        for elapsed, factor in ((0.0, 1.0), (0.5, 0.75), (2.0, 0.5)):
            frame = make_target(run)
            frame.axes[:], frame.elapsed = 4.0, elapsed
            *_, loudness = shown = follows.present(frame)
            assert loudness == pytest.approx(factor)
            assert shown[2] == pytest.approx(factor * full.present(frame)[2])
        assert follows.adjust(SonificationSettings(loudness=law, far=9.0))
        assert follows.present(frame)[-1] == pytest.approx(0.5), "it goes on where it was"
        assert full.adjust(SonificationSettings(loudness=0.2))
        assert full.present(frame)[2] == pytest.approx(0.4 * shown[2])


def test_a_paused_session_is_silent() -> None:
    sonification = Sonification(SonificationSettings(), offline_server)
    with opened(sonification, RUN):
        frame = make_target(RUN)
        assert sonification.present(frame)[2] > 0
        frame.paused = True
        assert sonification.present(frame)[2] == 0


@pytest.mark.parametrize("block", BLOCKS)
def test_the_sound_has_the_pitch_of_the_law_within_five_cents(block: int) -> None:
    settings = SonificationSettings(block=block)
    with a_synth(block=block) as synth:
        for distance in (3.5, 1.3, 0.0):
            wanted = tone(settings, distance, 0.0, 0.0)
            synth.sound(wanted)
            blocks(synth, 0.1)
            heard = pitch_of(blocks(synth, 0.5)[:, 0])
            assert abs(1200 * math.log2(heard / wanted.pitch)) < 5.0


def test_partials_have_the_levels_of_the_law() -> None:
    with a_synth() as synth:
        synth.sound(Tone(pitch=480.0, overtones=3.0, level=0.2, pan=-1.0))
        blocks(synth, 0.1)
        sound = blocks(synth, 0.8)  # whole periods
    count = len(sound)
    spectrum = np.abs(np.fft.rfft(sound[:, 0] * np.hanning(count))) / count * 4
    peaks = [spectrum[round(480 * n * count / RATE) + np.arange(-3, 4)].max() for n in range(1, 6)]
    np.testing.assert_allclose(peaks[:4], 0.2 / np.arange(1, 5), rtol=0.03)
    assert peaks[4] < 1e-4
    assert np.abs(sound[:, 1]).max() < 1e-4  # panned to the left


@pytest.mark.parametrize("block", BLOCKS)
def test_a_change_is_heard_from_the_next_block_on(block: int) -> None:
    with a_synth(block=block, ramp_s=0.0) as synth:
        assert not synth.block().any()
        synth.sound(Tone(pitch=1000.0, overtones=0.0, level=0.5, pan=0.0))
        assert np.abs(synth.block()[1:]).max() > 0.1


def test_a_ramped_change_does_not_click() -> None:
    # A click is a jump: a jump of the signal's slope beyond what its partials themselves have.
    wanted = Tone(pitch=300.0, overtones=0.0, level=0.5, pan=0.0)
    largest = {}
    for ramp in (0.0, 0.015):
        with a_synth(ramp_s=ramp, overtones=(0, 0)) as synth:
            synth.sound(wanted)
            before = blocks(synth, 0.2)
            synth.silence()
            after = blocks(synth, 0.05)
        steps = np.abs(np.diff(np.concatenate([before[2000:], after])[:, 0]))
        largest[ramp] = steps.max() / (2 * math.pi * 300 / RATE * 0.5 * math.sqrt(0.5))
    assert largest[0.015] < 1.1
    assert largest[0.0] > 3.0


def test_impossible_settings_are_refused() -> None:
    with pytest.raises(ValidationError, match="level must be 0 to 1, but is 0, 2"):
        SonificationSettings(level=(0.0, 2.0))
    with pytest.raises(ValidationError, match="overtones must be 0 to 15, but are 0, 99"):
        SonificationSettings(overtones=(0, 99))
    with pytest.raises(ValidationError, match="it is -3, and devices are counted from 0; leave it"):
        SonificationSettings(device=-3)
    recorded = SonificationSettings.model_validate({"device": -1}, context={"recorded": True})
    assert recorded.device == -1


def test_a_python_without_tkinter_says_nothing_of_it() -> None:
    code = "import sys; sys.modules['tkinter'] = None; import labcrane_sonification.synth"
    done = ran([sys.executable, "-c", code], check=True)
    assert done.stdout == ""


NO_DEVICE = """
from labcrane import DeviceError
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.synth import server
try:
    server(SonificationSettings(driver={driver!r}, device={device!r}))
except DeviceError as error:
    print(error)
"""


def refusal(driver: str = "portaudio", device: int | None = None, **env: str) -> str:
    """Return what is said when a sound server is asked for in a process of its own."""
    done = ran(
        [sys.executable, "-c", NO_DEVICE.format(driver=driver, device=device)],
        env={"JACK_DEFAULT_SERVER": "nobody", **env},
    )
    assert done.returncode == 0, done.stderr  # pyo itself would end with a segmentation fault
    return done.stdout


@needs("alsa.conf", "no sound card")
def test_a_computer_without_sound_is_told_so() -> None:
    said = refusal()
    assert said.startswith("there is no sound output device; connect one, use driver: jack, or")


def null_device(folder: Path) -> str:
    """Return an ALSA configuration whose only device takes everything and sounds nothing."""
    config = folder / "asoundrc"
    config.write_text("pcm.!default { type null }\nctl.!default { type null }\n", encoding="utf-8")
    return str(config)


def test_an_unknown_device_is_refused(tmp_path: Path) -> None:
    said = refusal(device=99, ALSA_CONFIG_PATH=null_device(tmp_path))
    assert "there is no sound output device 99; there is " in said


def test_a_missing_jack_server_is_told_so() -> None:
    assert "in blocks of 256 samples; start a JACK server first" in refusal(driver="jack")


def test_the_weighting_is_that_of_the_standards_table() -> None:
    """IEC 61672-1, table 3, in dB to one decimal."""
    table = {63.0957: -26.2, 125.893: -16.1, 251.189: -8.6, 501.187: -3.2, 1000.0: 0.0,
             1995.26: 1.2, 3981.07: 1.0, 7943.28: -1.1, 15848.9: -6.6}  # fmt: skip
    ours = 20.0 * np.log10(weighted(np.array(list(table))))
    np.testing.assert_allclose(ours, list(table.values()), atol=0.051)


def level_of(sound: np.ndarray) -> float:
    """Return the A-weighted level of a sound in dB, from its spectrum and the standard's table."""
    hertz = [31.6228, 63.0957, 125.893, 251.189, 501.187, 1000.0, 1995.26, 3981.07, 7943.28]
    decibels = [-39.4, -26.2, -16.1, -8.6, -3.2, 0.0, 1.2, 1.0, -1.1]
    power = np.abs(np.fft.rfft(sound * np.hanning(len(sound)))) ** 2
    found = np.fft.rfftfreq(len(sound), 1.0 / RATE)[1:]
    weights = np.interp(np.log(found), np.log(hertz), decibels)
    return float(10.0 * np.log10(np.sum(power[1:] * 10.0 ** (weights / 10.0))))


def test_at_one_level_the_tone_is_equally_loud_at_every_distance() -> None:
    levels = {}
    for weighting in ("a", "none"):
        with a_synth(weighting=weighting) as synth:
            settings = SonificationSettings(weighting=weighting)
            for distance in (4.0, 3.1, 2.3, 1.7, 0.9, 0.4, 0.0):
                wanted = tone(settings, distance, 0.0, 0.0)
                assert 0.0 < wanted.level <= 0.3001, "it is never more than the level"
                synth.sound(wanted)
                blocks(synth, 0.1)
                levels.setdefault(weighting, []).append(level_of(blocks(synth, 0.4)[:, 0]))
    assert np.ptp(levels["a"]) < 1.0  # the table is read between its octaves
    assert np.ptp(levels["none"]) > 10.0


@pytest.mark.parametrize(
    ("wrong", "said", "right"),
    [
        ({"level": (1.0, 1.0), "pitch_hz": (880.0, 220.0)},
         "level is 1, 1, and the fundamental and its overtones add up to 2.45 at 0 m from the "
         r"target, where 1 is all .* write level: \[0.4, 0.4\], or fewer overtones",
         {"level": (0.4, 0.4)}),
        ({"overtones": (15, 15), "weighting": "none"}, r"add up to 1\.014 .* level: \[0.29, 0.29\]",
         {"level": (0.29, 0.29)}),
    ],
)  # fmt: skip
def test_a_tone_louder_than_full_scale_is_refused_with_a_level_that_can_be_played(
    wrong: dict[str, object], said: str, right: dict[str, object]
) -> None:
    with pytest.raises(ValidationError, match=said):
        SonificationSettings.model_validate(wrong)
    assert SonificationSettings.model_validate({**wrong, **right})
    was_run = SonificationSettings.model_validate(wrong, context={"recorded": True})
    assert was_run.overtones == wrong.get("overtones", (0, 5))


def test_the_shipped_groups_of_sphere_and_tone_are_told_the_same() -> None:
    tone_alone = SonificationSettings(pan="none", silent_after_s=None)
    assert tone_alone.reveals() == SphereSettings().reveals()
    assert set(SonificationSettings().reveals()) > set(tone_alone.reveals())


@pytest.mark.parametrize(
    "settings",
    [
        SphereSettings(smallest=0.3, largest=0.3, brightness="constant"),
        SonificationSettings(
            pitch_hz=(440.0, 440.0), overtones=(2, 2), pan="none", silent_after_s=None
        ),
        SonificationSettings(level=(0.0, 0.0)),
    ],
)
def test_a_cue_that_is_constant_tells_nothing(
    settings: SphereSettings | SonificationSettings,
) -> None:
    assert settings.reveals() == ()


def test_a_tone_whose_level_alone_changes_tells_the_distance() -> None:
    louder = SonificationSettings(pitch_hz=(440.0, 440.0), overtones=(2, 2), level=(0.1, 0.3))
    assert str(louder.reveals()[0]) == "how far the tip is from the target, up to 4 m"
    assert "pitch_hz" not in louder.doubts(ch8())
