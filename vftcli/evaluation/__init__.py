"""Evaluation: errors of estimates against a reference, with intervals, lags and significance."""
