"""Estimates only a complete log allows: its free part tells noise, bias, bands and best gains."""
