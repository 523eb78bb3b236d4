"""Many logs: one work on each, in this process, on its cores, or on a cluster."""
