# Load a complete export of labcrane with one call:
#
#   source("read.R"); study <- read_labcrane(".")
#   study$trials                          one row per movement
#   study$questionnaires, study$scores    one row per answer, per score
#   study$streams[["NAME_ses-01_frames"]] one row per tick
#   study$codebook                        unit, meaning, source, type and levels of every column
#
# Columns have the types of the codebook: text stays text, also where it is all digits, and what has
# planned levels (groups, conditions, choices) is a factor with the levels in the protocol's order.
#
# Streams are Parquet files, which the package arrow or nanoparquet reads. Export with
# --set streams=csv for streams that need no package. All other files need none.

read_labcrane <- function(folder = ".") {
  names <- sub("\\.csv$", "", list.files(folder, "\\.csv$"))
  path <- function(name) file.path(folder, paste0(name, ".csv"))
  codebook <- read_text(path("codebook"), "character")
  read <- function(name) {
    if (name == "codebook") codebook else read_typed(path(name), name, codebook)
  }
  study <- sapply(names, read, simplify = FALSE)
  study$streams <- read_streams(file.path(folder, "streams"), codebook)
  study
}

read_text <- function(path, types, ...) {
  read.csv(path, colClasses = types, na.strings = "", encoding = "UTF-8", check.names = FALSE, ...)
}

read_typed <- function(path, table, codebook) {
  book <- codebook[codebook$table == table, ]
  columns <- names(read_text(path, "character", nrows = 1))
  book <- book[match(columns, book$column), ]
  data <- read_text(path, ifelse(book$type %in% "number", "numeric", "character"))
  for (n in seq_along(columns)) {
    if (book$type[n] %in% "truth") data[[n]] <- data[[n]] == "true"
    if (!is.na(book$levels[n]) && book$type[n] %in% "text") {
      planned <- strsplit(book$levels[n], "\n", fixed = TRUE)[[1]]
      data[[n]] <- factor(data[[n]], union(planned, setdiff(data[[n]], NA)))
    }
  }
  data
}

read_streams <- function(folder, codebook) {
  files <- list.files(folder)
  names <- unique(sub("\\.(csv\\.gz|parquet)$", "", files))
  sapply(names, function(name) read_stream(folder, name, files, codebook), simplify = FALSE)
}

read_stream <- function(folder, name, files, codebook) {
  parquet <- file.path(folder, paste0(name, ".parquet"))
  text <- paste0(name, ".csv.gz")
  if (file.exists(parquet) && requireNamespace("arrow", quietly = TRUE)) {
    return(as.data.frame(arrow::read_parquet(parquet)))
  }
  if (file.exists(parquet) && requireNamespace("nanoparquet", quietly = TRUE)) {
    return(as.data.frame(nanoparquet::read_parquet(parquet)))
  }
  if (text %in% files) {
    table <- sub("^.+?_ses-[0-9]+_", "", name, perl = TRUE)
    return(read_typed(file.path(folder, text), table, codebook))
  }
  warning(name, " is Parquet: install.packages(\"nanoparquet\"), or export with --set streams=csv",
    call. = FALSE)
  NULL
}
