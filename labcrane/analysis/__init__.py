"""From recordings to results.

From the bottom up::

    cohort         who is in a data folder, and who counts
    movements      one movement's arrays, cut out of a session
    smoothness, sticks, fitts, gaze    what is measured in them
    measures       all of it, as a table with one row per movement
    codebook       every column, with its unit and where it comes from
    learning       learning curves, one per participant
    anova, trends, reported, power    statistics
    quality        how well the loop ran and the clocks agreed
    figures, pages, report     the HTML report
    indicator, operator_tests  the performance indicator of tests
    next_practice, workbook    what to practise next; the evaluation workbook

Nothing here is needed while people are recorded. What is heavy is imported when it is used.
"""
