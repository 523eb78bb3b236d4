"""Outputs of one log's analysis: tables, files, recordings."""
