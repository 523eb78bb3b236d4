"""The version that every output states."""

VERSION = "0.3.0"
