"""Electrodes: a stream of EEG and the like as samples of one rate, with events at their samples.

Input: a stream of a participant file. Output: the data for EEG programs, and an MNE object.
"""
