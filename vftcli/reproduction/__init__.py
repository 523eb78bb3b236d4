"""A paper's experiments run again on simulated equivalents, beside what is printed."""
