"""What another package may add to nanobench, each in one file."""
