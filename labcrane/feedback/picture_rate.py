"""Rate of pictures that a study's own views reach on this computer, before anyone sits down."""

import time
from pathlib import Path

from labcrane.analysis.presented import PresentedLimits, operators_views
from labcrane.core.findings import Finding, Verdict
from labcrane.core.records import Frame, SessionState
from labcrane.doctor.check_process import Call
from labcrane.errors import DeviceError
from labcrane.feedback.presenter import Presenter
from labcrane.feedback.preview import chosen
from labcrane.feedback.processes import host_orders
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study, load
from labcrane.registry.registry import discover

WARM_UP_S, SHOWN_S = 0.5, 2.0
"""Duration of drawing before pictures are counted, and of counting."""

WAIT_S = 120.0
"""How long an examination may take: a movement is simulated first."""

SPARE = 2.0
"""Sufficient rate in multiples of the minimum: in a session other programs need the processor."""

ADVICE = "choose a lower quality or size, close other programs, or check the graphics driver"


def rate_examinations(study: Study) -> dict[str, Call]:
    """Return the examination of each view of the operator, by its name."""
    folder = study.path.parent
    described = {f"views.{name}": each.described(folder) for name, each in study.views.items()}
    return {
        name: Call(f"the pictures of view {name!r}", ADVICE, examine_rate, (study.path, name))
        for name in operators_views(described)
    }


def examine_rate(protocol: Path, name: str) -> list[Finding]:
    """Return the picture rate of a view, per second.

    It is opened alone, as in a session, and shows a simulated movement of the study with all of its
    cues switched on.
    """
    registry = discover(study=protocol)
    study = load(protocol, registry)
    frames, scene = chosen(study, None, 1, None)
    run = Rig.build(study, simulated=True).describe(study, participant_seed=0)
    (order,) = [each for each in host_orders(study, run, "doctor") if each.name == name]
    presenter = Presenter(order, registry)
    try:
        presenter.open()
        presenter.update(SessionState(scene=scene, active=tuple(presenter.cues)))
        return [judged(_rate_hz(presenter, frames), study.protocol.presented)]
    except DeviceError as error:
        return [Finding.failed(error)]
    finally:
        presenter.close()


def _rate_hz(presenter: Presenter, frames: list[Frame]) -> float:
    """Return the picture rate during a movement, per second."""
    begun = time.perf_counter()
    since, count = begun, 0
    for frame in frames:
        presenter.present(frame)
        now = time.perf_counter()
        if now - begun < WARM_UP_S:
            since = now
            continue
        count += 1
        if now - since >= SHOWN_S:
            break
    return count / max(time.perf_counter() - since, 1e-9)


def judged(rate_hz: float, limits: PresentedLimits) -> Finding:
    """Return the finding on a view that shows ``rate_hz`` pictures a second."""
    text = f"shows {rate_hz:.0f} pictures a second of this study; {limits.min_hz:g} are needed"
    if rate_hz < limits.min_hz:
        return Finding(Verdict.FAIL, f"{text}, so that no movement would be included", ADVICE)
    if rate_hz < SPARE * limits.min_hz:
        return Finding(Verdict.WARN, f"{text}, also while other programs run", ADVICE)
    return Finding(Verdict.PASS, text)
