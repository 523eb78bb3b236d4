"""Outputs: files and screens of an analysis; no estimate is computed here."""
