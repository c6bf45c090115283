"""Cranes that follow speed commands, in any engine.

Input: settings and a machine. Output: the base classes of the cranes that plugins move, with their
drives, their loads and their compiled kernels.
"""
