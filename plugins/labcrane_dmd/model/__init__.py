"""A Dynamic Model Description: how fast a joint moves at which valve signal and angle; its file."""
