"""Wrench."""
