# Load a complete export of labcrane with one call:
#
#   source("read.R"); study <- read_labcrane(".")
#   study$trials                          one row per movement
#   study$questionnaires, study$scores    one row per answer, per score
#   study$streams[["NAME_ses-01_frames"]] one row per tick
#   study$codebook                        unit, meaning and source of every column
#
# Streams are Parquet files, which the package arrow or nanoparquet reads. Export with
# --set streams=csv for streams that need no package. All other files need none.

read_labcrane <- function(folder = ".") {
  table <- function(name) {
    read.csv(file.path(folder, name), na.strings = "", encoding = "UTF-8", check.names = FALSE)
  }
  names <- sub("\\.csv$", "", list.files(folder, "\\.csv$"))
  study <- sapply(names, function(name) table(paste0(name, ".csv")), simplify = FALSE)
  study$streams <- read_streams(file.path(folder, "streams"))
  study
}

read_streams <- function(folder) {
  files <- list.files(folder)
  names <- unique(sub("\\.(csv\\.gz|parquet)$", "", files))
  sapply(names, function(name) read_stream(folder, name, files), simplify = FALSE)
}

read_stream <- function(folder, name, files) {
  parquet <- file.path(folder, paste0(name, ".parquet"))
  text <- paste0(name, ".csv.gz")
  if (file.exists(parquet) && requireNamespace("arrow", quietly = TRUE)) {
    return(as.data.frame(arrow::read_parquet(parquet)))
  }
  if (file.exists(parquet) && requireNamespace("nanoparquet", quietly = TRUE)) {
    return(as.data.frame(nanoparquet::read_parquet(parquet)))
  }
  if (text %in% files) {
    return(read.csv(file.path(folder, text), na.strings = "", check.names = FALSE))
  }
  warning(name, " is Parquet: install.packages(\"nanoparquet\"), or export with --set streams=csv",
    call. = FALSE)
  NULL
}
