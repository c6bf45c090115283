"""Definitions of the measures of a movement: the unit and the meaning of each."""

from collections.abc import Mapping

MEASURES: Mapping[str, tuple[str, str]] = {
    "sequence": ("1", "position in the session of the pair of targets, from 1"),
    "position": ("1", "position in the session of the movement among the counted ones, from 1"),
    "constant_error": (
        "m",
        "signed error along the task axis, positive for too far; NaN where nothing moved",
    ),
    "absolute_error": (
        "m",
        "distance of the tip from the target's centre at the end, in any direction (radial error); "
        "not absolute_error_along_m of the report, which is along the task axis only; NaN where "
        "nothing moved",
    ),
    "halts": (
        "1",
        "stretches between onset and offset in which the tip is not faster than onset_speed for "
        "onset_hold or longer; the final rest is not one",
    ),
    "halt_time": ("s", "total duration of the halts"),
    "main_stroke_time": (
        "s",
        "of the stroke with the highest speed, from the halt before it to the one behind it",
    ),
    "amplitude": ("m", "distance along the task axis, from onset to offset"),
    "path_ratio": (
        "1",
        "path length, low-pass filtered, divided by the straight distance between its ends",
    ),
    "peak_speed_tip": ("m/s", "largest speed of the tip between onset and offset"),
    "sub_movements": ("1", "peaks of the tip's speed, low-pass filtered"),
    "sparc": ("1", "spectral arc length of the tip's speed"),
    "ldlj": ("1", "log dimensionless jerk of the tip's velocity, a vector, low-pass filtered"),
    "reversals": ("1/s", "changes of direction of all stick axes together, per second"),
    "simultaneous": ("1", "fraction of the movement time with two or more axes in use"),
    "axes_used": ("1", "mean number of axes in use"),
    "bimanual": ("1", "of the time with a stick in use, the fraction with more than one"),
    "duty_cycle": ("1", "fraction of the movement time in which a stick axis moves"),
    "aggressiveness": (
        "1/s",
        "root mean square of the rate of all stick axes together, in full scales per second",
    ),
    "stick_power": ("1", "variance of all stick axes together, up to 10 Hz"),
    "stick_centroid": ("Hz", "mean frequency of that power"),
    "stick_step": ("1", "smallest change of a stick axis from one tick to the next"),
    "stick_least": ("1", "smallest deflection of a stick axis; a dead zone hides smaller ones"),
    "steering_entropy": (
        "1",
        "entropy of the errors of a prediction of the stick axes, 0 to 1; compared with all "
        "movements of the session",
    ),
    "heart_rate": (
        "1/min",
        "mean of the channel of beats per minute from onset to offset; only where one stream has "
        "it",
    ),
    "pupil": (
        "",
        "mean size of the pupils from onset to offset, without blinks, in the unit of their "
        "stream; light changes it as well as load; only where one stream has it",
    ),
    "coordination": (
        "1",
        "largest cross-correlation of both sticks' deflections, up to half a second apart",
    ),
    "coordination_lag": ("s", "its lag, positive when the right stick follows"),
    "effort": ("1", "root mean square of the joint commands, as a fraction of full speed"),
    "limit_hits": ("1", "times a joint came to one of its limits"),
    "assist_share": (
        "1",
        "mean share of the assistant in the command, 0 where the operator had taken over; this "
        "and the next three only in a study with assist",
    ),
    "operator_part": (
        "1",
        "of the path in joint space that operator and assistant commanded, each weighted with its "
        "share, the operator's fraction; 1 with assistant_part",
    ),
    "assistant_part": ("1", "the assistant's fraction of that path"),
    "opposition_time": (
        "s",
        "time in which operator and assistant asked for opposite joint movements: the scalar "
        "product of their joint speeds, without shares, is negative",
    ),
}
"""Unit and meaning of what is measured here; the trial table's own columns come in addition."""

OF_ASSISTANCE = ("assist_share", "operator_part", "assistant_part", "opposition_time")
"""Those that only a study with an assistant has."""
