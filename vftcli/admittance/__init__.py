"""The paper's variable-parameter admittance law, replayed and in closed loop."""
