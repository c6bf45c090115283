"""The contract of a run: the records that flow through it, and the roles that a plugin fills.

In and out go plain data: ticks, frames, events, signals, shapes, questionnaire items. Whatever a
plugin fills is an abstract class in ``roles``.
"""
