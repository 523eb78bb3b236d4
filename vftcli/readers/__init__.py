"""Readers: a log in any known format becomes a Recording. The content decides, never the name."""
