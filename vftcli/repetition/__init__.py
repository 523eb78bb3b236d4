"""Ground truth: what the estimates are judged by, each with its own error where it can be known."""
