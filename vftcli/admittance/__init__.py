"""Admittance: the paper's variable-parameter law, on recorded forces and in closed loop."""
