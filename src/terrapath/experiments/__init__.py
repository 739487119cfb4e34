"""Floor 7: experiments, each a function that returns data."""
