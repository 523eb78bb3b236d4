"""Contacts: what touched the arm, when, how hard, where, and how sure that is."""
