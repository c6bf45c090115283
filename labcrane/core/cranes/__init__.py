"""Cranes: what a crane that follows speed commands is, in whatever engine.

In come settings and a machine; out go the base classes of the cranes that plugins move, with their
drives, their loads and their compiled twins.
"""
