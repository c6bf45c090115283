"""What a check asks, how it is answered, and what a rehearsal finds."""

# ruff: noqa: E501 - a case is one line

import json
import re
from pathlib import Path
from random import Random
from shutil import copytree
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rehearsal import SHORT

from labcrane import ProtocolError
from labcrane.files.units import in_unit
from labcrane.protocol.design import RULES
from labcrane.protocol.effective import written_quantities
from labcrane.protocol.questions import about, questions
from labcrane.simulation import rehearsal
from labcrane.simulation.rehearsal import rehearse
from labcrane.testing import Study, discover, load, main, plan_session


def a_study(folder: Path, *changes: tuple[str, str]) -> Study:
    text = SHORT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "study.yaml"
    path.write_text(text)
    return load(path, discover(study=path))


KEYBOARD = (
    "input: {use: keyboard, view: front, axes: "
    "{slew: [a, d], elbow: [s, w], wrist: [j, l], shoulder: [k, i]}}"
)
BLOCK = "      - block: {task: aiming, pairs: 1}\n"
OWN = (
    "questionnaires: {q: {use: free, title: Q, questions: [{name: a, text: A}], sums: {s: [a]}}}\n"
)
RULE = "{questionnaire: q, score: s, above: 5}"
BALL = "feedback: {ball: {use: sphere}, tone: {use: sphere}}\nsessions:"
SEEN = f"views: {{front: {{use: view}}}}\n{BALL}"
GROUPS = f"design: {{groups: {{none: [], ball: [ball]}}}}\n{BALL}"

BOTH = "{ball: {use: sphere}, tone: {use: sonification}}"
NEAR = (
    "feedback: {ball: {use: sphere, far: 4.0}, "
    "tone: {use: sonification, far: 0.3, pan: none, silent_after_s: null}}\n"
    "design: {groups: {none: [], seen: [ball], heard: [tone]}}\n"
)
TWO_BLOCKS = "".join(
    BLOCK.replace("pairs", f"feedback: [{each}], pairs") for each in ("ball", "tone")
)
UNEQUAL = (
    "feedback: {ball: {use: sphere}, tone: {use: sonification}}\n"
    "design: {groups: {none: [], seen: [ball], heard: [tone], both: [ball, tone]}}\n"
)

MAP = "map: {slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}"
UNLIKE = [
    (
        f"use: joint_velocity\n  {MAP}",
        f"use: switchable\n  button: left.trigger\n  joint_velocity: {{{MAP}}}\n"
        "  end_effector: {speed_m_s: 0.5, map: {x: -left.y, y: -left.x, z: right.y}}",
    )
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "key", "said"),
    [
        ([("movements: 2", "movements: 2, limit_s: 0.3")], "tasks.aiming.limit_s", "at full speed"),
        ([(BLOCK, BLOCK.replace(", pairs: 1", ""))], "design.order.pairs", "for pairs of 'aiming', so they come as written, in one order for everybody"),
        ([("sessions:", "design: {order: {pairs: shuffled}}\nsessions:")], "sessions.1.steps.1.block.pairs",
         "takes 1 of the 2 pairs of 'aiming', whose order is shuffled: each participant does a different"),
        ([("sessions:", "design: {order: {pairs: {rule: shuffled, times: 2}}}\nsessions:"), ("pairs: 1", "pairs: 2")],
         "sessions.1.steps.1.block.pairs", "takes 2 of the 2 pairs"),
        ([("sessions:", "design: {order: {pairs: latin_square}}\nsessions:")], "sessions.1.steps.1.block.pairs", "whose order is latin_square"),
        # NASA-TLX has six answers; a repetition of this block has two trials, and an approach that is not counted.
        ([(BLOCK, BLOCK.replace("}", ", repeat: 26, ask: [nasa_tlx]}"))], "sessions.1.steps.1.block.ask",
         "6 answers after each of 52 trials are 312 in all; ask once, in a step of its own, or ask less"),
        ([(BLOCK, BLOCK.replace("block", "practice"))], "sessions", "no session has a block, only practice, whose trials are not counted"),
        ([(BLOCK, BLOCK.replace("block", "reference"))], "sessions", "no session has a block, only reference, whose"),
        ([(BLOCK, "      - questionnaire: nasa_tlx\n")], "sessions", "no session has a block, so a report has no result; write block"),
        ([("movements: 2", "movements: 2, limit_s: 5e6")], "tasks.aiming.limit_s", "5e+06 s"),
        ([(BLOCK, f"{BLOCK}      - break: {{seconds: 3 days}}\n")],
         "sessions.1.steps.2.break.seconds", "a break of 72 hours"),
        ([("movements: 2", "movements: 900"), (BLOCK, BLOCK.replace("pairs: 1", "repeat: 9"))], "sessions.1", "is likely to take"),
        ([("    steps:", "    after_days: [1, 2]\n    steps:")], "sessions.1.after_days", "no session before"),
        ([("rate_hz: 240", "rate_hz: 1500")], "rate_hz", "few computers hold"),
        ([("rate_hz: 240", "rate_hz: 10")], "rate_hz", "appear to jump"),
        ([("sessions:", BALL), (BLOCK, BLOCK.replace("pairs", "feedback: [ball], pairs"))],
         "feedback.tone", "never switched on"),
        ([("sessions:", GROUPS)], "design.groups", "no block has feedback: group"),
        ([("sessions:", "views: {v: {use: view, rate_hz: 10}}\nsessions:")], "views.v.rate_hz",
         "shows 10 pictures a second, but presented requires 15, so no movement counts"),
        ([("sessions:", "views: {v: {use: view}}\npresented: {max_gap_s: 2}\nsessions:")], "presented.max_gap_s",
         "presented allows 2 s without a picture, but min_hz requires pictures in every 1 s"),
        ([("sessions:", BALL)], "feedback.ball", "the operator has none, so that nobody sees it"),
        ([("sessions:", f"views: {{desk: {{use: view, seen_by: examiner, hud: []}}}}\n{BALL}")], "feedback.ball",
         "add one, as views: {operator: {use: view}}"),
        ([(BLOCK, f"      - fixation: {{}}\n{BLOCK}")], "sessions.1.steps.1.fixation",
         "the operator has no view, so that nobody sees them"),
        ([("sessions:", SEEN.replace("tone", "none"))], "feedback.none", "feedback is called 'none'"),
        ([("movements: 2", "movements: 2, rest_s: 100")], "tasks.aiming.limit_s",
         "takes more than 100 s"),
        ([("sessions:", f"participants: {{planned: 1}}\n{GROUPS}")], "participants.planned",
         "some have no participants"),
        ([("sessions:", f"participants: {{planned: 9}}\n{GROUPS}")], "participants.planned",
         "a multiple of 2 is"),
        ([("sessions:", "views: {front: {use: view, beside: [cab_left]}}\nsessions:")], "views.front.beside",
         "a second camera called 'cab_left'"),
        ([("sessions:", "views: {front: {use: view, size: [19200, 10800]}}\nsessions:")], "views.front.size",
         "more than any screen has"),
        ([("input: {use: dual_joystick}", KEYBOARD), ("left.x", "keyboard.slew"),
          ("sessions:", "views: {front: {use: view, keys: [a, d, s, w, j, l, k, i]}}\nsessions:"),
          ("left.y", "keyboard.elbow"), ("right.x", "keyboard.wrist"), ("right.y", "keyboard.shoulder")],
         "operator", "has no keyboard.slew, keyboard.elbow, keyboard.wrist, keyboard.shoulder"),
        ([("sessions:", "participants: {pattern: left.x}\nsessions:")], "participants.pattern",
         "with room for 1 participant,"),
        ([("sessions:", "page: {certificate: lab.pem, key: ../study.yaml}\nsessions:")],
         "page.certificate", "'lab.pem', which is not on this computer"),
        ([("sessions:", "participants: {pattern: P000, planned: 2}\nsessions:")], "participants.pattern",
         "with room for 2 participants"),
        ([("sessions:", "participants: {planned: 20_000}\nsessions:")], "participants.pattern",
         "with room for 20000 participants"),
        ([("name: only", "name: only\n    window_s: 10 s")], "sessions.1.window_s",
         "and may take 10 s"),
        ([(BLOCK, BLOCK.replace("block: {", "practice: {until: {successes: 9, rounds: 1}, "))],
         "sessions.1.steps.1.practice.until.successes", "9 successes in a row, and has 3 trials"),
        ([("sessions:", GROUPS.replace("none: []", "all: [ball]")),
          (BLOCK, BLOCK.replace("pairs", "feedback: group, pairs"))],
         "design.groups.ball", "groups 'all' and 'ball' are given the same feedback"),
        ([("sessions:", f"{UNEQUAL}sessions:"), (BLOCK, BLOCK.replace("pairs", "feedback: group, pairs"))],
         "design.groups.heard", "in 'heard' alone people learn on which side the target is and whether the tip is inside the target;"),
        ([("sessions:", f"{NEAR}sessions:"), (BLOCK, BLOCK.replace("pairs", "feedback: group, pairs"))],
         "design.groups.heard", "in 'seen' alone people learn how far the tip is from the target, up to 4 m; in 'heard' alone people learn how far the tip is from the target, up to 0.3 m; the effect"),
        ([("sessions:", f"feedback: {BOTH}\nsessions:"), (BLOCK, TWO_BLOCKS)], "sessions.1.steps.2.block",
         "blocks at step 1 of 'only' and step 2 of 'only' do not give the same information: in step 2 of 'only' alone people learn on which side the target is and whether the tip is inside the target; the effect"),
        ([("sessions:", "feedback: {ball: {use: sphere, smallest: 0.3, largest: 0.3, brightness: constant}}\nsessions:")], "feedback.ball.brightness",
         "smallest and largest are both 0.3 m, so that the sphere looks the same at every distance"),
        ([(BLOCK, BLOCK.replace("pairs", "ask: [nasa_tlx, nasa_tlx], pairs"))],
         "sessions.1.steps.1.block.ask.2", "has 'nasa_tlx' twice"),
        ([("machine: ch8", "operator: {use: simulated_operator, reaction_sd: 1e300}\nmachine: ch8")],
         "operator.reaction_sd", "is 1e+300"),
        ([("sessions:", "participants: {planned: 3}\ndesign: {order: {pairs: williams}}\nsessions:")],
         "design.order.pairs", "which has 2 rows; a multiple of 2 does"),
        ([("tasks:", "tasks:\n  spare: {use: aiming}")], "tasks.spare", "no session has task 'spare'"),
        ([("sessions:", "design: {tracks: {t: {factor: pairs, levels: {2m_far_left: 2, 2m_near_left: 3}, up_down: {}}}}\nsessions:")],
         "design.tracks.t", "no block has track 't'"),
        ([("sessions:", "sync: {gap_s: [2, 1]}\nsessions:")], "sync.gap_s", "warns beyond 2, and fails beyond 1 already"),
        ([("sessions:", "sync: {missing: [0, 2]}\nsessions:")], "sync.missing", "fails beyond 2, and is a share of 1"),
        ([("sessions:", "questionnaires: {load: {use: nasa_tlx}}\nsessions:")], "questionnaires.load",
         "no session asks questionnaire 'load'"),
        ([("sessions:", f"{OWN}stop_rules: [{{questionnaire: q, score: s, above: 5}}]\nsessions:")],
         "stop_rules.1.questionnaire", "goes by 'q', which no session asks"),
        ([("sessions:", f"{OWN}stop_rules: [{RULE}, {RULE}]\nsessions:")], "stop_rules.2.score",
         "a second rule goes by q.s"),
        ([("sessions:", f"{OWN.replace('{name: a, ', '{name: a, step: 3, ')}sessions:")], "questionnaires.q.questions.1",
         "goes from 0 to 10 in steps of 3, so that 9 is the most"),
        ([("sessions:", f"{OWN.replace('{name: a, ', '{name: b, text: B, kind: choice, choices: [x]}, {name: a, ')}sessions:")],
         "questionnaires.q.questions.1", "has one choice"),
        ([("sessions:", f"{OWN.replace('{name: a, ', '{name: b, text: B, kind: text, left: l}, {name: a, ')}sessions:")],
         "questionnaires.q.questions.1", "has left, which only a scale shows"),
        ([(BLOCK, f"{BLOCK}      - consent\n")], "sessions.1.steps.2", "asks for consent, after trials"),
        ([(BLOCK, f"      - consent\n      - consent\n{BLOCK}")], "sessions.1.steps.2", "asks for consent again"),
        ([(BLOCK, f"{BLOCK}      - break: {{seconds: 60}}\n")], "sessions.1.steps.2", "ends with a break"),
        ([("sessions:", BALL), (BLOCK, BLOCK.replace("pairs: 1", "pairs: 1, fading: [1, 0.7, 0.3, 0]"))],
         "sessions.1.steps.1.block.fading", "fades in 4 parts, over 3 trials"),
        ([("sessions:", BALL), (BLOCK, BLOCK.replace("pairs: 1", "pairs: 1, feedback: none, fading: [1, 0]"))],
         "sessions.1.steps.1.block.fading", "fades, and there is none"),
        ([("machine: ch8", "operator: {use: dual_joystick}\nmachine: ch8")], "operator", "'dual_joystick', is a device that a person moves"),
        ([("sessions:", "feedback: {ball: {use: sphere, largest: 5}}\nsessions:")], "feedback.ball.largest", "is 5 m"),
        ([("sessions:", "feedback: {t: {use: sonification, pitch_hz: [220, 40_000]}}\nsessions:")], "feedback.t.pitch_hz", "not everybody hears"),
        ([("sessions:", "feedback: {t: {use: sonification, pitch_hz: [440, 440], overtones: [0, 0]}}\nsessions:")], "feedback.t.pitch_hz", "at every distance"),
        ([("sessions:", "feedback: {t: {use: sonification, pitch_hz: [220, 8800], overtones: [0, 15]}}\nsessions:")], "feedback.t.overtones", "reach 140800 Hz"),
        ([("sessions:", "feedback: {t: {use: sonification, level: [0, 0]}}\nsessions:")], "feedback.t.level", "nothing is heard"),
        ([("sessions:", "feedback: {t: {use: sonification, rate_hz: 480}}\nsessions:")], "feedback.t.rate_hz", "few sound cards"),
        ([("sessions:", "views: {front: {use: view, delay_s: 1 min}}\nsessions:")], "views.front.delay_s", "is 60 s, and 5 is very much"),
        ([("sessions:", "views: {front: {use: view, rate_hz: 0.1}}\nsessions:")], "views.front.rate_hz", "is 0.1 Hz, and 5 is very little"),
        ([("sessions:", "views: {front: {use: view, viewing_m: 60}}\nsessions:")], "views.front.viewing_m", "is 60 m, and 10 is very much"),
        ([("sessions:", "views: {front: {use: view, viewing_m: 0.6, text_arcmin: 5000}}\nsessions:")], "views.front.text_arcmin", "is 5000 arcmin, and 180 is very much"),
        ([("sessions:", "views: {front: {use: view, screen: 1}, back: {use: view, screens: [0, 1]}}\nsessions:")], "views.back", "'front' and 'back' both fill screen 1"),
        ([("sessions:", f"design: {{groups: {{'': [], ball: [ball]}}}}\n{BALL}"), (BLOCK, BLOCK.replace("pairs", "feedback: group, pairs"))],
         "design.groups", "a group has no name"),
        ([("  use: joint_velocity\n", "  use: joint_velocity\n  soft_stop_deg: 170\n")], "scheme.soft_stop_deg", "a joint turns by 172 in all"),
        ([("sessions:", "streams: {a: {source_id: x}, b: {source_id: x}}\nsessions:")], "streams.b", "a and b are the same"),
        ([("sessions:", "streams: {a: {name: A, type: eeg}}\nsessions:")], "streams.a.type", "letter by letter, and devices write 'EEG'"),
        ([("sessions:", "streams: {a: {name: A, type: mocap}}\nsessions:")], "streams.a.type", "devices write 'MoCap'"),
        ([("sessions:", "streams: {a: {name: ''}}\nsessions:")], "streams.a", "by an empty text"),
        ([("sessions:", "views: {front: {use: view, hint_s: 1 ms}}\nsessions:")], "views.front.hint_s", "is 0.001 s, and 0.5 is very little"),
        ([("sessions:", "views: {front: {use: view, patch: {size: 5000}}}\nsessions:")], "views.front.patch.size", "is 5000 pixels, but the window has only 720"),
        ([("{use: kinematic_crane}", "{use: kinematic_crane, actuator: {lag_s: 50}}")], "dynamics.actuator", "follows 50 s late"),
        ([("{use: kinematic_crane}", "{use: bullet_crane, payload_kg: 99 t}")], "dynamics.payload_kg", "is 99000 kg; with it"),
        ([("{use: kinematic_crane}", "{use: bullet_crane, grapple: {length_m: 30}}")], "dynamics.grapple.length_m", "is 30 m, but the crane itself reaches only"),
        ([("sessions:", f"design: {{groups: {{ball: [ball]}}}}\n{BALL}"), (BLOCK, BLOCK.replace("pairs", "feedback: group, pairs"))],
         "design.groups", "'ball' is the only group"),
        ([("movements: 2", "movements: 2, onset_hold_s: 100")], "tasks.aiming.onset_hold_s", "no movement has an onset or a reaction time"),
        ([("movements: 2", "movements: 2, onset_speed: 40")], "tasks.aiming.onset_speed", "the tip never reaches"),
        ([("movements: 2", "movements: 2, rest_s: 0.001")], "tasks.aiming.rest_s", "and 0.002 is very little"),
        ([("  use: joint_velocity\n", "  use: joint_velocity\n  dead_zone: 0.99\n")], "scheme.dead_zone", "has no effect over most"),
        ([("sessions:", "streams: {g: {name: G, type: Gaze}}\nmonitors: {g: {use: eeg_signal}}\nsessions:")], "monitors.g", "for streams of type EEG"),
        ([("sessions:", "streams: {g: {name: G, min_delay_s: 10}}\nsessions:")], "streams.g.min_delay_s", "2 is very much"),
        ([("sessions:", "triggers: {a: {use: serial_ttl, port: COM3, codes: {trial.start: 1, trial.end: 1}}}\nsessions:")], "triggers.a.codes", "which look the same"),
        ([("sessions:", "triggers: {a: {use: serial_ttl, port: COM3}, b: {use: serial_ttl, port: COM3}}\nsessions:")], "triggers.b", "both write to port COM3"),
        ([("sessions:", "streams: {gaze: {name: Neon, latency_s: 40}}\nsessions:")], "streams.gaze.latency_s", "a latency of 40 s"),
        ([("sessions:", "streams: {g: {name: Neon Gaze}}\nsessions:")], "streams.g.space", "does not say what its pixels are of"),
        ([("sessions:", "streams: {g: {name: G, type: Gaze}}\nsessions:")], "streams.g.space", "write space: screen"),
        ([("sessions:", "streams: {g: {name: G, space: screen}, h: {name: H, space: screen}}\nsessions:")], "streams.h.space", "g and h are all places"),
        (UNLIKE, "scheme", "m/s with joint_velocity, 0.50 m/s with end_effector at the study's targets"),
        ([("sessions:", "streams: {eeg: {type: EEG}, gaze: {name: Neon}}\nsessions:")],
         "streams.eeg", "each run asks which one is meant; give the source_id"),
    ],
)  # fmt: skip
def test_a_number_that_nobody_means_is_asked_about_until_it_is_answered(
    tmp_path: Path, changes: list[tuple[str, str]], key: str, said: str
) -> None:
    asked: dict[str, str] = {}
    for each in questions(a_study(tmp_path, *changes)):
        asked[each.key] = f"{asked.get(each.key, '')}{each.text}"
    assert said in asked[key]
    assert asked[key].endswith("is that meant?")
    answer = ("sessions:", f"expected: [{', '.join(asked)}]\nsessions:")
    assert questions(a_study(tmp_path, *changes, answer)) == ()


def test_a_cue_that_is_told_nearer_beside_one_that_is_told_farther_adds_no_fact(
    tmp_path: Path,
) -> None:
    both = NEAR.replace("heard: [tone]", "both: [ball, tone]")
    group = (BLOCK, BLOCK.replace("pairs", "feedback: group, pairs"))
    asked = questions(a_study(tmp_path, ("sessions:", f"{both}sessions:"), group))
    assert not [each for each in asked if "not give the same information" in each.text]


def test_blocks_that_tell_the_same_and_blocks_of_other_tasks_are_not_asked_about(
    tmp_path: Path,
) -> None:
    alike = BOTH.replace("sonification", "sonification, pan: none, silent_after_s: null")
    changes = [("sessions:", f"feedback: {alike}\nsessions:"), (BLOCK, TWO_BLOCKS)]
    found = questions(a_study(tmp_path, *changes))
    other = [
        ("tasks:", "tasks:\n  also: {use: aiming, distances: [2], width: 0.5, movements: 2}"),
        ("sessions:", f"feedback: {BOTH}\nsessions:"),
        (BLOCK, "also, ".join(TWO_BLOCKS.rsplit("aiming, ", 1))),
    ]
    found += questions(a_study(tmp_path, *other))
    assert not [each for each in found if "not give the same information" in each.text]


RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
REFERENCE = "      - reference: {task: retrieval}"
ASK = ", ask: [subjective_accuracy, situational_awareness]"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "key", "said", "line"),
    [
        ([(REFERENCE, "      - break: {seconds: 9}")], "sessions.1.steps.4.block.task",
         "own reference time, which no earlier step measures, so labcrane score leaves its tests out; write reference: {task: retrieval}", "- block:"),
        ([(REFERENCE, REFERENCE.replace("}", ", scenes: 2}"))], "sessions.1.steps.4.block.task",
         "own reference time, which no earlier step measures", "- block:"),
        ([(REFERENCE, REFERENCE.replace("}", ", scenes: 2}")), ("{scenes: shuffled}", "{scenes: as_written}")],
         "sessions.1.steps.4.block.task", "reference time of {lacks}, which no earlier", "- block:"),
        ([(ASK, "")], "sessions.1.steps.4.block.ask", "subjective_accuracy and situational_awareness are asked neither in it nor after it", "- block:"),
        ([(ASK, ", ask: [situational_awareness]")], "sessions.1.steps.4.block.ask", "subjective_accuracy is asked neither", "- block:"),
    ],
)  # fmt: skip
def test_a_study_that_cannot_be_scored_is_asked_about_at_its_line(
    tmp_path: Path, changes: list[tuple[str, str]], key: str, said: str, line: str
) -> None:
    copytree(RETRIEVAL, tmp_path / "study")
    path = tmp_path / "study" / "protocol.yaml"
    text = path.read_text(encoding="utf-8")
    assert questions(load(path, discover(study=path))) == ()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text, encoding="utf-8")
    study = load(path, discover(study=path))
    (asked,) = questions(study)
    lacks = ", ".join(sorted(study.tasks["retrieval"].factors()["scenes"][2:]))
    assert asked.key == key
    assert said.format(lacks=lacks) in asked.text if "{lacks}" in said else said in asked.text
    found = about(study, asked)
    assert line in text.splitlines()[found["line"] - 1]
    path.write_text(text.replace("expected: [", f"expected: [{key}, "), encoding="utf-8")
    assert questions(load(path, discover(study=path))) == ()


@pytest.mark.parametrize(
    "change",
    [
        (ASK + "}", "}\n      - questionnaire: [situational_awareness, subjective_accuracy]"),
        (ASK + "}", "}\nindicator: {weights: {accuracy: 0, awareness: 0}}"),
        (REFERENCE, REFERENCE + "\n      - reference: {task: retrieval, scenes: 1}"),
    ],
)
def test_a_study_that_can_be_scored_is_not_asked_about(
    tmp_path: Path, change: tuple[str, str]
) -> None:
    copytree(RETRIEVAL, tmp_path / "study")
    path = tmp_path / "study" / "protocol.yaml"
    text = path.read_text(encoding="utf-8")
    assert change[0] in text
    path.write_text(text.replace(*change, 1), encoding="utf-8")
    assert questions(load(path, discover(study=path))) == ()


@pytest.mark.parametrize(
    "changes",
    [
        [(", pairs: 1", ""), ("sessions:", "design: {order: {pairs: as_written}}\nsessions:")],
        [(", pairs: 1", ""), ("sessions:", "design: {order: {pairs: shuffled}}\nsessions:")],
        [("pairs: 1", "pairs: 2"), ("sessions:", "design: {order: {pairs: shuffled}}\nsessions:")],
        [("pairs: 1", "pairs: 2"), ("sessions:", "design: {order: {pairs: {rule: blocked, times: 3}}}\nsessions:")],
        [("sessions:", "design: {order: {pairs: shuffled}}\nsessions:"), (BLOCK, BLOCK.replace("block", "practice") + BLOCK.replace(", pairs: 1", ""))],
        # 300 answers after the trials of a step, schemes that are alike fast by default, streams that can be no neighbour's.
        [(BLOCK, BLOCK.replace("}", ", repeat: 25, ask: [nasa_tlx]}"))],
        [(old, new.replace("speed_m_s: 0.5, ", "")) for old, new in UNLIKE],
        [("sessions:", "streams: {gaze: {name: Neon, type: Gaze, space: scene}}\nsessions:")],
        [("sessions:", "streams: {gaze: {source_id: neon-7}}\nsessions:")],
        [("sessions:", "streams: {gaze: {type: Gaze, several: true, space: screen}}\nsessions:")],
        [("rate_hz: 240", "rate_hz: 240 #Hz")],
    ],
)  # fmt: skip
def test_what_is_likely_to_be_meant_is_not_asked_about(
    tmp_path: Path, changes: list[tuple[str, str]]
) -> None:
    assert questions(a_study(tmp_path, *changes)) == ()


@pytest.mark.parametrize("seed", range(8))
def test_a_part_is_asked_about_where_plans_of_participants_hold_other_levels(
    tmp_path: Path, seed: int
) -> None:
    dice = Random(f"order {seed}")
    rule = dice.choice(RULES)
    times = dice.randint(1, 2)
    levels, used = 8, dice.randint(1, 8)
    order = f"design: {{order: {{pairs: {{rule: {rule}, times: {times}}}}}}}\nsessions:"
    study = a_study(
        tmp_path,
        ("distances: [2]", "distances: [2, 3, 4, 6]"),
        ("pairs: 1", f"pairs: {used}"),
        ("sessions:", order),
    )
    done = {
        frozenset(plan_session(study, f"P{number:03}", 1).blocks[0].levels["pairs"])
        for number in range(1, 3 * levels)
    }
    asked = [each.key for each in questions(study)]
    assert (asked == ["sessions.1.steps.1.block.pairs"]) == (len(done) > 1), (rule, times, used)
    assert len(asked) == (len(done) > 1)


@given(
    groups=st.dictionaries(
        st.sampled_from("abc"), st.sets(st.sampled_from(("ball", "tone"))), min_size=2
    ),
    named=st.one_of(
        st.just("all"), st.lists(st.sampled_from(("ball", "tone")), min_size=1, max_size=4)
    ),
    kind=st.sampled_from(("block", "practice")),
)
@settings(deadline=None, max_examples=30)
def test_feedback_of_a_step_is_asked_about_for_every_group_that_is_not_given_it(
    groups: dict[str, set[str]], named: str | list[str], kind: str
) -> None:
    """A line of the protocol must not take away by accident what the groups differ in."""
    design = {name: sorted(given) for name, given in groups.items()}
    step = f"      - {kind}: {{task: aiming, pairs: 1, feedback: {json.dumps(named)}}}\n"
    with TemporaryDirectory() as folder:
        study = a_study(
            Path(folder),
            ("sessions:", f"design: {{groups: {json.dumps(design)}}}\n{BALL}"),
            (BLOCK, step + BLOCK.replace("pairs", "feedback: group, pairs")),
        )
        key = f"sessions.1.steps.1.{kind}.feedback"
        asked = [each.text for each in questions(study) if each.key == key]
        again = [each.key for each in questions(study) if "twice" in each.text]
    names = ("ball", "tone") if named == "all" else named
    assert len(again) == len({name for name in names if names.count(name) > 1})
    assert key not in again, "an answer to the one would be an answer to the other"
    expected = {
        name: [group for group, given in groups.items() if name not in given] for name in names
    }
    said = "; ".join(
        f"'{name}' to {', '.join(map(repr, without))}"
        for name, without in expected.items()
        if without
    )
    assert len(asked) == bool(said)
    for text in asked:
        assert (
            f"{kind} 1 gives feedback to groups to whom the design does not give it, {said};"
            in text
        )


def test_feedback_that_does_not_say_what_it_tells_is_asked_about_as_well(tmp_path: Path) -> None:
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "broken.py").write_text(BROKEN)
    design = "feedback: {ball: {use: broken}}\ndesign: {groups: {none: [], lit: [ball]}}\nsessions:"
    named = BLOCK.replace("pairs", "feedback: [ball], pairs")
    study = a_study(tmp_path, ("sessions:", design), (BLOCK, named))
    key = "sessions.1.steps.1.block.feedback"
    (asked,) = (each for each in questions(study) if each.key == key)
    assert "to whom the design does not give it, 'ball' to 'none'; write feedback" in asked.text


def test_two_doubts_of_one_view_are_both_asked_and_answered_apart(tmp_path: Path) -> None:
    view = "{use: view, hud: [distance], patch: {on: [target.entered]}}"
    views = ("sessions:", f"views: {{cab: {view}}}\nsessions:")
    keys = [each.key for each in questions(a_study(tmp_path, views))]
    assert keys == ["views.cab.hud", "views.cab.patch"]
    answered = ("sessions:", "expected: [views.cab.patch]\nsessions:")
    assert [each.key for each in questions(a_study(tmp_path, views, answered))] == keys[:1]


def test_an_answer_to_nothing_is_told_with_the_nearest_question(tmp_path: Path) -> None:
    study = a_study(tmp_path, ("rate_hz: 240", "rate_hz: 10\nexpected: [rate_hs]"))
    assert [each.text for each in questions(study)][-1] == (
        "expected: 'rate_hs' matches no warning; did you mean 'rate_hz'?"
    )


def test_a_question_says_once_how_it_is_answered_that_it_is_meant(tmp_path: Path) -> None:
    study = a_study(tmp_path, (", pairs: 1", ""))
    (asked,) = (each for each in questions(study) if each.key == "design.order.pairs")
    assert asked.whole.count("as_written") == 0
    assert asked.whole.endswith("is that meant? (if it is, write expected: [design.order.pairs])")


def test_people_and_programs_are_asked_the_same_with_the_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a_study(tmp_path, ("rate_hz: 240", "rate_hz: 10"))
    path = str(tmp_path / "study.yaml")
    assert main(["check", path]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""  # a question is a result of a check, as that it is fine
    said, fine = printed.out.splitlines()
    assert fine.endswith("; 1 warning above")
    assert said.startswith(f"{path}:4:10: warning: rate_hz is 10 Hz, at which")
    assert "(if it is, write expected: [rate_hz])" in said
    assert main(["check", path, "--json"]) == 0
    (finding,) = json.loads(capsys.readouterr().out)["findings"]
    assert finding["whole"] == said.strip()
    assert (finding["kind"], finding["line"], finding["key"]) == ("question", 4, "rate_hz")


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("50 cm", "m", 0.5), ("2 m", "m", 2.0), ("1.5e3 mm", "m", 1.5), ("90 deg", "deg", 90.0),
        ("0.25 turn", "deg", 90.0), ("90°", "deg", 90.0), ("200ms", "s", 0.2), ("2 min", "s", 120.0),
        ("1 kHz", "Hz", 1000.0), ("30 rpm", "deg/s", 180.0), ("2 weeks", "day", 14.0),
        ("36 km/h", "m/s", 10.0), ("0.1 mV", "uV", 100.0), ("much", "m", None), ("1_0", "m", None),
    ],
)  # fmt: skip
def test_a_quantity_is_read_in_the_unit_that_is_asked_for(
    text: str, unit: str, number: float | None
) -> None:
    assert in_unit(text, unit) == (None if number is None else pytest.approx(number, rel=1e-12))


@pytest.mark.parametrize(
    ("text", "unit", "said"),
    [
        ("5 kg", "m", "'5 kg' is a mass, where a length is required; write a plain number, in m, or a length with its unit, as 50 cm"),
        ("90 deg", "m", "is an angle, where a length is required"),
        ("30 %", "deg", "where an angle is required"),
        ("3 foos", "s", "has no known unit, where a time is required"),
        ("1,5 m", "m", "write decimals with a point: 1.5 m"),
        ("1:30", "s", "is not a number of seconds; write 90"),
        ("9 m**9**9**9", "m", "has no known unit"),
    ],
)  # fmt: skip
def test_a_quantity_of_another_kind_is_told_with_what_is_asked_for(
    text: str, unit: str, said: str
) -> None:
    with pytest.raises(ValueError, match=r"[a-z]") as told:
        in_unit(text, unit)
    assert said in str(told.value)


def test_a_protocol_with_units_is_the_one_with_plain_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    units = "distances: [200 cm], width: 40 cm, diagonal_deg: 0.25 rad, limit_s: 0.5 min"
    study = a_study(tmp_path, ("distances: [2]", units))
    settings = study.task_choices["aiming"].settings.model_dump()
    assert settings["distances"] == (2.0,)
    assert settings["width"] == 0.4
    assert settings["limit_s"] == 30.0
    assert settings["diagonal_deg"] == pytest.approx(14.3239448783)
    recorded = study.task_choices["aiming"].described(tmp_path)["settings"]
    assert (recorded["width"], recorded["distances"]) == (0.4, [2.0])
    assert main(["plan", str(study.path), "--participants", "1"]) == 0
    assert "tasks.aiming.width: 40 cm is 0.4 m" in capsys.readouterr().out
    written = {each.place[-1]: each.written for each in written_quantities(study)}
    assert written["width"] == "40 cm"


def test_a_wrong_unit_is_told_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError) as told:
        a_study(tmp_path, ("distances: [2]", "distances: [2], width: 50 kg"))
    assert "study.yaml:12:48: tasks.aiming.width: '50 kg' is a mass, where a length" in str(
        told.value
    )


def test_a_truth_is_no_number_unless_it_was_recorded_as_one(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match=r"movements: true is not a number; write one"):
        a_study(tmp_path, ("movements: 2", "movements: true"))
    path = tmp_path / "study.yaml"
    assert load(path, discover(), recorded=True).tasks


def test_a_rehearsal_runs_a_trial_of_each_block_for_every_group(tmp_path: Path) -> None:
    grouped = BLOCK.replace("pairs", "feedback: group, pairs")
    more = f"{grouped}{BLOCK.replace('pairs', 'name: again, repeat: 3, pairs')}"
    done = rehearse(a_study(tmp_path, ("sessions:", GROUPS), (BLOCK, more)))
    # An approach and a counted movement of each block, for each of two groups.
    assert (done.sessions, done.trials, done.questions) == (2, 8, ())


BROKEN = '''\
"""A cue that fails when it is drawn."""

from labcrane import Cue, Settings, hookimpl, offer


class Broken(Cue):
    def __init__(self, settings, machine):
        pass

    def draw(self, frame):
        return [1 / 0]


@hookimpl
def labcrane_cues():
    return [offer("broken", Settings, Broken)]
'''


def test_a_rehearsal_finds_what_a_check_cannot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "broken.py").write_text(BROKEN)
    study = a_study(tmp_path, ("sessions:", "feedback: {ball: {use: broken}}\nsessions:"))
    path = str(study.path)
    assert main(["check", path]) == 0
    assert main(["check", path, "--rehearse"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "rehearsal, session 'only': cue 'ball'" in said
    assert "ZeroDivisionError" in said
    granted = ["--board", "B", "--reference", "R", "--valid-until", "2099-01-01", "--consent", "c"]
    assert main(["approve", path, *granted]) == 2
    assert "rehearsal, session 'only': cue 'ball'" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "study.lock.json").exists()


def test_nothing_is_locked_or_amended_while_something_is_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cue = tmp_path / "plugins" / "broken.py"
    cue.parent.mkdir()
    cue.write_text(BROKEN.replace("return [1 / 0]", "return []"))
    (tmp_path / "consent.md").write_text("You may stop at any time.\n")
    slow = ("rate_hz: 240", "rate_hz: 10")
    study = a_study(tmp_path, ("sessions:", "feedback: {ball: {use: broken}}\nsessions:"), slow)
    path, lock = str(study.path), tmp_path / "study.lock.json"
    granted = ["--board", "B", "--reference", "R", "--valid-until", "2099-01-01"]
    granted += ["--consent", str(tmp_path / "consent.md")]
    amendment = ["amend", path, "--why", "another cue", "--reference", "R2"]

    def refused(*words: str) -> str:
        assert main(words) == 2
        return " ".join(capsys.readouterr().err.split())

    said = refused("approve", path, *granted)
    assert ":4:10: warning: rate_hz is 10 Hz" in said
    assert said.endswith("nothing was locked; answer the warnings above first")
    assert not lock.exists()
    asking = study.path.read_text()
    keys = re.findall(r"if it is, write expected: \[(.+?)\]", said)
    assert len(keys) == said.count(": warning: ") > 0
    answered = asking.replace("rate_hz: 10", f"rate_hz: 10\nexpected: {keys}")
    study.path.write_text(answered)
    assert main(["approve", path, *granted]) == 0
    locked = lock.read_text()
    study.path.write_text(asking)
    assert ":4:10: warning: rate_hz is 10 Hz" in refused(*amendment)
    study.path.write_text(answered)
    cue.write_text(BROKEN)
    assert "rehearsal, session 'only': cue 'ball'" in refused(*amendment)
    assert lock.read_text() == locked


@pytest.mark.parametrize(
    ("second", "what"),
    [
        ("{task: aiming, pairs: 1, feedback: none}", "differ in feedback"),
        ("{task: wide, pairs: 1}", "differ in task (aiming and wide)"),
        ("{task: aiming, pairs: 1}", ""),
        ("{task: aiming, pairs: 1, feedback: [ball]}", ""),
    ],
)
def test_blocks_that_differ_in_one_order_for_everyone_are_asked_about(
    tmp_path: Path, second: str, what: str
) -> None:
    block = "      - block: {task: aiming, pairs: 1}"
    more = (block, f"{block}\n      - block: {second}")
    wide = ("tasks:\n", "tasks:\n  wide: {use: aiming, movements: 2, width: 0.8}\n")
    ball = ("sessions:", "feedback: {ball: {use: sphere}}\nsessions:")
    asked = [
        each.text
        for each in questions(a_study(tmp_path, more, wide, ball))
        if "come in this order for everyone" in each.text
    ]
    assert len(asked) == bool(what)
    assert all(f"steps 1 and 2 of 'only' {what} and come" in text for text in asked)


def test_a_trial_that_runs_out_of_time_is_asked_about(tmp_path: Path) -> None:
    done = rehearse(a_study(tmp_path, ("movements: 2", "movements: 2, limit_s: 1.5")))
    (question,) = done.questions
    assert question.key == "rehearsal.aiming"
    assert "the simulated operator runs out of time" in question.text
    answered = ("rate_hz: 240", "rate_hz: 240\nexpected: [rehearsal.aiming]")
    study = a_study(tmp_path, ("movements: 2", "movements: 2, limit_s: 1.5"), answered)
    assert questions(study) == rehearse(study).questions == ()


SLOW = """\
import time

import numpy as np

from labcrane import Controller, Settings, Signal, hookimpl, offer


class Slow(Controller):
    signals = (Signal("command", "rad/s", ("slew", "shoulder", "elbow", "wrist")),)

    def __init__(self, settings, machine):
        self._zeros = np.zeros(4)

    def inverse(self, velocity, state):
        return np.zeros(12)

    def command(self, axes, state):
        began = time.thread_time()
        while time.thread_time() - began < 0.006:
            pass
        return self._zeros


@hookimpl
def labcrane_controllers():
    return [offer("slow", Settings, Slow)]
"""


@pytest.mark.slow
def test_a_rate_that_this_computer_cannot_hold_is_asked_about_by_a_rehearsal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rehearsal, "PATIENCE_S", 1.0)
    monkeypatch.setattr(rehearsal, "PATIENCE", 0.0)
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "slow.py").write_text(SLOW)
    scheme = SHORT[SHORT.index("scheme:") : SHORT.index("dynamics:")]
    slow = (scheme, "scheme: {use: slow}\n")
    asked = {each.key: each for each in rehearse(a_study(tmp_path, slow)).questions}
    text = asked["rehearsal.rate_hz"].text
    assert text.startswith(
        "rate_hz is 240 Hz, a tick every 4.17 ms, and on this computer one takes "
    )
    assert (
        float(text.partition(" one takes ")[2].split()[0]) >= 6.0
    )  # ms, of a processor, however busy it is
    assert asked["rehearsal.rate_hz"].place == ("rate_hz",)
    fast = rehearse(a_study(tmp_path, slow, ("rate_hz: 240", "rate_hz: 50")))
    assert "rehearsal.rate_hz" not in {each.key for each in fast.questions}


@pytest.mark.parametrize("seed", range(6))
def test_a_text_that_ends_at_a_number_sign_is_asked_about_where_that_may_be_text(
    seed: int, tmp_path: Path
) -> None:
    """Drawn: a text, with or without quotation marks, and what is behind the sign."""
    dice = Random(seed)
    before = " ".join(dice.choice(["Which", "crane", "was", "harder", "é"]) for _ in range(3))
    cases = [
        (f"{before} #{dice.randint(1, 9)} or #2", True),
        (f"{before} # {dice.randint(1, 9)} or 2?", True),
        (f"{before}   #harder", True),
        (f"{before} # a comment", False),
        (f"{before} ## heading", False),
        (f"{before}#1", False),
        (f"'{before} #1 or #2?'", False),
        (f'"{before} #1"', False),
    ]
    for text, asked in dice.sample(cases, len(cases)):
        own = f"questionnaires:\n  q:\n    use: free\n    title: Q\n    questions:\n      - name: a\n        text: {text}\nsessions:"
        study = a_study(tmp_path, ("sessions:", own), (BLOCK, f"{BLOCK}      - questionnaire: q\n"))
        found = [
            each for each in questions(study) if each.key == "questionnaires.q.questions.1.text"
        ]
        assert bool(found) == asked, text
        if found:
            (cut,) = found
            assert text[text.index("#") :] in cut.text
            assert study.source is not None
            line, column = study.source.position(cut.place)
            assert study.source.text.splitlines()[line - 1][column - 1 :] == text


@pytest.mark.parametrize("seed", range(4))
def test_groups_and_conditions_that_readers_take_for_numbers_are_asked_about(
    seed: int, tmp_path: Path
) -> None:
    dice = Random(seed)
    numbers = dice.sample(["1", "02", "1e5", "-3", "2.5", "T", "false", "inf"], 3)
    for key in ("groups", "conditions"):
        for names, asked in ((numbers, True), ([*numbers[:2], "low"], False)):
            levels = ", ".join(f"'{each}': []" for each in names)
            study = a_study(tmp_path, ("sessions:", f"design: {{{key}: {{{levels}}}}}\nsessions:"))
            found = [each.text for each in questions(study) if "guess types" in each.text]
            assert bool(found) == asked
            assert all(repr(each) in found[0] for each in numbers if asked)


@pytest.mark.parametrize(("axis", "asked"), [("left.x", 1), ("-left.y", 1), ("left.trigger", 0)])
def test_a_response_that_moves_the_machine_is_asked_about(
    axis: str, asked: int, tmp_path: Path
) -> None:
    copytree(Path(__file__).parents[2] / "examples" / "workload", tmp_path / "study")
    path = tmp_path / "study" / "protocol.yaml"
    text = path.read_text(encoding="utf-8")
    assert "response: left.trigger" in text
    path.write_text(text.replace("response: left.trigger", f"response: {axis}"), "utf-8")
    found = [one.text for one in questions(load(path, discover()))]
    bare = axis.removeprefix("-")
    assert sum(f"'drt' uses {bare}, which moves the machine, too" in one for one in found) == asked


@pytest.mark.parametrize(
    ("dual", "said"),
    [
        (
            "[drt]",
            [
                "'drt' is on without a feedback that presents it; add one of beep, light; is that meant?"
            ],
        ),
        (
            "[light]",
            ["'light' presents 'drt', which is off; add drt, or leave it out; is that meant?"],
        ),
        ("[drt, light]", []),
    ],
)
def test_a_secondary_task_is_on_with_what_presents_it(
    dual: str, said: list[str], tmp_path: Path
) -> None:
    example = Path(__file__).parents[2] / "examples" / "workload"
    copytree(example, tmp_path / "study")
    path = tmp_path / "study" / "protocol.yaml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("with light: [drt, light]", f"with light: {dual}"), "utf-8")
    asked = [one.text for one in questions(load(path, discover()))]
    assert [text for text in asked if "drt" in text and "present" in text] == said
