"""A paper's experiments on simulated equivalents, beside its print."""
