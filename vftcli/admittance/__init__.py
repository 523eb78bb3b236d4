"""Admittance."""
