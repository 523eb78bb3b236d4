"""Readers: a log in any known format becomes a Recording, by content, not name."""
