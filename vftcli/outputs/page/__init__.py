"""The report of one log as an HTML page that needs nothing but a browser."""
