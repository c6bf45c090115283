"""What is varied, and in which order each participant meets it."""
