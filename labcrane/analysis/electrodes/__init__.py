"""Electrodes: a stream of EEG and the like as samples of one rate, with events at their samples.

In comes a stream of a participant file; out goes what programs for EEG need, and an MNE object.
"""
