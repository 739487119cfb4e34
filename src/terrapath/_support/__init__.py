"""What every package may use: files, memory, and who watches long work."""
