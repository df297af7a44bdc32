"""Other simulators behind our state, frames and units: one file each, imported on demand."""
