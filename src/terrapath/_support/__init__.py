"""What every part may use, and no user sees."""
