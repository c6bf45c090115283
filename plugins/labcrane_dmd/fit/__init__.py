"""The fit of a model to recordings, and its validation at signals that it was not fitted to."""
