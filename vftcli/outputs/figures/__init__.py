"""Figures for papers, drawn by matplotlib: only what asks for them loads it."""
