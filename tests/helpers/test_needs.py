"""What a test needs is skipped by its package's name, or missed where nothing may be skipped."""

import needs
import pytest


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer without Octave."""
    monkeypatch.setattr(needs.shutil, "which", lambda *_, **__: None)
    needs.missing.cache_clear()
    yield
    monkeypatch.undo()
    needs.missing.cache_clear()


@pytest.mark.usefixtures("bare")
def test_what_is_missing_skips_with_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(needs.SKIP_NOTHING, raising=False)
    with pytest.raises(pytest.skip.Exception) as skipped:
        needs.need("octave-cli", "jackd")
    assert str(skipped.value) == (
        "needs octave-cli (apt install octave), jackd (apt install jackd2)"
    )
    assert needs.not_tried([f"Skipped: {skipped.value}", f"Skipped: {skipped.value}"]) == [
        f"   2 not tried: {skipped.value}",
        "to try them: apt install jackd2 octave",
    ]


@pytest.mark.usefixtures("bare")
def test_where_nothing_may_be_skipped_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(needs.SKIP_NOTHING, "1")
    with pytest.raises(pytest.fail.Exception, match=r"needs octave-cli \(apt install octave\)"):
        needs.need("octave-cli")


def test_what_nobody_knows_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match=r"nothing is known of \['ocatve'\]; add it to"):
        needs.needs("ocatve")
