"""The wrench smoother: one linear model of wrench and model error along the whole log."""
