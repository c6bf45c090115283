"""Questions of ``labcrane check``, by subject.

Input: a study. Output: settings that are allowed, but probably a mistake, with key and place.
"""

from labcrane.protocol.questions.all import questions
from labcrane.protocol.questions.parts import PLAUSIBLE
from labcrane.protocol.questions.question import CheckQuestion, about, key_of, problems

__all__ = ["PLAUSIBLE", "CheckQuestion", "about", "key_of", "problems", "questions"]
