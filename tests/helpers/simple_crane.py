"""The simplest crane with two joysticks, as a part of a protocol."""

CRANE = """\
machine: ch8
input: {use: dual_joystick}
scheme:
  use: joint_velocity
  map: {slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}
dynamics: {use: kinematic_crane}
"""

FORM = CRANE.replace("{", "{{").replace("}", "}}")
"""The same for texts that are filled in by :meth:`str.format`."""
