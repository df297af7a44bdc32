"""Other people's simulators behind our state, frames and units: one file each, imported only where it is asked for."""
