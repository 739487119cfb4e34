"""What every package may use: files, memory, who watches long work, and who is told."""
