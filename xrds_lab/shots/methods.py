"""Names of the ways to a shot's frames, in files and tables."""

DEFAULT, BEST, MEDIAN = "cycles_oidn_default", "cycles_oidn_best", "median_of_three"
NL_MEANS, XRDS = "nl_means", "xrds"
CYCLES, SAME_PICTURE = "cycles_oidn", "same_picture"
SAME_SAMPLES = "same_samples"
THRESHOLD = "cycles_oidn_threshold"
