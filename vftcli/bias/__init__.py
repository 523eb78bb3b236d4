"""Estimates of a complete log: its free part gives noise, bias, bands, gains."""
