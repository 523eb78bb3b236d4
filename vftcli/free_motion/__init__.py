"""Ground truth: references for the estimates, each with its error if known."""
