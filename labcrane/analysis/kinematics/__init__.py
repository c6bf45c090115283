"""Kinematics of a movement: onset, halts and smoothness, as functions of arrays.

In come arrays of one movement, in SI; out go numbers.
"""
