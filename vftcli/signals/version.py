"""The version that every output states."""

VERSION = "0.2.0"
