"""Tables of a cohort: one Arrow dataset over all participants, and measures that are kept."""
