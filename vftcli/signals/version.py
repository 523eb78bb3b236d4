"""The version that every output states."""

VERSION = "0.1.0"
