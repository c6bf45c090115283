"""The protocol: what the YAML says, and the study that it becomes.

In comes a YAML file; out goes a study whose components are chosen and checked, or every mistake
with file and line.
"""
