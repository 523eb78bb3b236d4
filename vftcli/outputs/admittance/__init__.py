"""What an admittance replay is shown as."""
