"""The vehicle that flew: physical parameters from slow balances of recorded flights and from independent knowledge."""
