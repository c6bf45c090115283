"""One questionnaire in the course of a session: how it begins, and what follows from its scores."""

from collections.abc import Iterator, Mapping

from labcrane.console import Command, Order, by_whom
from labcrane.design.seeds import derive
from labcrane.inquiry import Inquiry, Said
from labcrane.plan import SessionPlan
from labcrane.records import Trial, Value
from labcrane.study import Study


class Asking:
    """Asks one questionnaire and looks at the study's stop rules.

    Parameters
    ----------
    answered
        What was answered before the session stopped.
    after
        The trial it follows; None when it is a step of its own.

    Attributes
    ----------
    alarming
        Whether a stop rule was met, known when it has ended.
    """

    def __init__(
        self,
        study: Study,
        plan: SessionPlan,
        name: str,
        step: int,
        answered: Mapping[str, Value],
        after: Trial | None,
    ) -> None:
        about: dict[str, Value] = {"step": step}
        if after is not None:
            about["trial"] = after.number
        self._inquiry = Inquiry(name, study.questionnaires[name], about, answered)
        self._name = name
        self._rules = [rule for rule in study.protocol.stop_rules if rule.questionnaire == name]
        self._seed = derive("answers", after.seed if after else plan.seed, step, name)
        self.alarming = False

    @property
    def over(self) -> bool:
        """Whether it has been handed in."""
        return self._inquiry.over

    def begin(self, *, simulated: bool) -> Iterator[Said]:
        """Yield what is said at its beginning, and a simulated participant's answers."""
        yield self._inquiry.begin()
        if simulated:
            yield from self._inquiry.simulated(self._seed)

    def heed(self, command: Command) -> Said:
        """Take an answer, or hand the questionnaire in; return what is said of it."""
        if command.order is Order.SUBMIT:
            return self._inquiry.hand_in(by_whom(command))
        return self._inquiry.take(command.text, by_whom(command))

    def end(self, *, skipped: bool) -> Iterator[Said]:
        """Yield what is said at its end: that it was left, and the stop rules that it meets.

        One that was left and not skipped is owed: the session has ended.
        """
        if not self.over:
            yield self._inquiry.leave(done=skipped)
        scores = self._inquiry.scores()
        for rule in self._rules:
            if scores[rule.score] > rule.above:  # a score that is NaN stops nobody
                self.alarming = True
                about: dict[str, Value] = {"questionnaire": self._name, "score": rule.score}
                yield "stop_rule.met", {**about, "above": rule.above, "value": scores[rule.score]}
