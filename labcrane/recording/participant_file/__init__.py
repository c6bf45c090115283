"""The participant file: one HDF5 file per participant, that R, MATLAB and Octave read alike.

In come journals; out goes a file that is verified before it takes the place of the old one, and a
reader of it. Clocks can be corrected again from the file alone.
"""
