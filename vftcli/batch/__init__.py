"""Many logs: the same work on each, in this process, on its cores, or on a cluster that stands."""
