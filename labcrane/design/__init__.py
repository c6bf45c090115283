"""The design of a study: orders, squares, slots and seeds, and the plan of a session.

In come a study and a participant's slot; out go the trials of each session in their order.
"""
