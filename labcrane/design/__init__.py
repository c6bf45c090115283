"""The design of a study: orders, squares, slots and seeds, and the plan of a session.

Input: a study and a participant's slot. Output: the trials of each session in their order.
"""
