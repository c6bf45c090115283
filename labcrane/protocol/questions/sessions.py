"""Questions about sessions: their steps, what counts, what is asked and scored."""

from labcrane.analysis.scoring.settings import COUNTS, RATINGS, TIME
from labcrane.files.yaml import Place
from labcrane.protocol.questions.design import drawn_part
from labcrane.protocol.questions.question import Doubts, asks, blocks_in, steps_in
from labcrane.protocol.steps import READING_S, Block
from labcrane.protocol.study import Study, trials_of

LONGEST_BREAK_S = 3600.0

LONGEST_SESSION_S = 4 * 3600.0
"""Of a visit that does not say how long it may take."""

MOST_ANSWERS = 300
"""Answers after the trials of one step that give no warning."""


@asks
def _of_sessions(study: Study) -> Doubts:
    for number, session in enumerate(study.protocol.sessions):
        place: Place = ("sessions", number)
        if number == 0 and session.after_days is not None:
            yield (*place, "after_days"), "after_days of the first session has no session before it"
        long = 0.0
        for at, step in enumerate(session.steps):
            if step.kind == "break" and step.seconds > LONGEST_BREAK_S:
                about = f"a break of {step.seconds / 3600:.3g} hours"
                yield (*place, "steps", at, "break", "seconds"), about
            long += step.seconds if step.kind == "break" else READING_S
            if step.block is not None:
                task = study.tasks[step.block.task]
                count, seconds = trials_of(step.block, study.protocol, task)
                long += seconds - READING_S
                until = step.block.until
                if until is not None and until.successes > count:
                    yield (
                        (*place, "steps", at, "practice", "until", "successes"),
                        f"practice is enough after {until.successes} successes in a row, and has "
                        f"{count:.0f} trials at most",
                    )
        likely = f"session {session.name!r} is likely to take {_duration(long)}"
        if session.window_s is not None and long > session.window_s:
            yield (*place, "window_s"), f"{likely}, and may take {_duration(session.window_s)}"
        elif session.window_s is None and long > LONGEST_SESSION_S:
            yield place, likely


def _duration(seconds: float) -> str:
    if seconds < 2 * 60.0:
        return f"{seconds:.3g} s"
    if seconds < 2 * 3600.0:
        return f"{seconds / 60:.3g} minutes"
    return f"{seconds / 3600:.3g} hours"


@asks
def _of_what_counts(study: Study) -> Doubts:
    """Question a study without any results."""
    kinds = dict.fromkeys(kind for _, kind, _ in steps_in(study))
    if "block" not in kinds:
        only = f", only {' and '.join(kinds)}, whose trials are not counted" if kinds else ""
        yield (
            ("sessions",),
            f"no session has a block{only}, so a report has no result; write block: "
            "{task: ...} where trials count",
        )
    for name, task in study.tasks.items():
        if not any(trial.counted for trial in task.plan(task.factors())):
            yield ("tasks", name), f"no trial of task {name!r} counts"


@asks
def _of_what_is_scored(study: Study) -> Doubts:
    """Question tests of which ``labcrane score`` would leave out the whole, or some points.

    Their columns say that they are scored; by the operator's own reference time in each scenario,
    of the latest reference before them.
    """
    weights = study.protocol.indicator.weights
    rated = [name for part, name in RATINGS.items() if getattr(weights, part)]
    timed: set[str] = set()
    for place, kind, block in steps_in(study):
        task = study.tasks[block.task]
        if not {TIME, *COUNTS.values()} <= {name for one in task.results for name in one.columns}:
            continue
        if kind == "reference":
            timed |= _scenarios(study, block, surely=True)
        elif kind == "block":
            here = f"{kind} {int(place[3]) + 1} of session {int(place[1]) + 1}"
            if lacks := _scenarios(study, block, surely=False) - timed:
                of = f" of {', '.join(sorted(lacks))}" if timed and all(lacks) else ""
                yield (
                    (*place, "task"),
                    f"{here} is scored against the operator's own reference time{of}, which no "
                    "earlier step measures, so labcrane score leaves its tests out; write "
                    f"reference: {{task: {block.task}}} before it",
                )
            steps = study.protocol.sessions[int(place[1])].steps[int(place[3]) + 1 :]
            asked = {*block.ask, *(name for step in steps for name in step.questionnaires)}
            if unasked := [name for name in rated if name not in asked]:
                yield (
                    (*place, "ask"),
                    f"{here} is scored by ratings too, and {' and '.join(unasked)} "
                    f"{'is' if len(unasked) == 1 else 'are'} asked neither in it nor after it, so "
                    "that its indicator has no sum; write ask: "
                    f"[{', '.join(rated)}], or give them no weight under indicator",
                )


def _scenarios(study: Study, block: Block, *, surely: bool) -> set[str]:
    """Return the scenarios that all participants do in a block, or that some may; "" for none."""
    task = study.tasks[block.task]
    levels = dict(task.factors())
    for factor, there in levels.items():
        if not drawn_part(study, block, factor):
            levels[factor] = there[: block.limits.get(factor)]
        elif surely:
            return set()
    return {str(trial.condition.get("scenario") or "") for trial in task.plan(levels)}


@asks
def _of_what_is_not_used(study: Study) -> Doubts:
    """Question tasks that no session has, and tracks that choose nothing."""
    protocol = study.protocol
    done = {block.task for _, block in blocks_in(study)}
    for name in protocol.tasks:
        if name not in done:
            yield ("tasks", name), f"no session has task {name!r}"
    tracks = {block.track for _, block in blocks_in(study)}
    for name in protocol.design.tracks:
        if name not in tracks:
            yield ("design", "tracks", name), f"no block has track {name!r}"


@asks
def _of_what_is_not_asked(study: Study) -> Doubts:
    """Question questionnaires that no session asks, and rules that use them."""
    protocol = study.protocol
    asked = {name for _, block in blocks_in(study) for name in block.ask}
    asked |= {
        name
        for session in protocol.sessions
        for step in session.steps
        for name in step.questionnaires
    }
    for name in protocol.questionnaires:
        if name not in asked:
            yield ("questionnaires", name), f"no session asks questionnaire {name!r}"
    for number, rule in enumerate(protocol.stop_rules):
        if rule.questionnaire and rule.questionnaire not in asked:
            yield (
                ("stop_rules", number, "questionnaire"),
                f"the rule goes by {rule.questionnaire!r}, which no session asks",
            )
    scores = [
        (rule.estimate or f"{rule.questionnaire}.{rule.score}", *rule.limit)
        for rule in protocol.stop_rules
    ]
    for number, score in enumerate(scores):
        if score in scores[:number]:
            key = "estimate" if protocol.stop_rules[number].estimate else "score"
            yield ("stop_rules", number, key), f"a second rule goes by {score[0]}"


@asks
def _of_orders_of_steps(study: Study) -> Doubts:
    """Question sessions that ask for consent too late, or end with a break."""
    for number, session in enumerate(study.protocol.sessions):
        kinds = [step.kind for step in session.steps]
        for at, kind in enumerate(kinds):
            place: Place = ("sessions", number, "steps", at)
            if kind == "consent" and any(step.block for step in session.steps[:at]):
                yield (
                    place,
                    f"sessions: step {at + 1} of {session.name!r} asks for consent, after trials",
                )
            if kind == "consent" and kind in kinds[:at]:
                yield place, f"sessions: step {at + 1} of {session.name!r} asks for consent again"
        if kinds[-1] == "break":
            at = len(kinds) - 1
            yield ("sessions", number, "steps", at), f"session {session.name!r} ends with a break"


@asks
def _of_answers(study: Study) -> Doubts:
    """Question blocks whose questionnaires after each trial ask for very many answers."""
    for place, block in blocks_in(study):
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        task = study.tasks[block.task]
        planned = task.plan(task.factors())
        counted = sum(trial.counted for trial in planned) / max(1, len(planned))
        trials = trials_of(block, study.protocol, task)[0] * counted
        each = sum(len(study.questionnaires[name].items()) for name in block.ask)
        if each * trials > MOST_ANSWERS:
            yield (
                (*place, kind, "ask"),
                f"{each} answers after each of {trials:.0f} trials are {each * trials:,.0f} in "
                "all; ask once, in a step of its own, or ask less",
            )


@asks
def _of_stop_rules(study: Study) -> Doubts:
    for number, rule in enumerate(study.protocol.stop_rules):
        if rule.questionnaire is None:
            continue
        ((key, limit),) = rule.limit.items()
        for score in study.questionnaires[rule.questionnaire].scores:
            always = rule.met(score.lowest)
            if score.name == rule.score and always is rule.met(score.highest):
                yield (
                    ("stop_rules", number, key),
                    f"{rule.score} is {score.lowest:g} to {score.highest:g}, so that one {key} "
                    f"{limit:g} is {'always' if always else 'never'} there",
                )
