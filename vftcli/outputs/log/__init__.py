"""What one log's analysis is shown as: tables, files, recordings."""
