"""Machines that other programs describe: URDF files.

In comes a file with the names of its joints; out goes a machine of this project, with every joint's
axis, limits and inertia as the file has them, or a refusal that names the joint that does not fit.
"""
