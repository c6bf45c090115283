# Repeats the report's tests of movement time with afex:
#
#   labcrane export data --to tables --set streams=none --out tables
#   Rscript analysis.R tables
#
# It prints the results and writes them to analysis.csv. The report's own results are in
# tables/anova.csv. The tests "with pairs' means taken away" are not repeated here.

suppressPackageStartupMessages(library(afex))

folder <- c(commandArgs(TRUE), "tables")[1]
trials <- read.csv(file.path(folder, "trials.csv"), na.strings = "")
results <- subset(trials, practice == 0 & outcome == "success" & !is.na(movement_time))
if ("presentation_failed" %in% names(results)) {  # the picture froze: not a valid result
  results <- subset(results, is.na(presentation_failed) | presentation_failed == 0)
}

# Number the pairs of targets from 1 in each session.
rank <- function(x) match(x, sort(unique(x)))
results$sequence <- ave(results$sequence, results$participant, results$session, FUN = rank)

# The condition that a participant began with: between people, it takes the period, which is the
# session, out of the condition.
begun <- results[order(results$session), ]
begun <- begun[!duplicated(begun$participant), ]
results$began <- begun$condition[match(results$participant, begun$participant)]

# Test the design and return the effects that involve all factors in `of`.
test <- function(data, measure, within, of = within, between = NULL) {
  fit <- aov_ez("participant", measure, data, between, within, fun_aggregate = mean)
  plain <- anova(fit, correction = "none")
  corrected <- anova(fit, correction = "GG")
  effects <- rownames(plain)
  asked <- sapply(strsplit(effects, ":"), function(parts) all(of %in% parts, !between %in% parts))
  data.frame(
    measure = measure, factor = effects, f = plain[, "F"], df1 = plain[, "num Df"],
    df2 = plain[, "den Df"], p = plain[, "Pr(>F)"], p_gg = corrected[effects, "Pr(>F)"]
  )[asked, ]
}

found <- suppressMessages(rbind(
  test(results, "movement_time", "condition", between = "began"),  # the study's research question
  test(results, "movement_time", "session"),    # first or second day
  test(results, "movement_time", c("session", "sequence"), "sequence"),
  test(results, "movement_time", c("session", "distance"), "distance"),
  test(results, "movement_time", c("session", "far_side"), "far_side"),
  test(results, "movement_time", c("distance", "far_side"))
))
write.csv(found, "analysis.csv", row.names = FALSE)
print(found, digits = 4, row.names = FALSE)
