"""Kinematics of a movement: onset, halts and smoothness, as functions of arrays.

Input: arrays of one movement, in SI units. Output: numbers.
"""
