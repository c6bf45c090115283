"""Questions about components, the machine and what they share."""

import math
from collections.abc import Mapping

from labcrane.core.references import Reference, mentioned
from labcrane.core.roles import Controller
from labcrane.files.system import is_there
from labcrane.files.yaml import Place
from labcrane.protocol.components import ComponentSpec
from labcrane.protocol.effective import written_numbers
from labcrane.protocol.pages import unserved
from labcrane.protocol.questions.question import (
    Doubts,
    asks,
    key_of,
)
from labcrane.protocol.study import Study

PLAUSIBLE: Mapping[str, tuple[float, float]] = {
    "m": (1e-5, 1000.0),
    "mm": (1e-2, 1e6),
    "s": (1e-5, 86_400.0),
    "deg": (0.0, 360.0),
    "rad": (0.0, 2 * math.pi),
    "arcmin": (0.0, 21_600.0),
    "Hz": (1e-3, 1e6),
    "kg": (1e-3, 1e5),
    "N": (1e-3, 1e7),
    "N m": (1e-3, 1e7),
    "m/s": (1e-5, 50.0),
    "deg/s": (1e-3, 720.0),
    "1/s": (1e-3, 1000.0),
    "day": (0.0, 3650.0),
    "ppm": (0.0, 1e6),
    "uV": (1e-3, 1e6),
    "px": (1.0, 1e5),
    "": (1e-12, 1e12),
}
"""Between which sizes a number of each unit can be meant in a study; 0 always can."""

ALIKE = 1.2
"""How many times as fast as another a scheme may be before a comparison is of speeds."""

FASTEST_HZ = 1000.0

SLOWEST_HZ = 20.0

FASTEST_JOINT_DEG_S = 360.0

HEAVIEST_LINK_KG = 50_000.0


@asks
def _of_sizes(study: Study) -> Doubts:
    """Question every number of implausible size, in its unit or without one."""
    for each in written_numbers(study):
        least, most = PLAUSIBLE[each.unit]
        said = f"{key_of(each.place)} is {each.value:g} {each.unit}".rstrip()
        if each.value and not least <= abs(each.value) <= most:
            yield each.place, said
        elif (size := each.usual) and each.value:
            if abs(each.value) > size.most:
                yield each.place, f"{said}, and {size.most:g} is very much"
            elif abs(each.value) < size.least:
                yield each.place, f"{said}, and {size.least:g} is very little"


@asks
def _of_components(study: Study) -> Doubts:
    for part, choice in study.choices.items():
        place: Place = tuple(part.split(".", 1))
        for key, text in choice.settings.doubts(study.machine).items():
            steps = [int(step) - 1 if step.isdecimal() else step for step in key.split(".")]
            yield (*place, *steps), f"{part}.{key} {text}"
        if part in {f"views.{name}" for name in study.views} and (
            told := choice.settings.reveals()
        ):
            yield (
                place,
                f"{part}: {choice.name} tells {' and '.join(map(str, told))}, in every "
                "group and block; put it under feedback, where the design says who is given it",
            )


@asks
def _of_the_loop(study: Study) -> Doubts:
    rate = study.protocol.rate_hz
    if rate > FASTEST_HZ:
        yield ("rate_hz",), f"rate_hz is {rate:g} Hz, and few computers hold more than 1000 Hz"
    elif rate < SLOWEST_HZ:
        yield ("rate_hz",), f"rate_hz is {rate:g} Hz, at which movements appear to jump"


@asks
def _of_the_machine(study: Study) -> Doubts:
    """Question joints that no crane has."""
    for joint, speed in zip(study.machine.joints, study.machine.speeds, strict=True):
        named = f"joint {joint.name!r} of the machine"
        if math.degrees(speed) > FASTEST_JOINT_DEG_S:
            said = f"{named} turns by {math.degrees(speed):.4g} degrees in a second"
            yield _of_joint(study, "speeds_deg_s", joint.name), said
        elif joint.mass_kg > HEAVIEST_LINK_KG:
            said = f"the link of {named} weighs {joint.mass_kg:g} kg"
            yield _of_joint(study, "", joint.name), said


def _of_joint(study: Study, key: str, joint: str) -> Place:
    """Return where the protocol says something of a joint, or names it; else the machine's file."""
    written = study.written.get("machine")
    described = written if isinstance(written, Mapping) else {}
    joints = described.get("joints", ())
    if joint in described.get(key, ()):
        return ("machine", key, joint)
    if isinstance(joints, Mapping):
        return ("machine", "joints", joint)
    return ("machine", "joints", joints.index(joint)) if joint in joints else ("machine",)


@asks
def _of_what_is_shared(study: Study) -> Doubts:
    """Question views that cover each other on one screen, and components that share a port."""
    first: dict[tuple[str, str], str] = {}
    for part, choice in study.choices.items():
        key, _, name = part.partition(".")
        given = choice.settings.provides(study.machine)
        for kind, does in (("screen", "fill"), ("port", "write to")):
            for what in given.get(kind, ()):
                if (other := first.setdefault((kind, what), name)) != name:
                    yield (key, name), f"{key} {other!r} and {name!r} both {does} {kind} {what}"


@asks
def _of_buttons(study: Study) -> Doubts:
    """Question a button that the scheme and a task both go by: one press does two things."""
    scheme = study.choices["scheme"].settings
    taken = {
        str(each.value): each.place
        for each in mentioned(scheme)
        if isinstance(each.mark, Reference) and each.mark.kind == "button"
    }
    for part, choice in study.choices.items():
        if part.startswith("tasks."):
            for button in choice.settings.needs(study.machine).get("button", ()):
                if button in taken:
                    yield (
                        tuple(part.split(".", 1)),
                        f"{part} goes by {button!r}, and so does {key_of(taken[button])} of the "
                        "scheme: one press does both",
                    )


@asks
def _of_schemes(study: Study) -> Doubts:
    """Question schemes of one study with which the tip cannot be moved alike fast."""
    if len(study.scheme.settings.provides(study.machine).get("scheme", ())) < 2:  # noqa: PLR2004
        return  # most studies have one, and nothing need be built
    scheme = study.scheme.build(study.machine)
    assert isinstance(scheme, Controller)  # noqa: S101 - the registry filed it under its role
    places = [place for task in study.tasks.values() for place in task.places()]
    speeds = scheme.attainable(places)
    if speeds and max(speeds.values()) > ALIKE * min(speeds.values()):
        said = ", ".join(f"{speed:.2f} m/s with {name}" for name, speed in speeds.items())
        yield (
            ("scheme",),
            f"the tip attains {said} at the study's targets (median over targets and directions), "
            "so that a comparison of the schemes finds their speeds; what is not given is worked "
            "out so that they are alike",
        )


@asks
def _of_monitors(study: Study) -> Doubts:
    """Question monitors of streams of another type than theirs."""
    for label, need in study.protocol.streams.items():
        choice = study.choices.get(f"monitors.{label}")
        types = choice.settings.provides(study.machine).get("stream type", ()) if choice else ()
        if choice and types and need.type and need.type.lower() not in map(str.lower, types):
            yield (
                ("monitors", label),
                f"monitors.{label} is {choice.name!r}, for streams of type {' or '.join(types)}, "
                f"and streams.{label} is of type {need.type!r}",
            )


def needs_people(operator: ComponentSpec) -> bool:
    """Whether the substitute of the input is itself hardware, or a view's keyboard."""
    shown = (each.mark for each in mentioned(operator.settings))
    return operator.offer.examine is not None or any(mark == Reference("view") for mark in shown)


@asks
def _of_the_pages(study: Study) -> Doubts:
    """Question what is the laboratory's, and not here: a check may be made at another desk."""
    page, folder = study.protocol.page, study.path.parent
    if study.recorded or page.certificate is None or page.key is None:
        return
    files = {"certificate": folder / page.certificate, "key": folder / page.key}
    for key, path in files.items():
        if not is_there(path):
            written = getattr(page, key)
            yield ("page", key), f"page.{key} is {str(written)!r}, which is not on this computer"
    if all(map(is_there, files.values())) and (why := unserved(**files)):
        yield ("page", "certificate"), why
