"""Signals: the types every room speaks, and what is done to a time series, once."""
