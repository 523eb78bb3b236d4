"""Outputs: show what the analysis made; nothing here computes an estimate or an error."""
