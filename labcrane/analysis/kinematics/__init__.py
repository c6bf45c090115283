"""Kinematics of a movement: halts and smoothness, as functions of arrays.

Input: arrays of one movement, in SI units. Output: numbers.
"""
