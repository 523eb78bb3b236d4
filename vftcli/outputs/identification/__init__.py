"""What an identification is shown as."""
