"""The answer: what touched the arm, and thresholds a robot can use."""
