"""Evaluation: errors of estimates with intervals, lags and significance."""
